"""Forces: closed-form averages, known signs, power balance, direct computation, kernel against numpy."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.cutting.cases import AL6061, MM, milling, table_31, table_32, turn_milling
from turnmill_core.cutting.engagement import engagement
from turnmill_core.cutting.forces import Revolution, cutting_velocity, revolution
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import Material, Operation, Tool

SHARP = Material("tangential force only", 1e9, 0.0, 0.0)


def turn(op: Operation, angles: int = 720, elements: int = 80, average: bool = True) -> Revolution:
    return revolution(op, op.conditions, angles, elements, average=average)


def mean_forces(op: Operation, start: float, stop: float) -> np.ndarray:
    """Closed-form average forces of an end mill without helix (Altintas, Manufacturing Automation, Eq. 2.23-2.24)."""
    n, a, c, m = op.tool.teeth, op.conditions.depth, op.feed_per_tooth, op.material

    def bracket(phi: float) -> np.ndarray:
        s2, c2 = math.sin(2 * phi), math.cos(2 * phi)
        return np.array([
            n * a * c / (8 * math.pi) * (m.Ktc * c2 - m.Krc * (2 * phi - s2))
            + n * a / (2 * math.pi) * (-m.Kte * math.sin(phi) + m.Kre * math.cos(phi)),
            n * a * c / (8 * math.pi) * (m.Ktc * (2 * phi - s2) + m.Krc * c2)
            - n * a / (2 * math.pi) * (m.Kte * math.cos(phi) + m.Kre * math.sin(phi)),
            # his z axis points out of the workpiece's bottom: the other sign of F_z
            n * a / (2 * math.pi) * (m.Kac * c * math.cos(phi) - m.Kae * phi)])

    return bracket(stop) - bracket(start)


def test_slot_averages_are_the_textbook_ones() -> None:
    tool = Tool("t", 20 * MM, 4)
    op = milling(tool, AL6061, 2 * MM, 0.1 * MM, (-10 * MM, 10 * MM))
    a, c, n, m = 2 * MM, 0.1 * MM, 4, AL6061
    expected = [-n * a / 4 * m.Krc * c - n * a / math.pi * m.Kre, n * a / 4 * m.Ktc * c + n * a / math.pi * m.Kte,
                -n * a / math.pi * m.Kac * c - n * a / 2 * m.Kae]
    assert turn(op).force_tool.mean(axis=0) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("span_mm", [(2, 10), (-10, -2), (-5, 5), (-10, 10)])
@pytest.mark.parametrize("helix_deg", [0.0, 30.0])
def test_averages_do_not_depend_on_helix(span_mm: tuple[float, float], helix_deg: float) -> None:
    cutting_only = dataclasses.replace(AL6061, Kte=0.0, Kre=0.0, Kae=0.0)
    op = milling(Tool("t", 20 * MM, 3, math.radians(helix_deg)), cutting_only, 4 * MM, 0.1 * MM,
                 (span_mm[0] * MM, span_mm[1] * MM))
    expected = mean_forces(op, math.acos(span_mm[1] / 10), math.acos(span_mm[0] / 10))
    assert turn(op).force_tool.mean(axis=0) == pytest.approx(expected, rel=1e-4)


def test_edge_forces_grow_with_the_length_of_the_helix() -> None:
    edge_only = Material("edge", 1.0, 0.0, 0.0, 20e3, 25e3, 8e3)
    straight, helical = (
        turn(milling(Tool("t", 20 * MM, 3, beta), edge_only, 4 * MM, 0.1 * MM, (2 * MM, 10 * MM)))
        for beta in (0.0, math.radians(30)))
    ratio = helical.force_tool.mean(axis=0) / straight.force_tool.mean(axis=0)
    assert ratio == pytest.approx(np.full(3, 1 / math.cos(math.radians(30))), rel=1e-4)


@pytest.mark.parametrize(("span_mm", "signs"), [((9, 10), (-1, 1)), ((-10, -9), (1, 1))])
def test_known_signs_of_the_tangential_force(span_mm: tuple[float, float], signs: tuple[int, int]) -> None:
    """The chip resists the edge. Up-milling: the edge moves with the feed at the wall on +y, so the
    tool is pushed back (F_x < 0) and, leaving along -y, pulled into the wall (F_y > 0). Down-milling:
    the edge moves against the feed at the wall on -y, so the tool is pulled forward (F_x > 0) and
    pushed off the wall (F_y > 0)."""
    op = milling(Tool("t", 20 * MM, 2), SHARP, 2 * MM, 0.1 * MM, (span_mm[0] * MM, span_mm[1] * MM))
    force = turn(op).force_tool
    cutting = np.abs(force).max(axis=1) > 0
    assert cutting.any()
    assert np.all(np.sign(force[cutting][:, :2]) == signs)


def test_radial_force_pushes_the_tool_away_from_the_material() -> None:
    radial = Material("radial", 1.0, 1e9, 0.0)
    for span, sign in (((9, 10), -1), ((-10, -9), 1)):
        op = milling(Tool("t", 20 * MM, 2), radial, 2 * MM, 0.1 * MM, (span[0] * MM, span[1] * MM))
        force = turn(op).force_tool.mean(axis=0)
        assert np.sign(force[1]) == sign
        assert force[0] < 0


@pytest.mark.parametrize(("sense", "speed"), [("up", 2), ("up", -2), ("down", 2), ("down", -2)])
def test_signs_in_the_machine_frame(sense: str, speed: float) -> None:
    """Up-milling resists the workpiece's rotation: the bar's surface drags the tool along +y_M for a
    positive speed; in down-milling the tool pulls the bar on, so the force is against it."""
    tool = Tool("t", 16 * MM, 2, flute_length=30 * MM)
    op = turn_milling(tool, AL6061, 105 * MM, 1 * MM, 2 * MM, 500, speed, sense)
    found = turn(op)
    force = found.force_tool.mean(axis=0) @ machine_from_tool(op, op.conditions).T
    assert np.sign(force[1]) == np.sign(speed) * (1 if sense == "up" else -1)
    assert force[0] < 0  # axial force: the tool is pulled into the bar, whose axis lies towards -x_M
    assert np.sign(found.workpiece_torque.mean()) == (1 if sense == "up" else -1)


@pytest.mark.parametrize("op", [table_31(), table_32(), table_31(0, runout=(10e-6, -15e-6)), turn_milling(
    Tool("t", 20 * MM, 4, math.radians(30), 40 * MM), AL6061, 60 * MM, 3 * MM, 15 * MM, 3000, -10, "down")])
def test_power_of_the_drives_is_the_power_of_cutting(op: Operation) -> None:
    """Spindles and feed drive together supply force times velocity of the edge in the material, element by element."""
    c, tool = op.conditions, op.tool
    count, elements = 720, 60
    found = revolution(op, c, count, elements, engine="plain", average=True)
    z = (np.arange(elements) + 0.5) * c.depth / elements
    arcs = engagement(op, c, z)
    sense = 1 if sum(c.cross_feed_span) > 0 else -1
    drives = (c.tool_speed * found.tool_torque.mean() + abs(c.workpiece_speed) * found.workpiece_torque.mean()
              - sense * c.feed_speed * found.force_tool.mean(axis=0)[1])
    dz = c.depth / elements
    runout = np.asarray(tool.runout or (0,) * tool.teeth)
    power = 0.0
    for j in range(tool.teeth):
        for arc in range(2):
            # the arc in fine steps; every tooth passes it once a revolution
            fraction = (np.arange(400) + 0.5) / 400
            phi = arcs.start[:, arc, None] + (arcs.exit - arcs.start)[:, arc, None] * fraction
            weight = (arcs.exit - arcs.start)[:, arc, None] / 400 / (2 * math.pi)
            fx = abs(c.workpiece_speed) * (c.effective_radius + z)[:, None]
            fy = sense * c.feed_speed
            h = np.min([(fx * np.sin(phi) + fy * np.cos(phi)) * k * 2 * math.pi / tool.teeth / c.tool_speed
                        + runout[j] - runout[(j + k) % tool.teeth] for k in range(1, tool.teeth + 1)], axis=0)
            m, on = op.material, h > 0
            ds = dz / math.cos(tool.helix_angle)
            ft, fr, fa = (on * (k * h * dz + e * ds) for k, e in
                          ((m.Ktc, m.Kte), (m.Krc, m.Kre), (m.Kac, m.Kae)))
            s, co, r = np.sin(phi), np.cos(phi), tool.radius + runout[j]
            force = np.stack([-fr * s - ft * co, -fr * co + ft * s, -fa])
            velocity = np.stack([r * c.tool_speed * co + fx, -r * c.tool_speed * s + fy,
                                 -abs(c.workpiece_speed) * r * s])
            power -= float((force * velocity * weight).sum())
    assert drives == pytest.approx(power, rel=2e-3)


def test_torque_power_is_the_tangential_force_along_the_edge_path_in_milling() -> None:
    """Tool power plus feed power equals force times the cutting velocity of Eq. 3.54."""
    op = milling(Tool("t", 20 * MM, 1), AL6061, 2 * MM, 0.1 * MM, (2 * MM, 10 * MM))
    found = turn(op, 3600, 4)
    velocity = cutting_velocity(op, op.conditions, found.angle, np.zeros(1))[:, 0]
    cutting = -(found.force_tool[:, :2] * velocity).sum(axis=1).mean()
    feed_power = -op.conditions.feed_speed * found.force_tool.mean(axis=0)[0]
    drives = op.conditions.tool_speed * found.tool_torque.mean() + feed_power
    assert drives == pytest.approx(cutting, rel=1e-3)


def test_workpiece_at_rest_is_ordinary_milling_along_the_bar() -> None:
    """No workpiece rotation: the tool mills a flat along the bar; direct sum over its chord, height by height."""
    tool = Tool("t", 20 * MM, 4, math.radians(30), 40 * MM)
    op = turn_milling(tool, AL6061, 60 * MM, 1 * MM, 4 * MM, 3000, 10)
    c = dataclasses.replace(op.conditions, workpiece_speed=0.0, feed_speed=0.02, cross_feed_span=(-10 * MM, 10 * MM))
    found = revolution(op, c, 360, 50)
    per_tooth, dz = 0.02 / (4 * 50), 1 * MM / 50
    force = np.zeros((360, 3))
    for i, spindle in enumerate(np.arange(360) * 2 * math.pi / 360):
        for tooth in range(4):
            for z in (np.arange(50) + 0.5) * dz:
                half = math.sqrt(30**2 - (29 + z * 1e3) ** 2) * MM
                # finer than one step: the mean over the cell, as the model takes it
                for phi in spindle + tooth * math.pi / 2 - z * math.tan(math.radians(30)) / 0.01 + np.linspace(
                        -0.4, 0.4, 5) * 2 * math.pi / 360:
                    # feed along +y: the chip is f cos(phi), inside the bar |x| < half
                    if math.cos(phi) > 0 and abs(10 * MM * math.sin(phi)) < half:
                        h = per_tooth * math.cos(phi)
                        ds = dz / math.cos(math.radians(30))
                        ft, fr, fa = (k * h * dz + e * ds for k, e in ((930e6, 21e3), (290e6, 25e3), (242e6, 8e3)))
                        force[i] += np.array([-fr * math.sin(phi) - ft * math.cos(phi),
                                              -fr * math.cos(phi) + ft * math.sin(phi), -fa]) / 5
    assert found.force_tool.mean(axis=0) == pytest.approx(force.mean(axis=0), abs=0.005 * np.abs(force).max())
    assert np.abs(found.force_tool - force).max() < 0.02 * np.abs(force).max()
    assert found.workpiece_torque.mean() != 0  # it holds the bar


def test_large_bar_is_flat_milling() -> None:
    """A bar of growing diameter at equal surface speed: block milling with the same feed per tooth."""
    tool = Tool("t", 20 * MM, 4, math.radians(30), 40 * MM)
    flat = turn(milling(tool, AL6061, 2 * MM, 0.1 * MM, (5 * MM, 10 * MM)))
    difference = []
    for radius in (1.0, 10.0, 100.0):
        rpm = 0.1 * MM * 4 * 3000 / (2 * math.pi * radius)
        op = turn_milling(tool, AL6061, 2 * radius, 2 * MM, 5 * MM, 3000, rpm)
        difference.append(np.abs(turn(op).force_tool - flat.force_tool).max() / np.abs(flat.force_tool).max())
    assert difference[2] < 2e-3
    assert difference[0] > 5 * difference[1] > 20 * difference[2]


CASES = [
    table_31(), table_31(0), table_32(), table_31(runout=(10e-6, -15e-6)),
    table_31(pitch_angles=(3.0, 2 * math.pi - 3)),
    milling(Tool("t", 20 * MM, 4, math.radians(45), runout=(0, 1e-5, -2e-5, 5e-6)), AL6061, 25 * MM, 0.1 * MM,
            (-10 * MM, 10 * MM)),
    milling(Tool("t", 20 * MM, 1, math.radians(-30)), AL6061, 25 * MM, 0.1 * MM, (-10 * MM, -2 * MM)),
    turn_milling(Tool("t", 20 * MM, 3, math.radians(30)), AL6061, 100 * MM, 0.5 * MM, 19 * MM, 3000, -5, "down"),
]


@pytest.mark.parametrize("chip", ["static", "exact"])
@pytest.mark.parametrize("op", CASES)
def test_kernel_and_numpy_give_the_same(op: Operation, chip: str) -> None:
    for angles in (4, 7, 90):
        for average in (False, True):
            fast, plain = (revolution(op, op.conditions, angles, 23, chip, engine, average)  # type: ignore[arg-type]
                           for engine in ("fast", "plain"))
            scale = np.abs(plain.force_tool).max()
            # a point on the very end of an arc counts half, to round-off over the width of a point (1e-6 rad)
            assert fast.force_tool == pytest.approx(plain.force_tool, abs=1e-8 * scale + 1e-12)
            assert fast.tool_torque == pytest.approx(plain.tool_torque, abs=1e-9 * scale + 1e-13)
            assert fast.workpiece_torque == pytest.approx(plain.workpiece_torque, abs=1e-9 * scale + 1e-13)
            assert fast.chip_thickness_max == pytest.approx(plain.chip_thickness_max, rel=1e-10)


def test_mean_force_converges_with_second_order() -> None:
    op = table_31()
    reference = revolution(op, op.conditions, 5760, 1600, average=True).force_tool.mean(axis=0)
    steps = [(90, 25), (180, 50), (360, 100), (720, 200)]
    means = [revolution(op, op.conditions, *s, average=True).force_tool.mean(axis=0) for s in steps]
    errors = [np.abs(mean - reference).max() for mean in means]
    order = -np.polyfit(np.log(range(1, 5)), np.log(errors), 1)[0]
    assert errors[2] < 1e-3 * np.abs(reference).max()
    assert order > 1


def test_forces_at_an_instant_against_a_fine_sum_along_the_edges() -> None:
    op = table_31()
    found = revolution(op, op.conditions, 360, 64)
    z = (np.arange(20000) + 0.5) / 20000 * op.conditions.depth
    arcs = engagement(op, op.conditions, z)
    feed = op.conditions.workpiece_speed * (op.conditions.effective_radius + z)
    for i in (10, 30, 40, 41, 42, 43):
        phi = math.radians(i) - z * math.tan(op.tool.helix_angle) / op.tool.radius
        on = (phi > arcs.start[:, 0]) & (phi < arcs.exit[:, 0])
        h = (feed * np.sin(phi) + op.conditions.feed_speed * np.cos(phi)) / (2 * 500 / 60)
        ft, fr = ((k * h + e / math.cos(op.tool.helix_angle)) * on * (z[1] - z[0])
                  for k, e in ((930e6, 21e3), (290e6, 25e3)))
        expected = [np.sum(-fr * np.sin(phi) - ft * np.cos(phi)), np.sum(-fr * np.cos(phi) + ft * np.sin(phi))]
        assert found.force_tool[i, :2] == pytest.approx(expected, abs=1.0)


def test_runout_leaves_a_once_per_revolution_force() -> None:
    even, odd = (turn(table_31(runout=r), average=False).force_tool for r in ((), (20e-6, -20e-6)))
    half = len(even) // 2
    assert even[:half] == pytest.approx(even[half:], abs=1e-9)
    assert np.abs(odd[:half] - odd[half:]).max() > 5


def test_bad_counts() -> None:
    op = table_31()
    with pytest.raises(ValueError, match="angles is 3"):
        revolution(op, op.conditions, 3)
    deep = milling(Tool("t", 10 * MM, 2, math.radians(45)), AL6061, 20 * MM, 0.1 * MM, (0, 5 * MM))
    with pytest.raises(ValueError, match=r"elements is 2.*lag"):
        revolution(deep, deep.conditions, 90, 2)
    with pytest.raises(ValueError, match="elements is 0"):
        revolution(op, op.conditions, 10, 0)
