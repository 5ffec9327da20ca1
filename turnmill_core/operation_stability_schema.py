"""Sections `process_damping` and `trials` of an operation file: keys, units, bounds, and the values made from them."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from .operation_stability import ProcessDamping, Trial, flank_contact_length
from .operation_units import (
    Frequency,
    Indentation,
    PositiveAngle,
    PositiveLength,
    PositiveSpeed,
    Ratio,
    Section,
    SignedSpeed,
    Text,
)


class ProcessDampingSection(Section):
    """Damping by the flank at low cutting speed; the contact length is given, or follows from the edge."""

    indentation: Indentation = Field(description="specific indentation coefficient of the material, K_sp")
    friction: Ratio | None = Field(None, description="tangential over radial flank force, in percent; 0 if left out")
    contact_length: PositiveLength | None = Field(None, description="length of flank on the surface, L_w")
    hone_radius: PositiveLength | None = Field(None, description="radius of the cutting edge (Eq. 4.72)")
    separation_angle: PositiveAngle | None = Field(None, description="where chip and flank part on the hone")
    clearance_angle: PositiveAngle | None = Field(None, description="of the flank, below 90 deg")

    @model_validator(mode="after")
    def _one_length(self) -> ProcessDampingSection:
        edge = [self.hone_radius, self.separation_angle, self.clearance_angle]
        given = sum(v is not None for v in edge)
        if (self.contact_length is None) != (given == 3) or given not in (0, 3):
            raise PydanticCustomError(
                "cross", "either contact_length, or hone_radius, separation_angle and clearance_angle")
        if self.clearance_angle is not None and self.clearance_angle >= math.pi / 2:
            raise PydanticCustomError("cross", "a clearance angle below 90 deg")
        return self


class TrialSection(Section):
    """One cut that was made, to be shown beside the computed stability."""

    tool_speed: PositiveSpeed = Field(description="tool spindle speed")
    workpiece_speed: SignedSpeed | None = Field(None, description="workpiece spindle speed; the cut's if left out")
    depth: PositiveLength = Field(description="depth of cut")
    outcome: Literal["stable", "marginal", "chatter"] = Field(description="what came of it")
    chatter_frequency: Frequency | None = Field(None, description="measured, where there was chatter")
    note: Text = Field("", min_length=0, description="for people: the point's name, where it is reported")


def process_damping_of(section: ProcessDampingSection | None) -> ProcessDamping | None:
    """The value of the section, None where there is none."""
    if section is None:
        return None
    length, hone = section.contact_length, section.hone_radius
    separation, clearance = section.separation_angle, section.clearance_angle
    if hone is not None and separation is not None and clearance is not None:
        length = flank_contact_length(hone, separation, clearance)
    assert length is not None
    return ProcessDamping(section.indentation, length, section.friction or 0.0)


def trials_of(sections: tuple[TrialSection, ...], workpiece_speed: float) -> tuple[Trial, ...]:
    """The values of the sections; workpiece_speed [rad/s]: of those that name none."""
    return tuple(
        Trial(t.tool_speed, workpiece_speed if t.workpiece_speed is None else t.workpiece_speed, t.depth, t.outcome,
              t.chatter_frequency, t.note) for t in sections)
