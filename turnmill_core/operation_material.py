"""Material of an operation file: coefficients as given, or those that follow from an alloy."""

from __future__ import annotations

import math

from .cutting.alloys import alloy_material, find_alloy
from .operation import Conditions, Material, Tool
from .operation_schema import MaterialSection


def material_of(section: MaterialSection, tool: Tool, nominal: Conditions) -> Material:
    """Coefficients of the section.

    Those of an alloy are taken at the cutting speed of the nominal cut, the tool's helix angle and the
    section's chip thickness, or the nominal cut's mean chip. Raises ValueError where the alloy is not known or its
    data do not reach there.
    """
    if section.alloy is None:
        keys = ("name", "Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")
        return Material(**{key: getattr(section, key) for key in keys if getattr(section, key) is not None})
    assert section.rake_angle is not None
    chip = mean_chip(tool, nominal) if section.chip_thickness is None else section.chip_thickness
    found = alloy_material(find_alloy(section.alloy), section.rake_angle, tool.helix_angle, chip,
                           tool.radius * nominal.tool_speed)
    return found if section.name is None else Material(
        section.name, found.Ktc, found.Krc, found.Kac, found.Kte, found.Kre, found.Kae)


def mean_chip(tool: Tool, cut: Conditions) -> float:
    """Mean chip thickness [m] over the arc of a cut: c (cos start - cos exit) / (exit - start), at the tool tip.

    c is the feed per tooth of the resultant feed; the arc is that of the width of cut.
    """
    low, high = (max(-1.0, min(1.0, y / tool.radius)) for y in cut.cross_feed_span)
    feed = cut.resultant_feed_speed * 2 * math.pi / (tool.teeth * cut.tool_speed)
    return feed * (high - low) / (math.acos(low) - math.acos(high))
