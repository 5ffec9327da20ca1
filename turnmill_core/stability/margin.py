"""Stability of an operation: at a point, its margin, and the lobes.

The depth limit ends the stable depth interval that holds the present depth or lies next below it.
The margin is 1 - depth / depth limit: positive in the first stable interval.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.prediction import PredictedType
from turnmill_core.stability.collocation import solve, verdict_at
from turnmill_core.stability.delay import DelayModel
from turnmill_core.stability.floquet import chatter_family
from turnmill_core.stability.lobes import Lobes as Lobes
from turnmill_core.stability.lobes import stability_lobes as stability_lobes
from turnmill_core.stability.operating_point import depth_family, stability_problem
from turnmill_core.stability.problem import StabilityProblem
from turnmill_core.stability.search import depth_limit, stable_depths
from turnmill_core.structure.at import Position

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
NAN = float("nan")

SPEED_STEP = 0.01
SPEED_RANGE = 0.5
"""The nearest stable speed is sought in steps of 1 % up to 50 % above and below the present one."""


@dataclass(frozen=True, eq=False)
class StabilityPoint:
    """Stability of one cut.

    spectral_radius: largest |Floquet multiplier| (NaN without contact). multipliers: leading ones by
    falling magnitude. predicted_type. chatter_frequency [Hz]: dominant predicted line, NaN where
    stable. chatter_family [Hz]: all predicted lines up to three times the highest natural frequency,
    empty where stable. principal_period [s]; delay [s], mean over the teeth. flips: real multipliers
    below -1.
    """

    spectral_radius: float
    multipliers: Complexes
    predicted_type: PredictedType
    chatter_frequency: float
    chatter_family: Floats
    principal_period: float
    delay: float
    flips: int = 0


@dataclass(frozen=True, eq=False)
class Margin:
    """Stability and margin of one cut; the fields of turnmill_msgs/StabilityMargin.

    tool_speed, workpiece_speed [rad/s]; depth, depth_limit, depth_searched [m]; stable_depths (n, 2)
    [m]: stable intervals up to depth_searched; depth_ratio [1]; nearest_stable_speed [rad/s], NaN
    where none was found; limit_type and limit_frequency [Hz]: what the chatter just above the depth
    limit would be. spectral_radius, multipliers, predicted_type, chatter_frequency, principal_period
    and delay: as in StabilityPoint.
    """

    tool_speed: float
    workpiece_speed: float
    depth: float
    depth_limit: float
    stable_depths: Floats
    depth_searched: float
    depth_ratio: float
    spectral_radius: float
    multipliers: Complexes
    predicted_type: PredictedType
    chatter_frequency: float
    principal_period: float
    delay: float
    nearest_stable_speed: float
    limit_type: PredictedType
    limit_frequency: float


def stability_point(
    op: Operation, conditions: Conditions, delay_model: DelayModel = "mean", position: Position | None = None,
) -> StabilityPoint:
    """Stability of `op` at `conditions`; NO_CUT where the tool does not touch the workpiece.

    delay_model, position: as in stability_problem.
    Raises ``ValueError`` for a rigid structure or a depth beyond the flute length.
    """
    if not conditions.in_cut:
        return StabilityPoint(NAN, np.empty(0, np.complex128), PredictedType.NO_CUT, NAN, np.empty(0), NAN, NAN)
    return _judged(stability_problem(op, conditions, delay_model, position))


def _judged(problem: StabilityProblem) -> StabilityPoint:
    found = solve(problem)
    family = np.empty(0)
    if found.predicted_type is not PredictedType.STABLE:
        highest = 3 * float(np.abs(np.linalg.eigvals(problem.structure.A)).max()) / (2 * math.pi)
        family = chatter_family(complex(found.multipliers[0]), found.period, highest)
    return StabilityPoint(
        found.spectral_radius, found.multipliers, found.predicted_type, found.chatter_frequency, family, found.period,
        float(np.mean(problem.delays)), found.flips,
    )


def searched_depth(op: Operation, conditions: Conditions) -> float:
    """Default largest depth [m] of a search: four times the nominal or twice the present depth, within tool and
    workpiece; without either the tool radius."""
    largest = max(4 * op.conditions.depth, 2 * conditions.depth)
    bounds = [op.tool.flute_length, 0.95 * op.workpiece.radius if op.workpiece.is_bar else op.workpiece.height]
    return min(largest if largest > 0 else op.tool.radius, *bounds)


def stability_margin(
    op: Operation, conditions: Conditions, depth_search: float | None = None, delay_model: DelayModel = "mean",
    speed_search: bool = True, position: Position | None = None,
) -> Margin:
    """Margin of `op` at `conditions`: stable depth intervals, limit, ratio and the nearest stable tool speed.

    depth_search [m]: largest depth that is searched (None: :func:`searched_depth`). speed_search: whether
    the nearest stable speed is looked for when the cut is unstable. delay_model, position: as in
    stability_problem. Without contact the type is NO_CUT and
    the limit is that of the cut at these speeds and this immersion, where there is one.
    Raises ``ValueError`` for a rigid structure or a depth beyond the flute length.
    """
    searched = searched_depth(op, conditions) if depth_search is None else depth_search
    require(0 < searched <= op.tool.flute_length, "depth search", searched, "m",
            f"in (0, {op.tool.flute_length}] m, the flute length")
    cuts = conditions.tool_speed > 0 and conditions.radial_immersion > 0
    family = depth_family(op, conditions, max(searched, conditions.depth), delay_model, position) if cuts else None
    point = stability_point(op, conditions, delay_model, position) if family is None or not conditions.in_cut else (
        _judged(family.problem(conditions.depth)))
    base = {
        "tool_speed": conditions.tool_speed, "workpiece_speed": conditions.workpiece_speed, "depth": conditions.depth,
        "depth_searched": searched, "spectral_radius": point.spectral_radius, "multipliers": point.multipliers,
        "predicted_type": point.predicted_type, "chatter_frequency": point.chatter_frequency,
        "principal_period": point.principal_period, "delay": point.delay,
    }
    if family is None:
        return Margin(**base, depth_limit=NAN, stable_depths=np.empty((0, 2)), depth_ratio=NAN,  # type: ignore[arg-type]
                      nearest_stable_speed=NAN, limit_type=PredictedType.UNKNOWN, limit_frequency=NAN)
    intervals = stable_depths(family, searched=searched).intervals
    limit = depth_limit(intervals, conditions.depth)
    limit_type, limit_frequency = PredictedType.UNKNOWN, NAN
    if 0 < limit < searched:
        above = verdict_at(family.problem(min(limit * 1.005, searched)))
        limit_type, limit_frequency = above.predicted_type, above.chatter_frequency
    nearest = conditions.tool_speed
    if point.predicted_type in (PredictedType.HOPF, PredictedType.FLIP):
        nearest = nearest_stable_speed(op, conditions, delay_model, position) if speed_search else NAN
    ratio = max(conditions.depth, 0.0) / limit if limit > 0 else math.inf
    return Margin(**base, depth_limit=limit, stable_depths=intervals, depth_ratio=ratio,  # type: ignore[arg-type]
                  nearest_stable_speed=nearest, limit_type=limit_type, limit_frequency=limit_frequency)


def nearest_stable_speed(
    op: Operation, conditions: Conditions, delay_model: DelayModel = "mean", position: Position | None = None,
) -> float:
    """Tool speed [rad/s] nearest to the present one that is stable at this depth; NaN where none was found.

    Searched outwards in steps of SPEED_STEP up to SPEED_RANGE of the present speed; where both sides are
    stable at the same distance, the one with the smaller spectral radius. delay_model, position: as in
    stability_problem.
    """
    family = depth_family(op, conditions, conditions.depth, delay_model, position)
    series = family.series([conditions.depth])
    for i in range(1, round(SPEED_RANGE / SPEED_STEP) + 1):
        stable = []
        for sign in (1, -1):
            speed = conditions.tool_speed * (1 + sign * i * SPEED_STEP)
            radius = abs(family.multipliers(series, speed)[0])
            if radius < 1:
                stable.append((radius, speed))
        if stable:
            return float(min(stable)[1])
    return NAN
