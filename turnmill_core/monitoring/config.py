"""Settings of the chatter monitor."""

from __future__ import annotations

import math
from dataclasses import dataclass

from turnmill_core.operation import Operation, require
from turnmill_core.operation_sensors import NO_SENSORS, Sensors


@dataclass(frozen=True)
class ChatterConfig:
    """What the monitor knows of the tool, how it cuts windows and where its thresholds lie.

    teeth; nominal_speed [rad/s], declared spindle speed (0: none); equal_pitch: False for variable
    pitch, whose chatter families repeat with the spindle frequency; nominal_chatter_band [Hz],
    lower and upper end of the band in which lines are judged.

    window [s] and revolutions: a window lasts max(window, revolutions at the speed of its end), at
    most longest_window [s]; hop [s] between windows.
    device, channel: the judged device and channel; empty: the first seen, the first usable. tip_x, tip_y: the
    tool tip's motion, found from the fibre probes among the sensors.
    fallback: judge the next usable channel where the chosen one is dead or saturated.

    expect_axes: windows wait for spindle speeds that cover their end, at most speed_timeout [s] of
    stamps. nominal_band: half width of the search for the true speed, relative to the axis or the nominal
    speed; axis_band: half width of its refinement around what was found. recorded_priors: windows wait
    for their RecordedPrior.

    noise_floor: root mean square of the signal out of the cut, in the channel's unit (None:
    learned). gate_ratio: level over floor that shows a cut.
    enter_ratio, leave_ratio: asynchronous (or half-order) energy over total energy at which chatter
    begins and ends; an amplitude of 20 % of the synchronous one is an energy of 0.04.
    sensors: calibration of channels in volts.
    runout_share: share of half-order lines in the cutting force's energy that a known runout gives (NaN: not known).

    enter_dwell, lone_dwell, leave_dwell, marginal_dwell, cut_dwell: windows in a row that must agree before chatter
    begins in a cut, before it begins where nothing but the chatter shows a cut, before it ends,
    before the cut is called marginal, and before the state changes between air and cut.
    """

    teeth: int
    nominal_speed: float = 0.0
    equal_pitch: bool = True
    band: tuple[float, float] = (40.0, 5000.0)
    window: float = 0.2
    revolutions: float = 10.0
    longest_window: float = 2.0
    hop: float = 0.05
    device: str = ""
    channel: str = ""
    fallback: bool = False
    expect_axes: bool = True
    speed_timeout: float = 2.0
    axis_band: float = 0.002
    nominal_band: float = 0.02
    recorded_priors: bool = False
    noise_floor: float | None = None
    gate_ratio: float = 2.0
    enter_ratio: float = 0.04
    leave_ratio: float = 0.02
    enter_dwell: int = 2
    lone_dwell: int = 8
    leave_dwell: int = 2
    marginal_dwell: int = 3
    cut_dwell: int = 2
    sensors: Sensors = NO_SENSORS
    runout_share: float = math.nan

    def __post_init__(self) -> None:
        require(self.teeth >= 1, "teeth", self.teeth, "", "an integer >= 1")
        for name, unit in (("window", "s"), ("revolutions", ""), ("longest_window", "s"), ("hop", "s"),
                           ("speed_timeout", "s")):
            value = getattr(self, name)
            require(math.isfinite(value) and value > 0, name.replace("_", " "), value, unit, "a finite number > 0")
        require(math.isfinite(self.nominal_speed) and self.nominal_speed >= 0, "nominal speed", self.nominal_speed,
                "rad/s", "a finite number >= 0")
        require(self.hop <= self.window <= self.longest_window, "window", self.window, "s",
                f"between hop {self.hop} s and longest window {self.longest_window} s")
        require(0 < self.band[0] < self.band[1], "band", self.band, "Hz", "(lower, upper) with 0 < lower < upper")
        for name in ("axis_band", "nominal_band"):
            require(0 < getattr(self, name) < 0.1, name.replace("_", " "), getattr(self, name), "", "in (0, 0.1)")
        require(0 < self.leave_ratio <= self.enter_ratio < 1, "leave ratio", self.leave_ratio, "",
                f"in (0, enter ratio {self.enter_ratio}]")
        require(self.gate_ratio > 1, "gate ratio", self.gate_ratio, "", "a number > 1")
        require(self.noise_floor is None or self.noise_floor > 0, "noise floor", self.noise_floor, "channel unit",
                "a number > 0")
        require(math.isnan(self.runout_share) or 0 <= self.runout_share <= 1, "runout share", self.runout_share, "",
                "NaN or a share from 0 to 1")
        for name in ("enter_dwell", "lone_dwell", "leave_dwell", "marginal_dwell", "cut_dwell"):
            require(getattr(self, name) >= 1, name.replace("_", " "), getattr(self, name), "windows", "an integer >= 1")

    @property
    def principal_teeth(self) -> int:
        """Equal parts of a revolution: the teeth at equal pitch, else 1 (then all families repeat with the spindle)."""
        return self.teeth if self.equal_pitch else 1

    @property
    def odd(self) -> bool:
        """True where half the principal frequency is no multiple of the spindle frequency."""
        return self.principal_teeth % 2 == 1


def config_from_operation(op: Operation) -> ChatterConfig:
    """Settings for an operation: its teeth, pitch and nominal spindle speed, everything else by default."""
    pitch = op.tool.pitch
    return ChatterConfig(
        teeth=op.tool.teeth, nominal_speed=op.conditions.tool_speed,
        equal_pitch=max(pitch) - min(pitch) < 1e-6, sensors=op.sensors, channel=op.sensors.judged,
    )
