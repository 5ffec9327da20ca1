"""Conditions from axis states: geometry and signs against independent constructions."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.machine.cases import RPM, bars, blocks, datums, milling, moved, turn_milling
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import (
    conditions_from_axes,
    feed_direction,
    machine_from_tool,
    nominal_axes,
    start_position,
    with_cut,
)
from turnmill_core.operation import Conditions, Operation, Vector

operations = st.one_of(bars(), blocks())


def close(a: Conditions, b: Conditions, scale: float) -> bool:
    x, y = (np.array([*dataclasses.astuple(c)[:4], *c.cross_feed_span, c.effective_radius]) for c in (a, b))
    return bool(np.allclose(x, y, rtol=1e-7, atol=1e-9 * scale + 1e-12))


@given(operations)
def test_nominal_conditions_to_axes_and_back(op: Operation) -> None:
    back = conditions_from_axes(op, nominal_axes(op))
    assert close(back, op.conditions, op.tool.diameter)
    assert back.in_cut


@given(operations, st.floats(0.2, 2.0), st.floats(0.2, 2.0), st.floats(0.05, 1.0), st.booleans())
def test_changed_cut_to_axes_and_back(op: Operation, tool: float, work: float, depth: float, reverse: bool) -> None:
    nominal = op.conditions
    workpiece_speed = nominal.workpiece_speed * work * (-1 if reverse else 1)
    cut = with_cut(op, nominal.tool_speed * tool, workpiece_speed, nominal.depth * depth)
    assert close(conditions_from_axes(op, nominal_axes(op, cut)), cut, op.tool.diameter)


@given(operations, datums, st.floats(-1, 2), st.floats(-1e-2, 1e-2))
def test_moving_datum_and_axes_together_changes_nothing(
    op: Operation, shift: Vector, along: float, lift: float
) -> None:
    step: Vector = (lift, 0.0, along * op.workpiece.length) if op.workpiece.is_bar else (
        along * op.workpiece.length, 0.0, lift)
    axes = moved(nominal_axes(op), step)
    piece = op.workpiece
    datum = tuple(d + s for d, s in zip(piece.datum, shift, strict=True))
    shifted = dataclasses.replace(op, workpiece=dataclasses.replace(piece, datum=datum))

    def outcome(op: Operation, axes: AxisState) -> Conditions | str:
        try:
            return conditions_from_axes(op, axes)
        except ValueError as error:
            return str(error).split(" is ")[0]

    one, two = outcome(op, axes), outcome(shifted, moved(axes, shift))
    assert one == two if isinstance(one, str) or isinstance(two, str) else close(one, two, 1.0)


# The cut found without any of the formulas: was this material inside the tool before?


def cut_angles(op: Operation, phi: np.ndarray) -> np.ndarray:
    """True where the edge at engagement angle phi, just inside the tool at its tip, meets material that the
    tool never covered before, followed backwards in time through the turning bar and the feed."""
    cut, R = op.conditions, op.tool.radius
    axes = nominal_axes(op)
    at = np.array(axes.position[:3]) - op.workpiece.datum
    frame = machine_from_tool(op, cut)
    edge = at + (0.999 * R * np.stack([np.sin(phi), np.cos(phi), 0 * phi], axis=1)) @ frame.T
    radius, angle = np.hypot(edge[:, 0], edge[:, 1]), np.arctan2(edge[:, 1], edge[:, 0])
    inside_bar = (radius < op.workpiece.radius) & (edge[:, 2] <= 0) & (edge[:, 2] >= -op.workpiece.length)
    revolution = 2 * math.pi / abs(cut.workpiece_speed)
    back = np.linspace(0.01 * R / cut.resultant_feed_speed, 2 * revolution, 20_001)[:, None]
    earlier = angle - cut.workpiece_speed * back
    x, y = radius * np.cos(earlier), radius * np.sin(earlier)
    tool_z = at[2] - axes.velocity[2] * back
    covered = (x >= cut.effective_radius) & (y**2 + (edge[:, 2] - tool_z) ** 2 < R**2)
    return inside_bar & ~covered.any(axis=0)


@pytest.mark.parametrize("workpiece_speed", [6 * RPM, -6 * RPM])
@pytest.mark.parametrize("sense", ["up", "down"])
def test_up_and_down_against_the_history_of_the_material(workpiece_speed: float, sense: str) -> None:
    """A large bar, so that its roundness leaves the strip of the feed as the only limit."""
    op = turn_milling(diameter=0.02, feed=0.006, bar=0.3, length=0.1, depth=4e-3, workpiece_speed=workpiece_speed,
                      sense=sense)
    phi = np.radians(np.arange(1.0, 360.0, 3.0))
    found = phi[cut_angles(op, phi)]
    lower, upper = conditions_from_axes(op, nominal_axes(op)).cross_feed_span
    start, end = math.acos(upper / op.tool.radius), math.acos(lower / op.tool.radius)
    assert found.min() == pytest.approx(start, abs=math.radians(8))
    assert found.max() == pytest.approx(end, abs=math.radians(8))
    # up-milling begins with a thin chip (phi = 0), down-milling ends with one (phi = pi)
    assert (start == pytest.approx(0)) == (sense == "up")
    assert (end == pytest.approx(math.pi)) == (sense == "down")
    # one of the two ends is the wall of the previous revolution, sharp to the grid
    wall = (found.max(), end) if sense == "up" else (found.min(), start)
    assert wall[0] == pytest.approx(wall[1], abs=math.radians(3.5))


@pytest.mark.parametrize("workpiece_speed", [1.0, -1.0])
def test_feed_of_the_tool_is_against_the_material(workpiece_speed: float) -> None:
    """v = Omega x r at the tool tip; the tool moves along x_T relative to it; the frame is right-handed."""
    op = turn_milling(workpiece_speed=workpiece_speed)
    frame = machine_from_tool(op, op.conditions)
    material = np.cross([0.0, 0.0, workpiece_speed], [op.conditions.effective_radius, 0.0, 0.0])
    assert np.allclose(frame[:, 0], -material / np.linalg.norm(material))
    assert np.allclose(frame[:, 2], [1.0, 0.0, 0.0])
    assert np.linalg.det(frame) == pytest.approx(1.0)
    assert np.allclose(frame.T @ frame, np.eye(3))


def test_frames_of_a_standing_bar_and_of_milling() -> None:
    op = turn_milling(workpiece_speed=-1.0)
    standing = dataclasses.replace(op.conditions, workpiece_speed=0.0)
    assert np.array_equal(machine_from_tool(op, standing), machine_from_tool(op, op.conditions))
    block = milling()
    assert np.array_equal(machine_from_tool(block, block.conditions), np.eye(3))


@pytest.mark.parametrize(
    ("workpiece_speed", "sense", "direction"), [(1.0, "up", -1), (1.0, "down", 1), (-1.0, "up", 1), (-1.0, "down", -1)])
def test_direction_of_the_axial_feed(workpiece_speed: float, sense: str, direction: int) -> None:
    op = turn_milling(workpiece_speed=workpiece_speed, sense=sense)
    assert feed_direction(op) == direction
    assert nominal_axes(op).velocity[2] * direction > 0
    # the uncut side in the tool frame: +y_T in up-milling
    ahead = machine_from_tool(op, op.conditions).T @ [0.0, 0.0, float(direction)]
    assert ahead[1] == pytest.approx(1 if sense == "up" else -1)


def test_reversing_the_workpiece_turns_up_into_down() -> None:
    op = turn_milling(feed=0.008)
    there, back = with_cut(op), with_cut(op, workpiece_speed=-op.conditions.workpiece_speed)
    assert there.cross_feed_span == pytest.approx((2e-3, 10e-3))
    assert back.cross_feed_span == pytest.approx((-10e-3, -2e-3))
    assert back.feed_speed == there.feed_speed


# No contact


@given(operations, st.floats(0, 0.1))
def test_above_the_workpiece_there_is_clearance(op: Operation, clearance: float) -> None:
    up = op.conditions.depth + clearance
    axes = moved(nominal_axes(op), (up, 0.0, 0.0) if op.workpiece.is_bar else (0.0, 0.0, up))
    cut = conditions_from_axes(op, axes)
    assert cut.depth == pytest.approx(-clearance, abs=1e-12)
    assert not cut.in_cut or cut.depth < 1e-12


@given(operations)
def test_standing_spindle_or_feed_is_no_cut(op: Operation) -> None:
    axes = nominal_axes(op)
    assert not conditions_from_axes(op, moved(axes, s=0.0)).in_cut
    assert conditions_from_axes(op, moved(axes, s=-0.05)).tool_speed == 0
    still = conditions_from_axes(op, moved(axes, x=0.0, z=0.0))
    assert not still.in_cut
    assert still.feed_speed == 0
    assert still.radial_immersion == 0


def travel(op: Operation, along: float) -> AxisState:
    """Nominal axes with the tool axis at `along` beyond the first edge of the workpiece, in feed direction."""
    axes, axis = nominal_axes(op), 2 if op.workpiece.is_bar else 0
    direction = feed_direction(op)
    piece = op.workpiece
    first = piece.datum[axis] - (piece.length if piece.is_bar and direction > 0 else 0.0)
    target = first + direction * along
    shift = [0.0, 0.0, 0.0]
    shift[axis] = target - axes.position[axis]
    return moved(axes, tuple(shift))  # type: ignore[arg-type]


@given(bars(), st.floats(0, 1))
def test_bar_entry_full_cut_exit(op: Operation, share: float) -> None:
    """The strip grows from nothing over one feed, stays, and shrinks over one feed at the far end."""
    R, fa, L = op.tool.radius, op.axial_feed, op.workpiece.length
    width = lambda along: conditions_from_axes(op, travel(op, along)).radial_immersion  # noqa: E731
    tiny = 1e-9
    assert width(-R - share * 0.1) == pytest.approx(0, abs=tiny)
    assert width(-R + share * min(fa, L)) == pytest.approx(share * min(fa, L), abs=tiny)
    if fa < L:
        assert width(-R + fa + share * (L - fa)) == pytest.approx(fa, abs=tiny)
        assert width(L - R + share * fa) == pytest.approx((1 - share) * fa, abs=tiny)
    assert width(L - R + fa + share * 0.1) == pytest.approx(0, abs=tiny)


@pytest.mark.parametrize(("sense", "sign"), [("up", 1), ("down", -1)])
def test_side_of_the_strip_at_entry_and_exit(sense: str, sign: int) -> None:
    """Entering, only the leading edge cuts (|y_T| near R); leaving, only the wall side (|y_T| near R - fa)."""
    op = turn_milling(diameter=0.02, feed=0.008, length=0.1, sense=sense)
    enter = conditions_from_axes(op, travel(op, -0.010 + 0.003)).cross_feed_span
    leave = conditions_from_axes(op, travel(op, 0.090 + 0.003)).cross_feed_span
    assert sorted(sign * y for y in enter) == pytest.approx([0.007, 0.010])
    assert sorted(sign * y for y in leave) == pytest.approx([0.002, 0.007])


@given(blocks(), st.floats(0, 1))
def test_block_has_no_contact_before_and_after(op: Operation, share: float) -> None:
    R, L = op.tool.radius, op.workpiece.length
    assert not conditions_from_axes(op, travel(op, -R - 1e-6 - share)).in_cut
    assert not conditions_from_axes(op, travel(op, L + 1e-6 + share)).in_cut
    assert conditions_from_axes(op, travel(op, share * (L - R) * 0.999)).radial_immersion == pytest.approx(
        op.conditions.radial_immersion, rel=1e-6)


def block_arc(op: Operation, axes: AxisState, phi: np.ndarray) -> np.ndarray:
    """True where the front of the tool (phi in 0 to pi) is inside the block, point by point."""
    x, y = axes.position[0] - op.workpiece.datum[0], axes.position[1] - op.workpiece.datum[1]
    px, py = x + op.tool.radius * np.sin(phi), y + op.tool.radius * np.cos(phi)
    return (px >= 0) & (px <= op.workpiece.length) & (py >= 0) & (py <= op.workpiece.width)


@given(blocks(), st.floats(-1.2, 1.2), st.booleans())
def test_block_engagement_point_by_point(op: Operation, place: float, at_end: bool) -> None:
    """Entry and exit of every immersion against points on the tool's front; two arcs are refused."""
    R = op.tool.radius
    axes = travel(op, place * R + (op.workpiece.length if at_end else 0.0))
    phi = np.linspace(0, math.pi, 4001)[1:-1]
    inside = block_arc(op, axes, phi)
    arcs = int(np.count_nonzero(np.diff(np.concatenate([[0], inside, [0]]).astype(int)) == 1))
    y = R * np.cos(phi)
    near_edge = 2e-3 * R
    ahead = op.workpiece.length * (not at_end) - place * R
    gone = math.sqrt(max(0.0, R**2 - ahead**2)) if ahead > 0 else R
    low, high = op.conditions.cross_feed_span
    if ahead < R and low < -gone * (1 + 1e-6) and gone * (1 + 1e-6) < high:
        with pytest.raises(ValueError, match="two arcs"):
            conditions_from_axes(op, axes)
        return
    lower, upper = conditions_from_axes(op, axes).cross_feed_span
    if np.count_nonzero(inside) <= 1:  # at most a touch
        assert upper - lower <= near_edge
        return
    assert arcs <= 1 or inside.mean() < 1e-2
    assert not inside[(y < lower - near_edge) | (y > upper + near_edge)].any()
    # near y = -R and R the arc runs along x: stay clear of the ends by an angle too
    well = (y > lower + near_edge) & (y < upper - near_edge)
    assert inside[well].all()


@pytest.mark.parametrize(("sense", "offset", "span"), [
    ("up", 0.0, (5e-3, 10e-3)), ("up", 1e-3, (4e-3, 10e-3)), ("up", -1e-3, (6e-3, 10e-3)),
    ("down", 0.0, (-10e-3, -5e-3)), ("down", 1e-3, (-10e-3, -6e-3)), ("slot", 2e-3, (-10e-3, 10e-3)),
])
def test_cross_feed_overlap_follows_y(sense: str, offset: float, span: tuple[float, float]) -> None:
    op = milling(diameter=0.02, immersion=0.005, sense=sense)
    axes = moved(nominal_axes(op), (0.0, offset, 0.0))
    assert conditions_from_axes(op, axes).cross_feed_span == pytest.approx(span)


# What is refused, and what is not because the tool is elsewhere

BAR, BLOCK = turn_milling(diameter=0.02, feed=0.008, bar=0.05), milling()


@pytest.mark.parametrize(("op", "change", "velocity", "words"), [
    (BAR, (0, 0, 0), {"z": -0.0011}, ["axial feed", "m/rev", "two arcs"]),
    (BAR, (0, 0, 0), {"c": 0.0}, ["workpiece speed", "turning"]),
    (BAR, (0, 1e-3, 0), {}, ["axis y", "0.001 m", "eccentric"]),
    (BAR, (-0.03, 0, 0), {}, ["depth", "bar's radius"]),
    (BAR, (0, 0, 0), {"s": -100.0}, ["tool spindle speed", "-100.0 rad/s", "clockwise"]),
    (BLOCK, (0, 0, 0), {"x": -0.01}, ["feed (axes x, y)", "+x"]),
    (BLOCK, (0, 0, 0), {"y": 0.01}, ["feed (axes x, y)", "+x"]),
    (BLOCK, (0, 0, -0.04), {}, ["depth", "block's height"]),
    (BAR, (math.nan, 0, 0), {}, ["finite"]),
])
def test_what_is_not_described_is_refused(
    op: Operation, change: Vector, velocity: dict[str, float], words: list[str]
) -> None:
    with pytest.raises(ValueError) as caught:
        conditions_from_axes(op, moved(nominal_axes(op), change, **velocity))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(("op", "away", "velocity"), [
    (BAR, (0.0, 0.0, 0.5), {"z": -0.5}), (BAR, (0.01, 0.3, 0.0), {"z": 0.5}), (BLOCK, (0.0, 0.0, 0.01), {"x": -0.5}),
    (BLOCK, (0.0, -0.5, 0.0), {"y": 0.5}),
])
def test_rapid_moves_in_the_air_are_no_cut(op: Operation, away: Vector, velocity: dict[str, float]) -> None:
    assert not conditions_from_axes(op, moved(nominal_axes(op), away, **velocity)).in_cut


def test_tilted_tool_is_refused_only_in_the_cut() -> None:
    for op in (BAR, BLOCK):
        axes = nominal_axes(op)
        tilted = dataclasses.replace(axes, position=(*axes.position[:3], 0.5, *axes.position[4:]))
        with pytest.raises(ValueError, match=r"axis b.*0\.5 rad"):
            conditions_from_axes(op, tilted)
        assert not conditions_from_axes(op, moved(tilted, (1.0, 0.0, 1.0))).in_cut


def test_flute_length_limits_the_depth() -> None:
    op = dataclasses.replace(BAR, tool=dataclasses.replace(BAR.tool, flute_length=2e-3))
    with pytest.raises(ValueError, match="flute length"):
        conditions_from_axes(op, moved(nominal_axes(op), (-1.5e-3, 0.0, 0.0)))
    with pytest.raises(ValueError, match="flute length"):
        with_cut(op, depth=3e-3)


@pytest.mark.parametrize(("op", "change", "words"), [
    (BAR, {"tool_speed": -1.0}, "tool speed is -1.0 rad/s"), (BAR, {"depth": 0.025}, "bar's radius"),
    (BAR, {"workpiece_speed": math.inf}, "workpiece speed"), (BLOCK, {"workpiece_speed": 1.0}, "0 in milling"),
    (BLOCK, {"depth": 0.031}, "block's height"), (BAR, {"depth": math.nan}, "depth"),
])
def test_with_cut_refuses(op: Operation, change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        with_cut(op, **change)


def test_with_cut_feed_follows_the_spindles() -> None:
    """Case 1 at 21 rpm: 8 mm/rev = 2.8 mm/s; milling: 0.1 mm x 2 teeth x 6000 rpm = 20 mm/s."""
    assert with_cut(BAR, workpiece_speed=21 * RPM).feed_speed == pytest.approx(2.8e-3)
    assert with_cut(BLOCK, tool_speed=6000 * RPM).feed_speed == pytest.approx(0.02)
    assert with_cut(BAR) == BAR.conditions
    assert with_cut(BAR, depth=-1e-3).effective_radius == pytest.approx(0.026)


def test_start_positions() -> None:
    """Bar: leading edge one feed inside the end face; block: tool axis above the edge, immersion on its side."""
    assert start_position(turn_milling(feed=0.008)) == pytest.approx((0.002, 0.0))
    assert start_position(turn_milling(feed=0.008, length=0.12, sense="down")) == pytest.approx((-0.122, 0.0))
    assert start_position(milling(immersion=0.005)) == pytest.approx((0.0, -0.005))
    assert start_position(milling(immersion=0.005, sense="down", width=0.05)) == pytest.approx((0.0, 0.055))
