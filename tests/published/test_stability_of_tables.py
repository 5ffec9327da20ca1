"""What the sources of the shipped thesis operations say about published and computed stability limits.

Each limit is bracketed: stable 6 % below, unstable 6 % above. "constant" is the thesis' engagement, the same at
all heights, which the same operation has on a bar so large that it is flat.
"""

from __future__ import annotations

import dataclasses
import math

import pytest

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation, Structure
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.prediction import PredictedType
from turnmill_core.stability.margin import stability_point
from turnmill_core.stability.trials import judged_trials

RPM = math.pi / 30


def load(name: str) -> Operation:
    return read_operation(shipped_operations()[name])


def on_a_flat_bar(op: Operation) -> Operation:
    return dataclasses.replace(op, workpiece=dataclasses.replace(op.workpiece, diameter=20.0))


def exchanged(structure: Structure) -> Structure:
    """Directions x and y exchanged: the other reading of columns XX and YY."""
    modes = tuple(dataclasses.replace(m, shape=(m.shape[1], m.shape[0], m.shape[2])) for m in structure.modes)
    return dataclasses.replace(structure, modes=modes)


def tool_exchanged(op: Operation) -> Operation:
    return dataclasses.replace(op, tool=dataclasses.replace(op.tool, structure=exchanged(op.tool.structure)))


def workpiece_exchanged(op: Operation) -> Operation:
    structure = exchanged(op.workpiece.structure)
    return dataclasses.replace(op, workpiece=dataclasses.replace(op.workpiece, structure=structure))


def check_limit(op: Operation, tool_rpm: float, workpiece_rpm: float, limit_mm: float, chatter: float) -> None:
    def point(depth: float) -> tuple[PredictedType, float]:
        cut = with_cut(op, tool_rpm * RPM, workpiece_rpm * RPM, depth)
        at = stability_point(op, cut)
        return at.predicted_type, at.chatter_frequency

    assert point(0.94e-3 * limit_mm)[0] is PredictedType.STABLE
    kind, frequency = point(1.06e-3 * limit_mm)
    assert kind is PredictedType.HOPF
    assert frequency == pytest.approx(chatter, rel=0.01)


@pytest.mark.parametrize("workpiece_rpm", [6, 21])
def test_case_1_published_point_is_computed_stable(workpiece_rpm: float) -> None:
    """Published: chatter at 6 rpm (871 Hz), stable at 21 rpm; the first is not reproduced."""
    op = load("thesis_table_4_9")
    cut = with_cut(op, workpiece_speed=workpiece_rpm * RPM)
    assert stability_point(op, cut).predicted_type is PredictedType.STABLE


@pytest.mark.parametrize(("tool_rpm", "chatter"), [(3100, 780), (3550, 779)])
def test_case_1_lobe_minima(tool_rpm: float, chatter: float) -> None:
    """Chatter frequency plus one tooth passing frequency: 883 and 897 Hz (published 871 Hz at 3350 rpm)."""
    op = load("thesis_table_4_9")
    check_limit(op, tool_rpm, 6, 2.88, chatter)
    check_limit(on_a_flat_bar(op), tool_rpm, 6, 1.76, chatter)
    check_limit(on_a_flat_bar(tool_exchanged(op)), tool_rpm, 6, 1.63, chatter)


@pytest.mark.parametrize(("workpiece_rpm", "round_bar", "constant", "other"), [
    (6, 2.79, 2.17, 1.35), (12, 2.85, 2.23, 1.39), (40, 3.26, 2.64, 1.73)])
def test_case_2_limits_rise_with_the_workpiece_speed(
    workpiece_rpm: float, round_bar: float, constant: float, other: float
) -> None:
    """Published: 0.6 mm unstable at 6 and 12 rpm, stable at 40 rpm; the trend is reproduced, the level is not."""
    op = load("thesis_table_4_10")
    check_limit(op, 3500, workpiece_rpm, round_bar, 1130)
    check_limit(on_a_flat_bar(op), 3500, workpiece_rpm, constant, 1130)
    check_limit(on_a_flat_bar(workpiece_exchanged(op)), 3500, workpiece_rpm, other, 1130)


def test_aisi_620_without_process_damping() -> None:
    """Published: chatter at 0.4 mm, 265 Hz, absolute limit 0.3 mm; not reproduced."""
    op = dataclasses.replace(load("thesis_table_4_11"), process_damping=None)
    check_limit(op, 2070, 6, 2.61, 256)
    check_limit(on_a_flat_bar(op), 2070, 6, 1.92, 256)


def test_table_5_2_first_row_is_stable() -> None:
    """10345 rpm, 10 rpm and 5.5 mm are published as feasible."""
    op = load("thesis_table_5_1")
    assert stability_point(op, op.conditions).predicted_type is PredictedType.STABLE


@pytest.mark.parametrize(("name", "agreeing"), [
    ("thesis_table_4_1", [True]), ("thesis_table_4_9", [False, False, True, True]),
    ("thesis_table_4_10", [False, False, True]), ("thesis_table_4_11", [False, False]),
])
def test_trials_of_the_tables_agree_or_not(name: str, agreeing: list[bool]) -> None:
    """Figures 4.7, 4.54, 4.61 and 4.64: chatter at 1.2 mm, 0.6 mm and 0.4 mm is not reproduced, the rest is."""
    assert [t.agrees for t in judged_trials(load(name))] == agreeing
