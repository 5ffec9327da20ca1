"""What the machine has shown so far: cuts that the monitor called chatter or stable."""

from __future__ import annotations

import math
from dataclasses import dataclass

from turnmill_core.monitoring.verdict import ChatterKind, Verdict
from turnmill_core.process.robust import Observation

CHATTER = (ChatterKind.HOPF, ChatterKind.FLIP)
AGREEING = 5
"""Verdicts in a row that make an observation."""
KEPT = 4
"""Newest observations that are kept."""
SAME = 0.02
"""Relative difference of speeds and depth up to which a cut is the same."""
NEAR_NS = 1_000_000_000
"""A verdict belongs to the cut that was predicted at most this long before or after it."""


@dataclass(frozen=True)
class _Cut:
    """A cut by its speeds [rad/s] and depth [m]."""

    tool_speed: float
    workpiece_speed: float
    depth: float

    def same(self, other: _Cut | Observation) -> bool:
        """Whether the two differ by SAME at most."""
        pairs = ((self.tool_speed, other.tool_speed), (self.workpiece_speed, other.workpiece_speed),
                 (self.depth, other.depth))
        return all(abs(a - b) <= SAME * max(abs(a), abs(b)) for a, b in pairs)


class Observed:
    """Collects cuts and verdicts; a cut that holds still and is judged alike AGREEING times is an observation."""

    def __init__(self) -> None:
        self._cut: tuple[int, _Cut] | None = None
        self._run: tuple[_Cut, bool, int] | None = None
        self._kept: list[Observation] = []

    @property
    def present(self) -> Observation | None:
        """The cut that is being made, None out of the cut."""
        if self._cut is None:
            return None
        cut = self._cut[1]
        return Observation(cut.tool_speed, cut.workpiece_speed, cut.depth, chatter=False)

    def observations(self) -> tuple[Observation, ...]:
        """The newest observations, oldest first, one for each cut."""
        return tuple(self._kept)

    def cut(self, stamp_ns: int, tool_speed: float, workpiece_speed: float, depth: float, in_cut: bool) -> None:
        """Note the present cut: speeds [rad/s], depth [m]."""
        self._cut = (stamp_ns, _Cut(tool_speed, workpiece_speed, depth)) if in_cut and depth > 0 else None

    def verdict(self, found: Verdict) -> None:
        """Note a verdict on the present cut."""
        chatter = found.state in CHATTER
        if self._cut is None or not (chatter or found.state is ChatterKind.STABLE) or (
                abs(found.window_end_ns - self._cut[0]) > NEAR_NS):
            self._run = None
            return
        cut = self._cut[1]
        count = self._run[2] + 1 if self._run and self._run[1] is chatter and self._run[0].same(cut) else 1
        self._run = (cut, chatter, count)
        if count >= AGREEING:
            frequency = found.chatter_frequency if chatter else math.nan
            seen = Observation(cut.tool_speed, cut.workpiece_speed, cut.depth, chatter, frequency)
            self._kept = [*(o for o in self._kept if not cut.same(o)), seen][-KEPT:]
