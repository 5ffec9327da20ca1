"""The frozen values of an operation check themselves."""

from __future__ import annotations

import dataclasses
import math
import pickle

import pytest

from turnmill_core.operation import Conditions, Material, Mode, Operation, SchedulePoint, Tool, Workpiece
from turnmill_core.operation_file import read_operation, shipped_operations


@pytest.fixture(scope="module")
def case_1() -> Operation:
    return read_operation(shipped_operations()["thesis_table_4_9"])


def test_stiffness_of_a_mode() -> None:
    assert Mode(682.0, 0.05, 1.303, (1.0, 0.0, 0.0)).stiffness == pytest.approx(1.303 * (2 * math.pi * 682) ** 2)


def test_equal_pitch_where_none_is_given() -> None:
    assert Tool("t", 0.02, 3).pitch == (2 * math.pi / 3,) * 3
    assert Tool("t", 0.02, 2, pitch_angles=(3.0, 2 * math.pi - 3.0)).pitch[0] == 3.0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Mode(-1.0, 0.1, 1.0, (1.0, 0.0, 0.0)), ["mode frequency", "-1.0 Hz", "> 0"]),
        (lambda: Mode(1.0, 1.1, 1.0, (1.0, 0.0, 0.0)), ["mode damping", "1.1", "(0, 1)"]),
        (lambda: Mode(1.0, 0.1, math.nan, (1.0, 0.0, 0.0)), ["mode mass", "nan kg"]),
        (lambda: Mode(1.0, 0.1, 1.0, (0.0, 0.0, 0.0)), ["mode shape", "not all zero"]),
        (lambda: Tool("t", 0.0, 2), ["tool diameter", "0.0 m"]),
        (lambda: Tool("t", 0.02, 0), ["tool teeth", "0", ">= 1"]),
        (lambda: Tool("t", 0.02, 2, helix_angle=2.0), ["helix", "2.0 rad"]),
        (lambda: Tool("t", 0.02, 2, pitch_angles=(3.0, 3.0)), ["pitch angles", "2 positive angles", "2 pi"]),
        (lambda: Tool("t", 0.02, 2, runout=(0.0,)), ["runout", "2 finite"]),
        (lambda: Workpiece("w", diameter=0.05, length=0.1, width=0.1), ["either a diameter"]),
        (lambda: Workpiece("w", length=0.1), ["workpiece width"]),
        (lambda: Material("m", 0.0, 0.0, 0.0), ["Ktc", "0.0 Pa"]),
        (lambda: Material("m", 1.0, 0.0, 0.0, Kte=-1.0), ["Kte", "-1.0 N/m"]),
        (lambda: Conditions(-1.0, 0.0, 0.001, 0.0, (0.0, 0.01)), ["tool speed", "-1.0 rad/s"]),
        (lambda: Conditions(1.0, 0.0, 0.001, 0.0, (0.01, 0.0)), ["cross feed span", "lower <= upper"]),
        (lambda: SchedulePoint(-1.0, 1.0, 0.0, 0.0), ["schedule time", "-1.0 s"]),
    ],
)
def test_wrong_values_name_field_value_and_bound(make: object, words: list[str]) -> None:
    with pytest.raises(ValueError) as caught:
        make()  # type: ignore[operator]
    for word in words:
        assert word in str(caught.value)


def test_operation_checks_what_belongs_together(case_1: Operation) -> None:
    with pytest.raises(ValueError, match="axial feed"):
        dataclasses.replace(case_1, axial_feed=0.0)
    with pytest.raises(ValueError, match="ascending"):
        dataclasses.replace(case_1, schedule=(SchedulePoint(1.0, 1.0, 1.0, 0.0), SchedulePoint(1.0, 1.0, 1.0, 0.0)))
    with pytest.raises(ValueError, match="0 in milling"):
        dataclasses.replace(case_1, process="milling")


def test_values_are_frozen_and_picklable(case_1: Operation) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        case_1.name = "other"  # type: ignore[misc]
    assert pickle.loads(pickle.dumps(case_1)) == case_1


def test_resultant_feed_speed_uses_the_radius_at_the_tool_tip(case_1: Operation) -> None:
    """Eq. 3.22 with the exact radius Rw - a (erratum M1): 21.8 mm at 6 rpm and 0.8 mm/s."""
    expected = math.hypot(0.8e-3, 2 * math.pi * 6 / 60 * 21.8e-3)
    assert case_1.conditions.resultant_feed_speed == pytest.approx(expected, rel=1e-12)


def test_in_cut_needs_depth_width_and_speed() -> None:
    cut = Conditions(100.0, 0.0, 0.001, 0.01, (0.0, 0.01))
    assert cut.in_cut
    assert not dataclasses.replace(cut, depth=0.0).in_cut
    assert not dataclasses.replace(cut, cross_feed_span=(0.01, 0.01)).in_cut
    assert not dataclasses.replace(cut, tool_speed=0.0).in_cut
