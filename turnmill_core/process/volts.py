"""What the sensors of an operation give in a simulated cut: volts, with noise, shank runout and a moving fixture.

The simulated motion is that of the cutting point; a fibre probe sees it times the mode shape where it looks, an
accelerometer times the shape where it sits. See docs/model_monitoring.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.linalg import expm

from turnmill_core.monitoring.blocks import Channel
from turnmill_core.operation_sensors import Fixture, Sensor, Sensors
from turnmill_core.process.sensors import CHANNELS, white_noise

Floats = NDArray[np.float64]


def signal_of(sensor: Sensor) -> str:
    """The simulated signal that a sensor measures."""
    return {"fibre probe": f"tool_{sensor.direction}", "microphone": "sound",
            "accelerometer": f"tool_acceleration_{sensor.direction}",
            "dynamometer": f"force_{sensor.direction}"}[sensor.kind]


def signals_of(sensors: Sensors) -> tuple[str, ...]:
    """Names of the simulated signals that sensors need, each once."""
    names = [signal_of(s) for s in sensors.channels]
    if sensors.fixture is not None:
        names += [f"force_{s.direction}" for s in sensors.channels if s.kind == "fibre probe"]
    return tuple(dict.fromkeys(names))


def channels_of(sensors: Sensors) -> tuple[Channel, ...]:
    """Channels in volts, one for each sensor."""
    places = ("machine enclosure" if s.kind == "microphone" else f"{s.kind}, {s.direction}_T" for s in sensors.channels)
    return tuple(Channel(s.name, "voltage", "V", place) for s, place in zip(sensors.channels, places, strict=True))


def volts(
    sensors: Sensors, signals: Mapping[str, Floats], tool_angle: Floats, rate: float, seed: int, first: int,
    casing: Floats,
) -> tuple[NDArray[np.float32], Floats]:
    """Volts (n, sensors) of all sensors, and the state of their fixture's motion.

    signals: (n,) in SI units by the names of signals_of, sound with that of the surroundings; tool_angle (n,) [rad];
    rate [Hz]; seed: of the noise; first: index of the first sample; casing (3, 2): what the call before returned
    (zeros at the beginning).
    """
    count, casing = len(tool_angle), casing.copy()
    moves: dict[str, Floats] = {}
    for axis in sorted({s.direction for s in sensors.channels if s.kind == "fibre probe"}):
        moves[axis] = np.zeros(count)
        if sensors.fixture is not None:
            row = "xyz".index(axis)
            moves[axis], casing[row] = casing_motion(sensors.fixture, signals[f"force_{axis}"], rate, casing[row])
    found = np.empty((count, len(sensors.channels)), dtype=np.float32)
    for k, sensor in enumerate(sensors.channels):
        value = signals[signal_of(sensor)]
        if sensor.kind == "fibre probe":
            value = probe_sees(sensor, value, out_of_roundness(sensor, tool_angle), moves[sensor.direction])
        elif sensor.kind == "accelerometer":
            value = sensor.shape * value
        noise = sensor.noise_rms * white_noise(seed, 1 + len(CHANNELS) + k, first, count)
        found[:, k] = measure(sensor, value, noise)
    return found, casing


def measure(sensor: Sensor, value: Floats, noise: Floats | float = 0.0) -> NDArray[np.float32]:
    """Volts that a sensor gives for the value (n,) that it measures, in SI units, with noise (n,) [V]; clipped to its
    linear range."""
    volts = np.clip(sensor.offset + sensor.sensitivity * value + noise, sensor.lowest, sensor.highest)
    return volts.astype(np.float32)


def out_of_roundness(sensor: Sensor, tool_angle: Floats) -> Floats:
    """Out-of-roundness of the shank [m] (n,) where a probe looks, at tool_angle (n,) [rad].

    The shank has its summits of all orders at the angle 0 of the tool; x lies a quarter of a turn after y.
    """
    since = tool_angle - (math.pi / 2 if sensor.direction == "x" else 0.0)
    found: Floats = np.zeros(len(tool_angle))
    for order, amplitude in enumerate(sensor.runout, 1):
        found += amplitude * np.cos(order * since)
    return found


def probe_sees(sensor: Sensor, tip: Floats, runout: Floats, casing: Floats) -> Floats:
    """Displacement [m] that a fibre probe sees (n,): of the shank, with its out-of-roundness, less that of its casing.

    tip, runout, casing (n,) [m], in the direction of the probe.
    """
    return sensor.shape * tip + runout - casing


def casing_motion(fixture: Fixture, force: Floats, rate: float, state: Floats | None = None) -> tuple[Floats, Floats]:
    """Motion of the probes' casing [m] (n,) under the cutting force (n,) [N] at `rate` [Hz], in one direction.

    One mode, exact for a force that is linear between the samples. state (2,): what the call on the force before
    returned beside its motion (None: at rest).
    """
    zeros, poles = _casing_filter(fixture, rate)
    found, state = signal.lfilter(zeros, poles, force, zi=np.zeros(2) if state is None else state)
    return fixture.cross_talk * found, state


@lru_cache(maxsize=16)
def _casing_filter(fixture: Fixture, rate: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Zeros and poles from a force of which 1 N moves the casing by 1 m at rest to its motion."""
    w, zeta = 2 * math.pi * fixture.frequency, fixture.damping
    system = np.zeros((4, 4))
    system[0, 1] = 1.0
    system[1, :3] = -(w**2), -2 * zeta * w, w**2
    system[2, 3] = 1.0
    flow = expm(system / rate)
    a = flow[:2, :2]
    late = flow[:2, 3] * rate
    early = flow[:2, 2] - late
    # x[n+1] = a x[n] + early f[n] + late f[n+1]; its transfer function to the displacement:
    return ((late[0], early[0] - a[1, 1] * late[0] + a[0, 1] * late[1], a[0, 1] * early[1] - a[1, 1] * early[0]),
            (1.0, -float(np.trace(a)), float(np.linalg.det(a))))
