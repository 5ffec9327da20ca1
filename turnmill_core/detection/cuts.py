"""Random cuts, each made from its kind and number alone: a tool, its modes, a speed, an immersion, a schedule of depth.

Depths are multiples of the depth limit of linear theory, so that cuts of every kind are found; what a cut really
does is asked of its simulated motion (see truth.py). Numbers below TRAIN_END serve to develop and to calibrate, the
others to test.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, replace

import numpy as np

from turnmill_core.operation import (
    Conditions,
    Material,
    Mode,
    Operation,
    SchedulePoint,
    Structure,
    Tool,
    Workpiece,
)
from turnmill_core.stability.margin import Margin, stability_margin

TRAIN_END = 10_000
"""Cases with a number below are for training, from it on for testing."""

KINDS = ("stable", "resonance", "runout", "chatter", "flip_odd", "flip_even", "ramp")
"""What a case is looked for: forced vibration at any speed, at a resonance, with much runout; beyond the depth limit
at any speed; where period two begins, with an odd or an even number of teeth; depth ramped over the limit."""

RATES = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Rates of the depth ramps [depth limit per second]."""

CLEARANCE = -2e-4
AIR_SECONDS, ENTRY_SECONDS = 0.5, 0.3
HELD_SECONDS = 3.6
LONGEST_RAMP = 25.0


@dataclass(frozen=True)
class Cut:
    """One case: its kind and number, the operation with its schedule, the linear margin at its depth.

    factor: depth over the depth limit (at the end of a ramp); rate [1/s]: of a ramp, else 0.
    """

    kind: str
    number: int
    operation: Operation
    margin: Margin
    factor: float
    rate: float = 0.0

    @property
    def what(self) -> str:
        """Teeth, speed, sense and depth in words."""
        op = self.operation
        return (f"{op.tool.teeth} teeth, {op.conditions.tool_speed * 30 / math.pi:.0f} rpm, {op.milling_sense}, "
                f"{self.factor:.2f} of the depth limit" + (f", {100 * self.rate:g} %/s" if self.rate else ""))


def generator(kind: str, number: int, purpose: str) -> np.random.Generator:
    """Random numbers for one purpose of one case."""
    return np.random.default_rng((number, zlib.crc32(f"{kind} {purpose}".encode())))


def make_cut(kind: str, number: int) -> Cut:
    """Case `number` of a kind. Raises ValueError for an unknown kind."""
    if kind not in KINDS:
        raise ValueError(f"kind is {kind!r}, expected one of {', '.join(KINDS)}")
    rng = generator(kind, number, "cut")
    for _ in range(200):
        op = _operation(kind, rng)
        margin = stability_margin(op, op.conditions, 40 * op.conditions.depth, speed_search=False)
        limit = margin.depth_limit
        if math.isfinite(limit) and limit < 0.9 * margin.depth_searched and _suits(kind, op, margin):
            return _scheduled(kind, number, rng, op, limit)
    raise ValueError(f"no cut of kind {kind} was found for number {number}")


def _suits(kind: str, op: Operation, margin: Margin) -> bool:
    flips = margin.limit_type.name == "FLIP"
    return flips if kind.startswith("flip") else True


def _teeth(kind: str, rng: np.random.Generator) -> int:
    if kind == "flip_odd":
        return int(rng.choice([1, 3, 5], p=[0.2, 0.5, 0.3]))
    if kind in ("flip_even", "runout"):
        return int(rng.choice([2, 4, 6], p=[0.45, 0.35, 0.2]))
    return int(rng.choice([2, 3, 4, 5, 6]))


def _operation(kind: str, rng: np.random.Generator) -> Operation:
    """Tool with one mode in each of x and y, a block, and a shallow nominal cut (a tenth of what is always stable)."""
    teeth, flips = _teeth(kind, rng), kind.startswith("flip")
    diameter = float(rng.uniform(8e-3, 25e-3))
    natural = float(np.exp(rng.uniform(math.log(350), math.log(2200))))
    tooth = natural / (float(rng.uniform(0.42, 0.58)) if flips else float(rng.integers(1, 7)) if kind == "resonance"
                       else float(np.exp(rng.uniform(math.log(0.7), math.log(8)))))
    tooth = float(np.clip(tooth, teeth * 1500 / 60, teeth * 18000 / 60))
    speed = 2 * math.pi * tooth / teeth
    sense = str(rng.choice(["up", "down"]))
    immersion = diameter * float(np.exp(rng.uniform(math.log(0.04), math.log(0.12 if flips else 0.9))))
    damping, ktc = float(rng.uniform(0.008, 0.04)), float(rng.uniform(600e6, 2000e6))
    arc = 2 * math.acos(1 - 2 * immersion / diameter)
    always = float(np.exp(rng.uniform(math.log(4e-4), math.log(4e-3))))
    stiffness = always * ktc * max(0.2, teeth * arc / (4 * math.pi)) / (2 * damping * (1 + damping))
    modes = []
    for shape in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        f = natural * (1.0 if kind == "resonance" and shape[0] else float(rng.uniform(0.85, 1.15)))
        modes.append(Mode(f, damping, stiffness / (2 * math.pi * f) ** 2, shape))
    tool = Tool("end mill", diameter, teeth, math.radians(float(rng.choice([10, 20, 30, 40]))), 1.0,
                runout=_runout(kind, teeth, rng), structure=Structure(tuple(modes), "tool"))
    feed = float(rng.uniform(0.05e-3, 0.15e-3))
    radius = diameter / 2
    span = (radius - immersion, radius) if sense == "up" else (-radius, immersion - radius)
    cut = Conditions(speed, 0.0, 0.1 * always, feed * teeth * speed / (2 * math.pi), span)
    material = Material("metal", ktc, ktc * float(rng.uniform(0.2, 0.5)), ktc * 0.15)
    block = Workpiece("block", length=200.0, width=0.3, height=1.0)
    return Operation(f"{kind} cut", "milling", "simulated", tool, block, material, cut, sense,  # type: ignore[arg-type]
                     feed_per_tooth=feed)


def _runout(kind: str, teeth: int, rng: np.random.Generator) -> tuple[float, ...]:
    """Radial offsets [m]: an eccentric tool and uneven teeth."""
    much = kind == "runout"
    size = 1e-6 * float(rng.uniform(4, 12) if much else rng.choice([0.0, 0.3, 1.0], p=[0.4, 0.3, 0.3]))
    phase, own = rng.uniform(0, 2 * math.pi), rng.standard_normal(teeth)
    if teeth == 1 or size == 0.0:
        return ()
    return tuple(float(size * (math.cos(phase + 2 * math.pi * j / teeth) + 0.3 * own[j])) for j in range(teeth))


def much_runout(cut: Cut) -> Cut:
    """The same cut with the teeth run out as much as those of the kind "runout"."""
    tool = cut.operation.tool
    runout = _runout("runout", tool.teeth, generator(cut.kind, cut.number, "much runout"))
    return replace(cut, operation=replace(cut.operation, tool=replace(tool, runout=runout)))


def _scheduled(kind: str, number: int, rng: np.random.Generator, op: Operation, limit: float) -> Cut:
    """Case with a schedule of depth: air, entry, then the depth held or ramped."""
    speed, rate = op.conditions.tool_speed, 0.0
    cut = AIR_SECONDS + ENTRY_SECONDS
    if kind == "ramp":
        rate = RATES[number % len(RATES)]
        begin = limit * float(rng.uniform(0.85, 0.95))
        first, length = begin, min(LONGEST_RAMP, 1.5 / rate)
        factor = begin / limit + rate * length
        points = [(cut, speed, first), (cut + 0.7, speed, first), (cut + 0.7 + length, speed, limit * factor)]
    else:
        factor = float(rng.uniform(1.15, 2.5) if kind in ("chatter", "flip_odd", "flip_even")
                       else rng.uniform(0.15, 0.8))
        ramp = float(rng.choice([0.0, 0.0, 0.02, -0.02])) * speed if kind in ("stable", "chatter") else 0.0
        points = [(cut, speed, factor * limit), (cut + 0.8, speed, factor * limit),
                  (HELD_SECONDS, speed + ramp, factor * limit)]
    schedule = [(0.0, speed, CLEARANCE), (AIR_SECONDS, speed, CLEARANCE), *points]
    depth = min(factor, 1.0 + 10 * rate) * limit if rate else factor * limit
    op = replace(op, conditions=replace(op.conditions, depth=depth),
                 schedule=tuple(SchedulePoint(t, s, 0.0, a) for t, s, a in schedule))
    margin = stability_margin(op, op.conditions, speed_search=False)
    return Cut(kind, number, op, margin, factor, rate)
