"""The `sensors` section of an operation file: keys, units and bounds, and the values made from it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from .operation_quantity import KINDS, quantity_value
from .operation_sensors import Fixture, Sensor, SensorKind, Sensors
from .operation_units import Compliance, Frequency, Noise, Ratio, Runout, Section, Text, Voltage

SENSITIVITY = {"fibre probe": "V/m", "microphone": "V/Pa", "accelerometer": "V*s^2/m", "dynamometer": "V/N"}
"""Unit of the sensitivity of each kind of sensor."""


class ChannelSection(Section):
    """One channel whose blocks hold volts, and its calibration."""

    name: Text = Field(description="name of the channel in the sensor blocks")
    kind: SensorKind = Field(description="what kind of sensor it is")
    sensitivity: Text = Field(description="signed voltage per displacement (5.8 mV/um), sound pressure (50 mV/Pa), "
                                          "acceleration (10.2 mV*s^2/m) or force (2 mV/N)")
    offset: Voltage = Field(0.0, description="voltage at zero, 0 V if left out")
    lowest: Voltage = Field(description="lower end of the linear range")
    highest: Voltage = Field(description="upper end of the linear range; beyond it the channel is saturated")
    direction: Literal["x", "y", "z"] = Field("x", description="axis of the tool frame that it looks along")
    shape: Ratio | None = Field(None, description="fibre probes, accelerometers: mode shape where it looks or sits, "
                                                  "over that at the tool tip, in percent")
    noise: Noise | None = Field(None, description="in the simulation, rms; typical of the kind if left out")
    runout: tuple[Runout, ...] = Field((), description="in the simulation, fibre probes: amplitude of the shank's "
                                                       "out-of-roundness at 1, 2, ... cycles per revolution")

    @model_validator(mode="after")
    def _belongs_together(self) -> ChannelSection:
        try:
            quantity_value(self.sensitivity, KINDS[SENSITIVITY[self.kind]])
        except ValueError as error:
            reason = str(error).removeprefix("expected ")
            raise PydanticCustomError("cross", "{reason}", {"reason": f"as sensitivity {reason}"}) from None
        if (self.kind == "fibre probe" and self.shape is None) or (
                self.kind not in ("fibre probe", "accelerometer") and self.shape is not None):
            raise PydanticCustomError("cross", "a shape for a fibre probe, and for nothing else but an accelerometer")
        if self.kind != "fibre probe" and self.runout:
            raise PydanticCustomError("cross", "a runout for a fibre probe only")
        return self


class FixtureSection(Section):
    """Fixture of the fibre probes."""

    frequency: Frequency = Field(description="natural frequency of the fixture")
    damping: Ratio = Field(description="viscous damping ratio, in percent, below 100 %")
    cross_talk: Compliance = Field(description="static displacement of the probes' casing per cutting force")


class SensorsSection(Section):
    """Sensors whose blocks hold volts, and their calibration."""

    channels: tuple[ChannelSection, ...] = Field(min_length=1, description="one entry per channel")
    fixture: FixtureSection | None = Field(None, description="what holds the fibre probes; rigid if left out")
    judged: Text | None = Field(None, description="channel that the monitor judges: the name of a sensor, or tip_x or "
                                                  "tip_y, the tool tip's motion; the first usable if left out")


def sensors_of(section: SensorsSection | None) -> Sensors:
    """Values of the section, or no sensors at all. Raises ValueError where they contradict each other."""
    if section is None:
        return Sensors()
    fixture = section.fixture
    return Sensors(tuple(
        Sensor(c.name, c.kind, quantity_value(c.sensitivity, KINDS[SENSITIVITY[c.kind]]), c.lowest, c.highest, c.offset,
               c.direction, 1.0 if c.shape is None else c.shape, c.noise, c.runout) for c in section.channels),
        None if fixture is None else Fixture(fixture.frequency, fixture.damping, fixture.cross_talk),
        section.judged or "")
