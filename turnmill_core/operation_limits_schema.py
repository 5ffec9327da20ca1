"""The `limits` section of an operation file: keys, units and bounds, and the values made from it."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from .operation_limits import Limits, Rating
from .operation_units import (
    Force,
    PositiveLength,
    PositiveSpeed,
    PositiveTime,
    Power,
    Ratio,
    Section,
    Text,
    Torque,
    Velocity,
)


class ChartPoint(Section):
    """One point of a torque-power chart: a speed with either its power or its torque."""

    speed: PositiveSpeed = Field(description="spindle speed")
    power: Power | None = Field(None, description="power at this speed")
    torque: Torque | None = Field(None, description="torque at this speed, instead of power")

    @model_validator(mode="after")
    def _one_load(self) -> ChartPoint:
        if (self.power is None) == (self.torque is None):
            raise PydanticCustomError("cross", "either power or torque")
        return self

    @property
    def watts(self) -> float:
        """Power [W]."""
        return self.power if self.power is not None else self.speed * (self.torque or 0.0)


class RatingSection(Section):
    """One curve of a spindle's torque-power chart."""

    rating: Text = Field(description="the rating, for people")
    points: tuple[ChartPoint, ...] = Field(
        min_length=1, description="ascending speeds; power is linear in speed between them, torque constant below")
    duration: PositiveTime | None = Field(None, description="how long it is given; continuous if left out")
    load: Literal["peak", "mean"] = Field(
        "peak", description="what it bounds: the largest torque of a tool revolution, or the mean")


class LimitsSection(Section):
    """What machine, tool and part allow; a limit that is left out does not exist."""

    chip_load: Literal["thickness", "feed per tooth"] = Field(
        "thickness", description="what chip_load_min and chip_load_max bound: the largest chip thickness in the arc, "
        "or the resultant feed per tooth at the surface of the bar")
    chip_load_min: PositiveLength | None = Field(None, description="least chip load; below it the edge rubs")
    chip_load_max: PositiveLength | None = Field(None, description="largest chip load")
    cutting_speed_min: Velocity | None = Field(None, description="least cutting speed")
    cutting_speed_max: Velocity | None = Field(None, description="largest cutting speed")
    tool_speed_min: PositiveSpeed | None = Field(None, description="least speed of the tool spindle")
    tool_speed_max: PositiveSpeed | None = Field(None, description="largest speed of the tool spindle")
    workpiece_speed_max: PositiveSpeed | None = Field(None, description="largest speed of the workpiece spindle")
    depth_max: PositiveLength | None = Field(None, description="largest depth of cut")
    feed_speed_max: Velocity | None = Field(None, description="largest speed of the linear axes")
    tool_force_max: Force | None = Field(None, description="largest force across the tool axis")
    feed_force_max: Force | None = Field(None, description="largest force along the linear axis that feeds")
    form_error_max: PositiveLength | None = Field(None, description="largest surface form error")
    stability_margin: Ratio | None = Field(None, description="share of the depth limit kept as reserve; 0 if left out")
    tool_spindle: tuple[RatingSection, ...] = Field((), description="torque-power chart of the tool spindle")
    workpiece_spindle: tuple[RatingSection, ...] = Field((), description="torque-power chart of the workpiece spindle")


def limits_of(section: LimitsSection | None) -> Limits:
    """Values of the section, or no limits at all. Raises ValueError where they contradict each other."""
    if section is None:
        return Limits()
    given = {key: value for key in LimitsSection.model_fields if (value := getattr(section, key)) is not None}
    for spindle in ("tool_spindle", "workpiece_spindle"):
        given[spindle] = tuple(
            Rating(r.rating, tuple(p.speed for p in r.points), tuple(p.watts for p in r.points),
                   math.inf if r.duration is None else r.duration, r.load) for r in getattr(section, spindle))
    return Limits(**given)
