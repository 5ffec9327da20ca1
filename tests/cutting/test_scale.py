"""Scale of the force coefficients: recovers an injected one, covers it as often as it says, refuses where it must."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from turnmill_core.cutting.scale import Measured, Predicted, ScaleConfig, ScaleEstimate, initial, update

SPEED = 2 * math.pi * 50  # 10 revolutions in a window of 0.2 s
SECOND = 1_000_000_000
RATE = 1000.0
ALL = ScaleConfig(memory=1e6)


def run(
    config: ScaleConfig, load: Callable[[float], np.ndarray], scale: float, noise: float = 0.0, seconds: float = 4.0,
    offset: float = 0.0, seed: int = 0, ripple: float = 0.0, cut: Callable[[float], bool] = lambda t: True,
    drop: Callable[[float], bool] = lambda t: False,
) -> list[ScaleEstimate]:
    """Estimates of a run whose truth is `scale`, samples in runs of 20 ms, a prediction after each."""
    rng, state, found = np.random.default_rng(seed), initial(len(load(0.0))), []
    for k in range(round(seconds * 50)):
        time = k / 50 + np.arange(20) / RATE
        true = np.array([load(k / 50) * cut(k / 50)] * 20)
        samples = scale * true * (1 + ripple * np.cos(2 * SPEED * time))[:, None] + offset
        samples = samples + rng.normal(0, noise, true.shape) if noise else samples
        kept = [not drop(t) for t in time]
        if any(kept):
            state, _ = update(config, state, Measured((np.round(time * SECOND)).astype(np.int64)[kept], samples[kept]))
        state, estimate = update(config, state, Predicted(
            round(k / 50 * SECOND), SPEED, load(k / 50) * cut(k / 50), cut(k / 50)))
        found += estimate
    return found


def steady(time: float) -> np.ndarray:
    return np.array([-50.0, 80.0, -10.0])


def test_recovers_an_injected_scale_exactly_without_noise() -> None:
    """The ripple at the tooth passing frequency vanishes over whole revolutions."""
    found = run(ALL, steady, 1.3, ripple=2.0)
    assert [e.reason for e in found[:2]] == ["fewer than 3 windows in the cut"] * 2
    assert [e.scale for e in found[2:]] == pytest.approx([1.3] * (len(found) - 2), rel=1e-9)
    assert found[-1].windows == pytest.approx(len(found), rel=1e-3)
    assert found[-1].measured == pytest.approx(1.3 * steady(0.0))


@pytest.mark.parametrize(("trials", "within"), [
    (120, 0.05), pytest.param(2000, 0.02, marks=pytest.mark.slow)])
def test_interval_covers_the_scale_in_95_percent_of_trials(trials: int, within: float) -> None:
    """Window means with noise; also with an offset to be estimated and with fading memory."""
    def changing(time: float) -> np.ndarray:
        return np.array([100.0 * (1 + math.sin(time))])

    for config, load in ((ALL, steady), (replace(ALL, offset=True), changing), (replace(ALL, memory=2.0), steady)):
        inside = 0
        for seed in range(trials):
            rng, state, last = np.random.default_rng(seed), initial(len(load(0.0))), None
            for k in range(16):
                stamps = np.array([k * SECOND // 5, k * SECOND // 5 + SECOND // 10])
                config_now = replace(config, samples_per_revolution=0.0)
                level = 0.9 * load(k / 5) + (7.0 if config.offset else 0.0) + rng.normal(0, 10.0, len(load(0.0)))
                state, _ = update(config_now, state, Measured(stamps, np.array([level, level])))
                state, estimate = update(config_now, state, Predicted(k * SECOND // 5, SPEED, load(k / 5), True))
                last = estimate[-1] if estimate else last
            assert last is not None
            inside += last.lower <= 0.9 <= last.upper
        assert inside / trials == pytest.approx(0.95, abs=within)


def test_follows_a_scale_that_changes_within_its_memory() -> None:
    config = replace(ALL, memory=1.0)
    state, last = initial(1), math.nan
    for k in range(1000):
        truth = 1.0 if k < 500 else 1.5
        time = k * SECOND // 50 + np.arange(20) * SECOND // 1000
        state, _ = update(config, state, Measured(time, np.full((20, 1), truth * 100)))
        state, estimate = update(config, state, Predicted(k * SECOND // 50, SPEED, np.array([100.0]), True))
        last = estimate[-1].scale if estimate else last
    assert last == pytest.approx(1.5, abs=1e-3)


def test_idle_power_is_told_from_the_scale_once_the_level_without_a_cut_was_seen() -> None:
    config = replace(ALL, offset=True)
    constant = run(config, lambda t: np.array([200.0]), 1.2, offset=30.0)
    assert {e.reason[:26] for e in constant[3:]} == {"the load has not changed, "}
    found = run(config, lambda t: np.array([200.0]), 1.2, offset=30.0, noise=1.0, cut=lambda t: t >= 1.0)
    assert found[-1].scale == pytest.approx(1.2, rel=0.01)
    assert found[-1].offset == pytest.approx([30.0], abs=1.0)
    assert found[-1].lower < found[-1].scale < found[-1].upper


def test_refuses_where_there_is_no_cut() -> None:
    air = run(ALL, steady, 1.0, cut=lambda t: False, noise=1.0)
    assert {e.reason for e in air} == {"no cut"}
    assert all(math.isnan(e.scale) for e in air)
    entering = run(ALL, steady, 1.0, cut=lambda t: t >= 1.1)
    assert "the cut begins or ends in the window" in {e.reason for e in entering}
    assert entering[-1].scale == pytest.approx(1.0)
    tiny = run(ALL, lambda t: steady(t) * 1e-3, 1.0)
    assert {e.reason for e in tiny} == {"the predicted load is too small"}


def test_refuses_without_samples_with_gaps_and_below_one_revolution() -> None:
    assert {e.reason for e in run(ALL, steady, 1.0, drop=lambda t: True)} == {"no measured samples"}
    assert "a gap in the measured samples" in {e.reason for e in run(
        ALL, steady, 1.0, drop=lambda t: 0.25 < t < 0.33)}
    sparse = run(ALL, steady, 1.0, drop=lambda t: round(t * 1000) % 10 != 0)
    assert {e.reason for e in sparse} == {"too few measured samples"}
    state, _ = update(ALL, initial(1), Predicted(0, 1.0, np.ones(1), True))
    _, found = update(ALL, state, Predicted(3 * SECOND, 1.0, np.ones(1), True))
    assert [e.reason for e in found] == ["less than one tool revolution in a window"]


def test_which_kind_comes_first_does_not_matter() -> None:
    """All predictions first (within the patience), or all samples first: the same estimates."""
    stamps = np.arange(1500, dtype=np.int64) * 1_000_000
    samples = [Measured(stamps[k:k + 20], np.full((20, 1), 110.0)) for k in range(0, 1500, 20)]
    loads = [Predicted(k * 20_000_000, SPEED, np.array([100.0]), True) for k in range(76)]
    found = []
    for items in ((*samples, *loads), (*loads, *samples)):
        state, estimates = initial(1), []
        for item in items:
            state, new = update(ALL, state, item)
            estimates += [(e.end_ns, e.scale, e.reason) for e in new]
        found.append(estimates)
    assert len(found[0]) == 7
    assert found[0] == found[1]
    assert found[0][-1][1] == pytest.approx(1.1)


def test_the_same_whatever_the_runs_are_cut_into() -> None:
    """Samples in other portions give the same bits."""
    one, other = initial(1), initial(1)
    rng = np.random.default_rng(3)
    values = rng.normal(100, 5, (2000, 1))
    stamps = np.arange(2000) * 1_000_000
    results: list[list[ScaleEstimate]] = [[], []]
    for k in range(100):
        part = slice(20 * k, 20 * k + 20)
        one, _ = update(ALL, one, Measured(stamps[part], values[part]))
        for j in range(20 * k, 20 * k + 20, 5):
            other, _ = update(ALL, other, Measured(stamps[j:j + 5], values[j:j + 5]))
        item = Predicted(k * 20_000_000, SPEED, np.array([90.0]), True)
        (one, first), (other, second) = update(ALL, one, item), update(ALL, other, item)
        results[0] += first
        results[1] += second
    bits = [[(e.scale, e.lower, e.upper) for e in found[2:]] for found in results]
    assert bits[0] == bits[1]
    assert len(results[0]) == 9


@pytest.mark.parametrize(("change", "words"), [
    ({"window": 0.0}, "scale window"), ({"memory": math.nan}, "scale memory"), ({"least": -1.0}, "scale least"),
    ({"fewest": 1}, "scale fewest"), ({"confidence": 1.0}, "scale confidence"),
    ({"samples_per_revolution": -1.0}, "samples per revolution")])
def test_settings_that_make_no_sense(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ScaleConfig(**change)  # type: ignore[arg-type]


def test_wrong_shapes() -> None:
    with pytest.raises(ValueError, match="components"):
        initial(0)
    with pytest.raises(ValueError, match="predicted load"):
        update(ALL, initial(3), Predicted(0, SPEED, np.ones(2), True))
    with pytest.raises(ValueError, match="measured samples"):
        update(ALL, initial(3), Measured(np.zeros(4, dtype=np.int64), np.ones((4, 2))))
    with pytest.raises(ValueError, match="measured samples"):
        Measured(np.zeros(0, dtype=np.int64), np.ones((0, 3)))
