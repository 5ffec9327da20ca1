"""Building blocks of the operation file's sections: quantities with units and bounds, texts, the section itself.

Each room's sections (operation_schema.py and the operation_*_schema.py files) are made of these.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from .operation_quantity import KINDS, Bound, quantity_value


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


Length = Annotated[float, _Unit("m")]
PositiveLength = Annotated[float, _Unit("m", "positive")]
Angle = Annotated[float, _Unit("rad")]
PositiveAngle = Annotated[float, _Unit("rad", "positive")]
Time = Annotated[float, _Unit("s", "not negative")]
PositiveSpeed = Annotated[float, _Unit("rad/s", "positive")]
SpindleSpeed = Annotated[float, _Unit("rad/s", "not negative")]
SignedSpeed = Annotated[float, _Unit("rad/s")]
Frequency = Annotated[float, _Unit("Hz", "positive")]
Ratio = Annotated[float, _Unit("%", "positive")]
Mass = Annotated[float, _Unit("kg", "positive")]
PositivePressure = Annotated[float, _Unit("Pa", "positive")]
Pressure = Annotated[float, _Unit("Pa")]
EdgeForce = Annotated[float, _Unit("N/m", "not negative")]
Indentation = Annotated[float, _Unit("N/m^3", "positive")]
FeedPerRevolution = Annotated[float, _Unit("m/rev", "positive")]
PositiveTime = Annotated[float, _Unit("s", "positive")]
Velocity = Annotated[float, _Unit("m/s", "positive")]
Force = Annotated[float, _Unit("N", "positive")]
Torque = Annotated[float, _Unit("N*m", "positive")]
Power = Annotated[float, _Unit("W", "positive")]
Stiffness = Annotated[float, _Unit("N*m^-1", "positive")]
RotationalStiffness = Annotated[float, _Unit("N*m/rad", "positive")]
JointDamping = Annotated[float, _Unit("N*s/m", "not negative")]
RotationalDamping = Annotated[float, _Unit("N*m*s/rad", "not negative")]
Density = Annotated[float, _Unit("kg/m^3", "positive")]
Twist = Annotated[float, _Unit("rad/m")]
Compliance = Annotated[float, _Unit("m/N", "positive")]
Voltage = Annotated[float, _Unit("V")]
Noise = Annotated[float, _Unit("V", "not negative")]
Runout = Annotated[float, _Unit("m", "not negative")]

Text = Annotated[str, Field(min_length=1, max_length=200)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class Section(BaseModel):
    """A mapping of the file: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)
