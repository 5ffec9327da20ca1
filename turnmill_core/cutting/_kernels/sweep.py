"""What an axisymmetric cutter has swept, point by point, and the arcs in which its surface meets material.

Positions in metres in the workpiece frame, which turns with the workpiece. A pose is the tool tip, the tool
axis, and what both change by to the next pose (12,); a profile the numbers of `swept.profile_of`; a stock those
of `swept.stock_of`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


TIGHT = 1e-9
"""Distance [m] within which a point at the surface of an earlier pose counts as removed."""

# places in a profile; slopes are tangents, WIDEST is squared, CUSP is left between two poses
(TIP_SLOPE, TIP_END, CENTRE_RADIUS, CENTRE_HEIGHT, CORNER_SQUARE, CORNER_END, FOOT, TAPER_SLOPE, TOP, WIPER, DISH_SLOPE,
 WIDEST, CUSP) = range(13)


@njit(cache=True)
def within(profile: Array, square: float, z: float, margin: float) -> bool:
    """Whether a point at the squared distance `square` from the axis and the height z is in the tool, or that close."""
    if z < -margin or z > profile[TOP] or square >= profile[WIDEST]:
        return False
    z = max(z, 0.0)
    if z < profile[TIP_END]:
        reach = z / profile[TIP_SLOPE]
    elif z < profile[CORNER_END]:
        d = profile[CENTRE_HEIGHT] - z
        reach = profile[CENTRE_RADIUS] + math.sqrt(max(profile[CORNER_SQUARE] - d * d, 0.0))
    else:
        reach = profile[FOOT] + z * profile[TAPER_SLOPE]
    reach += margin
    if square >= reach * reach:
        return False
    if z < profile[WIPER] * profile[DISH_SLOPE]:
        return bool(z > (profile[WIPER] - math.sqrt(square)) * profile[DISH_SLOPE] - margin)
    return True


@njit(cache=True)
def in_stock(stock: Array, z_knots: Array, radius_knots: Array, x: float, y: float, z: float) -> bool:
    """Whether a point is in the uncut stock: a box, or a bar whose radius is linear between knots of falling z."""
    if x < stock[0] or x > stock[1] or y < stock[2] or y > stock[3] or z < stock[4] or z > stock[5]:
        return False
    if stock[6] == 0.0:
        return True
    n = z_knots.size
    low, high = 0, n - 1
    if z >= z_knots[0]:
        radius = radius_knots[0]
    elif z <= z_knots[n - 1]:
        radius = radius_knots[n - 1]
    else:
        while high - low > 1:
            middle = (low + high) // 2
            if z_knots[middle] >= z:
                low = middle
            else:
                high = middle
        share = (z_knots[low] - z) / (z_knots[low] - z_knots[high])
        radius = radius_knots[low] + share * (radius_knots[high] - radius_knots[low])
    return bool(x * x + y * y <= radius * radius)


@njit(cache=True)
def covered_by(profile: Array, poses: Array, x: float, y: float, z: float, hint: int) -> int:
    """Index of a pose whose tool holds the point, `hint` tried first; -1 where there is none."""
    n = len(poses)
    for i in range(-1, n):
        k = i
        if i < 0:
            if hint < 0 or hint >= n:
                continue
            k = hint
        dx, dy, dz = x - poses[k, 0], y - poses[k, 1], z - poses[k, 2]
        h = dx * poses[k, 3] + dy * poses[k, 4] + dz * poses[k, 5]
        if h < -profile[CUSP]:
            continue
        square = dx * dx + dy * dy + dz * dz - h * h
        if within(profile, square, h, profile[CUSP]) and (
                within(profile, square, h, TIGHT) or _between(profile, poses[k], x, y, z)):
            return k
    return -1


@njit(cache=True)
def _between(profile: Array, pose: Array, x: float, y: float, z: float) -> bool:
    """Whether the tool holds the point somewhere within half a step of a pose."""
    for i in range(1, 5):
        for t in (i / 8, -i / 8):
            dx, dy, dz = x - pose[0] - t * pose[6], y - pose[1] - t * pose[7], z - pose[2] - t * pose[8]
            h = dx * (pose[3] + t * pose[9]) + dy * (pose[4] + t * pose[10]) + dz * (pose[5] + t * pose[11])
            if within(profile, dx * dx + dy * dy + dz * dz - h * h, h, TIGHT):
                return True
    return False


@njit(cache=True)
def material(
    profile: Array, poses: Array, stock: Array, z_knots: Array, radius_knots: Array, points: Array, result: Array
) -> None:
    """Set result (n,) to 1 where a point (n, 3) is in the stock and in none of the poses, else to 0."""
    hint = -1
    for i in range(len(points)):
        x, y, z = points[i]
        result[i] = 0.0
        if in_stock(stock, z_knots, radius_knots, x, y, z):
            found = covered_by(profile, poses, x, y, z, hint)
            if found < 0:
                result[i] = 1.0
            else:
                hint = found


@njit(cache=True)
def arcs(
    radius: Array, height: Array, feed: Array, origin: Array, axes: Array, profile: Array, poses: Array, stock: Array,
    z_knots: Array, radius_knots: Array, step: float, tolerance: float, start: Array, stop: Array,
) -> int:
    """Find the arcs in which circles of the tool's surface move into material.

    radius, height (m,), feed (m, 3): coefficients of sin, cos and 1 in f . n; origin (3,) tool tip and axes (3, 3)
    columns x_T, y_T, z_T of the tool now; step: angle between probes; ends are found to `tolerance` [rad]. start, stop
    (m, A) are filled with arcs, NaN behind the last. Returns the largest number of arcs found on a circle, which may be
    more than A.
    """
    most = 0
    hint = -1
    for k in range(radius.size):
        start[k, :] = np.nan
        stop[k, :] = np.nan
        size = math.hypot(feed[k, 0], feed[k, 1])
        if feed[k, 2] <= -size:
            continue
        middle = math.atan2(feed[k, 0], feed[k, 1])
        half = math.pi if feed[k, 2] >= size else math.acos(-feed[k, 2] / size)
        low, high = middle - half, middle + half
        count = max(4, math.ceil((high - low) / step))
        found = 0
        before, was = low, False
        begin = low
        for i in range(count + 1):
            phi = low + (high - low) * i / count
            if i == 0:
                phi += tolerance
            elif i == count:
                phi -= tolerance
            now, hint = _probe(radius[k], height[k], phi, origin, axes, profile, poses, stock, z_knots, radius_knots,
                               hint)
            if i == 0:
                was = now
            elif now != was:
                a, b = before, phi
                while b - a > tolerance:
                    c = (a + b) / 2
                    at, hint = _probe(radius[k], height[k], c, origin, axes, profile, poses, stock, z_knots,
                                      radius_knots, hint)
                    if at == was:
                        a = c
                    else:
                        b = c
                if now:
                    begin = (a + b) / 2
                else:
                    if found < start.shape[1]:
                        start[k, found], stop[k, found] = begin, (a + b) / 2
                    found += 1
                was = now
            before = phi
        if was:
            if found < start.shape[1]:
                start[k, found], stop[k, found] = begin, high
            found += 1
        most = max(most, found)
    return most


@njit(cache=True)
def _probe(
    radius: float, height: float, phi: float, origin: Array, axes: Array, profile: Array, poses: Array, stock: Array,
    z_knots: Array, radius_knots: Array, hint: int,
) -> tuple[bool, int]:
    """Whether there is material at the angle phi of a circle on the tool, and the pose that took it otherwise."""
    x, y = radius * math.sin(phi), radius * math.cos(phi)
    px = origin[0] + axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * height
    py = origin[1] + axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * height
    pz = origin[2] + axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * height
    if not in_stock(stock, z_knots, radius_knots, px, py, pz):
        return False, hint
    found = covered_by(profile, poses, px, py, pz, hint)
    return found < 0, found if found >= 0 else hint


@njit(cache=True)
def near(poses: Array, centre: Array, size: float, profile: Array, chosen: Array) -> int:
    """Put the poses (K, 12) whose tool may reach into the ball `size` around `centre` into `chosen`; their number."""
    count = 0
    for k in range(len(poses)):
        dx, dy, dz = centre[0] - poses[k, 0], centre[1] - poses[k, 1], centre[2] - poses[k, 2]
        h = dx * poses[k, 3] + dy * poses[k, 4] + dz * poses[k, 5]
        if h < -size or h > profile[TOP] + size:
            continue
        lateral = math.sqrt(max(dx * dx + dy * dy + dz * dz - h * h, 0.0))
        if lateral < size + math.sqrt(profile[WIDEST]):
            chosen[count] = poses[k]
            count += 1
    return count


@njit(cache=True)
def touching(
    profile: Array, origin: Array, axes: Array, stock: Array, z_knots: Array, radius_knots: Array, radii: Array,
    heights: Array, angles: int, result: Array,
) -> None:
    """Set result (n,) to 1 where a circle of the tool (radii, heights) has one of `angles` points in the stock."""
    poses = np.empty((0, 12))
    for k in range(radii.size):
        result[k] = 0.0
        for i in range(angles):
            phi = 2 * math.pi * i / angles
            hit, _ = _probe(radii[k], heights[k], phi, origin, axes, profile, poses, stock, z_knots, radius_knots, -1)
            if hit:
                result[k] = 1.0
                break
