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

TYPICAL_NOISE: dict[str, float] = {
    "fibre probe": 5e-8, "microphone": 1e-3, "accelerometer": 5e-3, "dynamometer": 0.5,
}
"""Noise of a kind of sensor with its amplifier, rms in the unit that it measures, where a sensor gives none (assumed:
50 nm; 34 dB of sound; 0.5 mg; the noise of a charge amplifier in a range of some kN)."""

TIP_CHANNELS = ("tip_x", "tip_y")
"""Names under which the monitor judges the tool tip's motion that it finds from the fibre probes."""

LEAST_SPREAD = 0.05
"""Relative difference of mode shapes below which probes cannot tell the tool from their casing."""


@dataclass(frozen=True)
class Sensor:
    """One channel and its calibration: value = (volts - offset) / sensitivity.

    name: of the channel in the sensor blocks; kind. sensitivity [V per SI unit], its sign the sense of the sensor;
    offset [V]; lowest, highest [V]: range in which the calibration holds (linear range); direction: axis of the
    tool frame that it looks along; shape [1]: mode shape of the tool where a fibre probe looks at the shank or an
    accelerometer sits, over that at the tool tip. The simulation alone uses noise [V rms, None: typical of the kind]
    and runout [m], for fibre probes: amplitude of the shank's out-of-roundness at 1, 2, ... cycles per revolution.
    """

    name: str
    kind: SensorKind
    sensitivity: float
    lowest: float
    highest: float
    offset: float = 0.0
    direction: Axis = "x"
    shape: float = 1.0
    noise: float | None = None
    runout: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        require(self.name not in TIP_CHANNELS, "sensor name", self.name, "",
                f"another one: {' and '.join(TIP_CHANNELS)} are found from the fibre probes")
        require(self.sensitivity != 0, f"sensitivity of sensor {self.name}", self.sensitivity,
                f"V/({MEASURED[self.kind][1]})", "a number that is not 0")
        finite(f"sensitivity of sensor {self.name}", self.sensitivity, "V")
        require(self.lowest < self.highest, f"highest of sensor {self.name}", self.highest, "V",
                f"more than lowest, {self.lowest} V")
        require(self.lowest <= self.offset <= self.highest, f"offset of sensor {self.name}", self.offset, "V",
                f"a voltage between lowest, {self.lowest} V, and highest, {self.highest} V")
        positive(f"shape of sensor {self.name}", self.shape, "")
        require(self.noise is None or self.noise >= 0, f"noise of sensor {self.name}", self.noise, "V", "a number >= 0")
        require(all(r >= 0 for r in self.runout), f"runout of sensor {self.name}", self.runout, "m", "lengths >= 0")

    @property
    def noise_rms(self) -> float:
        """Noise of the channel [V rms]."""
        return TYPICAL_NOISE[self.kind] * abs(self.sensitivity) if self.noise is None else self.noise


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
    """Channels, each name once, and the fixture of the probes (None: rigid).

    judged: channel that the monitor judges, a sensor or one of TIP_CHANNELS (empty: the first usable).
    """

    channels: tuple[Sensor, ...] = ()
    fixture: Fixture | None = None
    judged: str = ""

    def __post_init__(self) -> None:
        names = [c.name for c in self.channels]
        require(len(set(names)) == len(names), "sensor names", names, "", "each name once")
        if self.judged in TIP_CHANNELS:
            self.probes(self.judged[-1])
        else:
            require(self.judged in ("", *names), "judged sensor", self.judged, "",
                    f"one of {', '.join([*names, *TIP_CHANNELS])}")

    def probes(self, axis: str) -> tuple[Sensor, ...]:
        """Fibre probes that look along an axis of the tool frame and tell the tool tip's motion along it.

        Raises ValueError where there is none, or, with a fixture, only one or only probes of one shape.
        """
        found = tuple(c for c in self.channels if c.kind == "fibre probe" and c.direction == axis)
        if not found:
            raise ValueError(f"no fibre probe looks along {axis}, expected at least one")
        shapes = [p.shape for p in found]
        if self.fixture is not None and max(shapes) - min(shapes) < LEAST_SPREAD * max(shapes):
            raise ValueError(f"shape of the probes along {axis} is {shapes}, expected values that differ by 5 % or "
                             "more: probes at one height cannot tell the tool from the casing")
        return found


NO_SENSORS = Sensors()
