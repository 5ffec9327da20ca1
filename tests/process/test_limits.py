"""Limits: each margin is 0 at its bound, and the grid sees what the full models see."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_limits import Limits, Rating
from turnmill_core.process.cut_values import cut_values, grid_values, load_table, searched_depth, with_feed
from turnmill_core.process.limits import LIMITS, CutValues, limit_margins, nearest_stable, stability

RPM = math.pi / 30
CUT = CutValues(
    tool_speed=500.0, workpiece_speed=2.0, depth=2e-3, cutting_speed=5.0, chip_thickness=1e-4, feed_per_tooth=1.1e-4,
    tool_torque=4.0, tool_torque_mean=1.5, workpiece_torque=-30.0, workpiece_torque_mean=-9.0, tool_force=400.0,
    feed_force=250.0, feed_speed=3e-3, duration=40.0, stable_from=0.0, stable_to=3e-3, form_error=2e-5)
TOOL = (Rating("peak", (100.0, 1000.0), (100.0 * 5.0, 1000.0 * 5.0)),
        Rating("mean", (100.0, 1000.0), (100.0 * 2.0, 1000.0 * 2.0), load="mean"))
FULL = Limits(
    chip_load_min=5e-5, chip_load_max=2e-4, cutting_speed_min=2.0, cutting_speed_max=8.0, tool_speed_min=100.0,
    tool_speed_max=900.0, workpiece_speed_max=4.0, depth_max=5e-3, feed_speed_max=0.1, tool_force_max=500.0,
    feed_force_max=500.0, form_error_max=4e-5, stability_margin=0.1, tool_spindle=TOOL,
    workpiece_spindle=(Rating("all", (1.0, 10.0), (50.0, 500.0)),))


def case(name: str = "thesis_table_5_1") -> Operation:
    return read_operation(shipped_operations()[name])


def test_every_limit_tells_what_is_left() -> None:
    found = {m.name: m for m in limit_margins(FULL, CUT)}
    assert len(found) == len(LIMITS)
    left = {name: float(m.margin) for name, m in found.items()}
    assert left["chip load, least"] == pytest.approx(0.5)
    assert left["chip load, largest"] == pytest.approx(0.5)
    assert left["tool spindle, torque"] == pytest.approx(1 - max(4 / 5, 1.5 / 2))
    assert left["workpiece spindle, peak torque"] == pytest.approx(1 - 30 / 50), "whichever sense"
    assert left["stability"] == pytest.approx(1 - 2 / (3 * 0.9))
    assert limit_margins(Limits(), replace(CUT, stable_to=math.nan)) == ()


BOUNDED = {  # limit -> (bound in Limits, value in CutValues)
    "chip load, least": ("chip_load_min", "chip_thickness"), "chip load, largest": ("chip_load_max", "chip_thickness"),
    "cutting speed, least": ("cutting_speed_min", "cutting_speed"),
    "cutting speed, largest": ("cutting_speed_max", "cutting_speed"),
    "tool speed, least": ("tool_speed_min", "tool_speed"), "tool speed, largest": ("tool_speed_max", "tool_speed"),
    "workpiece speed, largest": ("workpiece_speed_max", "workpiece_speed"), "depth, largest": ("depth_max", "depth"),
    "feed speed, largest": ("feed_speed_max", "feed_speed"), "tool force, largest": ("tool_force_max", "tool_force"),
    "feed force, largest": ("feed_force_max", "feed_force"), "form error, largest": ("form_error_max", "form_error"),
}


@pytest.mark.parametrize("name", BOUNDED)
@given(scale=st.floats(0.01, 100.0))
def test_a_margin_is_0_at_the_bound_and_falls_beyond(name: str, scale: float) -> None:
    bound, value = BOUNDED[name]
    at = getattr(FULL, bound)
    margins = {m.name: m for m in limit_margins(FULL, replace(CUT, **{value: np.array([at, at * scale])}))}
    exact, scaled = margins[name].margin
    assert exact == pytest.approx(0.0, abs=1e-12)
    beyond = scale < 1 if margins[name].lower else scale > 1
    assert scale == 1 or (scaled < 0) == beyond


def test_the_measure_of_the_chip_load_is_chosen() -> None:
    by_feed = limit_margins(replace(FULL, chip_load="feed per tooth"), CUT)
    assert next(m for m in by_feed if m.name == "chip load, largest").value == 1.1e-4


def test_stability_margin_in_islands() -> None:
    intervals = np.array([[0.0, 2e-3], [4e-3, 5e-3]])
    depths = np.array([1e-3, 2e-3, 3e-3, 4e-3, 4.5e-3, 6e-3])
    lower, upper = nearest_stable(intervals, depths, 8e-3)
    margin = stability(Limits(), replace(CUT, depth=depths, stable_from=lower, stable_to=upper))
    assert margin is not None
    expected = [0.5, 0.0, max(1 - 3 / 2, 1 - 4 / 3), 0.0, min(1 - 4.5 / 5, 1 - 4 / 4.5), 1 - 6 / 5]
    np.testing.assert_allclose(margin.margin, expected, atol=1e-12)
    lower, upper = nearest_stable(intervals, np.array([4.9e-3]), 5e-3)
    assert np.isinf(upper), "stable as far as was searched"
    lower, upper = nearest_stable(np.empty((0, 2)), depths, 8e-3)
    margin = stability(Limits(), replace(CUT, depth=depths, stable_from=lower, stable_to=upper))
    assert margin is not None
    assert np.all(margin.margin == -math.inf), "nowhere stable"


@pytest.mark.parametrize(("name", "edges", "tolerance"), [
    ("thesis_table_5_1", False, 2e-3), ("thesis_table_5_1", True, 3e-3), ("demo_runout_2_teeth", False, 5e-3),
    ("milling_benchmark_2dof", False, 2e-3),
])
def test_the_grid_agrees_with_the_full_models(name: str, edges: bool, tolerance: float) -> None:
    """Rigid loads from a table over depth and speed ratio, stability from a refined boundary; 6 seeded cuts."""
    op = case(name)
    if edges:
        op = replace(op, material=replace(op.material, Kte=20e3, Kre=25e3, Kae=2e3))
    rng, nominal = np.random.default_rng(3), op.conditions
    speeds = np.sort(nominal.tool_speed * rng.uniform(0.6, 1.4, 3))
    depths = np.sort(nominal.depth * rng.uniform(0.3, 1.0, 2))
    turning = abs(nominal.workpiece_speed)
    table = load_table(op, depths, 0.5 * turning / speeds[-1], 2 * turning / speeds[0])
    grid = grid_values(op, table, speeds, 1.3 * nominal.workpiece_speed)
    for i, depth in enumerate(depths):
        for j, speed in enumerate(speeds):
            exact = cut_values(op, with_cut(op, float(speed), 1.3 * nominal.workpiece_speed, float(depth)))
            for field in fields(CutValues):
                value = np.broadcast_to(getattr(grid, field.name), (2, 3))[i, j]
                wanted = getattr(exact, field.name)
                if field.name == "stable_to":  # the two were searched to different depths
                    searched = min(searched_depth(op, float(depth), 2.0), searched_depth(op, float(depths[-1])))
                    value, wanted = min(value, searched), min(wanted, searched)
                assert value == pytest.approx(wanted, rel=tolerance, nan_ok=True), field.name


def test_with_feed_moves_the_engagement() -> None:
    op = case()
    half = with_feed(op, 4e-3)
    assert half.conditions.radial_immersion == pytest.approx(4e-3)
    assert half.conditions.feed_speed == pytest.approx(op.conditions.feed_speed / 2)
    assert with_feed(op, op.axial_feed) == op
    with pytest.raises(ValueError, match="axial feed"):
        with_feed(op, 0.02)
    mill = case("milling_benchmark_2dof")
    assert with_feed(mill, 2 * mill.feed_per_tooth).conditions.feed_speed == pytest.approx(
        2 * mill.conditions.feed_speed)
