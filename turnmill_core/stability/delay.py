"""Regeneration delay of milling and turn-milling by several models, each with its name (thesis 4.3.4, errata D1 to D3).

The regeneration delay is the time since the preceding tooth cut the surface that is being cut now.

- ``"milling"``: the tooth passing period Td; the workpiece's rotation is left out.
- ``"mean"``: the mean of the thesis' discrete model, Td (1 + Omega_c / Omega_t) (Eq. 4.88, erratum
  D1); the workpiece's rotation always lengthens the delay. The default.
- ``"discrete-literal"``: the discrete model as printed (Eq. 4.74-4.88), with a ripple over the cut that comes from two
  points that do not match (erratum D1).
- ``"discrete-consistent"``: the same with matching points. It has no ripple: it is the mean.
- ``"first-principles"``: the time since the preceding tooth passed the material point that is being
  cut, Td (1 - v cos(phi) / (R_t Omega_t)) to first order with the surface speed v = R(z) Omega_c
  (erratum D3); shorter in up-milling, longer in down-milling, and it varies with the angle phi.
- ``"exact"``: that time without the expansion, by intersecting the two teeth's paths.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
DelayModel = Literal["milling", "mean", "first-principles"]
DELAY_MODELS: tuple[DelayModel, ...] = get_args(DelayModel)
"""Models that the stability solvers take. The discrete one is the mean, the exact one differs in second order only."""
DelayCurve = Literal["milling", "mean", "discrete-literal", "discrete-consistent", "first-principles", "exact"]
DELAY_CURVES: tuple[DelayCurve, ...] = get_args(DelayCurve)
"""All models, as curves over the angle of a tooth."""


def _check(tool_speed: float) -> None:
    if not (np.isfinite(tool_speed) and tool_speed > 0):
        raise ValueError(f"tool speed is {tool_speed} rad/s, expected a finite number > 0")


def tooth_period(pitch: ArrayLike, tool_speed: float) -> Floats:
    """Time [s] between the passes of neighbouring teeth, for pitch angles [rad] and tool speed [rad/s]."""
    _check(tool_speed)
    return np.asarray(pitch, dtype=np.float64) / tool_speed


def mean_delay(pitch: ArrayLike, tool_speed: float, workpiece_speed: float) -> Floats:
    """Mean delay [s] of each tooth, Td (1 + |Omega_c| / Omega_t) (mean of Eq. 4.88, erratum D1).

    pitch [rad]: angle to the preceding tooth; tool_speed, workpiece_speed [rad/s]. The limit without
    workpiece rotation is the tooth period of milling.
    """
    return tooth_period(pitch, tool_speed) * (1.0 + abs(workpiece_speed) / tool_speed)


def discrete_delay(
    pitch: float, tool_speed: float, workpiece_speed: float, tool_radius: float, workpiece_radius: float, depth: float,
    angle: ArrayLike, literal: bool = True,
) -> Floats:
    """Delay [s] of a tooth at `angle` [rad] by the discrete motion of tool and workpiece (Eq. 4.74-4.88).

    A tooth marks the bar at y = R_t sin(phi) across its axis; the mark turns with the bar for one tooth period; the
    angle alpha about the bar's axis between the next tooth's mark and the turned one gives Td (1 + alpha / pitch).
    literal: the mark of the present tooth is (y, R_w cos theta), the turned one R_w (sin theta', cos theta') with
    tan(theta) = y / (R_w - a) (Eq. 4.81-4.83); since y is not R_w sin(theta), alpha ripples (erratum D1). Else both
    marks lie on the bar, and alpha is the bar's rotation.
    pitch [rad]; tool_speed, workpiece_speed [rad/s]; tool_radius R_t, workpiece_radius R_w, depth a [m].
    """
    period = tooth_period(pitch, tool_speed)
    if not 0 <= depth < workpiece_radius:
        raise ValueError(f"depth is {depth} m, expected 0 to the bar's radius {workpiece_radius} m")
    y = tool_radius * np.sin(np.asarray(angle, dtype=np.float64))
    mark = np.arctan2(y, workpiece_radius - depth)
    turned = mark - abs(workpiece_speed) * period
    now = np.arctan2(y, workpiece_radius * np.cos(mark)) if literal else mark
    return np.asarray(period * (1.0 + np.abs(now - turned) / pitch), dtype=np.float64)


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
) -> Floats:
    """Time [s] since the preceding tooth passed the material point now cut at `angle` [rad] (erratum D3).

    pitch [rad], tool_speed [rad/s], tool_radius [m], surface_speed [m/s]: speed R(z) Omega_c of the
    material against the feed direction x. To first order Td (1 - v cos(phi) / (R_t Omega_t)).
    exact: solve v tau cos(phi) = R_t sin(Omega_t (Td - tau)), which follows from intersecting the
    tool's radius with the circle of the preceding tooth, by Newton's method. Raises ``ValueError``
    when the surface is as fast as the cutting edge, or so fast that the preceding tooth did not pass there at all.
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
        if not np.all((np.abs(step) <= 1e-9 * period) & (np.abs(tool_speed * (period - delay)) < np.pi / 2)):
            raise ValueError(f"surface speed is {surface_speed} m/s, expected a speed at which the preceding tooth "
                             "passed the point that is being cut")
    return delay


def delay_curve(
    model: DelayCurve, pitch: float, tool_speed: float, workpiece_speed: float, tool_radius: float,
    workpiece_radius: float, depth: float, angle: ArrayLike,
) -> Floats:
    """Delay [s] of one tooth at each `angle` (k,) [rad] by any of DELAY_CURVES.

    pitch [rad]; tool_speed, workpiece_speed [rad/s]; tool_radius, workpiece_radius, depth of cut [m]. The
    first-principles models take the surface speed at half the depth. Raises ``ValueError`` for an unknown model and as
    the models do.
    """
    at = np.asarray(angle, dtype=np.float64)
    if model == "milling":
        return np.full(at.shape, float(tooth_period(pitch, tool_speed)))
    if model == "mean":
        return np.full(at.shape, float(mean_delay(pitch, tool_speed, workpiece_speed)))
    if model in ("discrete-literal", "discrete-consistent"):
        return discrete_delay(pitch, tool_speed, workpiece_speed, tool_radius, workpiece_radius, depth, at,
                              model == "discrete-literal")
    if model in ("first-principles", "exact"):
        surface = abs(workpiece_speed) * (workpiece_radius - 0.5 * depth)
        return first_principles_delay(pitch, tool_speed, tool_radius, surface, at, model == "exact")
    raise ValueError(f"delay model is {model!r}, expected one of {', '.join(DELAY_CURVES)}")


def delay_statistics(
    model: DelayCurve, pitch: float, tool_speed: float, workpiece_speed: float, tool_radius: float,
    workpiece_radius: float, depth: float, angle: ArrayLike,
) -> tuple[float, float]:
    """Mean over `angle` in tooth periods [1] and (largest - smallest) / mean [1] of delay_curve.

    pitch [rad]; tool_speed, workpiece_speed [rad/s]; tool_radius, workpiece_radius, depth of cut [m]. Both NaN where
    the model does not hold: a bar thinner than the cut, a surface as fast as the edge.
    """
    try:
        curve = delay_curve(model, pitch, tool_speed, workpiece_speed, tool_radius, workpiece_radius, depth, angle)
    except ValueError:
        return float("nan"), float("nan")
    return float(curve.mean() * tool_speed / pitch), float(np.ptp(curve) / curve.mean())
