"""Stability of an operation: at a point, its margin, and the lobes.

The depth limit ends the stable depth interval that holds the present depth or lies next below it.
The margin is 1 - depth / depth limit: positive in the first stable interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.prediction import PredictedType
from turnmill_core.stability.delay import DelayModel
from turnmill_core.stability.floquet import FloquetVerdict, chatter_family, classify, verdict_from_map
from turnmill_core.stability.operating_point import at_depth, stability_problem
from turnmill_core.stability.problem import StabilityProblem
from turnmill_core.stability.semidiscretization import period_map

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
NAN = float("nan")

SCAN_DEPTHS = 24
"""Depths at which the spectral radius is sampled before its crossings of 1 are refined."""
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


@dataclass(frozen=True, eq=False)
class Lobes:
    """Stability diagram at one workpiece speed.

    tool_speeds (n,) [rad/s]; depths (m,) [m]; spectral_radius (m, n) [1]; predicted_type (m, n),
    values of PredictedType; depth_limit (n,) [m], the lowest stability limit at each tool speed, the
    largest depth where there is none.
    """

    workpiece_speed: float
    tool_speeds: Floats
    depths: Floats
    spectral_radius: Floats
    predicted_type: NDArray[np.uint8]
    depth_limit: Floats


def solve(problem: StabilityProblem) -> FloquetVerdict:
    """Verdict of one problem."""
    found = period_map(problem)
    return verdict_from_map(found.matrix, found.displacement, found.period)


def leading(problem: StabilityProblem) -> tuple[float, PredictedType]:
    """Spectral radius and type of one problem, without the chatter frequencies."""
    multipliers = np.linalg.eigvals(period_map(problem).matrix)
    return float(np.abs(multipliers).max()), classify(multipliers)


def stability_point(op: Operation, conditions: Conditions, delay_model: DelayModel = "mean") -> StabilityPoint:
    """Stability of `op` at `conditions`; NO_CUT where the tool does not touch the workpiece.

    Raises ``ValueError`` for a rigid structure or a depth beyond the flute length.
    """
    if not conditions.in_cut:
        return StabilityPoint(NAN, np.empty(0, np.complex128), PredictedType.NO_CUT, NAN, np.empty(0), NAN, NAN)
    problem = stability_problem(op, conditions, delay_model)
    found = solve(problem)
    highest = 3 * float(np.abs(np.linalg.eigvals(problem.structure.A)).max()) / (2 * math.pi)
    family = np.empty(0)
    if found.predicted_type is not PredictedType.STABLE:
        family = chatter_family(complex(found.multipliers[0]), found.period, highest)
    return StabilityPoint(
        found.spectral_radius, found.multipliers, found.predicted_type, found.chatter_frequency, family, found.period,
        float(np.mean(problem.delays)), found.flips,
    )


def searched_depth(op: Operation, conditions: Conditions) -> float:
    """Default largest depth [m] of a search: four times the nominal or present depth, within tool and workpiece."""
    nominal = max(op.conditions.depth, conditions.depth)
    largest = 4 * nominal if nominal > 0 else op.tool.radius
    bounds = [op.tool.flute_length, 0.95 * op.workpiece.radius if op.workpiece.is_bar else op.workpiece.height]
    return min(largest, *bounds)


def stability_margin(
    op: Operation, conditions: Conditions, depth_search: float | None = None, delay_model: DelayModel = "mean",
    speed_search: bool = True,
) -> Margin:
    """Margin of `op` at `conditions`: stable depth intervals, limit, ratio and the nearest stable tool speed.

    depth_search [m]: largest depth that is searched (None: :func:`searched_depth`). speed_search: whether
    the nearest stable speed is looked for when the cut is unstable. Without contact the type is NO_CUT and
    the limit is that of the cut at these speeds and this immersion, where there is one.
    Raises ``ValueError`` for a rigid structure or a depth beyond the flute length.
    """
    point = stability_point(op, conditions, delay_model)
    searched = searched_depth(op, conditions) if depth_search is None else depth_search
    require(0 < searched <= op.tool.flute_length, "depth search", searched, "m",
            f"in (0, {op.tool.flute_length}] m, the flute length")
    base = {
        "tool_speed": conditions.tool_speed, "workpiece_speed": conditions.workpiece_speed, "depth": conditions.depth,
        "depth_searched": searched, "spectral_radius": point.spectral_radius, "multipliers": point.multipliers,
        "predicted_type": point.predicted_type, "chatter_frequency": point.chatter_frequency,
        "principal_period": point.principal_period, "delay": point.delay,
    }
    if not (conditions.tool_speed > 0 and conditions.radial_immersion > 0):
        return Margin(**base, depth_limit=NAN, stable_depths=np.empty((0, 2)), depth_ratio=NAN,  # type: ignore[arg-type]
                      nearest_stable_speed=NAN, limit_type=PredictedType.UNKNOWN, limit_frequency=NAN)
    problem_at = _by_depth(op, conditions, delay_model)
    intervals = stable_depths(problem_at, searched)
    limit = _limit(intervals, conditions.depth)
    limit_type, limit_frequency = PredictedType.UNKNOWN, NAN
    if 0 < limit < searched:
        above = solve(problem_at(limit * 1.01))
        limit_type, limit_frequency = above.predicted_type, above.chatter_frequency
    nearest = conditions.tool_speed
    if point.predicted_type in (PredictedType.HOPF, PredictedType.FLIP):
        nearest = nearest_stable_speed(op, conditions, delay_model) if speed_search else NAN
    ratio = max(conditions.depth, 0.0) / limit if limit > 0 else math.inf
    return Margin(**base, depth_limit=limit, stable_depths=intervals, depth_ratio=ratio,  # type: ignore[arg-type]
                  nearest_stable_speed=nearest, limit_type=limit_type, limit_frequency=limit_frequency)


def _by_depth(op: Operation, conditions: Conditions, delay_model: DelayModel) -> Callable[[float], StabilityProblem]:
    return lambda depth: stability_problem(op, at_depth(op, conditions, depth), delay_model)


def _limit(intervals: Floats, depth: float) -> float:
    """Upper end of the interval that holds `depth` or lies next below it; 0 without one."""
    below = intervals[intervals[:, 0] <= max(depth, 0.0)] if intervals.size else intervals
    return float(below[-1, 1]) if below.size else 0.0


def stable_depths(
    problem_at: Callable[[float], StabilityProblem], searched: float, scan: int = SCAN_DEPTHS, tolerance: float = 1e-3,
) -> Floats:
    """Stable depth intervals (n, 2) [m] in (0, searched]: a scan, then each crossing of |mu| = 1 is refined.

    problem_at: the problem at a depth [m]. tolerance: of a crossing, relative to it. An island thinner than
    searched / scan may be missed. The first interval begins at 0, where the damped structure is stable.
    """
    depths = np.linspace(0.0, searched, scan + 1)
    values = [-1.0, *(leading(problem_at(float(a)))[0] - 1 for a in depths[1:])]
    edges = [0.0]
    for i in range(scan):
        if (values[i] < 0) != (values[i + 1] < 0):
            edges.append(_crossing(problem_at, depths[i], depths[i + 1], values[i], values[i + 1], tolerance))
    if values[-1] < 0:
        edges.append(searched)
    return np.array(edges).reshape(-1, 2)


def _crossing(
    problem_at: Callable[[float], StabilityProblem], low: float, high: float, f_low: float, f_high: float,
    tolerance: float,
) -> float:
    """Depth [m] where |mu| = 1 between two depths with opposite signs (Illinois regula falsi)."""
    for _ in range(60):
        middle = high - f_high * (high - low) / (f_high - f_low)
        value = leading(problem_at(float(middle)))[0] - 1
        if (value < 0) == (f_high < 0):
            f_low *= 0.5
        else:
            low, f_low = high, f_high
        high, f_high = middle, value
        if abs(high - low) <= tolerance * max(high, low) or value == 0:
            break
    return float(high)


def nearest_stable_speed(op: Operation, conditions: Conditions, delay_model: DelayModel = "mean") -> float:
    """Tool speed [rad/s] nearest to the present one that is stable at this depth; NaN where none was found.

    Searched outwards in steps of SPEED_STEP up to SPEED_RANGE of the present speed; the feed per tooth
    or per workpiece revolution does not matter to stability.
    """
    steps = round(SPEED_RANGE / SPEED_STEP)
    for i in range(1, steps + 1):
        stable = []
        for sign in (1, -1):
            speed = conditions.tool_speed * (1 + sign * i * SPEED_STEP)
            if speed > 0:
                radius, _ = leading(stability_problem(op, replace(conditions, tool_speed=speed), delay_model))
                if radius < 1:
                    stable.append((radius, speed))
        if stable:
            return min(stable)[1]
    return NAN


def stability_lobes(
    op: Operation, tool_speeds: Sequence[float] | Floats, depths: Sequence[float] | Floats,
    workpiece_speed: float | None = None, progress: Callable[[int, int], None] | None = None,
    delay_model: DelayModel = "mean",
) -> Lobes:
    """Stability diagram over tool speeds [rad/s] and depths [m], both ascending.

    workpiece_speed [rad/s] (None: the operation's). progress: called with (done, total) tool speeds.
    The depth limit is interpolated between the sampled depths on either side of it.
    Raises ``ValueError`` for values that are not positive, not ascending, or beyond the flute length.
    """
    speed, depth = (np.array(v, dtype=np.float64) for v in (tool_speeds, depths))
    for name, values, unit in (("tool speeds", speed, "rad/s"), ("depths", depth, "m")):
        ok = values.ndim == 1 and values.size > 0 and np.all(np.isfinite(values)) and values[0] > 0
        require(bool(ok and np.all(np.diff(values) > 0)), name, values.tolist(), unit, "ascending numbers > 0")
    radius = np.empty((depth.size, speed.size))
    kind = np.empty((depth.size, speed.size), dtype=np.uint8)
    for j, s in enumerate(speed):
        for i, a in enumerate(depth):
            conditions = with_cut(op, tool_speed=float(s), workpiece_speed=workpiece_speed, depth=float(a))
            radius[i, j], kind[i, j] = leading(stability_problem(op, conditions, delay_model))
        if progress is not None:
            progress(j + 1, speed.size)
    used = op.conditions.workpiece_speed if workpiece_speed is None else workpiece_speed
    return Lobes(used, speed, depth, radius, kind, lowest_limit(depth, radius))


def lowest_limit(depths: Floats, spectral_radius: Floats) -> Floats:
    """Depth [m] at which the spectral radius (m, n) first passes 1 in each column, else the largest of `depths`."""
    limit = np.full(spectral_radius.shape[1], depths[-1])
    for j, column in enumerate(spectral_radius.T):
        unstable = np.flatnonzero(column >= 1)
        if unstable.size:
            i = unstable[0]
            limit[j] = depths[0] if i == 0 else np.interp(1.0, column[i - 1:i + 1], depths[i - 1:i + 1])
    return limit
