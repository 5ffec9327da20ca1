"""Selection: the columns of the thesis' case, optimality, conflicts, robust choice, what the machine has shown."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.process.cut_values import cut_values
from turnmill_core.process.limits import limit_margins
from turnmill_core.process.plan import Grid, Plan, default_grid, plan, planned
from turnmill_core.process.robust import (
    Draws,
    Observation,
    agrees,
    draw,
    feasible_share,
    robust_choice,
)
from turnmill_core.process.suggestion import search_grid, suggest, with_modes
from turnmill_core.stability.margin import stability_point
from turnmill_core.stability.uncertainty import Spread

RPM = math.pi / 30
MM3_PER_MIN = 1 / 6e10


@cache
def case() -> Operation:
    return read_operation(shipped_operations()["thesis_table_5_1"])


def grid(*turning: float, speeds: int = 30, depths: int = 24) -> Grid:
    whole = default_grid(case(), speeds, depths)
    return replace(whole, workpiece_speeds=tuple(w * RPM for w in turning))


@cache
def made() -> Plan:
    return plan(case(), grid(10, 30, 50, 60))


def test_the_tool_speeds_of_table_5_2_and_no_cut_at_60_rpm() -> None:
    windows = [r.tool_speeds[r.feasible.any(axis=0)] / RPM for r in made().regions]
    assert [round(float(w[0])) for w in windows[:3]] == [1966, 5898, 9830]
    assert [round(float(w[-1])) for w in windows[:3]] == [10345] * 3
    assert made().choices[3] is None
    (conflict,) = made().reasons[3]
    assert conflict.limits == ("chip load, largest", "cutting speed, largest")
    assert round(conflict.asks / RPM) == 11796
    assert round(conflict.allows / RPM) == 10345
    assert conflict.shortfall < 0


def test_a_chosen_cut_meets_every_limit_and_its_rate_is_that_of_the_formula() -> None:
    op = case()
    for choice in made().choices[:3]:
        assert choice is not None
        cut = choice.conditions
        margins = limit_margins(op.limits, cut_values(op, cut))
        assert min(float(m.margin) for m in margins) >= -1e-9
        rate = cut.workpiece_speed / (2 * math.pi) * op.axial_feed * cut.depth * math.pi * (
            op.workpiece.diameter - cut.depth)
        assert choice.rate == pytest.approx(rate, rel=1e-12)
        assert any(a <= cut.tool_speed * (1 + 1e-3) and cut.tool_speed <= b * (1 + 1e-3) for a, b in choice.tool_speeds)
        assert planned(choice).conditions == cut
    best = made().best
    assert best is not None
    assert best.rate == max(c.rate for c in made().choices if c is not None)


def test_no_random_cut_beats_the_best() -> None:
    """Independent of the grid: seeded cuts judged by the full models only."""
    op, rng, best = case(), np.random.default_rng(8), made().choices[0]
    assert best is not None
    beaten = 0
    for _ in range(40):
        depth = best.conditions.depth * rng.uniform(1.01, 1.3)
        cut = with_cut(op, rng.uniform(1966, 10345) * RPM, 10 * RPM, depth)
        beaten += all(float(m.margin) >= 0 for m in limit_margins(op.limits, cut_values(op, cut)))
    assert beaten == 0


def test_the_front_holds_no_cut_that_another_beats() -> None:
    front = made().pareto
    assert len(front) >= 3
    rates, errors = [t.rate for t in front], [t.form_error for t in front]
    assert rates == sorted(set(rates))
    assert errors == sorted(set(errors))
    for found in made().regions:
        error, rate = found.values.form_error[found.feasible], (found.rate[:, None] + 0 * found.least)[found.feasible]
        for e, r in zip(error, rate, strict=True):
            assert any(t.rate >= r * (1 - 1e-12) and t.form_error <= e * (1 + 1e-12) for t in front)


def test_a_limit_that_nothing_meets_is_named_with_its_shortfall() -> None:
    op = replace(case(), limits=replace(case().limits, cutting_speed_max=0.5))
    found = plan(op, grid(10, speeds=8, depths=4))
    assert found.best is None
    (conflict,) = found.reasons[0]
    assert conflict.limits == ("cutting speed, largest",)
    assert conflict.shortfall == pytest.approx(1 - 1000 * RPM * op.tool.radius / 0.5)


def test_more_feed_is_searched_where_it_is_asked_for() -> None:
    found = plan(case(), replace(grid(10, speeds=8, depths=6), feeds=(4e-3, 8e-3)))
    assert [r.feed for r in found.regions] == [4e-3, 8e-3]
    assert found.regions[0].op.conditions.radial_immersion == pytest.approx(4e-3)


def test_milling_is_planned_by_speed_and_depth() -> None:
    op = read_operation(shipped_operations()["milling_benchmark_2dof"])
    found = plan(op, default_grid(op, 24, 12))
    best = found.best
    assert best is not None
    assert found.pareto == ()
    assert stability_point(op, best.conditions).spectral_radius < 1
    assert best.rate == pytest.approx(
        best.conditions.feed_speed * best.conditions.radial_immersion * best.conditions.depth)


def test_an_exception_from_the_progress_ends_the_search() -> None:
    def tell(share: float, what: str) -> None:
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan(case(), grid(10, 20, speeds=8, depths=4), tell)


def test_a_bad_grid_is_refused() -> None:
    with pytest.raises(ValueError, match="grid of depths"):
        replace(grid(10), depths=(2e-3, 1e-3))
    with pytest.raises(ValueError, match="flute length"):
        plan(case(), replace(grid(10), depths=(1e-3, 20e-3)))


def test_without_uncertainty_the_robust_choice_is_the_best_one() -> None:
    certain = draw(case(), 2, spread=Spread(0.0, 0.0, 0.0, 0.0))
    assert certain.operations[0] == case()
    best, robust = made().best, robust_choice(made(), certain)
    assert best is not None
    assert robust is not None
    assert robust.share == 1.0
    assert robust.rate == pytest.approx(best.rate, rel=0.05), "the share is known on a coarser grid"
    assert robust.rate <= best.rate * (1 + 1e-9)


def test_the_robust_choice_stays_feasible_in_fresh_draws() -> None:
    draws = draw(case(), 10, seed=1)
    assert draw(case(), 10, seed=1).operations == draws.operations
    robust, best = robust_choice(made(), draws, 0.9), made().best
    assert robust is not None
    assert best is not None
    assert robust.rate < best.rate
    fresh = draw(case(), 20, seed=99)
    assert feasible_share(robust, fresh) > feasible_share(best, fresh)
    assert feasible_share(robust, fresh) >= 0.75
    assert math.isnan(feasible_share(best, Draws((), 0)))


def test_draws_agree_with_what_the_machine_showed() -> None:
    """The truth is the operation with a workpiece 3 % lower in frequency; chatter that it has and the model has not."""
    op = read_operation(shipped_operations()["milling_benchmark_1dof"])
    truth = with_modes(op, [0.97 * m.frequency for m in op.tool.structure.modes])
    for speed in np.linspace(0.7, 1.3, 61) * op.conditions.tool_speed:
        cut = with_cut(op, tool_speed=float(speed), depth=0.4e-3)
        real = stability_point(truth, cut)
        if real.spectral_radius > 1.05 and stability_point(op, cut).spectral_radius < 0.95:
            break
    seen = Observation(cut.tool_speed, 0.0, cut.depth, True, real.chatter_frequency)
    assert not agrees(op, seen)
    assert agrees(truth, seen)
    found = draw(op, 10, seed=2, observations=(seen,))
    assert found.operations
    assert all(agrees(one, seen) for one in found.operations)
    assert found.drawn > 10
    frequencies = [one.tool.structure.modes[0].frequency for one in found.operations]
    assert np.median(frequencies) < op.tool.structure.modes[0].frequency, "they learned the direction"
    impossible = draw(op, 5, observations=(seen, replace(seen, chatter=False, frequency=math.nan)))
    assert impossible.operations == ()
    assert impossible.widened == 4.0


def test_a_suggestion_leaves_measured_chatter() -> None:
    op = read_operation(shipped_operations()["milling_benchmark_1dof"])
    deep = with_cut(op, depth=2.5 * op.conditions.depth)
    point = stability_point(op, deep)
    assert point.spectral_radius > 1
    seen = Observation(deep.tool_speed, 0.0, deep.depth, True, point.chatter_frequency)
    found = suggest(op, seen, (seen,), samples=6)
    assert found.choice is not None
    assert found.choice.conditions.depth <= deep.depth * (1 + 1e-9), "no depth that nobody asked for"
    assert stability_point(op, found.choice.conditions).spectral_radius < 1
    assert search_grid(case()).workpiece_speeds[-1] == pytest.approx(100 * RPM), "the limits are the range"


def test_changed_modes_keep_their_stiffness() -> None:
    op = case()
    changed = with_modes(op, [240.0, math.nan, math.nan, math.nan], [0.03] * 4)
    before, after = op.workpiece.structure.modes, changed.workpiece.structure.modes
    assert [m.frequency for m in after] == [240.0, *(m.frequency for m in before[1:])]
    assert [m.stiffness for m in after] == pytest.approx([m.stiffness for m in before])
    assert {m.damping for m in after} == {0.03}
    with pytest.raises(ValueError, match="mode frequencies"):
        with_modes(op, [240.0])
