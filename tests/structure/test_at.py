"""From an operation to the structure that stability solves."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from turnmill_core.machine.conditions import machine_from_tool, with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation, read_operation, shipped_operations
from turnmill_core.operation_structure import RIGID, CrossMode, Mode, ModeTable, Structure
from turnmill_core.stability.margin import stability_point
from turnmill_core.structure.at import ContactStructure, Position, structure_at, with_cross_reading

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
PAIR = (Mode(922.0, 0.03, 0.04, X), Mode(922.0, 0.03, 0.04, Y))
F = np.array([300.0, 680.0, 1150.0])


def load(name: str) -> Operation:
    """A shipped operation."""
    return read_operation(shipped_operations()[name])


def at(op: Operation, position: Position | None = None) -> ContactStructure:
    """Its structure at the nominal cut."""
    return structure_at(op, machine_from_tool(op, op.conditions), op.conditions, position)


def with_tool(op: Operation, structure: Structure) -> Operation:
    """The same operation, another tool structure."""
    return dataclasses.replace(op, tool=dataclasses.replace(op.tool, structure=structure))


def with_bar(op: Operation, structure: Structure) -> Operation:
    """The same operation, another workpiece structure."""
    return dataclasses.replace(op, workpiece=dataclasses.replace(op.workpiece, structure=structure))


@pytest.mark.parametrize(("speed", "depth"), [(6000, 0.3), (9000, 0.8), (12500, 0.5)])
def test_symmetric_tool_seen_from_both_frames(speed: float, depth: float) -> None:
    """Damping fixed in the machine: one cut, one spectral radius, whichever frame its file names (erratum D7)."""
    op = load("milling_benchmark_2dof")
    cut = with_cut(op, tool_speed=speed * np.pi / 30, depth=depth * 1e-3)

    def radius(structure: Structure) -> float:
        """Spectral radius over a tooth period (in the turning frame the period is the spindle's)."""
        point = stability_point(with_tool(op, structure), cut)
        teeth = point.principal_period * cut.tool_speed * op.tool.teeth / (2 * np.pi)
        return float(point.spectral_radius ** (1 / teeth))

    fixed = radius(Structure(PAIR))
    assert radius(Structure(PAIR, "rotating", turning_damping="machine")) == pytest.approx(fixed, abs=1e-6)
    assert abs(radius(Structure(PAIR, "rotating", turning_damping="tool")) - fixed) > 1e-5


def test_spindle_speed_dependent_modes() -> None:
    """The spindle's mode falls with the speed (Figure 4.2); standing still and beyond the table the ends hold."""
    table = ModeTable(("tool_speed",), ((0.0,), (2000.0,)), ((Mode(900, 0.03, 1, X),), (Mode(800, 0.04, 1, X),)))
    op = with_tool(load("milling_benchmark_2dof"), Structure(table.modes[0], table=table))
    R = machine_from_tool(op, op.conditions)
    for speed, frequency in ((500.0, 875.0), (1000.0, 850.0), (9000.0, 800.0)):
        found = structure_at(op, R, dataclasses.replace(op.conditions, tool_speed=speed))
        assert found.modes is not None
        assert found.modes.modes.frequency[0] == pytest.approx(frequency, rel=1e-12)


def test_position_dependent_modes_of_the_ram() -> None:
    """Section 4.3.7.1: 705 to 780 Hz over the stroke; without a position the first entry holds."""
    op = load("thesis_table_4_5")
    frequencies = []
    for y in (-0.125, 0.0, 0.125):
        found = at(op, (0.0, y, 0.0, 0.0, 0.0, 0.0))
        assert found.modes is not None
        frequencies.append(float(found.modes.modes.frequency[1]))
    assert frequencies == pytest.approx([705, 742.5, 780])
    assert at(op).modes.modes.frequency[1] == 705  # type: ignore[union-attr]


def test_the_same_structure_is_the_same_object() -> None:
    """Solvers keep what they have computed for a structure."""
    op = load("thesis_table_4_9")
    assert at(op).linear is at(op).linear


def test_an_asymmetric_workpiece_turns_with_the_c_axis() -> None:
    """A quarter turn exchanges its directions; half a turn changes nothing."""
    op = load("thesis_table_4_9")
    own = (Mode(400.0, 0.02, 3.0, X), Mode(600.0, 0.02, 2.0, Y))
    op = with_bar(with_tool(op, RIGID), Structure(own, "rotating"))
    still = dataclasses.replace(op, conditions=dataclasses.replace(op.conditions, workpiece_speed=1e-9))

    def seen(angle: float, one: Operation = still) -> np.ndarray:
        return at(one, (0.02, 0.0, 0.0, np.pi / 2, angle, 0.0)).linear.frf(F)

    fixed = with_bar(still, Structure(own, "machine"))
    swapped = with_bar(still, Structure((dataclasses.replace(own[0], shape=Y), dataclasses.replace(own[1], shape=X)),
                                        "machine"))
    np.testing.assert_allclose(seen(0.0), at(fixed).linear.frf(F), rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(seen(np.pi / 2), at(swapped).linear.frf(F), rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(seen(np.pi), seen(0.0), rtol=1e-6, atol=1e-15)
    assert np.abs(seen(np.pi / 4) - seen(0.0)).max() > 1e-9
    assert np.abs(seen(0.0, op) - seen(0.0)).max() < 1e-3 * np.abs(seen(0.0)).max()


def test_a_tool_that_turns_beside_a_flexible_workpiece_is_refused() -> None:
    op = with_tool(load("thesis_table_4_9"), Structure(PAIR, "rotating"))
    with pytest.raises(ValueError, match="rigid workpiece"):
        at(op)


def test_a_rigid_structure_is_refused() -> None:
    op = with_bar(with_tool(load("thesis_table_4_9"), RIGID), RIGID)
    with pytest.raises(ValueError, match="cannot chatter"):
        at(op)


def test_above_a_critical_speed_a_tool_damped_in_itself_is_refused() -> None:
    op = with_tool(load("milling_benchmark_2dof"), Structure(PAIR, "rotating"))
    fast = dataclasses.replace(op.conditions, tool_speed=2 * np.pi * 1000)
    with pytest.raises(ValueError, match="decays"):
        structure_at(op, machine_from_tool(op, fast), fast)


def test_readings_of_cross_modes_change_the_structure() -> None:
    op = load("thesis_table_4_9")
    bar = dataclasses.replace(op.workpiece.structure, cross_modes=(CrossMode(774, 0.002, 40.7, "xy"),))
    phi = [at(with_bar(op, with_cross_reading(bar, r))).linear.frf([774.0])[0]
           for r in ("none", "symmetric", "rank-one")]
    assert phi[0][0, 1] == 0
    assert phi[1][0, 1] == pytest.approx(phi[2][0, 1], rel=1e-9)
    assert phi[1][0, 0] == pytest.approx(phi[0][0, 0], rel=1e-9)
    assert phi[2][0, 0] == pytest.approx(phi[0][0, 0] + phi[2][0, 1], rel=1e-9)


FILE = """
    frame: tool
    modes:
      - {direction: x, frequency: 922 Hz, damping: 1.1 %, mass: 0.03993 kg}
      - {direction: y, frequency: 922 Hz, damping: 1.1 %, mass: 0.03993 kg}
"""


def parsed(structure: str) -> Operation:
    """The milling benchmark with another structure section."""
    text = shipped_operations()["milling_benchmark_2dof"].read_text(encoding="utf-8")
    assert FILE in text
    return parse_operation(text.replace(FILE, "\n" + structure), "cut.yaml")


def test_everything_from_a_file() -> None:
    op = parsed("""    frame: tool
    heights: [0 mm, 10 mm]
    cross_modes: symmetric
    modes:
      - {shapes: [[1, 0, 0], [0.8, 0, 0]], frequency: 900 Hz, damping: 2 %, mass: 1 kg, phase: 2 deg}
      - {shapes: [[1, 0, 0], [0.8, 0, 0]], frequency: 950 Hz, damping: 2 %, mass: 1 kg, phase: -2.1 deg}
      - {shapes: [[0, 0, 1], [0, 0, 1]], torsion: 30 rad/m, frequency: 3 kHz, damping: 2 %, mass: 1 kg}
      - {direction: xy, frequency: 940 Hz, damping: 1 %, mass: 20 kg}
""")
    found = at(op)
    assert found.modes is not None
    assert found.modes.shapes.shape == (2, 4, 5)
    assert found.linear.size == 10


MODE = "frequency: 9 Hz, damping: 1 %, mass: 1 kg}"


@pytest.mark.parametrize(("structure", "words"), [
    ("    frame: tool\n", "either modes or a table"),
    (f"    frame: rotating\n    modes:\n      - {{direction: x, {MODE}\n", "u and v"),
    (f"    frame: tool\n    modes:\n      - {{direction: u, {MODE}\n", "u and v"),
    (f"    frame: tool\n    modes:\n      - {{direction: xy, {MODE}\n", "cross_modes"),
    (f"    frame: tool\n    cross_modes: none\n    modes:\n      - {{direction: x, {MODE}\n", "cross_modes"),
    (f"    frame: tool\n    modes:\n      - {{direction: x, shapes: [[1, 0, 0]], {MODE}\n", "either direction"),
    (f"    frame: tool\n    heights: [0 mm, 5 mm]\n    modes:\n      - {{direction: x, {MODE}\n",
     "one shape per contact height"),
    (f"    frame: tool\n    table:\n      - at: {{x: 0 mm}}\n        modes:\n          - {{direction: x, {MODE}\n"
     f"      - at: {{y: 0 mm}}\n        modes:\n          - {{direction: x, {MODE}\n", "same axes"),
])
def test_impossible_structure_sections_are_refused(structure: str, words: str) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        parsed(structure)
    assert str(caught.value).startswith("cut.yaml: tool")
