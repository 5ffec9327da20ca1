"""Sections of an operation file for the shape of the cutter and of the stock, and the values made from them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .operation_cutter import CYLINDER, Shape
from .operation_units import Angle, Length, PositiveLength, Section


class ShapeSection(Section):
    """The APT cutter's corner, tip and taper, and details of the edges."""

    corner_radius: PositiveLength | None = Field(
        None, description="radius of the corner; half of the diameter makes a ball; sharp if left out")
    corner_radial: Length | None = Field(
        None, description="distance of the corner's centre from the axis; tangent to tip and flank if left out")
    corner_axial: Length | None = Field(
        None, description="height of the corner's centre above the tip; tangent to tip and flank if left out")
    tip_angle: Angle = Field(0.0, description="of the tip cone above the plane across the axis, 0 deg if left out")
    taper_angle: Angle = Field(
        0.0, description="of the flank out of the axis, > 0 gets wider upwards, 0 deg if left out")
    bottom_clearance: Angle = Field(
        0.0, description="angle by which the bottom edges rise towards the axis (dish), 0 deg if left out")
    wiper_length: Length = Field(0.0, description="flat bottom edge beside the corner, 0 mm if left out")
    helix_angles: tuple[Angle, ...] = Field((), description="one per tooth, instead of helix_angle")
    helix_law: Literal["lead", "angle"] = Field(
        "lead", description="what is constant along a tapered flank, lead if left out")
    axial_runout: tuple[Length, ...] = Field(
        (), description="how far each tooth stands out below the others; none if left out")


class ProfilePoint(Section):
    """One point of a stepped or curved bar; straight lines in between."""

    z: Length = Field(description="from the free end face, 0 mm, to -length; two points at one z make a step")
    diameter: PositiveLength = Field(description="diameter there")


def shape_of(section: ShapeSection | None) -> Shape:
    """Values of the section, a flat end mill without it. Raises ValueError where they contradict each other."""
    if section is None:
        return CYLINDER
    given = {key: value for key in ShapeSection.model_fields if (value := getattr(section, key)) is not None}
    return Shape(**given)


def profile_of(points: tuple[ProfilePoint, ...]) -> tuple[tuple[float, float], ...]:
    """Points (z, radius) [m] of the stock."""
    return tuple((p.z, p.diameter / 2) for p in points)
