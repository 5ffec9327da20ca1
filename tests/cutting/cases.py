"""Operations of the cutting tests, built in code."""

from __future__ import annotations

import math
from typing import Any

from turnmill_core.operation import Conditions, Material, Operation, Tool, Workpiece

RPM = 2 * math.pi / 60
MM = 1e-3
AL6061 = Material("Al6061-T6, thesis 3.4", 930e6, 290e6, 242e6, 21e3, 25e3, 8e3)
AISI1040 = Material("AISI 1040, thesis 3.4", 1706e6, 759e6, 577e6)


def turn_milling(
    tool: Tool, material: Material, bar_diameter: float, depth: float, axial_feed: float, tool_rpm: float,
    workpiece_rpm: float, sense: str = "up",
) -> Operation:
    """Orthogonal turn-milling of a bar; up- or down-milling by the side of the uncut material."""
    radius, width = tool.radius, min(axial_feed, tool.diameter)
    span = {"up": (radius - width, radius), "down": (-radius, width - radius), "slot": (-radius, radius)}[sense]
    conditions = Conditions(
        tool_speed=tool_rpm * RPM, workpiece_speed=workpiece_rpm * RPM, depth=depth,
        feed_speed=axial_feed * abs(workpiece_rpm) / 60, cross_feed_span=span,
        effective_radius=bar_diameter / 2 - depth,
    )
    return Operation(
        name="turn-milling", process="turn-milling", machine="test", tool=tool,
        workpiece=Workpiece("bar", diameter=bar_diameter, length=0.2), material=material, conditions=conditions,
        milling_sense=sense, axial_feed=axial_feed,  # type: ignore[arg-type]
    )


def table_31(helix_deg: float = 25.0, **tool: Any) -> Operation:
    """Thesis Table 3.1: 16 mm tool, 2 teeth, 500 rpm, bar 105 mm at 2 rpm, 4 mm/min, 1 mm deep."""
    cutter = Tool("end mill 16 mm", 16 * MM, 2, math.radians(helix_deg), 30 * MM, **tool)
    return turn_milling(cutter, AL6061, 105 * MM, 1 * MM, 2 * MM, 500, 2)


def table_32(helix_deg: float = 30.0) -> Operation:
    """Thesis Table 3.2: 10 mm tool, 4 teeth, 2000 rpm, bar 90 mm at 20 rpm, 6 mm/min, 0.5 mm deep; helix not given."""
    cutter = Tool("end mill 10 mm", 10 * MM, 4, math.radians(helix_deg), 30 * MM)
    return turn_milling(cutter, AISI1040, 90 * MM, 0.5 * MM, 0.3 * MM, 2000, 20)


def milling(
    tool: Tool, material: Material, depth: float, feed_per_tooth: float, span: tuple[float, float],
    tool_rpm: float = 3000,
) -> Operation:
    """Milling of a block with the material between the two cross feed positions of `span` [m]."""
    conditions = Conditions(
        tool_speed=tool_rpm * RPM, workpiece_speed=0.0, depth=depth,
        feed_speed=feed_per_tooth * tool.teeth * tool_rpm / 60, cross_feed_span=span,
    )
    return Operation(
        name="milling", process="milling", machine="test", tool=tool,
        workpiece=Workpiece("block", length=0.2, width=0.1, height=0.05), material=material, conditions=conditions,
        milling_sense="up", feed_per_tooth=feed_per_tooth,
    )
