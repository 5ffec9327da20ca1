"""The tool tip's motion as a judged channel: from fibre probes on the shank, window by window.

What the probes see holds the shank's out-of-roundness, which is learned by the tool's angle in windows that are judged
as air, and the motion of their casing (sensors.py). Both are taken off in the window that is judged, from its own
samples, so that the result depends neither on the block size nor on what came when.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.monitoring import stream as streams
from turnmill_core.monitoring.channel import usable
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.sensors import (
    FEWEST_TURNS,
    low_orders,
    shank_runout,
    tip_motion,
    whole_turns,
    without_runout,
)
from turnmill_core.monitoring.speed import SpindleSpeed
from turnmill_core.monitoring.stream import Stream
from turnmill_core.monitoring.verdict import Reason
from turnmill_core.operation_sensors import TIP_CHANNELS

Floats = NDArray[np.float64]

KNOWN = 4
"""Windows of air after which the shank's runout is known."""

ROUND_ORDERS = 5
"""Cycles per revolution of which a shank's out-of-roundness mostly consists: taken off while it is not known, so that
air is known as air."""

REMEMBERED = 100
"""Windows of air over which it is averaged: a newer one counts for a hundredth at least."""


@dataclass(frozen=True, eq=False)
class ShankRunout:
    """Out-of-roundness learned so far: table (points, probes) [m] by the tool's angle, and from how many windows."""

    table: Floats | None = None
    windows: int = 0

    @property
    def known(self) -> bool:
        """Whether it is taken off."""
        return self.windows >= KNOWN


@dataclass(frozen=True, eq=False)
class Seen:
    """What the probes along one axis saw in a window, or why it cannot be judged.

    displacement (n, probes) [m]; turns (n,): revolutions of the tool, absolute (None: its angle is not known).
    """

    displacement: Floats
    turns: Floats | None
    reason: Reason
    text: str


def probes_in(config: ChatterConfig, s: Stream, start: int, end: int, speeds: tuple[SpindleSpeed, ...],
              longest_gap_ns: int) -> Seen | None:
    """What the probes saw in window [start, end); None where another channel is to be judged."""
    names = [c.name for c in s.channels]
    if config.channel not in TIP_CHANNELS or config.channel in names:
        return None
    try:
        probes = config.sensors.probes(config.channel[-1])
    except ValueError as error:
        return None if config.fallback else _blind(Reason.BAD_SAMPLES, f"{config.channel}: {error}")
    missing = [p.name for p in probes if p.name not in names]
    if missing:
        return None if config.fallback else _blind(
            Reason.BAD_SAMPLES, f"{config.channel} needs channel {missing[0]!r}, which is not among {', '.join(names)}")
    columns: list[Floats] = []
    for probe in probes:
        k = names.index(probe.name)
        x = streams.samples(s, start, end, k)
        reason, text = usable(x, streams.status(s, start, end, k), s.channels[k])
        if reason is not Reason.NONE:
            return None if config.fallback else _blind(reason, text)
        columns.append(x.astype(np.float64))
    turns = tool_turns(speeds, s.stamp(start), end - start, s.sample_rate, longest_gap_ns)
    return Seen(np.stack(columns, axis=1), turns, Reason.NONE, "")


def _blind(reason: Reason, text: str) -> Seen:
    return Seen(np.zeros((0, 0)), None, reason, text)


def tip_in(config: ChatterConfig, seen: Seen, runout: ShankRunout, rate: float) -> Floats:
    """Motion of the tool tip (n,) [m] along the judged axis in a window sampled at `rate` [Hz]."""
    displacement, turns = seen.displacement, seen.turns
    if not len(displacement):
        return np.zeros(0)
    if turns is not None:
        table = runout.table if runout.known else None
        if table is None and whole_turns(turns) >= FEWEST_TURNS:
            table = low_orders(shank_runout(displacement, turns), ROUND_ORDERS)
        if table is not None:
            displacement = without_runout(displacement, turns, table)
    tip, _ = tip_motion(config.sensors, config.channel[-1], displacement, rate)
    return tip


def learned(runout: ShankRunout, seen: Seen) -> ShankRunout:
    """Runout after a window of air."""
    turns = seen.turns
    if turns is None or whole_turns(turns) < FEWEST_TURNS:
        return runout
    new = shank_runout(seen.displacement, turns)
    if runout.table is None or runout.table.shape != new.shape:
        return ShankRunout(new, 1)
    windows = min(REMEMBERED, runout.windows + 1)
    return ShankRunout(runout.table + (new - runout.table) / windows, windows)


def tool_turns(speeds: tuple[SpindleSpeed, ...], start_ns: int, count: int, rate: float,
               longest_gap_ns: int) -> Floats | None:
    """Revolutions of the tool (count,), absolute and ascending, at samples from `start_ns` at `rate` [Hz].

    Linear between the angles of the axis states; None where these do not cover the samples, lie further apart than
    `longest_gap_ns` or hold no angle, or where the tool does not turn one way.
    """
    last_ns = start_ns + round((count - 1) * 1e9 / rate)
    first = next((i for i in range(len(speeds) - 1, -1, -1) if speeds[i].stamp_ns <= start_ns), -1)
    if first < 0 or speeds[-1].stamp_ns < last_ns:
        return None
    last = next(i for i in range(first, len(speeds)) if speeds[i].stamp_ns >= last_ns)
    used = speeds[first: last + 1]
    turned = np.array([h.angle for h in used]) / (2 * math.pi)
    turned = np.sign(turned[-1] - turned[0]) * turned
    at = np.array([h.stamp_ns - start_ns for h in used]) * 1e-9
    if not np.all(np.diff(turned) > 0) or np.any(np.diff(at) > longest_gap_ns * 1e-9):
        return None
    found: Floats = np.interp(np.arange(count) / rate, at, turned)
    return found
