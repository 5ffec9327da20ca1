"""Shape of an operation file, schema version 1: keys, units and bounds (pydantic models).

Numbers are in SI units once a model is made. Keys may be added in a later version of the package
without a new schema number as long as old files keep their meaning.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, model_validator
from pydantic_core import PydanticCustomError

from .operation_cutter_schema import ProfilePoint, ShapeSection
from .operation_limits_schema import LimitsSection
from .operation_sensors_schema import SensorsSection
from .operation_stability_schema import ProcessDampingSection, TrialSection
from .operation_structure_schema import BeamSection, StructureSection
from .operation_units import (
    Angle,
    EdgeForce,
    FeedPerRevolution,
    Length,
    PositiveAngle,
    PositiveLength,
    PositivePressure,
    PositiveSpeed,
    Pressure,
    Section,
    SignedSpeed,
    SpindleSpeed,
    Text,
    Time,
)

SCHEMA_VERSION = 1


class ToolSection(Section):
    """End mill or face mill, a cylinder unless a shape is given."""

    name: Text = Field(description="tool, for people")
    diameter: PositiveLength = Field(description="diameter at the cutting edges")
    teeth: int = Field(strict=True, ge=1, le=200, description="number of teeth")
    helix_angle: Angle = Field(0.0, description="helix angle, 0 deg if left out")
    flute_length: PositiveLength | None = Field(None, description="longest axial depth, no limit if left out")
    pitch_angles: tuple[PositiveAngle, ...] = Field(
        (), description="from each tooth to the next, one per tooth, sum 360 deg; equal pitch if left out")
    runout: tuple[Length, ...] = Field((), description="radial offset of each tooth; none if left out")
    shape: ShapeSection | None = Field(None, description="corner, tip and taper; a cylinder if left out")
    structure: StructureSection | None = Field(None, description="tool modes; rigid if left out")


class BarSection(Section):
    """Round bar on the workpiece spindle."""

    name: Text = Field(description="workpiece, for people")
    diameter: PositiveLength = Field(description="diameter before the cut")
    length: PositiveLength = Field(description="length from the free end face to the chuck")
    datum: tuple[Length, Length, Length] = Field(
        (0.0, 0.0, 0.0), description="machine coordinates of the centre of the free end face")
    profile: tuple[ProfilePoint, ...] = Field(
        (), description="stepped or curved stock from the free end to the chuck; a cylinder if left out")
    structure: StructureSection | None = Field(None, description="workpiece modes; rigid if left out")
    beam: BeamSection | None = Field(None, description="workpiece modes from its shape, instead of structure")

    @model_validator(mode="after")
    def _one_structure(self) -> BarSection:
        if self.structure is not None and self.beam is not None:
            raise PydanticCustomError("cross", "either structure or beam")
        return self


class BlockSection(Section):
    """Rectangular block on the table."""

    name: Text = Field(description="workpiece, for people")
    length: PositiveLength = Field(description="size along x, the feed")
    width: PositiveLength = Field(description="size along y")
    height: PositiveLength = Field(description="size along z, the tool axis")
    datum: tuple[Length, Length, Length] = Field(
        (0.0, 0.0, 0.0), description="machine coordinates of the corner with the lowest x and y on the top face")
    structure: StructureSection | None = Field(None, description="workpiece modes; rigid if left out")


class MaterialSection(Section):
    """Cutting force coefficients, or an alloy of the database and the rake angle that they follow from."""

    name: Text | None = Field(None, description="work material, for people; the alloy's name if left out")
    Ktc: PositivePressure | None = Field(None, description="tangential, per chip area")
    Krc: Pressure | None = Field(None, description="radial, per chip area")
    Kac: Pressure | None = Field(None, description="axial, per chip area")
    Kte: EdgeForce | None = Field(None, description="tangential, per edge length; 0 N/mm if left out")
    Kre: EdgeForce | None = Field(None, description="radial, per edge length; 0 N/mm if left out")
    Kae: EdgeForce | None = Field(None, description="axial, per edge length; 0 N/mm if left out")
    alloy: Text | None = Field(
        None, description="alloy of the database (turnmill operation --alloys), in place of coefficients")
    rake_angle: Angle | None = Field(None, description="normal rake angle of the edges, with an alloy")
    chip_thickness: PositiveLength | None = Field(
        None, description="chip at which an alloy's data are taken; the mean chip of the nominal cut if left out")

    @model_validator(mode="after")
    def _coefficients_or_alloy(self) -> MaterialSection:
        given = {key for key, value in self if value is not None}
        own, alloy = {"name", "Ktc", "Krc", "Kac"}, {"alloy", "rake_angle"}
        if not (own <= given <= own | {"Kte", "Kre", "Kae"} or alloy <= given <= alloy | {"name", "chip_thickness"}):
            raise PydanticCustomError(
                "cross", "either name, Ktc, Krc, Kac (and Kte, Kre, Kae), or alloy and rake_angle (and chip_thickness)")
        return self


class TurnMillingCut(Section):
    """Nominal cut of orthogonal turn-milling."""

    tool_speed: PositiveSpeed = Field(description="tool spindle speed, clockwise seen from the spindle")
    workpiece_speed: SignedSpeed = Field(description="workpiece spindle speed about +z of the machine, signed, not 0")
    depth: PositiveLength = Field(description="depth of cut along the tool axis")
    axial_feed: FeedPerRevolution = Field(
        description="feed along the bar per workpiece revolution = radial immersion; at most the tool radius")
    sense: Literal["up", "down"] = Field(
        description="up- or down-milling; with the sign of workpiece_speed it gives the direction of the axial feed")
    eccentricity: Length = Field(
        0.0, description="offset of the tool axis from the workpiece axis along +y of the machine, 0 mm if left out")
    tilt: Angle = Field(0.0, description="B angle beyond 90 degrees, 0 deg if left out")


class MillingCut(Section):
    """Nominal cut of milling; the tool feeds along +x."""

    tool_speed: PositiveSpeed = Field(description="tool spindle speed, clockwise seen from the spindle")
    depth: PositiveLength = Field(description="axial depth of cut")
    feed_per_tooth: PositiveLength = Field(description="feed per tooth")
    sense: Literal["up", "down", "slot", "centred"] = Field(description="side of the tool that cuts")
    radial_immersion: PositiveLength | None = Field(
        None, description="radial width of cut; left out in a slot (tool diameter) and centred (block width)")


class TurnMillingPoint(Section):
    """Set values at one time; linear in between."""

    time: Time = Field(description="time since the start")
    tool_speed: SpindleSpeed = Field(description="tool spindle speed")
    workpiece_speed: SignedSpeed = Field(description="workpiece spindle speed")
    depth: Length = Field(description="depth of cut; negative is clearance")


class MillingPoint(Section):
    """Set values at one time; linear in between."""

    time: Time = Field(description="time since the start")
    tool_speed: SpindleSpeed = Field(description="tool spindle speed")
    depth: Length = Field(description="depth of cut; negative is clearance")


class _Common(Section):
    schema_version: Literal[1] = Field(alias="schema", description="version of this format")
    name: Text = Field(description="operation, for people")
    machine: Text = Field(description="machine tool, for people")
    sources: str = Field("", max_length=20000, description="where the numbers come from, and what is assumed")
    tool: ToolSection
    material: MaterialSection
    process_damping: ProcessDampingSection | None = Field(
        None, description="damping by the flank at low cutting speed; none if left out")
    trials: tuple[TrialSection, ...] = Field((), description="cuts that were made, shown beside computed stability")
    limits: LimitsSection | None = Field(None, description="what machine, tool and part allow; no limits if left out")
    sensors: SensorsSection | None = Field(None, description="calibration of channels in volts; none if left out")


class TurnMillingFile(_Common):
    """Orthogonal turn-milling of a round bar."""

    process: Literal["turn-milling"]
    workpiece: BarSection
    cut: TurnMillingCut
    schedule: tuple[TurnMillingPoint, ...] = Field(
        (), description="what the simulated controller runs; the nominal cut if left out")


class MillingFile(_Common):
    """Milling of a rectangular block."""

    process: Literal["milling"]
    workpiece: BlockSection
    cut: MillingCut
    schedule: tuple[MillingPoint, ...] = Field(
        (), description="what the simulated controller runs; the nominal cut if left out")


OperationFile = Annotated[TurnMillingFile | MillingFile, Field(discriminator="process")]
ADAPTER: TypeAdapter[TurnMillingFile | MillingFile] = TypeAdapter(OperationFile)


def operation_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of an operation file, with descriptions and unit hints.

    Every quantity is a string with its unit; "x-unit" names the SI unit it is stored in and
    "x-bound" whether it must be positive.
    """
    schema = ADAPTER.json_schema(by_alias=True)
    for section in schema["$defs"].values():
        for node in section["properties"].values():
            if "x-unit" in node and "default" in node:
                node["default"] = f"{node['default']:g} {node['x-unit']}"
            elif "datum" in section["properties"] and node.get("default") == [0.0] * 3:
                node["default"] = ["0 m"] * 3
            elif node.get("default", 0) is None:
                del node["default"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"turnmill operation, schema {SCHEMA_VERSION}",
        **schema,
    }
