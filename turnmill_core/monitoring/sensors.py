"""Sensors: from volts to SI units, what is plausible, what probes on the shank say of the tool tip.

Blocks carry what the converter measured; this is the one place where calibrations are applied. A fibre probe sees
the shank, its out-of-roundness, and its own casing:

    s_i = shape_i u_tip + runout_i(angle) - c,     volts = offset + sensitivity s

Two probes in one direction at places of different mode shape tell the tip's vibration u_tip and the casing's motion c
apart (thesis 4.3.7.3: two pairs on the shank, a fixture of 80 Hz); without a fixture c is zero.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.operation_sensors import MEASURED, Fixture, Sensors

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
    volts = [k for k, channel in enumerate(block.channels) if channel.unit == "V"]
    if not volts:
        return block
    channels, samples = list(block.channels), block.samples.copy()
    for k in volts:
        if channels[k].name not in known:
            channels[k] = replace(channels[k], status=channels[k].status | Status.UNCALIBRATED)
    columns = [k for k in volts if channels[k].name in known]
    used = [known[channels[k].name] for k in columns]
    seen = block.samples[:, columns]
    ends = np.array([(s.lowest, s.highest) for s in used], dtype=np.float32).reshape(-1, 2)
    outside = (seen.min(axis=0, initial=np.inf) <= ends[:, 0]) | (seen.max(axis=0, initial=-np.inf) >= ends[:, 1])
    for k, sensor, beyond in zip(columns, used, outside, strict=True):
        quantity, unit = MEASURED[sensor.kind]
        channels[k] = replace(channels[k], quantity=quantity, unit=unit,
                              status=channels[k].status | (Status.SATURATED if beyond else Status.OK))
    samples[:, columns] = (seen - np.array([s.offset for s in used])) / np.array([s.sensitivity for s in used])
    return replace(block, channels=tuple(channels), samples=samples)


def whole_turns(turns: Floats) -> int:
    """Whole revolutions, from angle 0 to angle 0, in ascending turns (n,)."""
    return int(math.floor(turns[-1]) - math.ceil(turns[0]))


def shank_runout(displacement: Floats, turns: Floats, points: int = 256) -> Floats:
    """Out-of-roundness (points, k) that probes see while the tool turns in air: mean by angle over whole revolutions.

    displacement (n, k) [m]; turns (n,): revolutions at the samples. Raises ValueError below four whole ones.
    """
    first, last = math.ceil(turns[0]), math.floor(turns[-1])
    if whole_turns(turns) < FEWEST_TURNS:
        raise ValueError(f"air lasts {turns[-1] - turns[0]:.3g} revolutions, expected at least {FEWEST_TURNS} whole "
                         "ones")
    at = np.arange(first * points, last * points) / points
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


def low_orders(runout: Floats, orders: int) -> Floats:
    """The part of a shank's runout (points, k) [m] of 0 to `orders` cycles per revolution."""
    lines = np.fft.rfft(runout, axis=0)
    lines[orders + 1:] = 0.0
    found: Floats = np.fft.irfft(lines, len(runout), axis=0)
    return found


def tip_motion(sensors: Sensors, axis: str, displacement: Floats, rate: float) -> tuple[Floats, Floats]:
    """Vibration of the tool tip and motion of the casing (n,) [m] along one axis of the tool frame, by mode shape.

    displacement (n, k) [m] at `rate` [Hz] of the probes of ``sensors.probes(axis)``, calibrated and without runout.
    With a fixture, two or more probes tell tip and casing apart; the casing's motion is that below STIFF_ABOVE
    times the natural frequency of the fixture, above which its inertia keeps it at rest, so that the probes' noise
    counts little there. Without a fixture the casing is at rest. Raises ValueError where the probes cannot tell.
    """
    shapes = np.array([p.shape for p in sensors.probes(axis)])
    casing: Floats = np.zeros(len(displacement))
    if sensors.fixture is not None:
        # What the straight line of least squares through the displacements over the shapes has at shape 0 is -c.
        apart = shapes - shapes.mean()
        line = shapes.mean() * apart / np.sum(apart**2) - 1 / len(shapes)
        casing = signal.sosfiltfilt(_low_pass(sensors.fixture, rate), np.einsum("nk,k->n", displacement, line))
    tip: Floats = np.einsum("nk,k->n", displacement + casing[:, None], shapes / np.sum(shapes**2))
    return tip, casing


@lru_cache(maxsize=16)
def _low_pass(fixture: Fixture, rate: float) -> Floats:
    """Second-order sections that keep what a fixture moves by."""
    found: Floats = signal.butter(4, min(STIFF_ABOVE * fixture.frequency, 0.45 * rate), fs=rate, output="sos")
    return found


FEWEST_TURNS = 4
"""Whole revolutions of air from which a shank's runout is learned at least."""

STIFF_ABOVE = 4.0
"""Multiple of its natural frequency above which a fixture moves by less than a fifteenth of its static displacement."""
