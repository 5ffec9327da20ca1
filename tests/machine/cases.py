"""Operations for the tests of the machine room: any tool, bar or block, sense and datum."""

from __future__ import annotations

import dataclasses
import math

from hypothesis import strategies as st

from turnmill_core.machine.axes import AXES, AxisState
from turnmill_core.operation import Conditions, Material, Operation, SchedulePoint, Tool, Vector, Workpiece

RPM = math.pi / 30
STEEL = Material("steel", 2e9, 1e9, 1e8)


def turn_milling(
    diameter: float = 0.02, feed: float = 0.008, bar: float = 0.05, length: float = 0.12, depth: float = 1e-3,
    tool_speed: float = 3350 * RPM, workpiece_speed: float = 6 * RPM, sense: str = "up",
    datum: Vector = (0.0, 0.0, 0.0), schedule: tuple[SchedulePoint, ...] = (), teeth: int = 2,
) -> Operation:
    R, feed_speed = diameter / 2, feed * abs(workpiece_speed) / (2 * math.pi)
    span = (R - feed, R) if sense == "up" else (-R, -R + feed)
    return Operation(
        "bar", "turn-milling", "test", Tool("tool", diameter, teeth), Workpiece("bar", bar, length, datum=datum), STEEL,
        Conditions(tool_speed, workpiece_speed, depth, feed_speed, span, bar / 2 - depth),
        sense, axial_feed=feed, schedule=schedule,  # type: ignore[arg-type]
    )


def milling(
    diameter: float = 0.02, immersion: float = 0.005, sense: str = "up", length: float = 0.2, width: float = 0.05,
    height: float = 0.03, depth: float = 1e-3, tool_speed: float = 5000 * RPM, feed_per_tooth: float = 1e-4,
    datum: Vector = (0.0, 0.0, 0.0), schedule: tuple[SchedulePoint, ...] = (), teeth: int = 2,
) -> Operation:
    R = diameter / 2
    span = {"up": (R - immersion, R), "down": (-R, -R + immersion), "slot": (-R, R),
            "centred": (-width / 2, width / 2)}[sense]
    return Operation(
        "block", "milling", "test", Tool("tool", diameter, teeth),
        Workpiece("block", length=length, width=width, height=height, datum=datum), STEEL,
        Conditions(tool_speed, 0.0, depth, feed_per_tooth * teeth * tool_speed / (2 * math.pi), span),
        sense, feed_per_tooth=feed_per_tooth, schedule=schedule,  # type: ignore[arg-type]
    )


def moved(axes: AxisState, shift: Vector = (0.0, 0.0, 0.0), **velocity: float) -> AxisState:
    """Axis state with x, y, z shifted and some velocities replaced."""
    position = tuple(p + s for p, s in zip(axes.position, (*shift, 0.0, 0.0, 0.0), strict=True))
    speeds = tuple(velocity.get(name, v) for name, v in zip(AXES, axes.velocity, strict=True))
    return dataclasses.replace(axes, position=position, velocity=speeds)  # type: ignore[arg-type]


lengths = st.floats(-0.5, 0.5)
datums = st.tuples(lengths, lengths, lengths)


@st.composite
def bars(draw: st.DrawFn) -> Operation:
    diameter = draw(st.floats(4e-3, 40e-3))
    bar = draw(st.floats(10e-3, 200e-3))
    return turn_milling(
        diameter=diameter, feed=diameter / 2 * draw(st.floats(0.05, 1.0)), bar=bar,
        length=draw(st.floats(0.02, 0.5)), depth=bar / 2 * draw(st.floats(0.01, 0.9)),
        tool_speed=draw(st.floats(10, 3000)),
        workpiece_speed=draw(st.sampled_from([-1.0, 1.0])) * draw(st.floats(0.2, 10)),
        sense=draw(st.sampled_from(["up", "down"])), datum=draw(datums),
    )


@st.composite
def blocks(draw: st.DrawFn) -> Operation:
    diameter = draw(st.floats(4e-3, 80e-3))
    sense = draw(st.sampled_from(["up", "down", "slot", "centred"]))
    immersion = diameter * draw(st.floats(0.02, 1.0))
    width = immersion if sense == "centred" else max(immersion, diameter) * draw(st.floats(1.0, 3.0))
    height = draw(st.floats(5e-3, 0.1))
    return milling(
        diameter=diameter, immersion=immersion, sense=sense, width=width, height=height,
        length=draw(st.floats(2, 10)) * diameter, depth=height * draw(st.floats(0.01, 1.0)),
        tool_speed=draw(st.floats(10, 3000)), feed_per_tooth=draw(st.floats(1e-5, 5e-4)),
        datum=draw(datums), teeth=draw(st.integers(1, 8)),
    )
