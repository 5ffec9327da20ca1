"""Modes at several places: followed through a crossing, interpolated, held outside."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnmill_core.operation_structure import Mode, ModeTable, Structure
from turnmill_core.structure.table import followed, mac, modes_at_place, structure_at_place

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def modes(y: float) -> tuple[Mode, ...]:
    """A mode in x that rises from 700 to 780 Hz over y = -1 ... 1, and one in y that falls from 760 to 690 Hz."""
    up = Mode(740 + 40 * y, 0.05 - 0.04 * y, 1.0 - 0.2 * y, X)
    down = Mode(725 - 35 * y, 0.03, 2.0, Y)
    return tuple(sorted((up, down), key=lambda m: m.frequency))


CROSSING = ModeTable(("y",), ((-1.0,), (0.0,), (1.0,)), tuple(modes(y) for y in (-1.0, 0.0, 1.0)))


def test_modes_whose_frequencies_cross_keep_their_shapes() -> None:
    """In order of frequency the first mode is in x at one end and in y at the other."""
    assert [m[0].shape for m in CROSSING.modes] == [X, Y, Y]
    table = followed(CROSSING)
    assert {m[0].shape for m in table.modes} == {X}
    assert {m[1].shape for m in table.modes} == {Y}


@given(st.floats(-1.0, 1.0))
def test_what_is_linear_is_found_between_the_places(y: float) -> None:
    found = modes_at_place(CROSSING, {"y": y})
    wanted = {m.shape: m for m in modes(y)}
    for mode in found:
        true = wanted[mode.shape]
        assert mode.frequency == pytest.approx(true.frequency, rel=1e-12)
        assert mode.damping == pytest.approx(true.damping, rel=1e-9)
        assert mode.mass == pytest.approx(true.mass, rel=1e-12)


@pytest.mark.parametrize(("y", "end"), [(-5.0, -1.0), (9.0, 1.0)])
def test_the_nearest_place_holds_outside(y: float, end: float) -> None:
    assert set(modes_at_place(CROSSING, {"y": y})) == set(modes(end))


def test_two_axes_are_bilinear() -> None:
    def at(x: float, speed: float) -> tuple[Mode, ...]:
        return (Mode(700 + 50 * x - 0.01 * speed + 0.02 * x * speed, 0.03, 1.0, X),)

    places = ((0.0, 0.0), (1.0, 0.0), (0.0, 1000.0), (1.0, 1000.0))
    table = ModeTable(("x", "tool_speed"), places, tuple(at(*p) for p in places))
    found = modes_at_place(table, {"x": 0.3, "tool_speed": 250.0})
    assert found[0].frequency == pytest.approx(at(0.3, 250.0)[0].frequency, rel=1e-12)


def test_a_shape_of_the_other_sign_is_the_same_mode() -> None:
    ends = (Mode(700, 0.03, 1.0, (1, 0.2, 0)),), (Mode(720, 0.03, 1, (-1, 0, 0)),)
    table = ModeTable(("z",), ((0.0,), (1.0,)), ends)
    assert modes_at_place(table, {"z": 0.5})[0].shape == pytest.approx((1.0, 0.1, 0.0))


def test_modes_of_one_direction_are_followed_by_frequency() -> None:
    """Both in x: MAC says nothing, the nearer frequency does; the order in the entry does not matter."""
    low, high = (Mode(300.0, 0.02, 5.0, X), Mode(310.0, 0.02, 5.0, X)), (Mode(900.0, 0.02, 1.0, X),) * 2
    table = ModeTable(("x",), ((0.0,), (1.0,)), ((low[0], high[0]), (high[1], low[1])))
    assert [m.frequency for m in modes_at_place(table, {"x": 0.5})] == [305.0, 900.0]


def test_mac() -> None:
    a, b = Mode(1, 0.1, 1, X), Mode(1, 0.1, 1, (math.sqrt(0.5), math.sqrt(0.5), 0.0))
    assert mac(a, a) == pytest.approx(1)
    assert mac(a, b) == pytest.approx(0.5)
    assert mac(a, Mode(1, 0.1, 1, Y)) == 0


def test_a_structure_without_a_table_is_itself() -> None:
    plain = Structure(modes(0.0))
    assert structure_at_place(plain, {}) is plain


@pytest.mark.parametrize(("axes", "places", "words"), [
    (("c",), ((0.0,), (1.0,)), "axes"), (("x", "x"), ((0.0, 0.0), (1.0, 1.0)), "axes"),
    (("x",), ((0.0,), (0.0,)), "different places"), (("x",), ((0.0,), (math.inf,)), "finite"),
    (("x", "y"), ((0.0, 0.0), (1.0, 1.0)), "full grid"), (("x",), ((0.0, 1.0), (1.0, 1.0)), "places"),
])
def test_impossible_tables_are_refused(
    axes: tuple[str, ...], places: tuple[tuple[float, ...], ...], words: str,
) -> None:
    with pytest.raises(ValueError, match=words):
        ModeTable(axes, places, (modes(0.0),) * len(places))


def test_entries_of_unlike_length_are_refused() -> None:
    with pytest.raises(ValueError, match="same number of modes"):
        ModeTable(("x",), ((0.0,), (1.0,)), (modes(0.0), modes(0.0)[:1]))
