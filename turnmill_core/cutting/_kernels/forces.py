"""Loops that the profiler blamed: forces over a tool revolution, element by element.

Each has a plain numpy twin in forces.py that gives the same numbers to round-off. Arguments and
results are arrays in SI; shapes: n angles, N teeth, m heights, K predecessors.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def static_forces(
    count: int, enter: Array, leave: Array, offset: Array, runout: Array, radius: Array, height: Array,
    sin_kappa: Array, cos_kappa: Array, lag: Array, start: Array, stop: Array, feed: Array, delay: Array, step: Array,
    width: Array, length: Array, coefficients: Array, origin: Array, axis: Array, result: Array,
) -> None:
    """Add forces (x, y, z), tool torque and workpiece torque of the static chip to `result` (count, 5).

    Around the start of an arc an element comes into the cut over the window `enter` [rad] (N, m, A), around
    its exit it goes out over `leave`; within a window it counts with the share that is in the cut,
    evaluated at the middle of that share. coefficients (m, 6) by element.
    """
    cell = 2 * math.pi / count
    sine, cosine = np.empty(count), np.empty(count)
    for i in range(count):
        sine[i], cosine[i] = math.sin(i * cell), math.cos(i * cell)
    for j in range(offset.size):
        for k in range(radius.size):
            base = offset[j] - lag[j, k]
            sin_base, cos_base = math.sin(base), math.cos(base)
            fx, fy, fn = feed[k]
            sk, ck, r = sin_kappa[k], cos_kappa[k], radius[k] + runout[j]
            ktc, krc, kac, kte, kre, kae = coefficients[k]
            edge_t, edge_r, edge_a = kte * length[j, k], kre * length[j, k], kae * length[j, k]
            arm_x, arm_y = origin[0] + axis[1] * height[k], origin[1] - axis[0] * height[k]
            for arc in range(start.shape[1]):
                if stop[k, arc] <= start[k, arc]:
                    continue
                low, high = start[k, arc] - base, stop[k, arc] - base
                before, after = enter[j, k, arc], leave[j, k, arc]
                first = math.floor((low - before / 2) / cell)
                last = math.ceil((high + after / 2) / cell)
                row = first % count
                for i in range(first, last + 1):
                    middle = i * cell
                    outside = max(0.0, low - middle + before / 2)
                    past = max(0.0, middle + after / 2 - high)
                    if outside < before and past < after:
                        if outside > 0.0 or past > 0.0:
                            share = (1.0 - outside / before) * (1.0 - past / after)
                            angle = middle + base + (outside - past) / 2
                            s, c = math.sin(angle), math.cos(angle)
                        else:
                            share = 1.0
                            s = sine[row] * cos_base + cosine[row] * sin_base
                            c = cosine[row] * cos_base - sine[row] * sin_base
                        along = fx * s + fy * c + fn
                        h = along * delay[k, j, 0] + step[k, j, 0]
                        for p in range(1, delay.shape[2]):
                            h = min(h, along * delay[k, j, p] + step[k, j, p])
                        if h > 0.0:
                            area = h * width[k]
                            ft = share * (ktc * area + edge_t)
                            fr = share * (krc * area + edge_r)
                            fa = share * (kac * area + edge_a)
                            across = sk * fr + ck * fa
                            x, y, z = -across * s - ft * c, -across * c + ft * s, ck * fr - sk * fa
                            result[row, 0] += x
                            result[row, 1] += y
                            result[row, 2] += z
                            result[row, 3] += r * ft
                            result[row, 4] += ((arm_x - axis[2] * (r * c)) * x + (arm_y + axis[2] * (r * s)) * y
                                               + (origin[2] + axis[0] * (r * c) - axis[1] * (r * s)) * z)
                    row += 1
                    if row == count:
                        row = 0


@njit(cache=True)
def exact_forces(
    count: int, offset: Array, runout: Array, tool_radius: float, lag: Array, feed: Array, sense: float, lead: float,
    lower: float, upper: float, half_width: Array, tooth_lag: Array, step: Array, tool_speed: float, width: Array,
    length: Array, coefficients: Array, lever: Array, result: Array,
) -> float:
    """Add forces (x, y, z), tool torque and workpiece torque of the exact chip to `result` (count, 5).

    A cylinder. Evaluated at the angles themselves. Returns the largest chip [m].
    """
    cell = 2 * math.pi / count
    sine, cosine = np.empty(count), np.empty(count)
    for i in range(count):
        sine[i], cosine[i] = math.sin(i * cell), math.cos(i * cell)
    ktc, krc, kac, kte, kre, kae = coefficients
    largest = 0.0
    for j in range(offset.size):
        radius = tool_radius + runout[j]
        for k in range(lever.size):
            base = offset[j] - lag[j, k]
            sin_base, cos_base = math.sin(base), math.cos(base)
            fx, fy = feed[k, 0], feed[k, 1]
            for i in range(count):
                s = sine[i] * cos_base + cosine[i] * sin_base
                c = cosine[i] * cos_base - sine[i] * sin_base
                # material inside the bar and between the walls
                inner, outer = 0.0, radius
                if s != 0.0:
                    outer = min(outer, half_width[k] / abs(s))
                x = radius * s
                square = lever[k] * lever[k] + x * x
                place = (sense * radius * c - lead * math.atan2(x, lever[k])
                         - tool_radius * (math.sqrt(1.0 + lead * lead / square) - 1.0))
                slope = sense * c - lead * s * lever[k] / square
                if slope != 0.0:
                    if lower > -math.inf:
                        bound = radius - (place - lower) / slope
                        if slope > 0.0:
                            inner = max(inner, bound)
                        else:
                            outer = min(outer, bound)
                    if upper < math.inf:
                        bound = radius - (place - upper) / slope
                        if slope < 0.0:
                            inner = max(inner, bound)
                        else:
                            outer = min(outer, bound)
                along, across = fx * s + fy * c, fx * c - fy * s
                for p in range(tooth_lag.shape[1]):
                    if outer <= inner:
                        break
                    r = radius - step[j, p]
                    q = across / (tool_speed * r)
                    delta = q * tooth_lag[j, p] / (1.0 + q)
                    # behind the feed: no chip even if the path bends twice as much as it does
                    if step[j, p] + r * delta * delta + along * (tooth_lag[j, p] - delta) / tool_speed < 0.0:
                        inner = outer
                        break
                    for _ in range(3):
                        sin_delta, cos_delta = math.sin(delta), math.cos(delta)
                        change = (sin_delta - q * (tooth_lag[j, p] - delta)) / (cos_delta + q)
                        delta -= change
                        if abs(change) < 1e-8:  # the next step would be its square
                            break
                    # cosine of the last step, expanded
                    cos_delta += sin_delta * change - cos_delta * change * change / 2
                    inner = max(inner, r * cos_delta - along * (tooth_lag[j, p] - delta) / tool_speed)
                h = outer - inner
                if h > 0.0:
                    largest = max(largest, h)
                    ft = ktc * h * width[k] + kte * length[j, k]
                    fr = krc * h * width[k] + kre * length[j, k]
                    fa = kac * h * width[k] + kae * length[j, k]
                    force = -fr * s - ft * c
                    result[i, 0] += force
                    result[i, 1] += -fr * c + ft * s
                    result[i, 2] -= fa
                    result[i, 3] += radius * ft
                    result[i, 4] -= lever[k] * force + radius * s * fa
    return largest
