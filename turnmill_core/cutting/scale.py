"""Scale of the force coefficients, estimated as the cut goes on: measured loads against predicted ones.

Measured means over whole tool revolutions are regressed on the predicted means,

    measured_k = offset_k + s predicted_k + noise,

with weights that fade by the factor e over `memory` seconds of cutting. s = 1 where the coefficients of the
operation are right; a worn edge or another alloy moves it. The offsets (drift of a dynamometer, idle power of a
spindle) can be taken as zero or estimated; then the level outside the cut, or a cut that changes, must have been
seen. The interval is that of the noise: independent from window to window, of one size in all components. An
error of the model that changes from cut to cut is not part of it.

State in, state out: the same functions serve a node and a recording.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from turnmill_core.cutting.tool import Array, read_only
from turnmill_core.operation import require


@dataclass(frozen=True)
class ScaleConfig:
    """How the scale is estimated.

    window [s]: length of the windows on a fixed grid of time, of which whole tool revolutions are averaged;
    memory [s]: time in which an old window loses its weight by the factor e; offset: estimate a constant in
    each component; least: predicted magnitude [N, N m or W] below which there is no cut to measure; fewest: windows
    in the cut before a scale is given; samples_per_revolution: fewest that give a mean; patience [s]: how long a
    window waits for measured samples; confidence: of the interval.
    """

    window: float = 0.2
    memory: float = 10.0
    offset: bool = False
    least: float = 1.0
    fewest: int = 3
    samples_per_revolution: float = 8.0
    patience: float = 2.0
    confidence: float = 0.95

    def __post_init__(self) -> None:
        for name, unit in (("window", "s"), ("memory", "s"), ("least", ""), ("patience", "s")):
            value = getattr(self, name)
            require(math.isfinite(value) and value > 0, f"scale {name}", value, unit, "a finite number > 0")
        require(self.fewest >= 2, "scale fewest", self.fewest, "windows", "at least 2")
        require(self.samples_per_revolution >= 0, "scale samples per revolution", self.samples_per_revolution, "",
                "a number >= 0")
        require(0 < self.confidence < 1, "scale confidence", self.confidence, "", "a probability in (0, 1)")


@dataclass(frozen=True)
class Predicted:
    """Predicted means at one instant: load (k,) [N, N m or W], 0 without contact; tool_speed [rad/s]."""

    stamp_ns: int
    tool_speed: float
    load: Array
    in_cut: bool


@dataclass(frozen=True)
class Measured:
    """Measured samples (n, k) in the unit of the prediction, at the times stamps_ns (n,), which ascend."""

    stamps_ns: NDArray[np.int64]
    samples: Array

    def __post_init__(self) -> None:
        require(self.samples.ndim == 2 and self.samples.shape[0] == len(self.stamps_ns) > 0, "measured samples",
                self.samples.shape, "", f"an array ({len(self.stamps_ns)}, k) with at least one sample")


@dataclass(frozen=True)
class ScaleEstimate:
    """The scale after a window.

    end_ns: end of the window; measured, predicted (k,): means over its whole revolutions, measured empty without;
    scale with its interval (lower, upper), NaN where reason says why there is none; windows: effective number of
    windows in the cut behind it; offset (k,): 0 unless estimated.
    """

    end_ns: int
    measured: Array
    predicted: Array
    scale: float
    lower: float
    upper: float
    windows: float
    offset: Array
    reason: str


@dataclass(frozen=True)
class ScaleState:
    """What is kept between calls.

    sums (2, 7, k): of the windows, with their weights and with these squared: weight, weight in the cut, load,
    measured, load squared, load times measured, measured squared; updated_ns: end of the last window in them;
    measured, predicted: what has arrived for the windows that are not complete.
    """

    sums: Array
    updated_ns: int = 0
    measured: tuple[Measured, ...] = ()
    predicted: tuple[Predicted, ...] = ()


def initial(components: int) -> ScaleState:
    """State before the first window, for loads of `components` components."""
    require(components >= 1, "components", components, "", "at least 1")
    return ScaleState(read_only(np.zeros((2, 7, components))))


def update(
    config: ScaleConfig, state: ScaleState, item: Predicted | Measured
) -> tuple[ScaleState, tuple[ScaleEstimate, ...]]:
    """Take measured samples or a prediction, and give the estimates of the windows that are then complete.

    A window is complete once predictions and measured samples reach its end, or predictions go beyond it by
    `patience`. Each kind comes in the order of its stamps; which kind is ahead does not matter. Samples that come after
    their window are left out. Raises ValueError for a wrong number of components.
    """
    size = state.sums.shape[2]
    if isinstance(item, Measured):
        require(item.samples.shape[1] == size, "measured samples", item.samples.shape, "", f"an array (n, {size})")
        state = replace(state, measured=(*state.measured, item))
    else:
        require(np.shape(item.load) == (size,), "predicted load", np.shape(item.load), "", f"an array ({size},)")
        state = replace(state, predicted=(*state.predicted, item))
    found = []
    while state.predicted and _complete(config, state):
        state, estimate = _closed(config, state)
        found.append(estimate)
    return state, tuple(found)


def _window(config: ScaleConfig, stamp_ns: int) -> int:
    return stamp_ns // round(config.window * 1e9)


def _complete(config: ScaleConfig, state: ScaleState) -> bool:
    """Whether the window of the oldest prediction can be judged."""
    end = (_window(config, state.predicted[0].stamp_ns) + 1) * round(config.window * 1e9)
    ahead = state.predicted[-1].stamp_ns - end
    covered = bool(state.measured) and state.measured[-1].stamps_ns[-1] >= end
    return ahead >= 0 and (covered or ahead >= config.patience * 1e9)


def _closed(config: ScaleConfig, state: ScaleState) -> tuple[ScaleState, ScaleEstimate]:
    """The state without the window of the oldest prediction, and what that window gives."""
    length, number = round(config.window * 1e9), _window(config, state.predicted[0].stamp_ns)
    begin, end = number * length, (number + 1) * length
    within = [p for p in state.predicted if p.stamp_ns < end]
    speed = float(np.mean([p.tool_speed for p in within]))
    load = np.mean([p.load for p in within], axis=0)
    measured, reason = _mean(config, state.measured, begin, speed)
    cuts = [p.in_cut for p in within]
    sums, updated = state.sums, state.updated_ns
    if not reason and any(cuts) and not all(cuts):
        reason = "the cut begins or ends in the window"
    if not reason and any(cuts) and np.linalg.norm(load) < config.least:
        reason = "the predicted load is too small"
    if not reason and (any(cuts) or config.offset):
        sums, updated = _added(config, state, end, load, measured, any(cuts)), end
    if not reason and not any(cuts):
        reason = "no cut"
    kept = ScaleState(sums, updated, tuple(m for m in state.measured if m.stamps_ns[-1] >= end),
                      state.predicted[len(within):])
    return kept, _estimate(config, sums, ScaleEstimate(
        end, read_only(measured), read_only(load), math.nan, math.nan, math.nan, 0.0, np.zeros_like(load), reason))


def _mean(config: ScaleConfig, runs: tuple[Measured, ...], begin: int, speed: float) -> tuple[Array, str]:
    """Mean over the whole revolutions that fit into the window from `begin` [ns], or why there is none."""
    turns = math.floor(speed * config.window / (2 * math.pi) + 1e-9)
    nothing = np.empty(0)
    if turns == 0:
        return nothing, "less than one tool revolution in a window"
    end = begin + round(turns * 2 * math.pi / speed * 1e9)
    if not runs:
        return nothing, "no measured samples"
    stamps = np.concatenate([m.stamps_ns for m in runs])
    inside = (stamps >= begin) & (stamps < end)
    if inside.sum() < max(2.0, turns * config.samples_per_revolution):
        return nothing, "too few measured samples"
    steps = np.diff(np.concatenate([[begin], stamps[inside], [end]]))
    if steps.max() > 2.5 * (end - begin) / inside.sum():
        return nothing, "a gap in the measured samples"
    return np.concatenate([m.samples for m in runs])[inside].mean(axis=0), ""


def _added(config: ScaleConfig, state: ScaleState, end: int, load: Array, measured: Array, in_cut: bool) -> Array:
    """The sums with one more window, the older ones faded."""
    fade = math.exp(-min((end - state.updated_ns) * 1e-9 / config.memory, 1.0))
    one = np.ones_like(load)
    row = np.stack([one, one * in_cut, load, measured, load**2, load * measured, measured**2])
    return read_only(np.array([fade, fade**2])[:, None, None] * state.sums + row)


def _estimate(config: ScaleConfig, sums: Array, found: ScaleEstimate) -> ScaleEstimate:
    """Weighted least squares from the sums, with Student's t interval."""
    weight, cut, p, y, pp, py, yy = sums[0]
    components, total = len(p), float(weight[0])
    if cut[0] == 0:
        return found
    effective, in_cut = total**2 / sums[1, 0, 0], float(cut[0] ** 2 / sums[1, 1, 0])
    found = replace(found, windows=in_cut)
    if found.reason:
        return found
    mean = p / total if config.offset else np.zeros_like(p)
    spread = float(np.sum(pp - mean * p))
    freedom = components * (effective - config.offset) - 1
    if in_cut < config.fewest - 0.5 or freedom <= 0.5:
        return replace(found, reason=f"fewer than {config.fewest} windows in the cut")
    if spread < total * config.least**2:
        return replace(found, reason="the load has not changed, so that the level without a cut is not known")
    scale = float(np.sum(py - mean * y)) / spread
    offset = (y / total - scale * mean) if config.offset else np.zeros_like(p)
    left = float(np.sum(yy - offset * y - scale * py))
    variance = max(left, 0.0) * effective / (total * freedom)
    squared = float(np.sum(sums[1, 4] - 2 * mean * sums[1, 2] + mean**2 * sums[1, 0]))
    half = float(stdtrit(freedom, (1 + config.confidence) / 2)) * math.sqrt(variance * squared) / spread
    return replace(found, scale=scale, lower=scale - half, upper=scale + half, offset=read_only(offset))
