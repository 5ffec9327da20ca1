"""What an axisymmetric cutter has swept, point by point, and the arcs in which its surface meets material.

Positions in metres in the workpiece frame, which turns with the workpiece. A pose is the tool tip, the tool axis, what
both change by to the next pose, a column (12, K); a profile the numbers of `swept.profile_of`; a stock those of
`swept.Stock`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Where = tuple[Array, Array, Array, Array, Array]  # tool tip, tool axes, stock with its knots z and radius


TIGHT = 1e-9
"""Distance [m] within which a point at the surface of an earlier pose counts as removed."""

BLOCK = 32
"""Poses that are looked at together."""

# places in a profile; slopes are tangents, WIDEST is squared and a STEP, the longest way to a next pose, too wide;
# BALL is 1 where the tool ends in one, otherwise 0
(TIP_SLOPE, TIP_END, CENTRE_RADIUS, CENTRE_HEIGHT, CORNER_SQUARE, CORNER_END, FOOT, TAPER_SLOPE, TOP, WIPER, DISH_SLOPE,
 WIDEST, STEP, BALL) = range(14)


@njit(cache=True)
def within(profile: Array, square: float, z: float) -> bool:
    """Whether a point at the squared distance `square` from the tool axis and the height z is in the tool."""
    if z < -TIGHT or z > profile[TOP] or square >= profile[WIDEST]:
        return False
    z = max(z, 0.0)
    if z < profile[TIP_END]:
        reach = z / profile[TIP_SLOPE]
    elif z < profile[CORNER_END]:
        d = profile[CENTRE_HEIGHT] - z
        reach = profile[CENTRE_RADIUS] + math.sqrt(max(profile[CORNER_SQUARE] - d * d, 0.0))
    else:
        reach = profile[FOOT] + z * profile[TAPER_SLOPE]
    reach += TIGHT
    if square >= reach * reach:
        return False
    if z < profile[WIPER] * profile[DISH_SLOPE]:
        return bool(z > (profile[WIPER] - math.sqrt(square)) * profile[DISH_SLOPE] - TIGHT)
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
def _on_the_way(profile: Array, poses: Array, k: int, x: float, y: float, z: float, t: float) -> bool:
    """Whether the tool holds the point the part t of the way from pose k to the next."""
    dx, dy, dz = x - poses[0, k] - t * poses[6, k], y - poses[1, k] - t * poses[7, k], z - poses[2, k] - t * poses[8, k]
    h = (dx * (poses[3, k] + t * poses[9, k]) + dy * (poses[4, k] + t * poses[10, k])
         + dz * (poses[5, k] + t * poses[11, k]))
    return within(profile, dx * dx + dy * dy + dz * dz - h * h, h)


@njit(cache=True)
def _holds(profile: Array, poses: Array, k: int, x: float, y: float, z: float) -> bool:
    """Whether the tool holds the point at pose k or on the way to the next.

    On the way the point is looked at where it comes closest to the tool axis while it is above the tip, where it is
    highest, and where it comes closest to the centre of a ball; the tool is convex, so elsewhere it is no deeper in it
    but for a trifle.
    """
    dx, dy, dz = x - poses[0, k], y - poses[1, k], z - poses[2, k]
    ax, ay, az = poses[3, k], poses[4, k], poses[5, k]
    h = dx * ax + dy * ay + dz * az
    if within(profile, dx * dx + dy * dy + dz * dz - h * h, h):
        return True
    vx, vy, vz, wx, wy, wz = poses[6, k], poses[7, k], poses[8, k], poses[9, k], poses[10, k], poses[11, k]
    after = (dx - vx) * (ax + wx) + (dy - vy) * (ay + wy) + (dz - vz) * (az + wz)
    rise = vx * ax + vy * ay + vz * az
    if h < 0.0 and after < 0.0:  # it may come above the tip in between: its height is quadratic on the way
        bend = vx * wx + vy * wy + vz * wz
        t = 0.0 if bend <= 0.0 else (dx * wx + dy * wy + dz * wz - rise) / (2.0 * bend)
        return 0.0 < t < 1.0 and _on_the_way(profile, poses, k, x, y, z, t)
    sx, sy, sz = vx - rise * ax + h * wx, vy - rise * ay + h * wy, vz - rise * az + h * wz
    square = sx * sx + sy * sy + sz * sz
    t = 0.5 if square == 0.0 else (dx * sx + dy * sy + dz * sz) / square
    if h < 0.0:
        t = max(t, h / (h - after))
    elif after < 0.0:
        t = min(t, h / (h - after))
    if 0.0 < t < 1.0 and _on_the_way(profile, poses, k, x, y, z, t):
        return True
    if profile[CORNER_SQUARE] > 0.0:
        f = profile[CENTRE_HEIGHT]
        sx, sy, sz = vx + f * wx, vy + f * wy, vz + f * wz
        square = sx * sx + sy * sy + sz * sz
        t = 0.5 if square == 0.0 else ((dx - f * ax) * sx + (dy - f * ay) * sy + (dz - f * az) * sz) / square
        return 0.0 < t < 1.0 and _on_the_way(profile, poses, k, x, y, z, t)
    return False


@njit(cache=True)
def covered_by(profile: Array, poses: Array, x: float, y: float, z: float, hint: int) -> int:
    """Index of a pose (columns of poses) whose tool holds the point, `hint` tried first; -1 where there is none."""
    if 0 <= hint < poses.shape[1] and _holds(profile, poses, hint, x, y, z):
        return hint
    tip_x, tip_y, tip_z, axis_x, axis_y, axis_z = poses[0], poses[1], poses[2], poses[3], poses[4], poses[5]
    lowest, highest, widest = -profile[STEP], profile[TOP], profile[WIDEST]
    centre, ball = profile[CENTRE_HEIGHT], profile[BALL]
    n = poses.shape[1]
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        candidates = 0
        for k in range(first, last):  # without branches, so that it is vectorized
            dx, dy, dz = x - tip_x[k], y - tip_y[k], z - tip_z[k]
            h = dx * axis_x[k] + dy * axis_y[k] + dz * axis_z[k]
            below = min(h - centre, 0.0)
            square = dx * dx + dy * dy + dz * dz - h * h + ball * below * below
            candidates += (square < widest) & (h > lowest) & (h <= highest)
        if candidates > 0:
            for k in range(first, last):
                dx, dy, dz = x - tip_x[k], y - tip_y[k], z - tip_z[k]
                h = dx * axis_x[k] + dy * axis_y[k] + dz * axis_z[k]
                below = min(h - centre, 0.0)
                if h <= lowest or dx * dx + dy * dy + dz * dz - h * h + ball * below * below >= widest:
                    continue
                if _holds(profile, poses, k, x, y, z):
                    return k
    return -1


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
def near(poses: Array, centre: Array, size: float, profile: Array, chosen: NDArray[np.int64]) -> int:
    """Put the places of poses whose tool may reach into the ball `size` around `centre` in `chosen`; their number."""
    count = 0
    for k in range(poses.shape[1]):
        dx, dy, dz = centre[0] - poses[0, k], centre[1] - poses[1, k], centre[2] - poses[2, k]
        h = dx * poses[3, k] + dy * poses[4, k] + dz * poses[5, k]
        if h < -size or h > profile[TOP] + size:
            continue
        lateral = math.sqrt(max(dx * dx + dy * dy + dz * dz - h * h, 0.0))
        if lateral < size + math.sqrt(profile[WIDEST]):
            chosen[count] = k
            count += 1
    return count


@njit(cache=True)
def _leading(feed: Array) -> tuple[float, float]:
    """Angles between which f . n > 0; equal where there are none."""
    size = math.hypot(feed[0], feed[1])
    if feed[2] <= -size:
        return 0.0, 0.0
    middle = math.atan2(feed[0], feed[1])
    half = math.pi if feed[2] >= size else math.acos(-feed[2] / size)
    return middle - half, middle + half


@njit(cache=True)
def _place(radius: float, height: float, phi: float, where: Where) -> tuple[float, float, float]:
    """Place of a point of the tool's surface in the workpiece frame."""
    origin, axes = where[0], where[1]
    x, y = radius * math.sin(phi), radius * math.cos(phi)
    return (origin[0] + axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * height,
            origin[1] + axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * height,
            origin[2] + axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * height)


@njit(cache=True)
def _probe(
    radius: float, height: float, phi: float, where: Where, profile: Array, poses: Array, ball: Array, inner: Array,
    hint: int,
) -> tuple[bool, int]:
    """Whether there is material at the angle phi of a circle on the tool, and the pose that took it otherwise."""
    x, y, z = _place(radius, height, phi, where)
    if not in_stock(where[2], where[3], where[4], x, y, z):
        return False, hint
    if ball[3] > 0 and (x - ball[0]) ** 2 + (y - ball[1]) ** 2 + (z - ball[2]) ** 2 < ball[3] ** 2:
        return covered_by(profile, inner, x, y, z, -1) < 0, hint
    found = covered_by(profile, poses, x, y, z, hint)
    return found < 0, found if found >= 0 else hint


@njit(cache=True)
def _core(
    radius: Array, height: Array, feed: Array, where: Where, profile: Array, poses: Array, step: float
) -> tuple[Array, Array]:
    """A ball (centre, size) that holds most of the material met, and the poses that reach into it.

    Found on some of the circles; a point inside it needs only those poses.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    hint, none, nowhere = -1, np.empty((12, 0)), np.array([0.0, 0.0, 0.0, -1.0])
    if poses.shape[1] < 2 * BLOCK:
        return nowhere, none
    for k in range(0, radius.size, 6):
        first, last = _leading(feed[k])
        for i in range(math.ceil((last - first) / step)):
            phi = first + (i + 0.5) * step
            now, hint = _probe(radius[k], height[k], phi, where, profile, poses, nowhere, none, hint)
            if now:
                place = _place(radius[k], height[k], phi, where)
                for axis in range(3):
                    low[axis] = min(low[axis], place[axis])
                    high[axis] = max(high[axis], place[axis])
    ball = nowhere
    if low[0] <= high[0]:
        ball[:3] = (low + high) / 2
        ball[3] = 0.55 * math.sqrt(np.sum((high - low) ** 2)) + step * radius.max()
    chosen = np.empty(poses.shape[1], dtype=np.int64)
    return ball, poses[:, chosen[:near(poses, ball[:3], ball[3], profile, chosen)]]


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
    where = (origin, axes, stock, z_knots, radius_knots)
    ball, inner = _core(radius, height, feed, where, profile, poses, 2 * step)
    hint = -1
    for k in range(radius.size):
        start[k, :] = np.nan
        stop[k, :] = np.nan
        low, high = _leading(feed[k])
        if high <= low:
            continue
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
            now, hint = _probe(radius[k], height[k], phi, where, profile, poses, ball, inner, hint)
            if i == 0:
                was = now
            elif now != was:
                a, b = before, phi
                while b - a > tolerance:
                    c = (a + b) / 2
                    at, hint = _probe(radius[k], height[k], c, where, profile, poses, ball, inner, hint)
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
    for turn in range(2 * radius.size - 2):  # up, then down: arcs that are narrower than a step, beside a wider one
        k = turn + 1 if turn < radius.size - 1 else 2 * radius.size - 3 - turn
        beside = k - 1 if turn < radius.size - 1 else k + 1
        low, high = _leading(feed[k])
        for arc in range(start.shape[1]):
            if high <= low or not start[beside, arc] < stop[beside, arc]:
                break
            phi = (start[beside, arc] + stop[beside, arc]) / 2
            phi += 2 * math.pi * math.floor((high - phi) / (2 * math.pi))
            place = 0
            while place < start.shape[1] and stop[k, place] < phi:
                place += 1
            if phi <= low or place == start.shape[1] or start[k, place] <= phi:
                continue
            now, hint = _probe(radius[k], height[k], phi, where, profile, poses, ball, inner, hint)
            if now:
                room = (high - low) / max(4, math.ceil((high - low) / step))
                first, last = max(low, phi - room), min(high, phi + room)
                if place > 0:
                    first = max(first, stop[k, place - 1])
                if start[k, place] < last:
                    last = start[k, place]
                for i in range(start.shape[1] - 1, place, -1):
                    start[k, i], stop[k, i] = start[k, i - 1], stop[k, i - 1]
                for side, edge in enumerate((first, last)):
                    inside, outside = phi, edge
                    while abs(outside - inside) > tolerance:
                        c = (inside + outside) / 2
                        at, hint = _probe(radius[k], height[k], c, where, profile, poses, ball, inner, hint)
                        if at:
                            inside = c
                        else:
                            outside = c
                    if side == 0:
                        start[k, place] = (inside + outside) / 2
                    else:
                        stop[k, place] = (inside + outside) / 2
                count = 0
                while count < start.shape[1] and start[k, count] < stop[k, count]:
                    count += 1
                most = max(most, count + 1)
    return most


@njit(cache=True)
def touching(
    origin: Array, axes: Array, stock: Array, z_knots: Array, radius_knots: Array, radii: Array, heights: Array,
    angles: int, result: Array,
) -> None:
    """Set result (n,) to 1 where a circle of the tool (radii, heights) has one of `angles` points in the stock."""
    where = (origin, axes, stock, z_knots, radius_knots)
    for k in range(radii.size):
        result[k] = 0.0
        for i in range(angles):
            x, y, z = _place(radii[k], heights[k], 2 * math.pi * i / angles, where)
            if in_stock(stock, z_knots, radius_knots, x, y, z):
                result[k] = 1.0
                break
