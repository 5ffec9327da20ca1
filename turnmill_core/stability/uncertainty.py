"""What uncertain modes and cutting coefficients do to the depth limit: seeded sampling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import Conditions, Material, Mode, Operation, Structure, require
from turnmill_core.stability.delay import DelayModel
from turnmill_core.stability.margin import searched_depth
from turnmill_core.stability.operating_point import depth_family
from turnmill_core.stability.search import SCAN_DEPTHS, depth_limit, stable_depths

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """Relative standard deviations [1] of every natural frequency, damping ratio, modal mass and force coefficient."""

    frequency: float = 0.005
    damping: float = 0.1
    mass: float = 0.05
    coefficient: float = 0.05

    def __post_init__(self) -> None:
        for name in ("frequency", "damping", "mass", "coefficient"):
            value = getattr(self, name)
            require(np.isfinite(value) and 0 <= value < 0.5, f"spread of {name}", value, "", "a ratio in [0, 0.5)")


@dataclass(frozen=True, eq=False)
class LimitDistribution:
    """limits (samples,) [m]: depth limits of the sampled operations, ascending; probability_stable [1]: share of them
    that is stable at the present depth."""

    limits: Floats
    probability_stable: float

    def quantile(self, q: float) -> float:
        """Depth limit [m] that a share `q` of the samples does not exceed."""
        return float(np.quantile(self.limits, q))


def limit_distribution(
    op: Operation, conditions: Conditions, spread: Spread | None = None, samples: int = 50, seed: int = 0,
    delay_model: DelayModel = "mean", progress: Callable[[int, int], None] | None = None,
) -> LimitDistribution:
    """Depth limits of `op` at `conditions` with modes and coefficients drawn from log-normal distributions.

    spread: None for the defaults. samples, seed: number of draws and their seed; equal arguments give equal results.
    delay_model: as in stability_problem. progress: called with (done, total) draws. Raises ``ValueError`` as
    stability_problem does.
    """
    require(samples >= 1, "samples", samples, "", "an integer >= 1")
    rng, spread = np.random.default_rng(seed), spread or Spread()
    deepest = searched_depth(op, conditions)
    limits, stable = np.empty(samples), 0
    for i in range(samples):
        family = depth_family(sampled(op, spread, rng), conditions, deepest, delay_model)
        intervals = stable_depths(family, scan=SCAN_DEPTHS, tolerance=1e-3).intervals
        limits[i] = depth_limit(intervals, conditions.depth)
        stable += bool(np.any((intervals[:, 0] <= conditions.depth) & (conditions.depth <= intervals[:, 1])))
        if progress is not None:
            progress(i + 1, samples)
    return LimitDistribution(np.sort(limits), stable / samples)


def sampled(op: Operation, spread: Spread, rng: np.random.Generator) -> Operation:
    """`op` with every mode and the material drawn anew with `spread`; rng: source of the draws."""
    def draw(sigma: float) -> float:
        return float(np.exp(sigma * rng.standard_normal()))

    def structure(old: Structure) -> Structure:
        factors = [(draw(spread.frequency), draw(spread.damping), draw(spread.mass)) for _ in old.modes]

        def moved(modes: tuple[Mode, ...]) -> tuple[Mode, ...]:
            return tuple(replace(m, frequency=m.frequency * f, damping=min(m.damping * z, 0.99), mass=m.mass * w)
                         for m, (f, z, w) in zip(modes, factors, strict=True))

        table = old.table and replace(old.table, modes=tuple(moved(modes) for modes in old.table.modes))
        return replace(old, modes=moved(old.modes), table=table)

    m, c = op.material, spread.coefficient
    material = Material(m.name, m.Ktc * draw(c), m.Krc * draw(c), m.Kac * draw(c), m.Kte, m.Kre, m.Kae)
    return replace(op, material=material, tool=replace(op.tool, structure=structure(op.tool.structure)),
                   workpiece=replace(op.workpiece, structure=structure(op.workpiece.structure)))
