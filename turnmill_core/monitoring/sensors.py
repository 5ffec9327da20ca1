"""Sensors: from volts to SI units, what is plausible, what probes on the shank say of the tool tip.

Blocks carry what the converter measured; this is the one place where calibrations are applied. A fibre probe sees
the shank, its out-of-roundness, and its own casing:

    s_i = shape_i u_tip + runout_i(angle) - c,     volts = offset + sensitivity s

Two probes in one direction at places of different mode shape tell the tip's vibration u_tip and the casing's motion c
apart (thesis 4.3.7.3: two pairs on the shank, a fixture of 80 Hz); one probe takes c for zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.linalg import expm

from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.operation_sensors import MEASURED, Fixture, Sensor, Sensors

Floats = NDArray[np.float64]

PLAUSIBLE = {"Pa": 1e3, "m": 1e-2, "m/s2": 1e5, "N": 1e5, "N m": 1e4, "W": 1e6, "V": 1e3}
"""Largest plausible magnitude by unit; beyond it the unit is probably wrong (1000 um taken for 1000 m)."""


def implausible(channel: Channel, low: float, high: float) -> str:
    """Empty where values between `low` and `high` can be what the channel measures, else why not."""
    largest, worst = PLAUSIBLE.get(channel.unit, math.inf), max(-low, high)
    return "" if worst <= largest else f"{worst:.3g} {channel.unit} is beyond {largest:g}; is the unit right?"


def calibrate(sensors: Sensors, block: SensorBlock) -> SensorBlock:
    """Block in SI units: channels in volts that a sensor is known for are calibrated, others left as they are.

    SATURATED where a sample lies at or beyond the ends of the linear range; UNCALIBRATED where a channel is in
    volts and no sensor has its name.
    """
    known = {s.name: s for s in sensors.channels}
    if not any(c.unit == "V" for c in block.channels):
        return block
    samples, channels = block.samples.copy(), list(block.channels)
    for k, channel in enumerate(block.channels):
        sensor = known.get(channel.name)
        if channel.unit != "V":
            continue
        if sensor is None:
            channels[k] = replace(channel, status=channel.status | Status.UNCALIBRATED)
            continue
        volts = samples[:, k]
        outside = bool(np.any((volts <= sensor.lowest) | (volts >= sensor.highest)))
        quantity, unit = MEASURED[sensor.kind]
        channels[k] = replace(channel, quantity=quantity, unit=unit,
                              status=channel.status | (Status.SATURATED if outside else Status.OK))
        samples[:, k] = (volts - sensor.offset) / sensor.sensitivity
    return replace(block, channels=tuple(channels), samples=samples)


def measure(sensor: Sensor, value: Floats) -> NDArray[np.float32]:
    """Volts that a sensor gives for the value (n,) that it measures, in SI units; clipped to its linear range."""
    volts = np.clip(sensor.offset + sensor.sensitivity * value, sensor.lowest, sensor.highest)
    return volts.astype(np.float32)


def probe_sees(sensor: Sensor, tip: Floats, runout: Floats, casing: Floats) -> Floats:
    """Displacement [m] that a fibre probe sees (n,): of the shank, with its out-of-roundness, less that of its casing.

    tip, runout, casing (n,) [m], in the direction of the probe.
    """
    return sensor.shape * tip + runout - casing


def casing_motion(fixture: Fixture, force: Floats, rate: float) -> Floats:
    """Motion of the probes' casing [m] (n,) under the cutting force (n,) [N] at `rate` [Hz], in one direction.

    One mode from rest, exact for a force that is linear between the samples.
    """
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
    poles = [1.0, -float(np.trace(a)), float(np.linalg.det(a))]
    zeros = [late[0], early[0] - a[1, 1] * late[0] + a[0, 1] * late[1], a[0, 1] * early[1] - a[1, 1] * early[0]]
    found: Floats = fixture.cross_talk * signal.lfilter(zeros, poles, force)
    return found


def shank_runout(displacement: Floats, turns: Floats, points: int = 256) -> Floats:
    """Out-of-roundness (points, k) that probes see while the tool turns in air: mean by angle.

    displacement (n, k) [m]; turns (n,): revolutions at the samples. Raises ValueError below ten revolutions.
    """
    if turns[-1] - turns[0] < 10:
        raise ValueError(f"air lasts {turns[-1] - turns[0]:.3g} revolutions, expected at least 10")
    at = np.arange(math.ceil(turns[0]) * points, math.floor(turns[-1]) * points) / points
    rows = np.stack([np.interp(at, turns, column) for column in displacement.T], axis=1)
    found: Floats = rows.reshape(-1, points, displacement.shape[1]).mean(axis=0)
    return found


def without_runout(displacement: Floats, turns: Floats, runout: Floats) -> Floats:
    """Displacement (n, k) [m] less the shank's runout (points, k) at the tool's angle; turns (n,)."""
    points = len(runout)
    table = np.vstack([runout, runout[:1]])
    at = (turns % 1.0) * points
    found: Floats = displacement - np.stack([np.interp(at, np.arange(points + 1), c) for c in table.T], axis=1)
    return found


def tip_motion(probes: Sequence[Sensor], displacement: Floats, rate: float,
               fixture: Fixture | None) -> tuple[Floats, Floats]:
    """Vibration of the tool tip and motion of the casing (n, 2) [m], x and y of the tool frame, by mode shape.

    probes (k): fibre probes, at least one in each of x and y; displacement (n, k) [m] at `rate` [Hz], calibrated and
    without runout. With a fixture, two or more probes in a direction tell tip and casing apart; the casing's motion
    is that below STIFF_ABOVE times the natural frequency of the fixture, above which its inertia keeps it at rest, so
    that the probes' noise counts little there. Without a fixture the casing is at rest. Raises ValueError
    where a direction has no probe, or, with a fixture, only one or only probes of one shape.
    """
    tip, casing = (np.zeros((len(displacement), 2)) for _ in range(2))
    for column, axis in enumerate(("x", "y")):
        at = [k for k, p in enumerate(probes) if p.direction == axis and p.kind == "fibre probe"]
        if not at:
            raise ValueError(f"no fibre probe looks along {axis}, expected at least one in each of x and y")
        shapes, seen = np.array([probes[k].shape for k in at]), displacement[:, at]
        if fixture is not None:
            if np.ptp(shapes) < 0.05 * shapes.max():
                raise ValueError(f"shape of the probes along {axis} is {shapes.tolist()}, expected values that differ "
                                 "by 5 % or more: probes at one height cannot tell the tool from the casing")
            both = seen @ np.linalg.pinv(np.stack([shapes, -np.ones(len(at))], axis=1)).T
            low = signal.butter(4, min(STIFF_ABOVE * fixture.frequency, 0.45 * rate), fs=rate, output="sos")
            casing[:, column] = signal.sosfiltfilt(low, both[:, 1])
        tip[:, column] = (seen + casing[:, [column]]) @ shapes / np.sum(shapes**2)
    return tip, casing


STIFF_ABOVE = 4.0
"""Multiple of its natural frequency above which a fixture moves by less than a fifteenth of its static displacement."""
