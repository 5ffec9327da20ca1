"""Loads with an engagement map: the closed form's cylinder, three-axis milling, power, signs, side and bottom."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from turnmill_core.cutting.chip import ChipModel
from turnmill_core.cutting.cutter import cutter_elements
from turnmill_core.cutting.engagement_map import EngagementMap, engagement_along, engagement_map
from turnmill_core.cutting.feed import feed_at
from turnmill_core.cutting.forces import revolve
from turnmill_core.cutting.loads import cutting_loads, part_of, path_loads
from turnmill_core.cutting.steady import steady_map
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Operation, Shape, Tool

from .cases import AL6061, MM, milling, table_31, table_32, turn_milling
from .sweeping import BAR, DEPTH, SHAPES, R, endless, operation, state, steady

NUMBERS = ("force_tool_mean", "force_tool_peak", "force_machine_mean", "tool_torque_mean", "tool_torque_peak",
           "workpiece_torque_mean", "workpiece_torque_peak", "material_removal_rate", "chip_thickness_max")


@pytest.mark.parametrize("op", [
    table_31(), table_32(), table_31(runout=(10e-6, 0.0), pitch_angles=(3.0, 2 * math.pi - 3.0)),
    turn_milling(table_31().tool, AL6061, 105 * MM, 1 * MM, 2 * MM, 500, -2, "down")])
def test_a_cylinder_has_the_loads_of_the_closed_form(op: Operation) -> None:
    closed = cutting_loads(op, op.conditions)
    general = path_loads(op, steady_map(op, op.conditions, 64))
    for name in NUMBERS:
        size = np.abs(getattr(closed, name)).max()
        assert getattr(general, name) == pytest.approx(getattr(closed, name), rel=0.01, abs=0.01 * size), name
    assert general.in_cut


def test_forces_of_the_same_arcs_are_the_same_to_round_off() -> None:
    """With the closed form's arcs the general force model is the closed form's."""
    from turnmill_core.cutting.chip import prepare_cut

    for op in (table_31(), table_32()):
        closed = prepare_cut(op, op.conditions, 64)
        general = steady_map(op, op.conditions, 64, bottom=0)
        edges = cutter_elements(op.tool, op.conditions.depth, 64, 0)
        same = replace(general, elements=edges, arcs=closed.engagement, feed=closed.feed)
        cut = part_of(op, same, ~edges.bottom)
        assert cut.delay == pytest.approx(closed.delay, rel=1e-14)
        for average in (False, True):
            a, b = revolve(op, closed, 180, average=average), revolve(op, cut, 180, average=average)
            for name in ("force_tool", "tool_torque", "workpiece_torque"):
                truth = getattr(a, name)
                assert getattr(b, name) == pytest.approx(truth, rel=1e-11, abs=1e-11 * np.abs(truth).max())


def test_milling_needs_no_closed_form() -> None:
    op = milling(Tool("t", 20 * MM, 4, math.radians(30)), AL6061, 5 * MM, 0.1 * MM, (-10 * MM, 10 * MM))
    closed, general = cutting_loads(op, op.conditions), path_loads(op, steady_map(op, op.conditions, 64))
    assert general.force_tool == pytest.approx(closed.force_tool, rel=1e-6)
    assert general.workpiece_torque_mean == 0


@pytest.mark.parametrize("kind", ["ball", "bull nose"])
def test_a_standing_workpiece_is_three_axis_milling(kind: str) -> None:
    """Workpiece speed zero, feed along the bar: a direct sum over teeth, angles and the profile (Eq. 3.49)."""
    op = operation(SHAPES[kind])
    feed, tool_speed, z = 20e-3, 300.0, -60 * MM
    x = BAR - DEPTH

    def at(place: float) -> AxisState:
        return AxisState(0, (x, 0.0, place, math.pi / 2, 0.0, 0.0), (0.0, 0.0, -feed, 0.0, 0.0, tool_speed))

    cut = list(engagement_along(op, [at(z + 30 * MM), at(z)], endless(op), elements=60))[-1]
    loads = path_loads(op, cut, 90)
    edges = cut.elements.chosen(~cut.elements.bottom)
    delay = math.pi / tool_speed
    m = AL6061
    force = np.zeros((90, 3))
    for i in range(90):
        for tooth in range(2):
            phi = i * 2 * math.pi / 90 + tooth * math.pi - edges.lag[0]
            s, c, sk, ck = np.sin(phi), np.cos(phi), edges.sin_kappa, edges.cos_kappa
            on_tool = np.stack([edges.radius * s, edges.radius * c, edges.height], axis=1)
            place = cut.motion.tip + on_tool @ cut.motion.rotation.T
            h = feed * delay * (sk * c)  # y_T is the direction of the feed here
            in_bar = np.hypot(place[:, 0], place[:, 1]) <= BAR
            cuts = (c > 0) & in_bar
            area = np.where(cuts, h * edges.width, 0.0)
            length = np.where(cuts, edges.length[tooth], 0.0)
            fr, ft, fa = (k * area + e * length for k, e in ((m.Krc, m.Kre), (m.Ktc, m.Kte), (m.Kac, m.Kae)))
            force[i] += [np.sum(-(fr * sk + fa * ck) * s - ft * c), np.sum(-(fr * sk + fa * ck) * c + ft * s),
                         np.sum(fr * ck - fa * sk)]
    assert cut.motion.velocity == pytest.approx([0.0, feed, 0.0], abs=1e-15)
    assert loads.force_tool_mean == pytest.approx(force.mean(axis=0), rel=5e-3, abs=5e-3 * np.abs(force).max())
    # at an angle the sum has an element in or out, the loads have it come in gradually
    assert np.abs(loads.force_tool - force).mean() < 0.01 * np.abs(force).max()


def power_of_forces(op: Operation, cut: EngagementMap, angles: int) -> float:
    """Mean of force times velocity of the edge in the material, element by element, independent of torques."""
    motion, m = cut.motion, op.material
    edges, arcs = cut.elements, cut.arcs
    phi = (np.arange(angles) + 0.5) * 2 * math.pi / angles
    total = 0.0
    for k in range(len(edges.height)):
        inside = np.zeros(angles, dtype=bool)
        for start, stop in zip(arcs.start[k], arcs.exit[k], strict=True):
            inside |= (phi - start) % (2 * math.pi) < stop - start
        p = phi[inside]
        s, c, sk, ck = np.sin(p), np.cos(p), edges.sin_kappa[k], edges.cos_kappa[k]
        place = np.stack([edges.radius[k] * s, edges.radius[k] * c, np.full_like(p, edges.height[k])], axis=1)
        normal = np.stack([sk * s, sk * c, np.full_like(p, -ck)], axis=1)
        feed = feed_at(motion, place)
        turning = motion.tool_speed * np.stack([place[:, 1], -place[:, 0], np.zeros_like(p)], axis=1)
        h = (feed * normal).sum(axis=1) * 2 * math.pi / (op.tool.teeth * motion.tool_speed)
        kac, kae = (0.0, 0.0) if edges.bottom[k] else (m.Kac, m.Kae)
        width, length = edges.width[k], edges.length[0, k]
        fr, ft, fa = (a * h * width + e * length for a, e in ((m.Krc, m.Kre), (m.Ktc, m.Kte), (kac, kae)))
        tangent, along = np.stack([c, -s, 0 * c], axis=1), np.stack([ck * s, ck * c, np.full_like(p, sk)], axis=1)
        force = -fr[:, None] * normal - ft[:, None] * tangent - fa[:, None] * along
        total += -(force * (feed + turning)).sum() / angles * op.tool.teeth
    return float(total)


@pytest.mark.parametrize(("kind", "y", "b"), [
    ("cylinder", 0.0, 90.0), ("cylinder", 3.0, 80.0), ("ball", 3.0, 90.0), ("ball", 0.0, 75.0),
    ("bull nose", 2.0, 84.0)])
def test_power_of_torques_and_feeds_is_that_of_forces_and_velocities(kind: str, y: float, b: float) -> None:
    op = operation(SHAPES[kind])
    workpiece, end = steady(op, BAR - DEPTH, y * MM, math.radians(b))
    cut = engagement_map(op, workpiece, end, 60, 30)
    loads = path_loads(op, cut, bottom=True)
    axes = np.asarray(end.velocity[:3])
    power = loads.tool_power_mean + loads.workpiece_power_mean - float(loads.force_machine_mean @ axes)
    assert power == pytest.approx(power_of_forces(op, cut, 1440), rel=5e-3)
    assert loads.tool_power_mean > 0.8 * power


def test_signs_of_a_known_cut() -> None:
    """Up-milling ball: pushed back against its feed and lifted, in the machine frame the way the workpiece turns; a
    plunging ball is pushed back along its axis.
    """
    op = operation(SHAPES["ball"])
    loads = cutting_loads(op, op.conditions)
    assert loads.force_tool_mean[0] < 0
    assert loads.force_tool_mean[2] > 0
    assert loads.force_machine_mean[0] == pytest.approx(loads.force_tool_mean[2])  # z_T = x_M
    assert loads.force_machine_mean[1] == pytest.approx(-loads.force_tool_mean[0])  # x_T = -y_M
    assert loads.workpiece_torque_mean > 0
    down = operation(SHAPES["ball"], -10.0)
    mirrored = cutting_loads(down, down.conditions)
    assert mirrored.force_tool_mean == pytest.approx(loads.force_tool_mean, rel=1e-3)
    plunge = [AxisState(t, (x * MM, 0.0, 0.0, math.pi / 2, 0.0, 0.0), (-1e-3, 0, 0, 0, 0, 300.0))
              for t, x in enumerate((33.0, 28.0))]
    cut = list(engagement_along(op, plunge, endless(op)))[-1]
    pushed = path_loads(op, cut)
    assert pushed.force_machine_mean[0] > 0
    assert abs(pushed.force_tool_mean[1]) < 0.1 * pushed.force_tool_mean[2]
    along, across = math.sqrt(2 * R * 2 * MM - (2 * MM) ** 2), math.sqrt(2 * 2 * MM / (1 / R + 1 / BAR))
    assert cut.removal.total == pytest.approx(1e-3 * math.pi * along * across, rel=0.05)  # nearly an ellipse


def test_bottom_edges_lift_the_tool_and_carry_their_share() -> None:
    op = operation(Shape())
    cut = steady_map(op, op.conditions)
    without, with_bottom = path_loads(op, cut), path_loads(op, cut, bottom=True)
    assert with_bottom.force_tool_mean[2] > without.force_tool_mean[2]
    assert with_bottom.tool_torque_mean > without.tool_torque_mean
    assert without.bottom_share == with_bottom.bottom_share == pytest.approx(0.24, abs=0.02)
    closed = cutting_loads(op, op.conditions, bottom=True)
    assert with_bottom.force_tool_mean == pytest.approx(closed.force_tool_mean, rel=0.05, abs=2.0)


def test_clearance_leaves_the_bottom_to_the_wiper() -> None:
    """The volume stays; a wiper as long as the feed cuts all of it that a flat bottom does, and the hollow nothing."""
    flat = operation(Shape())
    base = steady_map(flat, flat.conditions, 64, 120).removal
    for clearance, wiper in ((0.2, 2.0), (6.0, 2.0), (0.2, 0.5), (6.0, 0.5)):
        op = operation(Shape(bottom_clearance=math.radians(clearance), wiper_length=wiper * MM))
        cut = steady_map(op, op.conditions, 64, 120)
        assert cut.removal.total == pytest.approx(base.total, rel=1e-3 if wiper == 2.0 else 0.03)
        if wiper == 2.0:
            assert cut.removal.bottom == pytest.approx(base.bottom, rel=1e-3)
            assert not cut.arcs.angle[cut.elements.bottom & (cut.elements.radius < 5.9 * MM)].any()


def test_a_wiper_as_long_as_the_feed_has_the_bottom_forces_of_a_flat_tool() -> None:
    """With either chip; the rest of the dished bottom is out of the cut, and so are its edge forces."""
    flat, dished = operation(Shape()), operation(Shape(bottom_clearance=0.1, wiper_length=2 * MM))
    chips: tuple[ChipModel, ...] = ("static", "exact")
    for chip in chips:
        a, b = (cutting_loads(op, op.conditions, chip=chip, bottom=True) for op in (flat, dished))
        assert b.force_tool_mean == pytest.approx(a.force_tool_mean, rel=0.03, abs=1.5)
        side = cutting_loads(dished, dished.conditions, chip=chip)
        assert side.force_tool_mean == pytest.approx(cutting_loads(flat, flat.conditions, chip=chip).force_tool_mean)
        assert b.force_tool_mean[2] > side.force_tool_mean[2]


def test_axial_runout_is_felt_at_the_bottom_of_a_ball() -> None:
    even = operation(SHAPES["ball"])
    uneven = operation(Shape(corner_radius=R, axial_runout=(30e-6, 0.0)))
    a, b = (cutting_loads(op, op.conditions) for op in (even, uneven))
    period = len(a.angle) // 2
    assert a.force_tool[:period] == pytest.approx(a.force_tool[period:], rel=1e-6, abs=1e-6)
    first, second = b.force_tool[:period, 2], b.force_tool[period:, 2]
    assert np.ptp(first) != pytest.approx(np.ptp(second), rel=0.02)


def test_variable_helix_and_pitch_have_forces_without_a_tooth_period() -> None:
    op = operation(Shape(corner_radius=2 * MM, helix_angles=(0.4, 0.6)), pitch_angles=(3.0, 2 * math.pi - 3.0))
    loads = cutting_loads(op, op.conditions)
    assert loads.in_cut
    assert loads.material_removal_rate == pytest.approx(
        cutting_loads(operation(Shape(corner_radius=2 * MM)), op.conditions).material_removal_rate, rel=1e-6)


def test_eccentricity_and_tilt_of_an_operation_go_through_the_numeric_way() -> None:
    op = replace(operation(Shape()), eccentricity=3 * MM, tilt=math.radians(-4))
    loads = cutting_loads(op, op.conditions)
    assert loads.in_cut
    with pytest.raises(ValueError, match="chip model is 'exact', expected 'static'"):
        cutting_loads(op, op.conditions, chip="exact")


def test_no_contact_or_a_tool_at_rest_is_no_load_and_no_error() -> None:
    op = operation(SHAPES["ball"])
    for conditions in (replace(op.conditions, depth=-1 * MM), replace(op.conditions, tool_speed=0.0),
                       replace(op.conditions, workpiece_speed=0.0, feed_speed=0.0)):
        loads = cutting_loads(op, conditions)
        assert not loads.in_cut
        assert not loads.force_tool.any()
        assert loads.material_removal_rate == 0
    workpiece, end = steady(op, BAR + 1 * MM)
    assert not path_loads(op, engagement_map(op, workpiece, end)).in_cut
    still = replace(state(op, BAR - DEPTH), velocity=(0.0,) * 6)
    assert not path_loads(op, engagement_map(op, endless(op), still)).in_cut


def test_a_depth_beyond_the_flutes_is_refused() -> None:
    short = Tool("t", 16 * MM, 2, flute_length=9 * MM, shape=SHAPES["ball"])
    op = turn_milling(short, AL6061, 60 * MM, 8.9 * MM, 2 * MM, 3000, 10)
    with pytest.raises(ValueError, match=r"depth is 0\.01 m, expected in .* the flute length"):
        cutting_loads(op, replace(op.conditions, depth=10 * MM, effective_radius=20 * MM))


def test_maps_are_made_at_every_state_of_a_path() -> None:
    op = operation(SHAPES["bull nose"])
    states = [state(op, BAR - DEPTH, time=t, z=12 * MM) for t in np.linspace(0.0, 12.0, 25)]
    cuts = list(engagement_along(op, states))
    assert len(cuts) == 25
    rates = np.array([c.removal.total for c in cuts])
    assert rates[0] == 0
    assert np.all(np.diff(rates[rates > 0][:5]) > 0)  # it comes into the bar from its end
    assert [c.motion.stamp_ns for c in cuts] == [s.stamp_ns for s in states]
