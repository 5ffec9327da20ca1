"""The bar while it is cut: shape, modes at the cutting point, supports, and what the operation makes of it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from turnmill_core.machine.conditions import conditions_from_axes, machine_from_tool, nominal_axes
from turnmill_core.operation import Operation, Workpiece
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_structure import Beam, BeamMaterial, Chuck, Structure, Support
from turnmill_core.structure.beam import free_bar, on_chuck, receptances
from turnmill_core.structure.modal import frf, modal_model
from turnmill_core.structure.profile import BarProfile, cylinder, profile_of_heights, stock_profile
from turnmill_core.structure.workpiece import bar_structure, contact_place, in_process_profile, workpiece_at


def stock() -> Operation:
    """The aluminium stock on the chuck with the fitted rotation."""
    return read_operation(shipped_operations()["thesis_table_4_7"])


def at(op: Operation, z: float, x: float | None = None) -> tuple[float, ...]:
    """Axis positions with the tool axis at z [m] and its tip at the radius x [m]."""
    start = nominal_axes(op).position
    return (start[0] if x is None else x, start[1], z, *start[3:])


def test_published_modes_of_the_stock() -> None:
    """Section 4.3.7.2: 313 Hz; 1150 Hz within 1.5 % with the rotational stiffness as printed in the file."""
    op = stock()
    found = workpiece_at(op, op.conditions, machine_from_tool(op, op.conditions))
    assert found.modes[0].frequency == pytest.approx(313, abs=0.5)
    assert found.modes[1].frequency == pytest.approx(1150, rel=0.015)


def test_modes_give_the_receptance_of_the_elements() -> None:
    """At every place and in both planes, one with 11 % damping in the chuck: kept modes against all elements."""
    op = stock()
    beam = op.workpiece.beam
    assert beam is not None
    profile = stock_profile(op.workpiece)
    f = np.linspace(100, 1300, 200)
    for axis, chuck in enumerate((beam.chuck_x, beam.chuck_y)):
        plane = on_chuck(free_bar(profile, beam.material), chuck)
        for place in (0.0, 0.037, 0.1):
            structure = dataclasses.replace(bar_structure(profile, beam, place), frame="tool")
            found = frf(modal_model(Structure(), structure), f)[:, axis, axis]
            expected = receptances(plane, plane.row(place), f)[:, 0, 0]
            assert np.abs(found - expected).max() < 2e-3 * np.abs(expected).max()


def test_one_kept_mode_alone_is_real() -> None:
    """Its velocity term has nothing to cancel with."""
    op = stock()
    beam = op.workpiece.beam
    assert beam is not None
    structure = bar_structure(stock_profile(op.workpiece), dataclasses.replace(beam, modes=1), 0.0)
    assert [m.phase for m in structure.modes] == [0.0, 0.0]
    assert any(m.phase for m in bar_structure(stock_profile(op.workpiece), beam, 0.0).modes)


def test_the_cutting_point_is_stiffer_than_the_tip() -> None:
    op = stock()
    beam = op.workpiece.beam
    assert beam is not None
    profile = stock_profile(op.workpiece)
    static = [sum(m.shape[0] ** 2 / m.stiffness for m in bar_structure(profile, beam, s).modes)
              for s in (0.0, 0.04, 0.08, 0.119)]
    assert static == sorted(static, reverse=True)


def test_material_that_goes_changes_the_modes() -> None:
    """Lighter tip: the frequency rises; the cylinder that is left at the end is the finished bar."""
    op = stock()
    R = machine_from_tool(op, op.conditions)
    start, length = nominal_axes(op).position[2], op.workpiece.length
    along = [workpiece_at(op, op.conditions, R, at(op, start - step, 0.03)).modes[0].frequency
             for step in (0.0, 0.03, 0.06)]
    assert along == sorted(along)
    done = in_process_profile(op.workpiece, length, True, 0.03)
    np.testing.assert_allclose(done.radius, 0.03)
    assert in_process_profile(op.workpiece, 0.05, False, 0.03).mass(2700) < stock_profile(op.workpiece).mass(2700)


@pytest.mark.parametrize("sense", ["up", "down"])
@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_what_lies_behind_the_cut_is_cut(sense: str, speed: float) -> None:
    """Both senses of cut and of rotation: the side that the tool comes from is the cut one."""
    op = stock()
    span = (0.002, 0.01) if sense == "up" else (-0.01, -0.002)
    conditions = dataclasses.replace(op.conditions, cross_feed_span=span, workpiece_speed=speed)
    op = dataclasses.replace(op, conditions=conditions, milling_sense=sense)  # type: ignore[arg-type]
    axes = nominal_axes(op)
    place, from_free_end = contact_place(op, conditions, machine_from_tool(op, conditions), axes.position[2])
    assert from_free_end == (axes.velocity[2] < 0)
    assert place == pytest.approx(0.004 if from_free_end else op.workpiece.length - 0.004)


def test_the_live_path_through_axis_states() -> None:
    op = stock()
    axes = dataclasses.replace(nominal_axes(op), position=at(op, -0.05))  # type: ignore[arg-type]
    cut = conditions_from_axes(op, axes)
    R = machine_from_tool(op, cut)
    found = workpiece_at(op, cut, R, axes.position)
    assert found == workpiece_at(op, cut, R, axes.position)
    assert len(found.modes) == 4
    assert found.modes[0].frequency > workpiece_at(op, cut, R).modes[0].frequency


def test_a_tailstock_holds_the_tip() -> None:
    """Figure 4.11: with the free end held the tip hardly moves, and the bar bends between its ends."""
    op = stock()
    beam = op.workpiece.beam
    assert beam is not None
    held = dataclasses.replace(beam, supports=(Support(0.0, 1e9, 1e3),))
    profile = cylinder(0.4, 0.05)
    tip, middle = (sum(m.shape[0] ** 2 / m.stiffness for m in bar_structure(profile, b, s).modes)
                   for b, s in ((held, 0.0), (held, 0.2)))
    free = sum(m.shape[0] ** 2 / m.stiffness for m in bar_structure(profile, beam, 0.0).modes)
    assert tip < middle < free / 10


def test_profiles() -> None:
    """Volumes: a cone, a step, a cut, a map of radii."""
    shape = ((0.0, 0.02), (-0.06, 0.03), (-0.06, 0.025), (-0.1, 0.025))
    cone = Workpiece("cone", diameter=0.06, length=0.1, profile=shape)
    volume = math.pi * (0.06 * (0.02**2 + 0.02 * 0.03 + 0.03**2) / 3 + 0.04 * 0.025**2)
    assert stock_profile(cone).mass(1.0) == pytest.approx(volume, rel=1e-12)
    bar = cylinder(0.1, 0.06, 0.02)
    assert bar.cut(0.02, 0.05, 0.02).mass(1.0) == pytest.approx(
        math.pi * (0.07 * (9e-4 - 1e-4) + 0.03 * (4e-4 - 1e-4)), rel=1e-12)
    assert bar.cut(0.0, 0.1, 0.05).radius.tolist() == [0.03]
    z, angle = np.linspace(0, 0.1, 41), np.linspace(0, 2 * np.pi, 64, endpoint=False)
    around = np.broadcast_to(0.03 + 0.001 * np.cos(2 * angle), (41, 64))
    assert profile_of_heights(z, around).mass(1.0) == pytest.approx(math.pi * 0.1 * (9e-4 + 0.5e-6), rel=1e-9)


@pytest.mark.parametrize(("edges", "radius", "bore"), [
    ([0.0, 0.1, 0.05], [0.02, 0.02], 0.0), ([0.01, 0.1], [0.02], 0.0), ([0.0, 0.1], [0.02], 0.02),
    ([0.0, np.nan], [0.02], 0.0), ([0.0], [], 0.0), ([0.0, 0.1], [-0.01], 0.0),
])
def test_impossible_profiles_are_refused(edges: list[float], radius: list[float], bore: float) -> None:
    with pytest.raises(ValueError, match=r"expected|finite"):
        BarProfile(np.array(edges), np.array(radius), bore)


@pytest.mark.parametrize(("change", "words"), [
    ({"length": -0.1}, "length"),
    ({"beam": Beam(BeamMaterial(7e10, 2700, 0.33), Chuck(), Chuck(), bore=0.2)}, "bore"),
    ({"beam": Beam(BeamMaterial(7e10, 2700, 0.33), Chuck(), Chuck(), (Support(0.2, 1e7),))}, "support position"),
])
def test_beams_that_do_not_fit_are_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(stock().workpiece, **change)


def test_a_bar_without_any_damping_is_refused() -> None:
    bare = Beam(BeamMaterial(7e10, 2700, 0.33), Chuck(), Chuck())
    with pytest.raises(ValueError, match="loss factor"):
        bar_structure(cylinder(0.3, 0.05), bare, 0.0)
