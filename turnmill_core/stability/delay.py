"""Regeneration delay of milling and turn-milling, three models by name (thesis 4.3.4, errata D1 to D3).

The regeneration delay is the time since the preceding tooth cut the surface that is being cut now.

- ``"milling"``: the tooth passing period; the workpiece's rotation is left out.
- ``"mean"``: the mean of the thesis' discrete model, Td (1 + Omega_c / Omega_t) (Eq. 4.88, erratum
  D1); the workpiece's rotation always lengthens the delay. The default.
- ``"first-principles"``: the time since the preceding tooth passed the material point that is being
  cut, Td (1 - v cos(phi) / (R_t Omega_t)) to first order with the surface speed v = R(z) Omega_c
  (erratum D3); shorter in up-milling, longer in down-milling, and it varies with the angle phi.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

DelayModel = Literal["milling", "mean", "first-principles"]
DELAY_MODELS: tuple[DelayModel, ...] = ("milling", "mean", "first-principles")


def _check(tool_speed: float) -> None:
    if not (np.isfinite(tool_speed) and tool_speed > 0):
        raise ValueError(f"tool speed is {tool_speed} rad/s, expected a finite number > 0")


def tooth_period(pitch: ArrayLike, tool_speed: float) -> NDArray[np.float64]:
    """Time [s] between the passes of neighbouring teeth, for pitch angles [rad] and tool speed [rad/s]."""
    _check(tool_speed)
    return np.asarray(pitch, dtype=np.float64) / tool_speed


def mean_delay(pitch: ArrayLike, tool_speed: float, workpiece_speed: float) -> NDArray[np.float64]:
    """Mean delay [s] of each tooth, Td (1 + |Omega_c| / Omega_t) (mean of Eq. 4.88, erratum D1).

    pitch [rad]: angle to the preceding tooth; tool_speed, workpiece_speed [rad/s]. The limit without
    workpiece rotation is the tooth period of milling.
    """
    return tooth_period(pitch, tool_speed) * (1.0 + abs(workpiece_speed) / tool_speed)


def delay_variation(tool_radius: float, tool_speed: float, surface_speed: float) -> float:
    """Ratio v / (R_t Omega_t) [1] in the first-principles delay Td (1 - ratio cos(phi)) (erratum D3).

    tool_radius R_t [m], tool_speed Omega_t [rad/s], surface_speed v [m/s].
    """
    _check(tool_speed)
    if not tool_radius > 0:
        raise ValueError(f"tool radius is {tool_radius} m, expected > 0")
    return abs(surface_speed) / (tool_radius * tool_speed)


def first_principles_delay(
    pitch: float, tool_speed: float, tool_radius: float, surface_speed: float, angle: ArrayLike, exact: bool = False,
) -> NDArray[np.float64]:
    """Time [s] since the preceding tooth passed the material point now cut at `angle` [rad] (erratum D3).

    pitch [rad], tool_speed [rad/s], tool_radius [m], surface_speed [m/s]: speed R(z) Omega_c of the
    material against the feed direction x. To first order Td (1 - v cos(phi) / (R_t Omega_t)).
    exact: solve v tau cos(phi) = R_t sin(Omega_t (Td - tau)), which follows from intersecting the
    tool's radius with the circle of the preceding tooth, by Newton's method. Raises ``ValueError``
    when the surface is as fast as the cutting edge.
    """
    ratio = delay_variation(tool_radius, tool_speed, surface_speed)
    if ratio >= 1:
        raise ValueError(f"surface speed is {surface_speed} m/s, expected below the cutting speed "
                         f"{tool_radius * tool_speed:.6g} m/s")
    cosine = np.cos(np.asarray(angle, dtype=np.float64))
    period = pitch / tool_speed
    delay = period * (1.0 - ratio * cosine)
    if exact:
        for _ in range(50):
            lead = tool_speed * (period - delay)
            step = (np.sin(lead) - tool_speed * delay * ratio * cosine) / (
                -tool_speed * np.cos(lead) - tool_speed * ratio * cosine)
            delay = delay - step
            if np.all(np.abs(step) <= 1e-14 * period):
                break
    return delay
