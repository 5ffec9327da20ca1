"""Points, margins and lobes of whole operations."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation, Shape
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_structure import ModeTable
from turnmill_core.prediction import PredictedType
from turnmill_core.stability.collocation import leading_multiplier, period_map
from turnmill_core.stability.delay import DelayModel
from turnmill_core.stability.lobes import stability_boundary
from turnmill_core.stability.margin import (
    stability_lobes,
    stability_margin,
    stability_point,
)
from turnmill_core.stability.operating_point import at_depth, depth_family, stability_problem

RPM = np.pi / 30
DEPTHS = {0.2e-3: 0.81974278, 0.5e-3: 1.07397559, 1.0e-3: 1.40647353}


@pytest.fixture(scope="module")
def milling() -> Operation:
    """The one-degree-of-freedom milling milling."""
    return read_operation(shipped_operations()["milling_benchmark_1dof"])


@pytest.fixture(scope="module")
def case_1() -> Operation:
    """Thesis Table 4.9."""
    return read_operation(shipped_operations()["thesis_table_4_9"])


@pytest.mark.parametrize("depth", DEPTHS)
def test_point_of_the_benchmark(milling: Operation, depth: float) -> None:
    point = stability_point(milling, with_cut(milling, depth=depth))
    assert point.spectral_radius == pytest.approx(DEPTHS[depth], abs=0.05)
    unstable = DEPTHS[depth] > 1
    assert (point.predicted_type is PredictedType.STABLE) != unstable
    assert np.isfinite(point.chatter_frequency) == unstable
    if unstable:
        assert 922 < point.chatter_frequency < 1000
        assert np.min(np.abs(point.chatter_family - point.chatter_frequency)) < 1e-6
    assert point.delay == pytest.approx(6e-3)
    assert point.principal_period == pytest.approx(6e-3)


def test_margin_of_the_benchmark(milling: Operation) -> None:
    margin = stability_margin(milling, with_cut(milling, depth=0.2e-3))
    assert 0.2e-3 < margin.depth_limit < 0.5e-3
    assert margin.depth_ratio == pytest.approx(0.2e-3 / margin.depth_limit)
    just_below, just_above = (
        stability_point(milling, with_cut(milling, depth=f * margin.depth_limit)).spectral_radius
        for f in (0.99, 1.01))
    assert just_below < 1 < just_above
    assert margin.limit_type is PredictedType.HOPF
    assert margin.nearest_stable_speed == margin.tool_speed


def test_nearest_stable_speed_is_stable(milling: Operation) -> None:
    conditions = with_cut(milling, depth=0.5e-3)
    margin = stability_margin(milling, conditions)
    assert margin.predicted_type is PredictedType.HOPF
    assert margin.depth_ratio > 1
    there = with_cut(milling, depth=0.5e-3, tool_speed=margin.nearest_stable_speed)
    assert stability_point(milling, there).predicted_type is PredictedType.STABLE
    assert margin.nearest_stable_speed != conditions.tool_speed


def test_a_stable_island_is_a_second_interval(milling: Operation) -> None:
    """Low-immersion milling: stable again above an unstable lens (found by the diagram below)."""
    speeds = np.array([17500.0]) * RPM
    lobes = stability_lobes(milling, speeds, np.linspace(0.2e-3, 4e-3, 20))
    margin = stability_margin(milling, with_cut(milling, tool_speed=float(speeds[0]), depth=1e-3), depth_search=4e-3)
    for depth, radius in zip(lobes.depths, lobes.spectral_radius[:, 0], strict=True):
        inside = np.any((margin.stable_depths[:, 0] <= depth) & (depth < margin.stable_depths[:, 1]))
        if abs(radius - 1) > 0.02:
            assert inside == (radius < 1)


def test_lobes_agree_with_points(case_1: Operation) -> None:
    calls: list[tuple[int, int]] = []
    speeds, depths = np.array([3100.0, 3350.0]) * RPM, np.array([1e-3, 4e-3])
    lobes = stability_lobes(case_1, speeds, depths, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(1, 2), (2, 2)]
    assert lobes.spectral_radius.shape == lobes.predicted_type.shape == (2, 2)
    for j, speed in enumerate(speeds):
        for i, depth in enumerate(depths):
            point = stability_point(case_1, with_cut(case_1, tool_speed=float(speed), depth=float(depth)))
            assert point.spectral_radius == pytest.approx(lobes.spectral_radius[i, j], abs=1e-4)
            assert point.predicted_type == lobes.predicted_type[i, j]
    assert np.all((lobes.depth_limit >= depths[0]) & (lobes.depth_limit <= depths[-1]))


def test_workpiece_rotation_enters_through_the_delay(case_1: Operation) -> None:
    slow, fast = (stability_problem(case_1, with_cut(case_1, workpiece_speed=w * RPM)) for w in (6.0, 21.0))
    assert fast.delays[0] / slow.delays[0] == pytest.approx(3371 / 3356, rel=1e-12)
    still = stability_problem(case_1, with_cut(case_1, workpiece_speed=6.0 * RPM), "milling")
    assert still.delays[0] == pytest.approx(still.period)
    exact = stability_problem(case_1, with_cut(case_1), "first-principles")
    assert exact.delay_variation == pytest.approx(6 * (23 - 0.6) / (3350 * 10), rel=1e-12)


def test_without_contact(case_1: Operation) -> None:
    margin = stability_margin(case_1, with_cut(case_1, depth=-1e-3))
    assert margin.predicted_type is PredictedType.NO_CUT
    assert np.isnan(margin.spectral_radius)
    assert margin.depth_limit > 0
    assert margin.depth_ratio == 0
    standing = stability_margin(case_1, with_cut(case_1, tool_speed=0.0))
    assert standing.predicted_type is PredictedType.NO_CUT
    assert np.isnan(standing.depth_limit)


def test_another_depth_moves_the_tip(case_1: Operation) -> None:
    deeper = at_depth(case_1, case_1.conditions, 2e-3)
    assert deeper.effective_radius == pytest.approx(23e-3 - 2e-3)


def test_a_rigid_operation_is_refused() -> None:
    rigid = read_operation(shipped_operations()["face_mill_6_teeth"])
    with pytest.raises(ValueError, match="rigid structure cannot chatter"):
        stability_margin(rigid, rigid.conditions)


@pytest.mark.parametrize(("speeds", "depths", "message"), [
    ([100.0, 90.0], [1e-3], "tool speeds"), ([0.0, 90.0], [1e-3], "tool speeds"), ([100.0], [np.nan], "depths"),
    ([100.0], [], "depths"), ([100.0], [0.1], "depth"),
])
def test_impossible_diagrams_are_refused(
    milling: Operation, speeds: list[float], depths: list[float], message: str,
) -> None:
    with pytest.raises(ValueError, match=message):
        stability_lobes(milling, speeds, depths)


def test_impossible_cuts_are_refused(milling: Operation) -> None:
    short = dataclasses.replace(milling, tool=dataclasses.replace(milling.tool, flute_length=1e-3))
    deep = dataclasses.replace(milling.conditions, depth=2e-3)
    with pytest.raises(ValueError, match="flute length"):
        stability_point(short, deep)
    with pytest.raises(ValueError, match="flute length"):
        stability_margin(short, short.conditions, depth_search=2e-3)
    for change, message in (({"tool_speed": 0.0}, "tool speed"), ({"depth": 0.0}, "depth"),
                            ({"cross_feed_span": (0.005, 0.005)}, "radial immersion")):
        with pytest.raises(ValueError, match=message):
            stability_problem(milling, dataclasses.replace(milling.conditions, **change))


@pytest.mark.parametrize("delay_model", ["mean", "milling", "first-principles"])
def test_every_delay_model_goes_through_the_fast_solver(case_1: Operation, delay_model: DelayModel) -> None:
    """A fast workpiece, so that the models differ: each depth of the series is the point's own result."""
    cut = with_cut(case_1, workpiece_speed=120 * RPM, depth=3e-3)
    family = depth_family(case_1, cut, 3e-3, delay_model)
    found = np.abs(family.multipliers(family.series([1e-3, 2e-3, 3e-3]), 310.0))
    for depth, value in zip((1e-3, 2e-3, 3e-3), found, strict=True):
        there = with_cut(case_1, tool_speed=310.0, workpiece_speed=120 * RPM, depth=depth)
        assert stability_point(case_1, there, delay_model).spectral_radius == pytest.approx(value, abs=1e-4)


def test_the_delay_models_differ_where_the_workpiece_is_fast(case_1: Operation) -> None:
    cut = with_cut(case_1, workpiece_speed=120 * RPM, depth=3e-3)
    found = [stability_point(case_1, cut, model).spectral_radius for model in ("mean", "milling", "first-principles")]
    assert np.ptp(found) > 0.01


def test_low_speed_makes_large_maps_and_still_ends(case_1: Operation) -> None:
    problem = stability_problem(case_1, with_cut(case_1, tool_speed=200 * RPM))
    assert len(period_map(problem).matrix) > 300
    point = stability_point(case_1, with_cut(case_1, tool_speed=200 * RPM))
    assert point.spectral_radius == pytest.approx(abs(leading_multiplier(problem)), abs=1e-4)


def test_the_boundary_is_where_the_diagram_turns(case_1: Operation) -> None:
    speeds, depths = np.array([3000.0, 3350.0, 3600.0]) * RPM, np.linspace(0.2e-3, 5e-3, 25)
    lobes = stability_lobes(case_1, speeds, depths)
    seen: list[int] = []
    boundary = stability_boundary(case_1, speeds, 5e-3, progress=lambda done, _: seen.append(done))
    for j, (intervals, types) in enumerate(boundary.stable):
        assert set(types[:, 1].tolist()) <= {PredictedType.STABLE, PredictedType.HOPF}
        assert boundary.depth_limit[j] == intervals[0, 1]
        inside = [np.any((intervals[:, 0] <= a) & (a <= intervals[:, 1])) for a in depths]
        far = np.abs(lobes.spectral_radius[:, j] - 1) > 1e-3
        np.testing.assert_array_equal(np.array(inside)[far], lobes.spectral_radius[far, j] < 1)
        assert lobes.depth_limit[j] == pytest.approx(intervals[0, 1], abs=0.02e-3)
    assert seen == [1, 2, 3]


def test_an_unknown_delay_model_is_refused(case_1: Operation) -> None:
    with pytest.raises(ValueError, match="delay model"):
        stability_point(case_1, case_1.conditions, "thesis")  # type: ignore[arg-type]


def test_cuts_that_the_model_does_not_know_are_refused(case_1: Operation) -> None:
    ball = dataclasses.replace(case_1.tool, shape=Shape(corner_radius=case_1.tool.radius))
    with pytest.raises(ValueError, match="cylindrical"):
        stability_point(dataclasses.replace(case_1, tool=ball), case_1.conditions)
    with pytest.raises(ValueError, match="eccentricity"):
        stability_point(dataclasses.replace(case_1, eccentricity=1e-3), case_1.conditions)


def test_process_damping_follows_the_tool_speed() -> None:
    """A series at another speed is the problem of that speed: damping goes with 1/V."""
    op = read_operation(shipped_operations()["thesis_table_4_11"])
    family = depth_family(op, op.conditions, 3e-3)
    found = abs(family.multipliers(family.series([2e-3, 3e-3]), 150.0)[1])
    there = with_cut(op, tool_speed=150.0, depth=3e-3)
    assert stability_point(op, there).spectral_radius == pytest.approx(found, abs=1e-4)
    bare = dataclasses.replace(op, process_damping=None)
    assert stability_point(bare, there).spectral_radius > found + 0.01


@pytest.mark.parametrize("name", ["thesis_table_4_1", "thesis_table_4_2"])
def test_turning_structures_follow_the_tool_speed(name: str) -> None:
    op = read_operation(shipped_operations()[name])
    family = depth_family(op, op.conditions, 2e-3)
    speed = 1.2 * op.conditions.tool_speed
    found = np.abs(family.multipliers(family.series([1e-3, 2e-3]), speed))
    for depth, value in zip((1e-3, 2e-3), found, strict=True):
        there = with_cut(op, tool_speed=speed, depth=depth)
        assert stability_point(op, there).spectral_radius == pytest.approx(value, abs=1e-4 * max(1, value))


def test_modes_that_depend_on_speed_are_taken_at_each_speed(milling: Operation) -> None:
    """Half the frequency at half the speed and a quarter of the stiffness: lobes of the slower mode."""
    mode = milling.tool.structure.modes[0]
    slow = dataclasses.replace(mode, frequency=mode.frequency / 2)
    table = ModeTable(("tool_speed",), ((250.0,), (600.0,)), ((slow,), (mode,)))
    changing = dataclasses.replace(milling, tool=dataclasses.replace(
        milling.tool, structure=dataclasses.replace(milling.tool.structure, modes=(slow,), table=table)))
    lobes = stability_lobes(changing, [250.0, 600.0], [0.1e-3])
    for j, (speed, only) in enumerate(((250.0, slow), (600.0, mode))):
        plain = dataclasses.replace(milling, tool=dataclasses.replace(
            milling.tool, structure=dataclasses.replace(milling.tool.structure, modes=(only,))))
        expected = stability_point(plain, with_cut(plain, tool_speed=speed, depth=0.1e-3)).spectral_radius
        assert lobes.spectral_radius[0, j] == pytest.approx(expected, abs=1e-4)
