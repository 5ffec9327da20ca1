"""Shipped operation files against the numbers as printed, typed in here a second time.

Source: A. Comak, PhD thesis, UBC 2018 (Tables 3.1, 3.2, 4.9, 4.10, 4.11, 5.1 and the text around them);
T. Insperger, G. Stepan, IJNME 61 (2004) 117-141.
"""

from __future__ import annotations

import math

import pytest

from turnmill_core.operation import Operation, Structure
from turnmill_core.operation_file import read_operation, shipped_operations

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)

# file: (tool mm, teeth, helix deg, bar diameter mm, bar length mm, Ktc Krc Kac MPa, Kte Kre Kae N/mm,
#        tool rpm, workpiece rpm, depth mm, axial feed mm/rev)
CUTS = {
    "thesis_table_3_1": (16, 2, 25, 105, 175, (930, 290, 242), (21, 25, 8), 500, 2, 1.0, 4 / 2),
    "thesis_table_3_2": (10, 4, 0, 90, 100, (1706, 759, 577), (0, 0, 0), 2000, 20, 0.5, 6 / 20),
    "thesis_table_4_9": (20, 2, 25, 46, 125, (930, 290, 242), (0, 0, 0), 3350, 6, 1.2, 8),
    "thesis_table_4_10": (20, 2, 25, 46, 125, (930, 290, 242), (0, 0, 0), 3500, 12, 0.6, 0.25 * 20),
    "thesis_table_4_11": (20, 2, 25, 100, 120, (2650, 1800, 125), (0, 0, 0), 2070, 6, 0.4, 8),
    "thesis_table_5_1": (20, 2, 25, 50, 120, (930, 290, 242), (0, 0, 0), 10345, 10, 5.5, 8),
}

# file: (tool modes, workpiece modes), each (shape, Hz, %, kg)
MODES = {
    "thesis_table_3_1": ([], []),
    "thesis_table_3_2": ([], []),
    "thesis_table_4_9": (
        [(X, 682, 5.32, 1.303), (X, 800, 1.97, 1.635), (Y, 776, 3.2, 0.873)],
        [(X, 332, 1.84, 4.94), (X, 772, 1.2, 1.63), (Y, 307, 3.42, 7.40), (Y, 781, 1.1, 1.40)],
    ),
    "thesis_table_4_10": ([], [(X, 367, 1.49, 4.72), (X, 1135, 1.14, 0.22), (Y, 1129, 1.12, 0.23)]),
    "thesis_table_4_11": (
        [(X, 813, 3.51, 1.99), (X, 2322, 3.49, 0.26), (Y, 807, 3.88, 1.31), (Y, 2319, 3.88, 0.26)],
        [(X, 250, 1.90, 13.45), (X, 282, 3.53, 41.83), (Y, 231, 4.28, 45.34), (Y, 260, 2.93, 15.58)],
    ),
    "thesis_table_5_1": (
        [],
        [(X, 250, 1.9, 13.45), (X, 282, 3.5, 41.82), (Y, 231, 4.2, 45.35), (Y, 260, 2.9, 15.58)],
    ),
}


def load(name: str) -> Operation:
    return read_operation(shipped_operations()[name])


def rows(structure: Structure) -> list[tuple[object, float, float, float]]:
    return [(m.shape, round(m.frequency, 9), round(m.damping * 100, 9), round(m.mass, 9)) for m in structure.modes]


def test_every_shipped_file_loads_and_says_where_its_numbers_come_from() -> None:
    names = set(shipped_operations())
    assert {*CUTS, "milling_benchmark_1dof", "milling_benchmark_2dof", "face_mill_6_teeth"} <= names
    for name in names:
        op = load(name)
        assert len(op.sources) > 40, name
        assert len(op.sha256) == 64, name


@pytest.mark.parametrize("name", CUTS)
def test_cut_of_the_thesis(name: str) -> None:
    diameter, teeth, helix, bar, length, chip, edge, tool_rpm, work_rpm, depth, feed = CUTS[name]
    op = load(name)
    cut, material = op.conditions, op.material
    assert op.process == "turn-milling"
    assert op.tool.diameter == pytest.approx(diameter * 1e-3, rel=1e-12)
    assert op.tool.teeth == teeth
    assert math.degrees(op.tool.helix_angle) == pytest.approx(helix, rel=1e-12)
    assert (op.workpiece.diameter, op.workpiece.length) == pytest.approx((bar * 1e-3, length * 1e-3), rel=1e-12)
    assert (material.Ktc, material.Krc, material.Kac) == pytest.approx([k * 1e6 for k in chip], rel=1e-12)
    assert (material.Kte, material.Kre, material.Kae) == pytest.approx([k * 1e3 for k in edge], rel=1e-12)
    assert cut.tool_speed == pytest.approx(tool_rpm * 2 * math.pi / 60, rel=1e-12)
    assert cut.workpiece_speed == pytest.approx(work_rpm * 2 * math.pi / 60, rel=1e-12)
    assert cut.depth == pytest.approx(depth * 1e-3, rel=1e-12)
    assert op.axial_feed == pytest.approx(feed * 1e-3, rel=1e-12)
    # feed per revolution is the radial immersion; speed = feed per revolution x revolutions per second
    assert cut.radial_immersion == pytest.approx(feed * 1e-3, rel=1e-12)
    assert cut.feed_speed == pytest.approx(feed * 1e-3 * work_rpm / 60, rel=1e-12)
    assert op.milling_sense == "up"
    assert cut.cross_feed_span[1] == op.tool.radius


@pytest.mark.parametrize("name", MODES)
def test_modes_of_the_thesis(name: str) -> None:
    tool, workpiece = MODES[name]
    op = load(name)
    assert rows(op.tool.structure) == tool
    assert rows(op.workpiece.structure) == workpiece


def test_case_1_tooth_passing_frequency_and_exit_angle() -> None:
    """Section 4.3.7.3: 111.7 Hz at 3350 rpm with 2 teeth; exit 1.3694 rad at 8 mm of 20 mm (erratum M10)."""
    op = load("thesis_table_4_9")
    assert op.tooth_passing_frequency == pytest.approx(111.7, abs=0.05)
    lower, upper = op.conditions.cross_feed_span
    assert math.acos(upper / op.tool.radius) == 0
    assert math.acos(lower / op.tool.radius) == pytest.approx(1.3694, abs=5e-5)


def test_axial_feed_speeds_of_tables_3_1_and_3_2() -> None:
    """The tables print 4 and 6 mm/min."""
    assert load("thesis_table_3_1").conditions.feed_speed * 6e4 == pytest.approx(4, rel=1e-12)
    assert load("thesis_table_3_2").conditions.feed_speed * 6e4 == pytest.approx(6, rel=1e-12)


def test_removal_rate_of_table_5_2_first_row() -> None:
    """61512 mm3/min = Omega_c fa a pi (Dw - a) (Eq. 5.1 with its lost factor a)."""
    op = load("thesis_table_5_1")
    turns = op.conditions.workpiece_speed / (2 * math.pi) * 60
    a, Dw = op.conditions.depth * 1e3, op.workpiece.diameter * 1e3
    assert turns * op.axial_feed * 1e3 * a * math.pi * (Dw - a) == pytest.approx(61512, abs=1)


@pytest.mark.parametrize(("name", "shapes"), [("milling_benchmark_1dof", [X]), ("milling_benchmark_2dof", [X, Y])])
def test_milling_benchmark(name: str, shapes: list[object]) -> None:
    op = load(name)
    assert op.process == "milling"
    assert (op.tool.teeth, op.tool.helix_angle) == (2, 0)
    assert (op.material.Ktc, op.material.Krc) == pytest.approx((600e6, 200e6), rel=1e-12)
    assert op.conditions.tool_speed == pytest.approx(5000 * 2 * math.pi / 60, rel=1e-12)
    assert op.conditions.cross_feed_span == (-op.tool.radius, op.tool.radius)
    assert rows(op.tool.structure) == [(shape, 922, 1.1, 0.03993) for shape in shapes]
    assert op.workpiece.structure.modes == ()


def test_face_mill_of_the_sound_recording() -> None:
    op = load("face_mill_6_teeth")
    assert op.tool.diameter == pytest.approx(63.5e-3, rel=1e-12)
    assert op.tool.teeth == 6
    assert op.tooth_passing_frequency == pytest.approx(165.6, rel=1e-12)
    for word in ("Unknown, assumed here", "no modes", "aluminium"):
        assert word in op.sources
