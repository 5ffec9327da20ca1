"""The tool tip's orbit in a recording, from fibre probes on the shank (thesis 4.3.7.3); no ROS needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from turnmill_core.machine.axes import AXES
from turnmill_core.monitoring.blocks import Channel, Status
from turnmill_core.monitoring.sensors import FEWEST_TURNS, shank_runout, tip_motion, whole_turns, without_runout
from turnmill_core.operation_sensors import Sensors
from turnmill_ros import topics
from turnmill_ros.bag import read_bag
from turnmill_ros.conversions import axes_from_message
from turnmill_ros.signals import Stretch, stretches

Floats = NDArray[np.float64]

MARGIN_NS = 100_000_000
"""Time before and after a stretch that is read as well: the filters settle there."""

LONGEST_AIR_NS = 5_000_000_000
LATE_NS = 300_000_000
"""Time before the end of a stretch of air in which the tool may be in the cut already: a verdict comes later."""

SPINDLE = AXES.index("s")


@dataclass(frozen=True, eq=False)
class Orbit:
    """Motion of the tool tip: stretches of x and y [m].

    turns (n,): absolute revolutions of the tool at the samples, ascending; round_off: whether the shank's runout has
    been taken off; saturated: a probe left its linear range.
    """

    x: Stretch
    y: Stretch
    turns: Floats
    round_off: bool
    saturated: bool

    def once(self) -> Floats:
        """Place (n, 2) [m] once per revolution of the tool."""
        whole = np.arange(math.ceil(self.turns[0]), self.turns[-1])
        at = np.interp(whole, self.turns, np.arange(float(len(self.turns))))
        found: Floats = np.stack([ndimage.map_coordinates(s.samples, [at], order=3, mode="nearest")
                                  for s in (self.x, self.y)], axis=1)
        return found


class TipReader:
    """Reads the tip's motion out of a recording, with the runout learned from stretches of air."""

    def __init__(self, path: Path, sensors: Sensors, air: Sequence[tuple[int, int]]) -> None:
        """air: stretches (from, to) [ns] in which the tool turns out of the cut; the longest is used.

        Raises ValueError where the probes cannot tell the tip's motion along x and y.
        """
        self._path, self._sensors = path, sensors
        self._probes = [sensors.probes(axis) for axis in "xy"]
        self._names = [p.name for probes in self._probes for p in probes]
        states = [axes_from_message(m) for _, _, m in read_bag(path, (topics.JOINT_STATES.name,))]
        stamps = np.array([s.stamp_ns for s in states], dtype=np.int64)
        turns = np.array([s.position[SPINDLE] for s in states]) / (2 * math.pi)
        order = np.argsort(stamps, kind="stable")
        self._stamps, self._turns = stamps[order], turns[order]
        self.runout = self._learn(air)

    def orbit(self, from_ns: int, to_ns: int) -> Orbit | None:
        """Motion in [from_ns, to_ns), less its mean in air; None without samples or axis states."""
        found = self._read(from_ns - MARGIN_NS, to_ns + MARGIN_NS)
        if found is None:
            return None
        seen, turns = found
        displacement = np.stack([s.samples for s in seen], axis=1)
        if self.runout is not None:
            displacement = without_runout(displacement, turns, self.runout)
        first = seen[0]
        stamps = first.start_ns + np.round(np.arange(len(turns)) * (1e9 / first.sample_rate)).astype(np.int64)
        kept = (stamps >= from_ns) & (stamps < to_ns)
        if np.count_nonzero(kept) < 64:
            return None
        parts, at = [], 0
        for axis, probes in zip("xy", self._probes, strict=True):
            tip, _ = tip_motion(self._sensors, axis, displacement[:, at: at + len(probes)], first.sample_rate)
            channel = Channel(f"tip_{axis}", "displacement", "m", "tool tip, from the probes on the shank")
            parts.append(Stretch(channel, int(stamps[kept][0]), first.sample_rate, tip[kept]))
            at += len(probes)
        saturated = any(s.channel.status & Status.SATURATED for s in seen)
        return Orbit(parts[0], parts[1], turns[kept], self.runout is not None, saturated)

    def _read(self, from_ns: int, to_ns: int) -> tuple[tuple[Stretch, ...], Floats] | None:
        """What the probes saw, and the tool's revolutions at the samples; None where either is not known."""
        found = stretches(self._path, self._names, from_ns, to_ns, self._sensors)
        if found is None or len(self._stamps) < 2:
            return None
        count, first = len(found[0].samples), found[0]
        at = (np.arange(count) / first.sample_rate) * 1e9
        known = (self._stamps - first.start_ns).astype(np.float64)
        covered = (at >= known[0]) & (at <= known[-1])
        if not covered.any():
            return None
        start = first.start_ns + round(float(at[covered][0]))
        seen = tuple(replace(s, samples=s.samples[covered], start_ns=start) for s in found)
        turns = np.interp(at[covered], known, self._turns)
        return seen, np.sign(turns[-1] - turns[0]) * turns

    def _learn(self, air: Sequence[tuple[int, int]]) -> Floats | None:
        """Runout (points, probes) [m] from the longest stretch of air; None where that is too short or saturated."""
        if not air:
            return None
        start, end = max(air, key=lambda span: span[1] - span[0])
        found = self._read(start, min(end - LATE_NS, start + LONGEST_AIR_NS))
        if found is None or any(s.channel.status & Status.SATURATED for s in found[0]):
            return None
        seen, turns = found
        if whole_turns(turns) < FEWEST_TURNS:
            return None
        return shank_runout(np.stack([s.samples for s in seen], axis=1), turns)
