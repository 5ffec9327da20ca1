"""Generated turn-milling paths against the geometry that they are to make."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.machine.cases import milling, turn_milling
from turnmill_core.machine.inverse_kinematics import inverse_path
from turnmill_core.machine.kinematics import NT3150
from turnmill_core.machine.path_motion import axis_states, path_motion
from turnmill_core.machine.toolpath import Toolpath
from turnmill_core.machine.turn_milling_paths import (
    TurnMillingCut,
    arc_profile,
    coaxial_path,
    curved_path,
    cut_from_operation,
    orthogonal_path,
    tangential_path,
)

RPM = math.pi / 30
CUT = TurnMillingCut(0.025, 0.12, 0.01, 1e-3, 0.008, 3350 * RPM, 6 * RPM)


def gap(path: Toolpath, index: int, cut: TurnMillingCut = CUT) -> float:
    """Least distance of the tool (a cylinder up the tool axis from the tip) from the workpiece axis at a point."""
    point = path.points[index]
    along, turn = np.linspace(0, 0.1, 1001), np.linspace(0, 2 * math.pi, 721)
    axis = np.array(point.axis)
    side = np.cross(axis, [0.0, 1.0, 0.0])
    ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(axis, side)
    flank = np.array(point.tip) + along[:, None, None] * axis + cut.tool_radius * ring
    face = np.array(point.tip) + np.linspace(0, cut.tool_radius, 101)[:, None, None] * ring
    return float(min(np.hypot(p[..., 0], p[..., 1]).min() for p in (flank, face)))


@pytest.mark.parametrize(("make", "axis"), [
    (orthogonal_path, (1.0, 0.0, 0.0)), (tangential_path, (1.0, 0.0, 0.0)), (coaxial_path, (0.0, 0.0, 1.0))])
@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize("speed", [6.0, -20.0])
def test_each_kind_leaves_the_finished_radius(make, axis, direction: int, speed: float) -> None:  # type: ignore[no-untyped-def]
    cut = dataclasses.replace(CUT, direction=direction, workpiece_speed=speed * RPM)
    path = make(cut)
    start, first, last, end = path.points
    assert [p.axis for p in path.points] == [axis] * 4
    for k in (1, 2):
        assert gap(path, k) == pytest.approx(cut.finished_radius, abs=2e-6)
    for k in (0, 3):
        assert gap(path, k) == pytest.approx(cut.bar_radius + cut.clearance, abs=2e-6)
    assert math.copysign(1, last.tip[2] - first.tip[2]) == direction
    assert (start.rapid, first.rapid, last.rapid, end.rapid) == (True, direction < 0, False, True)
    motion = path_motion(NT3150, path)
    turns = abs(last.tip[2] - first.tip[2]) / cut.axial_feed
    assert motion.time[2] - motion.time[1] == pytest.approx(turns * 2 * math.pi / abs(cut.workpiece_speed))
    assert motion.drives[2, 4] - motion.drives[1, 4] == pytest.approx(math.copysign(2 * math.pi * turns, speed))
    states = axis_states(motion, path, 2.0)
    assert {math.copysign(1, s.velocity[4]) for s in states} == {math.copysign(1, speed)}
    assert np.diff([s.position[4] for s in states]) == pytest.approx(np.full(len(states) - 1, cut.workpiece_speed / 2))


def test_where_the_tool_starts_it_does_not_touch_the_bar() -> None:
    for path, reach in ((orthogonal_path(CUT), CUT.tool_radius), (tangential_path(CUT), CUT.tool_radius),
                        (coaxial_path(CUT), 0.0)):
        assert path.points[1].tip[2] - reach == pytest.approx(CUT.clearance)
        assert path.points[2].tip[2] - reach == pytest.approx(-CUT.bar_length)


def test_eccentricity() -> None:
    cut = dataclasses.replace(CUT, eccentricity=-4e-3)
    path = orthogonal_path(cut)
    assert {p.tip[1] for p in path.points} == {-4e-3}
    assert gap(path, 1, cut) == pytest.approx(cut.finished_radius, abs=2e-6)
    path = coaxial_path(cut)
    assert path.points[1].tip[1] == -4e-3
    assert gap(path, 1, cut) == pytest.approx(cut.finished_radius, abs=2e-6)


def test_a_curved_contour_keeps_the_tool_across_the_surface() -> None:
    """On a circle the normal is known; differences weighted by the spacing are exact to second order."""
    off = []
    for n in (51, 101):
        profile = arc_profile(CUT, 8e-3, n)
        half, sagitta = CUT.bar_length / 2, 8e-3
        circle = (half**2 + sagitta**2) / (2 * sagitta)
        centre = np.array([-half, CUT.finished_radius - circle])
        assert np.linalg.norm(profile - centre, axis=1) == pytest.approx(np.full(n, circle), rel=1e-12)
        path = curved_path(CUT, profile)
        axes = np.array([p.axis for p in path.points[1:-1]])
        normal = (profile - centre) / circle
        off.append(np.abs(axes[:, [2, 0]] - normal).max())
    assert off[1] < 2e-4
    assert off[0] / off[1] == pytest.approx(4, rel=0.15)
    assert path.tips[1:-1] == pytest.approx(np.stack([profile[:, 1], 0 * profile[:, 0], profile[:, 0]], -1))
    assert not any(p.rapid for p in path.points[1:-1])


def test_the_tilting_head_follows_the_contour_while_the_workpiece_turns() -> None:
    path = curved_path(CUT, arc_profile(CUT, 8e-3))
    motion = path_motion(NT3150, path)
    tilt = np.degrees(motion.drives[:, 3])
    assert tilt[0] == pytest.approx(90 - math.degrees(2 * math.atan(8 / 60)), abs=0.1)
    assert tilt[len(tilt) // 2] == pytest.approx(90, abs=1e-3)
    assert np.all(np.diff(tilt[1:-1]) > 0)
    assert motion.drives[:, 3:][:, 0] == pytest.approx(
        inverse_path(NT3150, path.tips, path.axes, start=(1.3, 0.0))[:, 3], abs=1e-14)
    assert motion.drives[-1, 4] == pytest.approx(CUT.workpiece_speed * motion.duration)


def test_paths_from_operations() -> None:
    op = turn_milling(sense="down", workpiece_speed=-12 * RPM)
    cut = cut_from_operation(op, eccentricity=1e-3)
    assert (cut.bar_radius, cut.bar_length, cut.tool_radius, cut.depth) == (0.025, 0.12, 0.01, 1e-3)
    assert cut.direction == -1  # docs/frames.md: Omega_c < 0, towards the chuck is down-milling
    assert cut.workpiece_speed == pytest.approx(-12 * RPM)
    assert cut_from_operation(op, workpiece_speed=3.0).workpiece_speed == 3.0
    assert cut_from_operation(op, workpiece_speed=3.0).direction == -1
    with pytest.raises(ValueError, match="process"):
        cut_from_operation(milling())


@pytest.mark.parametrize(("values", "words"), [
    ({"depth": 0.03}, "depth"), ({"depth": 0.0}, "depth"), ({"workpiece_speed": 0.0}, "workpiece speed"),
    ({"axial_feed": -0.001}, "axial feed"), ({"tool_radius": 0.0}, "tool radius"), ({"direction": 0}, "direction"),
    ({"eccentricity": math.nan}, "eccentricity"), ({"flute_length": 0.0}, "flute length"),
])
def test_cuts_that_cannot_exist(values: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(CUT, **values)


def test_paths_that_cannot_be_made() -> None:
    def changed(**values: float) -> TurnMillingCut:
        return dataclasses.replace(CUT, **values)  # type: ignore[arg-type]

    with pytest.raises(ValueError, match="eccentricity"):
        orthogonal_path(changed(eccentricity=0.01))
    with pytest.raises(ValueError, match="flute length"):
        orthogonal_path(changed(depth=0.01, flute_length=0.005))
    with pytest.raises(ValueError, match="eccentricity"):
        tangential_path(changed(eccentricity=0.001))
    with pytest.raises(ValueError, match="chord of the cut"):
        tangential_path(changed(flute_length=0.013))
    with pytest.raises(ValueError, match="eccentricity"):
        coaxial_path(changed(eccentricity=0.04))
    with pytest.raises(ValueError, match="sagitta"):
        arc_profile(CUT, 0.03)
    with pytest.raises(ValueError, match="profile points"):
        arc_profile(CUT, 0.005, 2)
    for profile, words in (([[0.0, 0.02]], "profile"), ([[0.0, 0.02], [0.0, 0.02]], "rise or fall"),
                           ([[0.0, 0.02], [-0.1, 0.0]], "profile radius"), ([[0.0, math.nan], [1, 1]], "profile")):
        with pytest.raises(ValueError, match=words):
            curved_path(CUT, profile)
