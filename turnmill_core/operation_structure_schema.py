"""Sections of an operation file that describe vibration, and the values that they become."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from .operation_structure import (
    CROSS_PLANES,
    Beam,
    BeamMaterial,
    Chuck,
    ChuckMode,
    CrossMode,
    Mode,
    ModeTable,
    Structure,
    Support,
)
from .operation_units import (
    Angle,
    Density,
    Frequency,
    JointDamping,
    Length,
    Mass,
    Number,
    PositiveLength,
    PositivePressure,
    Ratio,
    RotationalDamping,
    RotationalStiffness,
    Section,
    SpindleSpeed,
    Stiffness,
    Twist,
)

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0), "u": (1.0, 0.0, 0.0), "v": (0.0, 1.0, 0.0)}
_Vector = tuple[Number, Number, Number]


class ModeSection(Section):
    """One vibration mode at the cutting point: direction (a direct or a cross mode), shape or shapes."""

    direction: Literal["x", "y", "z", "u", "v", "xy", "yz", "xz", "-xy", "-yz", "-xz"] | None = Field(
        None, description="direct mode along this axis of the frame, or a cross mode between two")
    shape: _Vector | None = Field(
        None, description="mode shape (x, y, z) at the cutting point, numbers without unit, for the modal mass given")
    shapes: tuple[_Vector, ...] | None = Field(
        None, description="mode shape at each of the structure's heights, for the modal mass given")
    torsion: Twist = Field(
        0.0, description="rotation about the tool axis that belongs to the shape; 0 rad/m if left out")
    frequency: Frequency = Field(description="undamped natural frequency")
    damping: Ratio = Field(description="viscous damping ratio, in percent, below 100 %")
    mass: Mass = Field(description="modal mass")
    phase: Angle = Field(0.0, description="lead of a complex residue over that of a real mode; 0 deg if left out")

    @model_validator(mode="after")
    def _one_shape(self) -> ModeSection:
        if sum(v is not None for v in (self.direction, self.shape, self.shapes)) != 1:
            raise PydanticCustomError("cross", "either direction, shape (three numbers) or shapes (one per height)")
        every = self.shapes if self.shapes is not None else () if self.shape is None else (self.shape,)
        if self.direction is None and not any(s for shape in every for s in shape) and not self.torsion:
            raise PydanticCustomError("cross", "a mode shape that is not all zero")
        if self.damping >= 1:
            raise PydanticCustomError("cross", "a damping ratio below 100 %")
        if self.direction in CROSS_PLANES and (self.torsion or self.phase):
            raise PydanticCustomError("cross", "a cross mode without torsion and phase")
        return self

    def value(self) -> Mode:
        """The mode."""
        shapes = self.shapes or (self.shape or _AXES[self.direction or "x"],)
        return Mode(self.frequency, self.damping, self.mass, shapes[0], self.torsion, tuple(shapes[1:]), self.phase)


class PlaceSection(Section):
    """Where the machine stands, and how fast the tool turns, when the modes were measured."""

    x: Length | None = Field(None, description="axis position")
    y: Length | None = Field(None, description="axis position")
    z: Length | None = Field(None, description="axis position")
    b: Angle | None = Field(None, description="tool head angle")
    tool_speed: SpindleSpeed | None = Field(None, description="tool spindle speed")


class TableSection(Section):
    """The modes at one place."""

    at: PlaceSection = Field(description="place or speed of these modes")
    modes: tuple[ModeSection, ...] = Field(min_length=1, description="modes there")


class StructureSection(Section):
    """Vibration modes at the cutting point and the frame of their directions."""

    frame: Literal["machine", "tool", "rotating"] = Field(
        description="frame of direction and shape (docs/frames.md); rotating: turns with the spindle")
    modes: tuple[ModeSection, ...] = Field((), description="modes; a rigid structure is left out")
    table: tuple[TableSection, ...] = Field((), description="modes at several places or speeds, instead of modes")
    heights: tuple[Length, ...] = Field((), description="contact points above the tool tip; one point if left out")
    cross_modes: Literal["none", "symmetric", "rank-one"] | None = Field(
        None, description="how modes in xy, yz and xz are read; needed where there are some")
    coriolis: Literal["printed", "skew-symmetric"] = Field(
        "printed", description="Coriolis coupling of modes in the rotating frame")
    turning_damping: Literal["tool", "machine"] = Field(
        "tool", description="where the damping of modes in the rotating frame is fixed")

    @model_validator(mode="after")
    def _consistent(self) -> StructureSection:
        if bool(self.modes) == bool(self.table):
            raise PydanticCustomError("cross", "either modes or a table of modes")
        turning = self.frame == "rotating"
        every = (*self.modes, *(m for entry in self.table for m in entry.modes))
        if any((m.direction in ("u", "v")) != turning for m in every):
            raise PydanticCustomError("cross", "directions u and v in the rotating frame, and only there")
        cross = any(m.direction in CROSS_PLANES for m in self.modes)
        if cross != (self.cross_modes is not None):
            raise PydanticCustomError("cross", "cross_modes (none, symmetric, rank-one) where modes are in xy, yz, xz")
        if any(m.direction in CROSS_PLANES for entry in self.table for m in entry.modes):
            raise PydanticCustomError("cross", "modes with direction x, y, z, shape or shapes in a table")
        if len({frozenset(entry.at.model_dump(exclude_none=True)) for entry in self.table}) > 1:
            raise PydanticCustomError("cross", "the same axes in every place of the table")
        return self

    def value(self) -> Structure:
        """The structure."""
        table = None
        if self.table:
            places = [entry.at.model_dump(exclude_none=True) for entry in self.table]
            table = ModeTable(tuple(places[0]), tuple(tuple(p.values()) for p in places),
                              tuple(tuple(m.value() for m in entry.modes) for entry in self.table))
        cross = tuple(CrossMode(m.frequency, m.damping, m.mass, plane) for m in self.modes for plane in CROSS_PLANES
                      if m.direction == plane)
        modes = table.modes[0] if table else tuple(m.value() for m in self.modes if m.direction not in CROSS_PLANES)
        return Structure(modes, self.frame, self.heights, cross, self.cross_modes or "none", self.coriolis,
                         self.turning_damping, table)


class ChuckModeSection(Section):
    """One mode of the chuck's face."""

    frequency: Frequency = Field(description="undamped natural frequency of the chuck alone")
    damping: Ratio = Field(description="viscous damping ratio, in percent, below 100 %")
    mass: Mass = Field(description="modal mass at the face")
    pivot: PositiveLength | None = Field(
        None, description="from the face back to the point about which it rocks; no rotation if left out")


class ChuckSection(Section):
    """The chuck in one plane; a joint stiffness that is left out is rigid."""

    modes: tuple[ChuckModeSection, ...] = Field((), description="modes of the face; it stands still if left out")
    stiffness: Stiffness | None = Field(None, description="of the joint, against displacement")
    rotational_stiffness: RotationalStiffness | None = Field(None, description="of the joint, against rotation")
    damping: JointDamping = Field(0.0, description="of the joint, against displacement; 0 N*s/m if left out")
    rotational_damping: RotationalDamping = Field(
        0.0, description="of the joint, against rotation; 0 N*m*s/rad if left out")

    def value(self) -> Chuck:
        """The chuck."""
        modes = tuple(ChuckMode(m.frequency, m.damping, m.mass, m.pivot or math.inf) for m in self.modes)
        return Chuck(modes, self.stiffness or math.inf, self.rotational_stiffness or math.inf, self.damping,
                     self.rotational_damping)


class BeamMaterialSection(Section):
    """What the bar is made of."""

    youngs_modulus: PositivePressure = Field(description="Young's modulus")
    density: Density = Field(description="density")
    poisson_ratio: Number = Field(ge=0, lt=0.5, description="Poisson's ratio, a number from 0, below 0.5")
    loss_factor: Number = Field(0.0, ge=0, lt=1, description="loss factor of the material, a number from 0, below 1")


class SupportSection(Section):
    """Tailstock or steady rest."""

    position: Length = Field(description="from the free end face")
    stiffness: Stiffness = Field(description="stiffness of the support")
    damping: JointDamping = Field(0.0, description="damping of the support; 0 N*s/m if left out")


class BeamSection(Section):
    """A bar whose modes follow from its shape, its chuck and what has been cut away."""

    material: BeamMaterialSection
    chuck_x: ChuckSection | None = Field(None, description="chuck in the plane of x; clamped if left out")
    chuck_y: ChuckSection | None = Field(None, description="chuck in the plane of y; clamped if left out")
    supports: tuple[SupportSection, ...] = Field((), description="tailstock, steady rests")
    bore: Length = Field(0.0, description="diameter of a hole along the axis; 0 mm if left out")
    shear: Literal["cowper", "hutchinson"] = Field("cowper", description="shear coefficient of the beam")
    modes: int = Field(2, strict=True, ge=1, le=20, description="modes kept in each plane")

    def value(self) -> Beam:
        """The beam."""
        x, y = (Chuck() if chuck is None else chuck.value() for chuck in (self.chuck_x, self.chuck_y))
        return Beam(BeamMaterial(**self.material.model_dump()), x, y,
                    tuple(Support(s.position, s.stiffness, s.damping) for s in self.supports), self.bore, self.shear,
                    self.modes)


def structure_of(section: StructureSection | None, rigid: Structure) -> Structure:
    """The structure that a section describes; `rigid` where there is none."""
    return rigid if section is None else section.value()
