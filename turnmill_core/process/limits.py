"""Limits of a cut, each a function that returns its margin (thesis section 5.2).

A margin is the share of a limit that is left: 1 - value / bound for an upper bound, 1 - bound / value for a lower one.
It is 0 at the limit and negative beyond. The functions take one cut or arrays of cuts, so that the limits of one cut
and the picture of a whole region come from the same lines.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation_limits import Limits, Load, Rating
from turnmill_core.process.charts import available_torque, top_speed

Floats = NDArray[np.float64]
Array = float | Floats


@dataclass(frozen=True, eq=False)
class CutValues:
    """What the limits look at: numbers of one cut, or arrays of one shape.

    tool_speed, workpiece_speed [rad/s], magnitudes; depth [m]; cutting_speed [m/s]; chip_thickness [m], largest in the
    arc; feed_per_tooth [m], resultant at the surface of the bar; tool_torque, tool_torque_mean, workpiece_torque,
    workpiece_torque_mean [N m]; tool_force [N], largest resultant across the tool axis; feed_force [N], largest along
    the feeding axis; feed_speed [m/s]; duration [s] of the pass; stable_from, stable_to [m], the stable depths next to
    this one (infinite stable_to: stable as far as was searched; NaN: rigid); form_error [m], NaN where not computed.
    """

    tool_speed: Array
    workpiece_speed: Array
    depth: Array
    cutting_speed: Array
    chip_thickness: Array
    feed_per_tooth: Array
    tool_torque: Array
    tool_torque_mean: Array
    workpiece_torque: Array
    workpiece_torque_mean: Array
    tool_force: Array
    feed_force: Array
    feed_speed: Array
    duration: Array
    stable_from: Array
    stable_to: Array
    form_error: Array


@dataclass(frozen=True, eq=False)
class LimitMargin:
    """One limit of one cut, or of an array of cuts.

    name; value and bound in `unit` (SI); margin [1]: what is left; lower: whether the bound is the least value.
    """

    name: str
    unit: str
    value: Array
    bound: Array
    margin: Floats
    lower: bool = False


Limit = Callable[[Limits, CutValues], LimitMargin | None]


def _upper(name: str, unit: str, value: Array, bound: Array) -> LimitMargin | None:
    if np.all(np.isinf(bound)):
        return None
    top = np.asarray(bound, dtype=np.float64)
    share = np.divide(value, top, out=np.full(np.broadcast(value, top).shape, math.inf), where=top > 0)
    return LimitMargin(name, unit, value, bound, np.asarray(1 - share))


def _lower(name: str, unit: str, value: Array, bound: float) -> LimitMargin | None:
    if bound == 0:
        return None
    at = np.asarray(value, dtype=np.float64)
    share = np.divide(bound, at, out=np.full(at.shape, math.inf), where=at > 0)
    return LimitMargin(name, unit, value, bound, np.asarray(1 - share), lower=True)


def _chip_load(limits: Limits, cut: CutValues) -> Array:
    return cut.chip_thickness if limits.chip_load == "thickness" else cut.feed_per_tooth


def chip_load_min(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Below it the edge rubs (Eq. 5.2)."""
    return _lower("chip load, least", "m", _chip_load(limits, cut), limits.chip_load_min)


def chip_load_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Above it the edge chips (Eq. 5.2)."""
    return _upper("chip load, largest", "m", _chip_load(limits, cut), limits.chip_load_max)


def cutting_speed_min(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Least cutting speed."""
    return _lower("cutting speed, least", "m/s", cut.cutting_speed, limits.cutting_speed_min)


def cutting_speed_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest cutting speed (section 5.2.5)."""
    return _upper("cutting speed, largest", "m/s", cut.cutting_speed, limits.cutting_speed_max)


def tool_speed_min(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Least speed of the tool spindle."""
    return _lower("tool speed, least", "rad/s", cut.tool_speed, limits.tool_speed_min)


def tool_speed_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest speed of the tool spindle: as given, and the end of its chart."""
    bound = min(limits.tool_speed_max, top_speed(limits.tool_spindle))
    return _upper("tool speed, largest", "rad/s", cut.tool_speed, bound)


def workpiece_speed_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest speed of the workpiece spindle: as given, and the end of its chart."""
    bound = min(limits.workpiece_speed_max, top_speed(limits.workpiece_spindle))
    return _upper("workpiece speed, largest", "rad/s", cut.workpiece_speed, bound)


def depth_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest depth of cut."""
    return _upper("depth, largest", "m", cut.depth, limits.depth_max)


def feed_speed_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest speed of the linear axes."""
    return _upper("feed speed, largest", "m/s", cut.feed_speed, limits.feed_speed_max)


def tool_force_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest force across the tool axis."""
    return _upper("tool force, largest", "N", cut.tool_force, limits.tool_force_max)


def feed_force_max(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest force on the linear axis that feeds."""
    return _upper("feed force, largest", "N", cut.feed_force, limits.feed_force_max)


def tool_spindle(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Torque of the tool spindle (Eq. 5.3, 5.5); its power is torque times speed and has the same margin."""
    return _spindle("tool spindle", limits.tool_spindle, cut.tool_speed, cut.tool_torque, cut.tool_torque_mean, cut)


def workpiece_spindle(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Torque of the workpiece spindle (Eq. 5.4, 5.5), whichever sense it has."""
    return _spindle("workpiece spindle", limits.workpiece_spindle, cut.workpiece_speed, cut.workpiece_torque,
                    cut.workpiece_torque_mean, cut)


def _spindle(
    name: str, ratings: tuple[Rating, ...], speed: Array, peak: Array, mean: Array, cut: CutValues,
) -> LimitMargin | None:
    """The tighter of what the chart says about the largest and the mean torque, at speeds that it covers."""
    at = np.minimum(speed, top_speed(ratings))
    loads: tuple[tuple[Load, Array], ...] = (("peak", np.abs(peak)), ("mean", np.abs(mean)))
    found = [_upper(f"{name}, {load} torque", "N m", value, available_torque(ratings, load, at, cut.duration))
             for load, value in loads]
    some = [m for m in found if m is not None]
    if len(some) < 2:
        return some[0] if some else None
    first, second = some
    tighter = first.margin <= second.margin
    return LimitMargin(f"{name}, torque", "N m", np.where(tighter, first.value, second.value),
                       np.where(tighter, first.bound, second.bound), np.where(tighter, first.margin, second.margin))


def stability(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Distance of the depth from the nearest stability limit, less the reserve that is asked for (section 5.2.3).

    The bound is the upper end of the stable depths, (1 - stability_margin) of it; the lower end of an island, as much
    above it, counts where it is nearer.
    """
    if np.all(np.isnan(cut.stable_to)):
        return None
    keep = 1 - limits.stability_margin
    upper = np.asarray(cut.stable_to, dtype=np.float64) * keep
    lower = np.asarray(cut.stable_from, dtype=np.float64) / keep
    above = np.divide(cut.depth, upper, out=np.full(np.broadcast(cut.depth, upper).shape, math.inf), where=upper > 0)
    depth = np.asarray(cut.depth, dtype=np.float64)
    below = np.divide(lower, depth, out=np.zeros(np.broadcast(lower, depth).shape), where=depth > 0)
    return LimitMargin("stability", "m", cut.depth, np.where(above >= below, upper, lower),
                       np.asarray(1 - np.maximum(above, below)))


def form_error(limits: Limits, cut: CutValues) -> LimitMargin | None:
    """Largest surface form error (Eq. 5.6)."""
    if math.isinf(limits.form_error_max) or np.all(np.isnan(cut.form_error)):
        return None
    return _upper("form error, largest", "m", cut.form_error, limits.form_error_max)


LIMITS: tuple[Limit, ...] = (
    tool_speed_min, tool_speed_max, workpiece_speed_max, cutting_speed_min, cutting_speed_max, chip_load_min,
    chip_load_max, depth_max, feed_speed_max, tool_spindle, workpiece_spindle, tool_force_max, feed_force_max,
    form_error, stability,
)
"""Every limit, the cheap ones first."""


def limit_margins(limits: Limits, cut: CutValues) -> tuple[LimitMargin, ...]:
    """Margins of every limit that is set, in the order of LIMITS."""
    return tuple(m for m in (limit(limits, cut) for limit in LIMITS) if m is not None)


def nearest_stable(intervals: Floats, depth: Floats, searched: float) -> tuple[Floats, Floats]:
    """Lower and upper end [m] of the stable depths nearest to each `depth` [m], any shape.

    intervals (n, 2) [m]: as from stable_depths. searched [m]: how far; an interval that reaches it has no upper end.
    Nearest is measured as the stability limit does: by the larger of depth / upper and lower / depth.
    """
    depth = np.asarray(depth, dtype=np.float64)
    if not len(intervals):
        return np.zeros(depth.shape), np.zeros(depth.shape)
    lower = intervals[:, 0]
    upper = np.where(intervals[:, 1] >= searched * (1 - 1e-9), math.inf, intervals[:, 1])
    a = np.maximum(depth, 1e-12)[..., None]
    best = np.argmin(np.maximum(a / upper, lower / a), axis=-1)
    return lower[best], upper[best]
