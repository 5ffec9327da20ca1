"""Motion along a path: times from feeds, axis states against the poses of the path, and derivatives."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.machine.cases import turn_milling
from tests.machine.test_kinematics import OFFSET
from turnmill_core.machine.conditions import conditions_from_axes
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.machine.kinematics import NT3150, MachineKinematics, RotaryAxis, forward, slides_at
from turnmill_core.machine.path_motion import axis_states, path_motion, positions_at, sample_times
from turnmill_core.machine.toolpath import PathPoint, Toolpath
from turnmill_core.machine.turn_milling_paths import cut_from_operation, orthogonal_path

UP = (0.0, 0.0, 1.0)
RPM = math.pi / 30


def tilted(b: float, c: float) -> tuple[float, float, float]:
    return math.sin(b) * math.cos(c), -math.sin(b) * math.sin(c), math.cos(b)


def five_axis_path() -> Toolpath:
    """C is positioned, b and c change all along."""
    s = np.linspace(0, 1, 9)
    return Toolpath(tuple(
        PathPoint((0.02 + 0.03 * u, 0.01 * math.sin(3 * u), -0.05 * u), tilted(0.3 + 0.8 * u, 2.0 * u), 0.01,
                  tool_speed=100.0) for u in s))


def test_time_is_length_over_feed_per_minute() -> None:
    path = Toolpath((PathPoint((0.0, 0.0, 0.0), UP), PathPoint((0.003, 0.004, 0.0), UP, 0.001),
                     PathPoint((0.003, 0.004, 0.05), UP, 0.001, rapid=True)))
    motion = path_motion(NT3150, path, rapid_speed=0.1)
    assert motion.time == pytest.approx([0.0, 5.0, 5.5])


def test_feed_per_revolution_is_that_of_the_turning_workpiece_else_of_the_tool() -> None:
    points = [PathPoint((0.0, 0.0, 0.0), UP), PathPoint((0.01, 0.0, 0.0), UP, 0.002, "revolution", 60 * RPM, 0.0),
              PathPoint((0.02, 0.0, 0.0), UP, 0.002, "revolution", 60 * RPM, -30 * RPM)]
    motion = path_motion(NT3150, Toolpath(tuple(points)))
    assert motion.time == pytest.approx([0, 5, 15])
    assert motion.tool_angle == pytest.approx([0, 10 * math.pi, 30 * math.pi])
    assert motion.drives[:, 4] == pytest.approx([0, 0, -10 * math.pi])


def test_a_turn_on_the_spot_takes_the_time_of_the_rotary_axis() -> None:
    path = Toolpath((PathPoint((0.0, 0.0, 0.0), UP), PathPoint((0.0, 0.0, 0.0), tilted(0.6, 0.0), 0.001)))
    assert path_motion(NT3150, path, rotary_speed=0.2).time[1] == pytest.approx(3.0)


@pytest.mark.parametrize(("point", "words"), [
    (PathPoint((0.1, 0.0, 0.0), UP), "feed to path point 2"),
    (PathPoint((0.1, 0.0, 0.0), UP, 0.001, "revolution"), "spindle speed at path point 2"),
    (PathPoint((0.1, 0.0, 0.0), tilted(0.5, 1.0), 0.001, workpiece_speed=1.0), "path point 2 needs c at 57.2958 or"),
])
def test_paths_that_cannot_be_timed(point: PathPoint, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        path_motion(NT3150, Toolpath((PathPoint((0.0, 0.0, 0.0), UP), point)))


def test_directions_out_of_reach_and_bad_rates() -> None:
    path = five_axis_path()
    with pytest.raises(ValueError, match="cannot be reached"):
        path_motion(MachineKinematics(b=RotaryAxis((0.0, 1.0, 2.0))), path)
    motion = path_motion(NT3150, path)
    for rate, words in ((0.0, "rate"), (math.nan, "rate"), (1e9, "number of axis states")):
        with pytest.raises(ValueError, match=words):
            sample_times(motion, rate)
    for name in ("rapid_speed", "rotary_speed"):
        with pytest.raises(ValueError, match=name.replace("_", " ")):
            path_motion(NT3150, path, **{name: 0.0})


@pytest.mark.parametrize("machine", [NT3150, OFFSET], ids=lambda m: m.name)
def test_the_drives_reach_every_pose_of_the_path(machine: MachineKinematics) -> None:
    path = five_axis_path()
    motion = path_motion(machine, path)
    tip, axis = forward(machine, motion.drives)
    assert tip == pytest.approx(path.tips, abs=1e-14)
    assert axis == pytest.approx(path.axes, abs=1e-14)
    assert np.abs(np.diff(motion.drives[:, 3:], axis=0)).max() < 0.3


@pytest.mark.parametrize("machine", [NT3150, OFFSET], ids=lambda m: m.name)
def test_between_the_points_the_tip_stays_on_the_line_at_the_feed(machine: MachineKinematics) -> None:
    path = five_axis_path()
    motion = path_motion(machine, path)
    time = np.linspace(0, motion.duration, 400)[:-1]
    position, _ = positions_at(motion, path, time)
    drives = np.concatenate([slides_at(machine, position[:, :3], position[:, 3]), position[:, 3:5]], -1)
    tip, _ = forward(machine, drives)
    expected = np.stack([np.interp(time, motion.time, path.tips[:, k]) for k in range(3)], -1)
    assert tip == pytest.approx(expected, abs=1e-13)


def mixed_path() -> Toolpath:
    """Five axes, then the workpiece turns, then C is positioned again."""
    first = five_axis_path().points
    turning = [PathPoint((0.1, 0.0, -0.01 * k), (1.0, 0.0, 0.0), 0.001, "revolution", 200.0, -5.0) for k in range(4)]
    return Toolpath((*first, *turning, *first))


@pytest.mark.parametrize("machine", [NT3150, OFFSET], ids=lambda m: m.name)
def test_velocities_are_the_derivatives_of_positions(machine: MachineKinematics) -> None:
    path = mixed_path()
    motion = path_motion(machine, path)
    time = np.random.default_rng(5).uniform(0, motion.duration, 300)
    time = time[np.abs(time[:, None] - motion.time).min(1) > 1e-4]
    h = 1e-5
    numeric = (positions_at(motion, path, time + h)[0] - positions_at(motion, path, time - h)[0]) / (2 * h)
    assert positions_at(motion, path, time)[1] == pytest.approx(numeric, abs=2e-5, rel=1e-6)


@pytest.mark.parametrize("machine", [NT3150, OFFSET], ids=lambda m: m.name)
def test_positions_are_continuous_between_positioned_and_turning_workpiece(machine: MachineKinematics) -> None:
    path = mixed_path()
    motion = path_motion(machine, path)
    before, after = (positions_at(motion, path, motion.time[1:-1] + d)[0] for d in (-1e-9, 1e-9))
    assert before == pytest.approx(after, abs=1e-5)
    assert positions_at(motion, path, motion.time)[0][:, :3] == pytest.approx(motion.tip, abs=1e-9)


def test_before_and_after_the_path_the_axes_stand_and_the_spindles_turn() -> None:
    path = mixed_path()
    motion = path_motion(NT3150, path)
    position, velocity = positions_at(motion, path, np.array([motion.duration, motion.duration + 1.0]))
    assert position[1, :5] == pytest.approx(position[0, :5])
    assert velocity[:, :5] == pytest.approx(np.zeros((2, 5)))
    assert position[1, 5] - position[0, 5] == pytest.approx(100.0)


def test_stamps_do_not_drift() -> None:
    path = Toolpath((PathPoint((0.0, 0.0, 0.0), UP), PathPoint((1.0, 0.0, 0.0), UP, 0.1)))
    states = axis_states(path_motion(NT3150, path), path, 300.0, start_ns=7)
    assert len(states) == 3001
    assert states[-1].stamp_ns == 10_000_000_007
    assert states[-1].position[0] == pytest.approx(1.0)
    assert states[1500].velocity[0] == pytest.approx(0.1)


@pytest.mark.parametrize("speed", [6.0, -6.0])
@pytest.mark.parametrize("sense", ["up", "down"])
def test_an_orthogonal_pass_is_the_cut_of_the_operation(sense: str, speed: float) -> None:
    """The motion of the generated path means the nominal conditions, and is the controller's own."""
    op = turn_milling(sense=sense, workpiece_speed=speed * RPM, datum=(0.1, 0.0, -0.2))
    machine = dataclasses.replace(NT3150, workpiece_datum=op.workpiece.datum,
                                  c=RotaryAxis((0.0, 0.0, 1.0), op.workpiece.datum))
    path = orthogonal_path(cut_from_operation(op))
    motion = path_motion(machine, path)
    for state in axis_states(motion, path, 5.0):
        t = state.stamp_ns * 1e-9
        if not motion.time[1] + 30 < t < motion.time[2] - 30:  # whole tool over the bar
            continue
        cut, nominal = conditions_from_axes(op, state), op.conditions
        assert cut.depth == pytest.approx(nominal.depth, abs=1e-12)
        assert cut.feed_speed == pytest.approx(nominal.feed_speed, rel=1e-12)
        assert cut.workpiece_speed == nominal.workpiece_speed
        assert cut.cross_feed_span == pytest.approx(nominal.cross_feed_span, abs=1e-12)
        own = axis_state_at(op, t, state.stamp_ns)
        assert state.velocity == pytest.approx(own.velocity, abs=1e-12)
        assert state.position[4:] == pytest.approx(own.position[4:], rel=1e-12)
