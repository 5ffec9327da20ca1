"""Frozen values that describe one machining operation, in SI units.

Spindle speeds are in rad/s, frequencies in Hz, lengths in m. An operation is read from YAML by
:mod:`turnmill_core.operation_file`; here the values check themselves.

Frames (drawn in docs/frames.md): machine frame M has z along the workpiece spindle (C axis), x
radial towards the tool in orthogonal turn-milling, y completing a right-handed frame. Tool frame T
has z along the tool axis from the tip to the spindle, x along the feed of the tool relative to the
material, y completing a right-handed frame (cross feed).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from .operation_checks import finite, not_negative, positive, require
from .operation_cutter import CYLINDER, Outline, Shape, check_shape, outline, require_bar_profile
from .operation_limits import NO_LIMITS, Limits
from .operation_sensors import NO_SENSORS, Sensors
from .operation_stability import ProcessDamping, Trial
from .operation_structure import RIGID, RIGID_IN_MACHINE, Beam, Frame, Mode, Structure, Vector, check_beam

__all__ = [
    "CYLINDER", "RIGID", "Conditions", "Frame", "Material", "Mode", "Operation", "Outline", "Process", "SchedulePoint",
    "Shape", "Structure", "Tool", "Vector", "Workpiece", "outline", "require",
]

Process = Literal["milling", "turn-milling"]


@dataclass(frozen=True)
class Tool:
    """End mill or face mill, a cylinder unless a shape is given.

    diameter [m]; teeth; helix_angle [rad]; flute_length [m], the longest axial depth; pitch_angles
    [rad], one per tooth, from tooth j to tooth j+1, summing to 2 pi (empty: equal pitch); runout
    [m], radial offset of each tooth (empty: none); shape: corner, tip, taper and details of the edges.
    """

    name: str
    diameter: float
    teeth: int
    helix_angle: float = 0.0
    flute_length: float = math.inf
    pitch_angles: tuple[float, ...] = ()
    runout: tuple[float, ...] = ()
    structure: Structure = RIGID
    shape: Shape = CYLINDER

    def __post_init__(self) -> None:
        positive("tool diameter", self.diameter, "m")
        require(self.teeth >= 1, "tool teeth", self.teeth, "", "an integer >= 1")
        require(abs(self.helix_angle) < math.pi / 2, "tool helix angle", self.helix_angle, "rad", "|angle| < pi/2")
        require(self.flute_length > 0, "tool flute length", self.flute_length, "m", "a number > 0")
        if self.pitch_angles:
            require(
                len(self.pitch_angles) == self.teeth and all(p > 0 for p in self.pitch_angles)
                and abs(sum(self.pitch_angles) - 2 * math.pi) < 1e-6,
                "tool pitch angles", self.pitch_angles, "rad", f"{self.teeth} positive angles that sum to 2 pi",
            )
        if self.runout:
            require(
                len(self.runout) == self.teeth and all(math.isfinite(r) for r in self.runout),
                "tool runout", self.runout, "m", f"{self.teeth} finite numbers",
            )
        check_shape(self.diameter, self.teeth, self.flute_length, self.shape)

    @property
    def radius(self) -> float:
        """Tool radius [m]."""
        return self.diameter / 2

    @property
    def pitch(self) -> tuple[float, ...]:
        """Pitch angles [rad], one per tooth, equal where none were given."""
        return self.pitch_angles or (2 * math.pi / self.teeth,) * self.teeth


@dataclass(frozen=True)
class Workpiece:
    """Round bar on the C axis, or a rectangular block on the table.

    Bar: diameter and length [m]; its free end face is at z = 0 of the workpiece datum and the bar
    extends towards -z. Block: length (x), width (y) and height [m]; its datum is the corner with
    the lowest x and y on its top face, z = 0 there.
    datum [m]: machine coordinates of the workpiece datum. profile: points (z, radius) [m] of a stepped
    or curved bar, from z = 0 to -length (empty: a cylinder). beam: how its modes follow from its shape.
    """

    name: str
    diameter: float = 0.0
    length: float = 0.0
    width: float = 0.0
    height: float = 0.0
    datum: Vector = (0.0, 0.0, 0.0)
    structure: Structure = RIGID_IN_MACHINE
    profile: tuple[tuple[float, float], ...] = ()
    beam: Beam | None = None

    def __post_init__(self) -> None:
        positive("workpiece length", self.length, "m")
        if self.profile:
            require(self.is_bar, "stock profile", len(self.profile), "points", "none: the workpiece is a block")
            require_bar_profile(self.profile, self.length, self.radius)
        if self.is_bar:
            positive("workpiece diameter", self.diameter, "m")
            require(self.width == 0 and self.height == 0, "workpiece", (self.width, self.height), "m",
                    "either a diameter (bar) or width and height (block)")
        else:
            positive("workpiece width", self.width, "m")
            positive("workpiece height", self.height, "m")
        if self.beam is not None:
            require(self.is_bar and not self.structure.flexible, "workpiece beam", self.name, "",
                    "none for a block or beside a structure")
            check_beam(self.beam, self.length, 2 * min((r for _, r in self.profile), default=self.radius))
        require(all(map(math.isfinite, self.datum)), "workpiece datum", self.datum, "m", "three finite numbers")

    @property
    def is_bar(self) -> bool:
        """True for a round bar on the C axis."""
        return self.diameter != 0.0

    @property
    def radius(self) -> float:
        """Radius of the bar [m]."""
        return self.diameter / 2


@dataclass(frozen=True)
class Material:
    """Cutting force coefficients: Ktc, Krc, Kac [Pa] of the chip, Kte, Kre, Kae [N/m] of the edge."""

    name: str
    Ktc: float
    Krc: float
    Kac: float
    Kte: float = 0.0
    Kre: float = 0.0
    Kae: float = 0.0

    def __post_init__(self) -> None:
        positive("Ktc", self.Ktc, "Pa")
        for name in ("Krc", "Kac"):
            finite(name, getattr(self, name), "Pa")
        for name in ("Kte", "Kre", "Kae"):
            not_negative(name, getattr(self, name), "N/m")


@dataclass(frozen=True)
class Conditions:
    """One instant of the cut.

    tool_speed [rad/s], > 0 in a cut, clockwise seen from the spindle; workpiece_speed [rad/s],
    signed about +z_M, 0 in milling; depth [m] along the tool axis, <= 0 without contact (its
    magnitude is then the clearance); feed_speed [m/s], speed of the linear axes; cross_feed_span
    [m], the interval of y_T relative to the tool axis that holds material to be cut: (R - ae, R)
    in up-milling, (-R, -R + ae) in down-milling, (-R, R) in a slot.
    effective_radius [m]: workpiece radius at the tool tip, Rw - a (0 in milling).

    The engagement angle phi is measured from +y_T towards +x_T, so start = acos(y_max/R) and
    exit = acos(y_min/R).
    """

    tool_speed: float
    workpiece_speed: float
    depth: float
    feed_speed: float
    cross_feed_span: tuple[float, float]
    effective_radius: float = 0.0

    def __post_init__(self) -> None:
        not_negative("tool speed", self.tool_speed, "rad/s")
        finite("workpiece speed", self.workpiece_speed, "rad/s")
        finite("depth", self.depth, "m")
        not_negative("feed speed", self.feed_speed, "m/s")
        not_negative("effective radius", self.effective_radius, "m")
        require(self.cross_feed_span[0] <= self.cross_feed_span[1], "cross feed span", self.cross_feed_span, "m",
                "(lower, upper) with lower <= upper")

    @property
    def radial_immersion(self) -> float:
        """Width of cut in the cross feed direction [m]."""
        return self.cross_feed_span[1] - self.cross_feed_span[0]

    @property
    def in_cut(self) -> bool:
        """True where the tool touches the workpiece."""
        return self.depth > 0 and self.radial_immersion > 0 and self.tool_speed > 0

    @property
    def resultant_feed_speed(self) -> float:
        """Speed of the tool tip relative to the material [m/s] (Eq. 3.22, with the exact radius, erratum M1)."""
        return math.hypot(self.feed_speed, self.workpiece_speed * self.effective_radius)


@dataclass(frozen=True)
class SchedulePoint:
    """Set values that the simulated controller reaches at `time` [s]; linear in between.

    tool_speed, workpiece_speed [rad/s]; depth [m], negative is clearance.
    """

    time: float
    tool_speed: float
    workpiece_speed: float
    depth: float

    def __post_init__(self) -> None:
        not_negative("schedule time", self.time, "s")
        not_negative("schedule tool speed", self.tool_speed, "rad/s")
        finite("schedule workpiece speed", self.workpiece_speed, "rad/s")
        finite("schedule depth", self.depth, "m")


@dataclass(frozen=True)
class Operation:
    """Machine, tool, workpiece, material and nominal cut; what an operation file holds.

    conditions: the nominal cut. axial_feed [m/rev] is the feed along the workpiece axis per
    workpiece revolution (turn-milling); feed_per_tooth [m] the feed of the table (milling); the
    other is 0. milling_sense: "up", "down", "slot" or "centred". schedule: what a simulated
    controller runs, at least two points, or empty (then the nominal cut is held).
    eccentricity [m] and tilt [rad] of the tool in turn-milling, 0 in milling.
    limits: what machine, tool and part allow. process_damping: of the flank.
    trials: cuts that were made. sensors: calibration of channels in volts. sources: where the numbers
    come from. text, sha256: the file it was read from, byte for byte.
    """

    name: str
    process: Process
    machine: str
    tool: Tool
    workpiece: Workpiece
    material: Material
    conditions: Conditions
    milling_sense: Literal["up", "down", "slot", "centred"]
    axial_feed: float = 0.0
    feed_per_tooth: float = 0.0
    schedule: tuple[SchedulePoint, ...] = ()
    eccentricity: float = 0.0
    tilt: float = 0.0
    limits: Limits = NO_LIMITS
    process_damping: ProcessDamping | None = None
    trials: tuple[Trial, ...] = ()
    sensors: Sensors = NO_SENSORS
    sources: str = ""
    text: str = field(default="", repr=False, compare=False)
    sha256: str = ""

    def __post_init__(self) -> None:
        if self.process == "turn-milling":
            require(self.workpiece.is_bar, "workpiece", self.workpiece.name, "",
                    "a bar (diameter, length) in turn-milling")
            positive("axial feed", self.axial_feed, "m/rev")
            finite("eccentricity", self.eccentricity, "m")
            require(abs(self.tilt) < math.pi / 2, "tilt", self.tilt, "rad", "|angle| < pi/2")
        else:
            require(self.conditions.workpiece_speed == 0, "workpiece speed", self.conditions.workpiece_speed, "rad/s",
                    "0 in milling")
            positive("feed per tooth", self.feed_per_tooth, "m")
            require(self.eccentricity == 0 and self.tilt == 0, "eccentricity and tilt", (self.eccentricity, self.tilt),
                    "", "0 in milling")
        require(self.conditions.depth <= self.tool.flute_length, "depth", self.conditions.depth, "m",
                f"at most the tool's flute length {self.tool.flute_length} m")
        times = [p.time for p in self.schedule]
        require(times == sorted(set(times)), "schedule times", times, "s", "strictly ascending times")

    @property
    def tooth_passing_frequency(self) -> float:
        """Nominal tooth passing frequency [Hz]."""
        return self.tool.teeth * self.conditions.tool_speed / (2 * math.pi)
