"""Frozen values that describe the vibration of tool and workpiece at the cutting point, in SI units.

A structure is a list of modes; beyond direct modes it may hold shapes at several heights along the tool axis,
torsion, cross modes in a named reading, modes that turn with the spindle, and modes that depend on where the
machine stands and how fast the tool spindle turns. A beam gives the modes of a bar from its shape and its chuck.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from .operation_checks import finite, not_negative, positive, require

Vector = tuple[float, float, float]
Frame = Literal["machine", "tool", "rotating"]
"""Frame of mode shapes. rotating: fixed in the tool (its u and v, x_T and y_T at tool angle 0) or in the workpiece
(x_M and y_M at C angle 0)."""
CrossReading = Literal["none", "symmetric", "rank-one"]
"""How a measured cross mode is read: left out; as a symmetric cross receptance; as a mode shape shared by both
directions, which moves them equally and so adds to the direct receptances too."""
Coriolis = Literal["printed", "skew-symmetric"]
"""Coupling of u and v by the Coriolis force, per unit of mass: 2 Omega in both rows (Eq. 4.17 as printed), or 2 Omega
sqrt(m_u m_v) as a force, which does no work where the modal masses differ."""
Damping = Literal["tool", "machine"]
"""Where the damping of a turning structure is fixed: in what turns (no circulatory term K_crc), or in the machine
(K_crc stands)."""
CrossPlane = Literal["xy", "yz", "xz", "-xy", "-yz", "-xz"]
CROSS_PLANES: tuple[CrossPlane, ...] = ("xy", "yz", "xz", "-xy", "-yz", "-xz")
CROSS_READINGS: tuple[CrossReading, ...] = ("none", "symmetric", "rank-one")
TABLE_AXES = ("x", "y", "z", "b", "tool_speed")
"""What modes may depend on: axis positions [m, rad] and the tool spindle's speed [rad/s]."""


@dataclass(frozen=True)
class Mode:
    """One vibration mode at the cutting point.

    frequency: undamped natural frequency [Hz]; damping: viscous damping ratio [1];
    mass: modal mass [kg] for `shape`; shape: mode shape at the cutting point [1], in the frame of
    the structure that holds the mode. A direct mode in x has shape (1, 0, 0).
    torsion: rotation about the tool axis that belongs to the shape [rad/m]. above: shapes at the further heights of
    the structure (its heights without the first), for the same modal mass. phase: angle [rad] by which the residue
    of a complex mode leads that of the real mode; see structure/complex_modes.py.
    """

    frequency: float
    damping: float
    mass: float
    shape: Vector
    torsion: float = 0.0
    above: tuple[Vector, ...] = ()
    phase: float = 0.0

    def __post_init__(self) -> None:
        positive("mode frequency", self.frequency, "Hz")
        require(0 < self.damping < 1, "mode damping", self.damping, "", "a ratio in (0, 1)")
        positive("mode mass", self.mass, "kg")
        finite("mode torsion", self.torsion, "rad/m")
        require(abs(self.phase) < math.pi / 2, "mode phase", self.phase, "rad", "an angle within +-pi/2")
        shapes = (self.shape, *self.above)
        require(
            all(math.isfinite(s) for shape in shapes for s in shape)
            and (self.torsion != 0 or any(s != 0 for shape in shapes for s in shape)),
            "mode shape", self.shape, "", "three finite numbers, not all zero",
        )

    @property
    def stiffness(self) -> float:
        """Modal stiffness [N/m]."""
        return self.mass * (2 * math.pi * self.frequency) ** 2


@dataclass(frozen=True)
class CrossMode:
    """A measured mode of the cross receptance between two directions, without a direct mode of its own.

    frequency [Hz], damping [1], mass [kg]: of the fitted receptance 1/(m (w_n^2 - w^2 + 2 i zeta w_n w));
    plane: the two directions, "xy", "yz" or "xz", with a minus where the receptance is the negative of that.
    """

    frequency: float
    damping: float
    mass: float
    plane: CrossPlane

    def __post_init__(self) -> None:
        self.shared()
        require(self.plane in CROSS_PLANES, "cross mode plane", self.plane, "", f"one of {', '.join(CROSS_PLANES)}")

    def directions(self) -> tuple[Vector, Vector]:
        """Unit vectors of the two directions, the second one reversed with a minus."""
        first, second = ((float(axis == "x"), float(axis == "y"), float(axis == "z")) for axis in self.plane[-2:])
        return first, (-second[0], -second[1], -second[2]) if self.plane[0] == "-" else second

    def shared(self) -> Mode:
        """The rank-one reading: one mode that moves both directions equally."""
        a, b = self.directions()
        return Mode(self.frequency, self.damping, self.mass, (a[0] + b[0], a[1] + b[1], a[2] + b[2]))


@dataclass(frozen=True)
class ModeTable:
    """Modes at several places or speeds, to be interpolated.

    axes: names out of TABLE_AXES; places: for each entry the values of the axes [m, rad, rad/s], together a full
    grid; modes: for each entry its modes, equally many, in any order (they are followed by shape and frequency).
    """

    axes: tuple[str, ...]
    places: tuple[tuple[float, ...], ...]
    modes: tuple[tuple[Mode, ...], ...]

    def __post_init__(self) -> None:
        require(bool(self.axes) and len(set(self.axes)) == len(self.axes) and set(self.axes) <= set(TABLE_AXES),
                "mode table axes", self.axes, "", f"different names out of {', '.join(TABLE_AXES)}")
        require(len(self.places) == len(self.modes) >= 2, "mode table", len(self.places), "entries", "at least two")
        require(all(len(p) == len(self.axes) and all(map(math.isfinite, p)) for p in self.places),
                "mode table places", self.places, "", f"{len(self.axes)} finite numbers each")
        require(len(set(self.places)) == len(self.places), "mode table places", self.places, "", "different places")
        grid = math.prod(len(values) for values in self.values())
        require(grid == len(self.places), "mode table", len(self.places), "places",
                f"the full grid of its axis values, {grid} places")
        counts = {len(modes) for modes in self.modes}
        require(len(counts) == 1 and 0 not in counts, "mode table", sorted(counts), "modes",
                "the same number of modes at every place")

    def values(self) -> tuple[tuple[float, ...], ...]:
        """Ascending values of each axis."""
        return tuple(tuple(sorted({place[i] for place in self.places})) for i in range(len(self.axes)))


@dataclass(frozen=True)
class Structure:
    """Vibration modes of the tool or of the workpiece at the cutting point; no modes: rigid.

    heights: contact points above the tool tip [m], ascending, at which the modes give shapes; empty: one contact
    point. cross_modes and cross_reading: measured cross modes and how they are read. coriolis, turning_damping: of
    modes in the rotating frame; there the k-th mode in u (x) and the k-th in v (y) are a pair. table: modes that
    depend on place or speed; `modes` are then those of its first entry.
    """

    modes: tuple[Mode, ...] = ()
    frame: Frame = "tool"
    heights: tuple[float, ...] = ()
    cross_modes: tuple[CrossMode, ...] = ()
    cross_reading: CrossReading = "none"
    coriolis: Coriolis = "printed"
    turning_damping: Damping = "tool"
    table: ModeTable | None = None

    def __post_init__(self) -> None:
        require(self.frame in ("machine", "tool", "rotating"), "structure frame", self.frame, "",
                "machine, tool or rotating")
        require(self.cross_reading in CROSS_READINGS, "cross reading", self.cross_reading, "",
                f"one of {', '.join(CROSS_READINGS)}")
        for height in self.heights:
            not_negative("contact height", height, "m")
        require(len(self.heights) != 1 and all(a < b for a, b in pairwise(self.heights)), "contact heights",
                self.heights, "m", "at least two ascending heights, or none")
        every = (self.modes, *(self.table.modes if self.table else ()))
        for mode in (mode for modes in every for mode in modes):
            require(len(mode.above) + 1 == max(1, len(self.heights)), "mode shape", len(mode.above) + 1, "points",
                    f"one shape per contact height, {max(1, len(self.heights))}")
            if self.frame == "rotating":
                _check_turning(mode)
        require(self.table is None or self.modes == self.table.modes[0], "modes", len(self.modes), "modes",
                "those of the table's first entry")

    @property
    def flexible(self) -> bool:
        """False for a rigid structure."""
        return bool(self.modes) or (bool(self.cross_modes) and self.cross_reading != "none")


def _check_turning(mode: Mode) -> None:
    u, v, w = mode.shape
    require(w == 0 and (u == 0) != (v == 0) and not mode.torsion and not mode.above and mode.phase == 0,
            "mode in the rotating frame", mode.shape, "", "a real direct mode in u (x) or v (y) at one contact point")


RIGID = Structure()
RIGID_IN_MACHINE = Structure(frame="machine")


@dataclass(frozen=True)
class ChuckMode:
    """One mode of the chuck's face: a translation y and a rotation y / pivot of the face.

    frequency [Hz], damping [1], mass [kg]: of the translation at the face; pivot [m]: distance from the face back to
    the point about which it rocks, infinite for a pure translation.
    """

    frequency: float
    damping: float
    mass: float
    pivot: float = math.inf

    def __post_init__(self) -> None:
        positive("chuck mode frequency", self.frequency, "Hz")
        require(0 < self.damping < 1, "chuck mode damping", self.damping, "", "a ratio in (0, 1)")
        positive("chuck mode mass", self.mass, "kg")
        require(self.pivot > 0, "chuck pivot", self.pivot, "m", "a number > 0")


@dataclass(frozen=True)
class Chuck:
    """The chuck in one plane, as its face meets the bar.

    modes: of the face; none: it does not move. stiffness [N/m], rotational_stiffness [N m/rad]: of the joint between
    face and bar, infinite for a rigid joint; damping [N s/m], rotational_damping [N m s/rad]: of the joint.
    """

    modes: tuple[ChuckMode, ...] = ()
    stiffness: float = math.inf
    rotational_stiffness: float = math.inf
    damping: float = 0.0
    rotational_damping: float = 0.0

    def __post_init__(self) -> None:
        require(self.stiffness > 0, "chuck stiffness", self.stiffness, "N/m", "a number > 0")
        require(self.rotational_stiffness > 0, "chuck rotational stiffness", self.rotational_stiffness, "N m/rad",
                "a number > 0")
        not_negative("chuck damping", self.damping, "N s/m")
        not_negative("chuck rotational damping", self.rotational_damping, "N m s/rad")


@dataclass(frozen=True)
class Support:
    """Tailstock or steady rest: an elastic support (Figure 4.11).

    position [m]: from the free end; stiffness [N/m]; damping [N s/m].
    """

    position: float
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        not_negative("support position", self.position, "m")
        positive("support stiffness", self.stiffness, "N/m")
        not_negative("support damping", self.damping, "N s/m")


ShearCoefficient = Literal["cowper", "hutchinson"]


@dataclass(frozen=True)
class BeamMaterial:
    """What the bar is made of: youngs_modulus [Pa], density [kg/m3], poisson_ratio [1], loss_factor [1]."""

    youngs_modulus: float
    density: float
    poisson_ratio: float
    loss_factor: float = 0.0

    def __post_init__(self) -> None:
        positive("Young's modulus", self.youngs_modulus, "Pa")
        positive("density", self.density, "kg/m3")
        require(0 <= self.poisson_ratio < 0.5, "Poisson's ratio", self.poisson_ratio, "", "a ratio in [0, 0.5)")
        require(0 <= self.loss_factor < 1, "loss factor", self.loss_factor, "", "a ratio in [0, 1)")


@dataclass(frozen=True)
class Beam:
    """How the modes of a bar follow from its shape (thesis 4.3.2).

    material; chuck_x, chuck_y: in the planes of x_M and y_M. supports: along it. bore [m]: diameter of a hole along
    the axis (0: solid). shear: shear coefficient by name. modes: how many are kept in each plane.
    """

    material: BeamMaterial
    chuck_x: Chuck
    chuck_y: Chuck
    supports: tuple[Support, ...] = ()
    bore: float = 0.0
    shear: ShearCoefficient = "cowper"
    modes: int = 2

    def __post_init__(self) -> None:
        not_negative("beam bore", self.bore, "m")
        require(self.shear in ("cowper", "hutchinson"), "shear coefficient", self.shear, "", "cowper or hutchinson")
        require(1 <= self.modes <= 20, "beam modes", self.modes, "", "an integer from 1 to 20")


def check_beam(beam: Beam, length: float, smallest: float) -> None:
    """Refuse a beam that does not fit a bar of this length [m] and smallest diameter `smallest` [m]."""
    require(beam.bore < smallest, "beam bore", beam.bore, "m", f"below the bar's smallest diameter {smallest} m")
    for support in beam.supports:
        require(support.position <= length, "support position", support.position, "m",
                f"at most the bar's length {length} m")
