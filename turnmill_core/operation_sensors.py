"""Sensors of an operation: frozen values of its `sensors` section, in SI units and volts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .operation_checks import finite, positive, require

SensorKind = Literal["fibre probe", "microphone", "accelerometer", "dynamometer"]
Axis = Literal["x", "y", "z"]

MEASURED: dict[str, tuple[str, str]] = {
    "fibre probe": ("displacement", "m"), "microphone": ("sound_pressure", "Pa"),
    "accelerometer": ("acceleration", "m/s2"), "dynamometer": ("force", "N"),
}
"""Quantity and SI unit that a kind of sensor measures."""


@dataclass(frozen=True)
class Sensor:
    """One channel and its calibration: value = (volts - offset) / sensitivity.

    name: of the channel in the sensor blocks; kind. sensitivity [V per SI unit], its sign the sense of the sensor;
    offset [V]; lowest, highest [V]: range in which the calibration holds (linear range); direction: axis of the
    tool frame that it looks along; shape [1]: mode shape of the tool where a fibre probe looks at the shank, over
    that at the tool tip.
    """

    name: str
    kind: SensorKind
    sensitivity: float
    lowest: float
    highest: float
    offset: float = 0.0
    direction: Axis = "x"
    shape: float = 1.0

    def __post_init__(self) -> None:
        require(self.sensitivity != 0, f"sensitivity of sensor {self.name}", self.sensitivity,
                f"V/({MEASURED[self.kind][1]})", "a number that is not 0")
        finite(f"sensitivity of sensor {self.name}", self.sensitivity, "V")
        require(self.lowest < self.highest, f"highest of sensor {self.name}", self.highest, "V",
                f"more than lowest, {self.lowest} V")
        require(self.lowest <= self.offset <= self.highest, f"offset of sensor {self.name}", self.offset, "V",
                f"a voltage between lowest, {self.lowest} V, and highest, {self.highest} V")
        positive(f"shape of sensor {self.name}", self.shape, "")


@dataclass(frozen=True)
class Fixture:
    """What holds the fibre probes, and moves with the cutting force itself: one mode (thesis Fig. 4.50).

    frequency [Hz]; damping [1]; cross_talk [m/N]: static displacement of the probes' casing per cutting force at the
    tool tip, in the direction of the force.
    """

    frequency: float
    damping: float
    cross_talk: float

    def __post_init__(self) -> None:
        positive("fixture frequency", self.frequency, "Hz")
        require(0 < self.damping < 1, "fixture damping", self.damping, "", "a ratio in (0, 1)")
        positive("fixture cross_talk", self.cross_talk, "m/N")


@dataclass(frozen=True)
class Sensors:
    """Channels, each name once, and the fixture of the probes (None: rigid)."""

    channels: tuple[Sensor, ...] = ()
    fixture: Fixture | None = None

    def __post_init__(self) -> None:
        names = [c.name for c in self.channels]
        require(len(set(names)) == len(names), "sensor names", names, "", "each name once")


NO_SENSORS = Sensors()
