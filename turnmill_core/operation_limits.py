"""What machine, tool and part allow: frozen values of the operation's `limits` section, in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from .operation_checks import not_negative, positive, require

ChipLoad = Literal["thickness", "feed per tooth"]
Load = Literal["peak", "mean"]


@dataclass(frozen=True)
class Rating:
    """What a spindle gives for some time: power by speed (a torque-power chart).

    name: for people. speeds [rad/s], ascending; powers [W]: points of the chart. Between them the power is linear in
    the speed, which is exact for constant torque and for constant power; below the first the torque is constant.
    duration [s]: how long the spindle gives it, infinite for a continuous rating. load: whether it bounds the
    largest torque of a tool revolution (thesis Eq. 5.5) or the mean.
    """

    name: str
    speeds: tuple[float, ...]
    powers: tuple[float, ...]
    duration: float = math.inf
    load: Load = "peak"

    def __post_init__(self) -> None:
        require(len(self.speeds) == len(self.powers) >= 1, f"points of rating {self.name}", len(self.speeds), "",
                "at least one speed with its power")
        for speed, power in zip(self.speeds, self.powers, strict=True):
            positive(f"speed of rating {self.name}", speed, "rad/s")
            positive(f"power of rating {self.name}", power, "W")
        require(all(a < b for a, b in pairwise(self.speeds)), f"speeds of rating {self.name}", self.speeds, "rad/s",
                "strictly ascending speeds")
        require(self.duration > 0, f"duration of rating {self.name}", self.duration, "s", "a number > 0")


@dataclass(frozen=True)
class Limits:
    """Limits of a cut; infinite, 0 or empty where nothing is limited (thesis section 5.2).

    chip_load_min, chip_load_max [m]: window of the chip load; chip_load: what it bounds, the largest chip thickness in
    the arc (Eq. 5.2) or the resultant feed per tooth at the surface of the bar (the numbers of section 5.3).
    cutting_speed_min, cutting_speed_max [m/s]; tool_speed_min, tool_speed_max [rad/s]; workpiece_speed_max [rad/s];
    depth_max [m]; feed_speed_max [m/s], of the linear axes; tool_force_max [N], largest resultant across the tool axis;
    feed_force_max [N], largest force along the linear axis that feeds; form_error_max [m]. stability_margin [1]: share
    of the depth limit that is kept as a reserve. tool_spindle, workpiece_spindle: their charts, one rating or more.
    """

    chip_load_min: float = 0.0
    chip_load_max: float = math.inf
    chip_load: ChipLoad = "thickness"
    cutting_speed_min: float = 0.0
    cutting_speed_max: float = math.inf
    tool_speed_min: float = 0.0
    tool_speed_max: float = math.inf
    workpiece_speed_max: float = math.inf
    depth_max: float = math.inf
    feed_speed_max: float = math.inf
    tool_force_max: float = math.inf
    feed_force_max: float = math.inf
    form_error_max: float = math.inf
    stability_margin: float = 0.0
    tool_spindle: tuple[Rating, ...] = ()
    workpiece_spindle: tuple[Rating, ...] = ()

    def __post_init__(self) -> None:
        for name, unit in (("chip_load", "m"), ("cutting_speed", "m/s"), ("tool_speed", "rad/s")):
            low, high = getattr(self, f"{name}_min"), getattr(self, f"{name}_max")
            not_negative(f"{name}_min", low, unit)
            require(high > low, f"{name}_max", high, unit, f"more than {name}_min, {low} {unit}")
        for name, unit in (("workpiece_speed", "rad/s"), ("depth", "m"), ("feed_speed", "m/s"), ("tool_force", "N"),
                           ("feed_force", "N"), ("form_error", "m")):
            require(getattr(self, f"{name}_max") > 0, f"{name}_max", getattr(self, f"{name}_max"), unit, "a number > 0")
        require(0 <= self.stability_margin < 1, "stability_margin", self.stability_margin, "", "a ratio in [0, 1)")
        for name in ("tool_spindle", "workpiece_spindle"):
            ratings = getattr(self, name)
            for load in ("peak", "mean"):
                times = [r.duration for r in ratings if r.load == load]
                require(not times or math.isinf(max(times)), f"{name}", max(times, default=math.inf), "s",
                        f"a continuous rating beside the short-time ones (load: {load})")


NO_LIMITS = Limits()
