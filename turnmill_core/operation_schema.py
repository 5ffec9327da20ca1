"""Shape of an operation file, schema version 1: keys, units and bounds (pydantic models).

Numbers are in SI units once a model is made. Keys may be added in a later version of the package
without a new schema number as long as old files keep their meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from .operation_quantity import KINDS, Bound, quantity_value

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class _Unit:
    """Annotation of a quantity: a text with its unit in the file, a float in SI units in the model."""

    unit: str
    bound: Bound = "any"

    def _parse(self, text: object) -> float:
        try:
            return quantity_value(text, KINDS[self.unit], self.bound)
        except ValueError as error:
            raise PydanticCustomError(
                "quantity", "{reason}", {"reason": str(error).removeprefix("expected ")}
            ) from None

    def __get_pydantic_core_schema__(self, source: type, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self._parse)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        example = KINDS[self.unit].example
        return {"type": "string", "examples": [example], "x-unit": self.unit, "x-bound": self.bound}


_Length = Annotated[float, _Unit("m")]
_PositiveLength = Annotated[float, _Unit("m", "positive")]
_Angle = Annotated[float, _Unit("rad")]
_PositiveAngle = Annotated[float, _Unit("rad", "positive")]
_Time = Annotated[float, _Unit("s", "not negative")]
_PositiveSpeed = Annotated[float, _Unit("rad/s", "positive")]
_SpindleSpeed = Annotated[float, _Unit("rad/s", "not negative")]
_SignedSpeed = Annotated[float, _Unit("rad/s")]
_Frequency = Annotated[float, _Unit("Hz", "positive")]
_Ratio = Annotated[float, _Unit("%", "positive")]
_Mass = Annotated[float, _Unit("kg", "positive")]
_PositivePressure = Annotated[float, _Unit("Pa", "positive")]
_Pressure = Annotated[float, _Unit("Pa")]
_EdgeForce = Annotated[float, _Unit("N/m", "not negative")]
_FeedPerRevolution = Annotated[float, _Unit("m/rev", "positive")]

_Text = Annotated[str, Field(min_length=1, max_length=200)]
_Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ModeSection(_Section):
    """One vibration mode at the cutting point: direction (a direct mode) or shape."""

    direction: Literal["x", "y", "z"] | None = Field(None, description="direct mode along this axis of the frame")
    shape: tuple[_Number, _Number, _Number] | None = Field(
        None, description="mode shape (x, y, z) at the cutting point, numbers without unit, for the modal mass given")
    frequency: _Frequency = Field(description="undamped natural frequency")
    damping: _Ratio = Field(description="viscous damping ratio, in percent, below 100 %")
    mass: _Mass = Field(description="modal mass")

    @model_validator(mode="after")
    def _one_shape(self) -> ModeSection:
        if (self.direction is None) == (self.shape is None):
            raise PydanticCustomError("cross", "either direction (x, y or z) or shape (three numbers)")
        if self.shape is not None and not any(self.shape):
            raise PydanticCustomError("cross", "a mode shape that is not all zero")
        if self.damping >= 1:
            raise PydanticCustomError("cross", "a damping ratio below 100 %")
        return self


class StructureSection(_Section):
    """Vibration modes at the cutting point and the frame of their directions."""

    frame: Literal["machine", "tool"] = Field(description="frame of direction and shape (docs/frames.md)")
    modes: tuple[ModeSection, ...] = Field(min_length=1, description="modes; a rigid structure is left out")


class ToolSection(_Section):
    """Cylindrical end mill or face mill."""

    name: _Text = Field(description="tool, for people")
    diameter: _PositiveLength = Field(description="diameter at the cutting edges")
    teeth: int = Field(strict=True, ge=1, le=200, description="number of teeth")
    helix_angle: _Angle = Field(0.0, description="helix angle, 0 deg if left out")
    flute_length: _PositiveLength | None = Field(None, description="longest axial depth, no limit if left out")
    pitch_angles: tuple[_PositiveAngle, ...] = Field(
        (), description="from each tooth to the next, one per tooth, sum 360 deg; equal pitch if left out")
    runout: tuple[_Length, ...] = Field((), description="radial offset of each tooth; none if left out")
    structure: StructureSection | None = Field(None, description="tool modes; rigid if left out")


class BarSection(_Section):
    """Round bar on the workpiece spindle."""

    name: _Text = Field(description="workpiece, for people")
    diameter: _PositiveLength = Field(description="diameter before the cut")
    length: _PositiveLength = Field(description="length from the free end face to the chuck")
    datum: tuple[_Length, _Length, _Length] = Field(
        (0.0, 0.0, 0.0), description="machine coordinates of the centre of the free end face")
    structure: StructureSection | None = Field(None, description="workpiece modes; rigid if left out")


class BlockSection(_Section):
    """Rectangular block on the table."""

    name: _Text = Field(description="workpiece, for people")
    length: _PositiveLength = Field(description="size along x, the feed")
    width: _PositiveLength = Field(description="size along y")
    height: _PositiveLength = Field(description="size along z, the tool axis")
    datum: tuple[_Length, _Length, _Length] = Field(
        (0.0, 0.0, 0.0), description="machine coordinates of the corner with the lowest x and y on the top face")
    structure: StructureSection | None = Field(None, description="workpiece modes; rigid if left out")


class MaterialSection(_Section):
    """Cutting force coefficients."""

    name: _Text = Field(description="work material, for people")
    Ktc: _PositivePressure = Field(description="tangential, per chip area")
    Krc: _Pressure = Field(description="radial, per chip area")
    Kac: _Pressure = Field(description="axial, per chip area")
    Kte: _EdgeForce = Field(0.0, description="tangential, per edge length; 0 N/mm if left out")
    Kre: _EdgeForce = Field(0.0, description="radial, per edge length; 0 N/mm if left out")
    Kae: _EdgeForce = Field(0.0, description="axial, per edge length; 0 N/mm if left out")


class TurnMillingCut(_Section):
    """Nominal cut of orthogonal turn-milling."""

    tool_speed: _PositiveSpeed = Field(description="tool spindle speed, clockwise seen from the spindle")
    workpiece_speed: _SignedSpeed = Field(description="workpiece spindle speed about +z of the machine, signed, not 0")
    depth: _PositiveLength = Field(description="depth of cut along the tool axis")
    axial_feed: _FeedPerRevolution = Field(
        description="feed along the bar per workpiece revolution = radial immersion; at most the tool radius")
    sense: Literal["up", "down"] = Field(
        description="up- or down-milling; with the sign of workpiece_speed it gives the direction of the axial feed")


class MillingCut(_Section):
    """Nominal cut of milling; the tool feeds along +x."""

    tool_speed: _PositiveSpeed = Field(description="tool spindle speed, clockwise seen from the spindle")
    depth: _PositiveLength = Field(description="axial depth of cut")
    feed_per_tooth: _PositiveLength = Field(description="feed per tooth")
    sense: Literal["up", "down", "slot", "centred"] = Field(description="side of the tool that cuts")
    radial_immersion: _PositiveLength | None = Field(
        None, description="radial width of cut; left out in a slot (tool diameter) and centred (block width)")


class TurnMillingPoint(_Section):
    """Set values at one time; linear in between."""

    time: _Time = Field(description="time since the start")
    tool_speed: _SpindleSpeed = Field(description="tool spindle speed")
    workpiece_speed: _SignedSpeed = Field(description="workpiece spindle speed")
    depth: _Length = Field(description="depth of cut; negative is clearance")


class MillingPoint(_Section):
    """Set values at one time; linear in between."""

    time: _Time = Field(description="time since the start")
    tool_speed: _SpindleSpeed = Field(description="tool spindle speed")
    depth: _Length = Field(description="depth of cut; negative is clearance")


class _Common(_Section):
    schema_version: Literal[1] = Field(alias="schema", description="version of this format")
    name: _Text = Field(description="operation, for people")
    machine: _Text = Field(description="machine tool, for people")
    sources: str = Field("", max_length=20000, description="where the numbers come from, and what is assumed")
    tool: ToolSection
    material: MaterialSection


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
