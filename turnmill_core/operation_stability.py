"""Frozen values of an operation that only its stability knows: process damping of the flank, and cutting trials."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from .operation_checks import finite, not_negative, positive, require

Outcome = Literal["stable", "marginal", "chatter"]


@dataclass(frozen=True)
class ProcessDamping:
    """Flank that presses on the wavy surface just cut (Eq. 4.70, 4.71).

    indentation: specific indentation coefficient K_sp [N/m3]; contact_length: length L_w of the flank that presses on
    the surface [m]; friction: ratio of tangential to radial force [1].
    """

    indentation: float
    contact_length: float
    friction: float = 0.0

    def __post_init__(self) -> None:
        not_negative("indentation coefficient", self.indentation, "N/m3")
        positive("flank contact length", self.contact_length, "m")
        not_negative("flank friction", self.friction, "")

    def coefficient(self, cutting_speed: float) -> float:
        """Damping per depth of cut [N s/m2], K_sp L_w^2 / (2 V), at a cutting speed V [m/s] (Eq. 4.71)."""
        positive("cutting speed", cutting_speed, "m/s")
        return self.indentation * self.contact_length**2 / (2 * cutting_speed)


def flank_contact_length(hone_radius: float, separation_angle: float, clearance_angle: float) -> float:
    """Length L_w [m] of the flank that presses on the surface (Eq. 4.72).

    hone_radius [m], separation_angle, clearance_angle [rad]. 60 um, 50 and 5 degrees give 294 um (erratum D6).
    """
    positive("hone radius", hone_radius, "m")
    require(0 < clearance_angle < math.pi / 2, "clearance angle", clearance_angle, "rad", "an angle in (0, pi/2)")
    b, g = separation_angle, clearance_angle
    return hone_radius * (math.sin(b) + math.sin(g) + (math.cos(g) - math.cos(b)) / math.tan(g))


@dataclass(frozen=True)
class Trial:
    """One cut that was made, and what came of it.

    tool_speed, workpiece_speed [rad/s]; depth [m]; outcome; chatter_frequency [Hz], None where none was reported; note.
    """

    tool_speed: float
    workpiece_speed: float
    depth: float
    outcome: Outcome
    chatter_frequency: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        positive("trial tool speed", self.tool_speed, "rad/s")
        finite("trial workpiece speed", self.workpiece_speed, "rad/s")
        positive("trial depth", self.depth, "m")
        require(self.outcome in ("stable", "marginal", "chatter"), "trial outcome", self.outcome, "",
                "stable, marginal or chatter")
        require(self.chatter_frequency is None or self.chatter_frequency > 0, "trial chatter frequency",
                self.chatter_frequency, "Hz", "a number > 0")
