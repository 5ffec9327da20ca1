"""Compiled envelope of all tooth passes: the finished surface of a turned bar."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WIPER_START, CLEARANCE, TIP_END, TIP_SLOPE, CORNER_RADIAL, CORNER_AXIAL, CORNER_RADIUS = range(7)
"""Entries of `bottom`: radius where the dished bottom ends [m] and its slope; end of flat or tip cone and its slope;
centre and radius of the corner arc [m]."""
REACH = 1e-12


@njit(cache=True, error_model="numpy")
def bottom_height(radius: float, bottom: Floats) -> float:
    """Height [m] above the tip of the bottom edge at `radius` [m] from the tool axis; infinite beyond the corner."""
    if radius < bottom[WIPER_START]:
        return float((bottom[WIPER_START] - radius) * bottom[CLEARANCE])
    if radius <= bottom[TIP_END] + REACH:
        return float(radius * bottom[TIP_SLOPE])
    beyond = radius - bottom[CORNER_RADIAL]
    if beyond > bottom[CORNER_RADIUS]:
        return math.inf
    return float(bottom[CORNER_AXIAL] - math.sqrt(bottom[CORNER_RADIUS] ** 2 - beyond * beyond))


@njit(cache=True, error_model="numpy")
def envelope(
    angle: Floats, axial: Floats, radius: float, lead: float, speeds: Floats, teeth: Floats, bottom: Floats,
    reach: float, offset: float, window: Floats, spread: float, vibration: Floats, height: Floats,
) -> None:
    """Lower the surface `height` (m, n) [m] above `radius` [m] to the lowest of everything that passed it, in place.

    angle (n,) [rad] around the workpiece, axial (m,) [m] along +y_T. lead [m/rad]: travel of the tool along +y_T per
    radian of the workpiece. speeds (2,): tool, workpiece [rad/s]. teeth (N, 2): angle [rad] and how far each stands out
    below [m]. bottom: see bottom_height; reach [m]: largest radius of the tool. offset [m]: x_T of the C axis seen
    from the tool axis. window (4, k): for k equal intervals of y_T from -reach to reach, between which x_T the tool can
    be lowest, its lowest static height [m] and the height that it surely passes below [m]; spread [m]: vibration
    from lowest to highest. vibration (p,) [m]: along +z_T over a tool revolution.
    """
    omega_t, omega_c = speeds[0], speeds[1]
    turn = 2.0 * math.pi
    bins = window.shape[1]
    for column in range(angle.shape[0]):
        for row in range(axial.shape[0]):
            # workpiece revolutions in which the tool reaches over this place
            near = (axial[row] - lead * angle[column]) / (lead * turn)
            width = abs(reach / (lead * turn))
            first, last = math.ceil(near - width), math.floor(near + width)
            sure = math.inf
            for n in range(first, last + 1):
                y = axial[row] - lead * (angle[column] + n * turn)
                b = min(bins - 1, max(0, int((y + reach) * bins / (2.0 * reach))))
                sure = min(sure, window[3, b])
            lowest = height[row, column]
            for attempt in range(2):  # the second, over all revolutions, only where no pass was found
                for n in range(first, last + 1):
                    y0 = axial[row] - lead * (angle[column] + n * turn)
                    b = min(bins - 1, max(0, int((y0 + reach) * bins / (2.0 * reach))))
                    if attempt == 0 and window[2, b] > sure + spread:
                        continue
                    under = (angle[column] + n * turn) / omega_c
                    begin = under - math.atan((window[1, b] - offset) / radius) / omega_c
                    end = under - math.atan((window[0, b] - offset) / radius) / omega_c
                    for j in range(teeth.shape[0]):
                        lowest = min(lowest, _lowest_pass(
                            begin, end, under, y0, teeth[j, 0], teeth[j, 1], radius, offset, lead, omega_t, omega_c,
                            bottom, vibration))
                if lowest < height[row, column]:
                    break
            height[row, column] = lowest


@njit(cache=True, error_model="numpy")
def _lowest_pass(
    begin: float, end: float, under: float, y0: float, tooth: float, stands_out: float, radius: float, offset: float,
    lead: float, omega_t: float, omega_c: float, bottom: Floats, vibration: Floats,
) -> float:
    """Lowest height [m] at which one tooth passes a place between two times [s]; see envelope."""
    turn, steps = 2.0 * math.pi, vibration.shape[0]
    least = 2.0 * radius * omega_c / omega_t
    k = math.ceil((_ahead(begin, under, y0, radius, offset, omega_c, least) + omega_t * begin + tooth) / turn)
    last = math.floor((_ahead(end, under, y0, radius, offset, omega_c, least) + omega_t * end + tooth) / turn)
    lowest = math.inf
    while k <= last:
        t = (k * turn - tooth) / omega_t
        t -= _ahead(t, under, y0, radius, offset, omega_c, least) / omega_t
        for _ in range(2):
            t = (k * turn - tooth - _ahead(t, under, y0, radius, offset, omega_c, least)) / omega_t
        psi = omega_c * (under - t)
        x = radius * math.tan(psi) + offset
        y = y0 + lead * omega_c * (under - t)
        place = omega_t * t / turn
        place = (place - math.floor(place)) * steps
        base = int(place)
        part = place - base
        moved = (1.0 - part) * vibration[base % steps] + part * vibration[(base + 1) % steps]
        up = bottom_height(math.sqrt(x * x + y * y), bottom) + moved - stands_out
        lowest = min(lowest, (radius + up) / math.cos(psi) - radius)
        k += 1
    return lowest


@njit(cache=True, error_model="numpy")
def _ahead(t: float, under: float, y: float, radius: float, offset: float, omega_c: float, least: float) -> float:
    """Minus the direction [rad] in which a material point lies from the tool axis, from +y_T towards +x_T.

    The point stands under the tool axis' middle plane at time `under` [s]. least [m]: |y| is not taken smaller.
    """
    x = radius * math.tan(omega_c * (under - t)) + offset
    if y >= 0.0:
        return -math.atan(x / max(y, least))
    return math.atan(x / max(-y, least)) - math.pi
