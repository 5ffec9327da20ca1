"""Compiled loops of the process simulator; everything else in this room is plain Python.

`advance.py_func` is the plain version of the integrator; tests/process compare the two bit by bit,
and hold both against independent solutions.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Columns of `knots`, one row per axis state.
TIME, TOOL_ANGLE, TOOL_SPEED, SLIP, DEPTH, FEED_X, FEED_X_SLOPE, FEED_Y, START, EXIT = range(10)
KNOT_COLUMNS = 10
# SLIP: relative lengthening of the delay; FEED_X [m/s] at the tool tip and its SLOPE along the tool
# axis [1/s]; START, EXIT [rad] of the arc across the feed, the end of the bar left out.
# Columns of `modes`: exact transition of one oscillator over one step with a force linear in time.
A11, A12, A21, A22, B1, C1, B2, C2, STIFFNESS, DAMPING, INVERSE_MASS, SHAPE_X, SHAPE_Y, SHAPE_Z, SIDE, RADIATION = range(16)
MODE_COLUMNS = 16
# SIDE: +1 on the tool, -1 on the workpiece, 0 radiates only (does not move the cutting point).
# Columns of `raw`, one row per step.
RAW = (
    "angle", "sound", "tool_x", "tool_y", "tool_z", "workpiece_x", "workpiece_y", "workpiece_z",
    "force_x", "force_y", "force_z",
)
# Entries of `scalars`, carried from step to step.
ANGLE, PSI, LAST_DEPTH, CHIP = range(4)
TIME_TOLERANCE = 0.5e-9


@njit(cache=True)
def _ramp(u: float) -> float:
    """Step function averaged with a hat of width one step; u in steps past the edge."""
    if u <= -1.0:
        return 0.0
    if u >= 1.0:
        return 1.0
    if u < 0.0:
        return 0.5 * (1.0 + u) * (1.0 + u)
    return 1.0 - 0.5 * (1.0 - u) * (1.0 - u)


@njit(cache=True)
def _cubic(row: Floats, position: float) -> float:
    """Value of the periodic table `row` at a fractional `position` (four-point Lagrange)."""
    cells = row.shape[0]
    base = math.floor(position)
    t = position - base
    i = int(base) % cells
    m = row[i - 1 if i > 0 else cells - 1]
    a = row[i]
    b = row[i + 1 if i + 1 < cells else i + 1 - cells]
    c = row[i + 2 if i + 2 < cells else i + 2 - cells]
    s = 1.0 - t
    return (
        -t * s * (1.0 + s) / 6.0 * m + (1.0 + t) * s * (1.0 + s) / 2.0 * a
        + (1.0 + t) * t * (1.0 + s) / 2.0 * b - (1.0 + t) * t * s / 6.0 * c
    )


@njit(cache=True)
def _hermite(a: float, va: float, b: float, vb: float, h: float, u: float) -> float:
    """Cubic through values a, b and slopes va, vb at the ends of an interval of length h, at fraction u."""
    w = 1.0 - u
    return a * w * w * (1.0 + 2.0 * u) + b * u * u * (3.0 - 2.0 * u) + h * u * w * (va * w - vb * u)


@njit(cache=True)
def advance(
    first: int, dt: float, knots: Floats, modes: Floats, tooth_angle: Floats, pitch: Floats, runout: Floats,
    radius: float, bar_radius: float, lag_per_depth: float, coefficients: Floats, modal: Floats, force: Floats, scalars: Floats,
    surface: Floats, raw: Floats, marks_per_turn: int, marks: Floats,
) -> int:
    """Integrate the cut over len(raw) steps of `dt`, from step index `first`; returns the marks written.

    knots (K, 10): axis states, times ascending; modes (M, 16); tooth_angle, pitch [rad], runout [m]
    (teeth,); radius of the tool and bar_radius (0: a block) [m]; lag_per_depth [rad/m]; coefficients Ktc, Krc, Kac [Pa], Kte, Kre, Kae [N/m].
    Updated in place: modal (M, 2) displacement and velocity, force (3,) on the tool, scalars (4,),
    surface (teeth, slices, cells) [m]. Written: raw (steps, 11), see RAW; marks (>= steps, 4): time,
    relative displacement x, y, and largest chip since the last mark, at every 2 pi / marks_per_turn
    of the tool angle.
    """
    teeth, slices, cells = surface.shape
    cell = 2.0 * math.pi / cells
    mark_angle = 2.0 * math.pi / marks_per_turn
    longest_pitch = pitch.max()
    predicted = np.empty((modes.shape[0], 2))
    zone = np.zeros((teeth, slices), dtype=np.bool_)
    wrapped = np.empty((teeth, slices))
    height = np.full((teeth, slices), -1.0)  # middle of the engaged part of the slice, or -1
    written = 0
    k = 0
    rx = ry = vx = vy = 0.0
    for m in range(modes.shape[0]):
        side = modes[m, SIDE]
        rx += side * side * modes[m, SHAPE_X] * modal[m, 0]
        ry += side * side * modes[m, SHAPE_Y] * modal[m, 0]
        vx += side * side * modes[m, SHAPE_X] * modal[m, 1]
        vy += side * side * modes[m, SHAPE_Y] * modal[m, 1]
    for i in range(raw.shape[0]):
        time = (first + i + 1) * dt
        while k + 2 < knots.shape[0] and time > knots[k + 1, TIME] + TIME_TOLERANCE:
            k += 1
        span = knots[k + 1, TIME] - knots[k, TIME]
        u = (time - knots[k, TIME]) / span
        w = 1.0 - u
        tool_speed = w * knots[k, TOOL_SPEED] + u * knots[k + 1, TOOL_SPEED]
        slip = w * knots[k, SLIP] + u * knots[k + 1, SLIP]
        depth = max(0.0, w * knots[k, DEPTH] + u * knots[k + 1, DEPTH])
        feed_x = w * knots[k, FEED_X] + u * knots[k + 1, FEED_X]
        feed_x_slope = w * knots[k, FEED_X_SLOPE] + u * knots[k + 1, FEED_X_SLOPE]
        feed_y = w * knots[k, FEED_Y] + u * knots[k + 1, FEED_Y]
        start = w * knots[k, START] + u * knots[k + 1, START]
        leave = w * knots[k, EXIT] + u * knots[k + 1, EXIT]
        angle = _hermite(knots[k, TOOL_ANGLE], knots[k, TOOL_SPEED], knots[k + 1, TOOL_ANGLE],
                         knots[k + 1, TOOL_SPEED], span, u)
        turned = angle - scalars[ANGLE]
        psi0 = scalars[PSI]
        psi1 = psi0 + turned / (1.0 + slip)

        # Displacement at the end of the step, the force held: third order in dt at the chip.
        px = py = 0.0
        for m in range(modes.shape[0]):
            load = modes[m, SHAPE_X] * force[0] + modes[m, SHAPE_Y] * force[1] + modes[m, SHAPE_Z] * force[2]
            predicted[m, 0] = modes[m, A11] * modal[m, 0] + modes[m, A12] * modal[m, 1] + modes[m, B1] * load
            predicted[m, 1] = modes[m, A21] * modal[m, 0] + modes[m, A22] * modal[m, 1] + modes[m, B2] * load
            end = predicted[m, 0] + modes[m, C1] * load
            side = modes[m, SIDE]
            px += side * side * modes[m, SHAPE_X] * end
            py += side * side * modes[m, SHAPE_Y] * end

        # Cutting force there.
        fx = fy = fz = 0.0
        chip = 0.0
        margin = 4.0 * max(cell, turned) + 1.5 * longest_pitch * slip
        lowest = 0.5 * (start + leave) - math.pi
        inner = bar_radius - depth
        lag_step = lag_per_depth * depth / slices
        turning = turned > 0.0 and tool_speed > 0.0 and leave > start
        if turning:
            for j in range(teeth):
                period = pitch[j] / tool_speed
                ahead = j + 1 if j + 1 < teeth else 0
                for s in range(slices):
                    lag = (s + 0.5) * lag_step
                    phi = angle + tooth_angle[j] - lag
                    phi -= 2.0 * math.pi * math.floor((phi - lowest) / (2.0 * math.pi))
                    wrapped[j, s] = phi
                    zone[j, s] = start - margin <= phi <= leave + margin
                    height[j, s] = -1.0
                    if not zone[j, s] or depth <= 0.0:
                        continue
                    weight = _ramp((phi - start) / turned) - _ramp((phi - leave) / turned)
                    if weight <= 0.0:
                        continue
                    sin, cos = math.sin(phi), math.cos(phi)
                    low = depth * s / slices
                    high = depth * (s + 1) / slices
                    if bar_radius > 0.0:
                        reach = radius * sin
                        high = min(high, math.sqrt(max(0.0, bar_radius * bar_radius - reach * reach)) - inner)
                    width = weight * (high - low)
                    if width <= 0.0:
                        continue
                    height[j, s] = 0.5 * (low + high)
                    feed = (feed_x + feed_x_slope * height[j, s]) * sin + feed_y * cos
                    left = _cubic(surface[ahead, s], (psi1 + tooth_angle[j] - lag) / cell)
                    h = runout[j] + px * sin + py * cos + feed * period - left
                    if h <= 0.0:
                        continue
                    chip = max(chip, h)
                    tangential = width * (coefficients[0] * h + coefficients[3])
                    radial = width * (coefficients[1] * h + coefficients[4])
                    axial = width * (coefficients[2] * h + coefficients[5])
                    fx -= radial * sin + tangential * cos
                    fy -= radial * cos - tangential * sin
                    fz -= axial

        # Modes with the force linear over the step.
        sound = 0.0
        dx0, dy0, dvx0, dvy0 = rx, ry, vx, vy
        rx = ry = vx = vy = 0.0
        for c in range(raw.shape[1]):
            raw[i, c] = 0.0
        for m in range(modes.shape[0]):
            load = modes[m, SHAPE_X] * fx + modes[m, SHAPE_Y] * fy + modes[m, SHAPE_Z] * fz
            q = predicted[m, 0] + modes[m, C1] * load
            v = predicted[m, 1] + modes[m, C2] * load
            modal[m, 0] = q
            modal[m, 1] = v
            acceleration = modes[m, INVERSE_MASS] * (load - modes[m, STIFFNESS] * q - modes[m, DAMPING] * v)
            sound += modes[m, RADIATION] * acceleration
            side = modes[m, SIDE]
            if side == 0.0:
                continue
            rx += modes[m, SHAPE_X] * q
            ry += modes[m, SHAPE_Y] * q
            vx += modes[m, SHAPE_X] * v
            vy += modes[m, SHAPE_Y] * v
            column = 2 if side > 0.0 else 5
            raw[i, column] += side * modes[m, SHAPE_X] * q
            raw[i, column + 1] += side * modes[m, SHAPE_Y] * q
            raw[i, column + 2] += side * modes[m, SHAPE_Z] * q
        force[0], force[1], force[2] = fx, fy, fz
        raw[i, 0] = angle
        raw[i, 1] = sound
        raw[i, 8], raw[i, 9], raw[i, 10] = fx, fy, fz

        # The surface that each tooth leaves, at every node of material angle that it passed.
        if turning:
            lag_before = lag_per_depth * scalars[LAST_DEPTH] / slices
            for j in range(teeth):
                period = pitch[j] / tool_speed
                ahead = j + 1 if j + 1 < teeth else 0
                for s in range(slices):
                    if not zone[j, s]:
                        continue
                    before = (psi0 + tooth_angle[j] - (s + 0.5) * lag_before) / cell
                    after = (psi1 + tooth_angle[j] - (s + 0.5) * lag_step) / cell
                    node = math.floor(before) + 1.0
                    while node <= after:
                        part = (node - before) / (after - before)
                        phi = wrapped[j, s] - (1.0 - part) * turned
                        sin, cos = math.sin(phi), math.cos(phi)
                        edge = runout[j] + sin * _hermite(dx0, dvx0, rx, vx, dt, part) \
                            + cos * _hermite(dy0, dvy0, ry, vy, dt, part)
                        place = int(node) % cells
                        if height[j, s] >= 0.0 and start <= phi <= leave:
                            feed = (feed_x + feed_x_slope * height[j, s]) * sin + feed_y * cos
                            edge = max(edge, surface[ahead, s, place] - feed * period)
                        surface[j, s, place] = edge
                        node += 1.0

        # Relative displacement at equal angles of the tool, for the truth.
        scalars[CHIP] = max(scalars[CHIP], chip)
        if turned > 0.0:
            mark = math.floor(scalars[ANGLE] / mark_angle) + 1.0
            while mark * mark_angle <= angle:
                part = (mark * mark_angle - scalars[ANGLE]) / turned
                marks[written, 0] = time - (1.0 - part) * dt
                marks[written, 1] = _hermite(dx0, dvx0, rx, vx, dt, part)
                marks[written, 2] = _hermite(dy0, dvy0, ry, vy, dt, part)
                marks[written, 3] = scalars[CHIP]
                scalars[CHIP] = 0.0
                written += 1
                mark += 1.0
        scalars[ANGLE] = angle
        scalars[PSI] = psi1
        scalars[LAST_DEPTH] = depth
    return written


@njit(cache=True)
def decimate(rows: Floats, taps: Floats, ratio: int, out: Floats) -> None:
    """Filter `rows` (rows, channels) with symmetric `taps` and keep every `ratio`-th row in `out`.

    out[k] is centred on rows[k * ratio + len(taps) // 2]; the order of summation is fixed.
    """
    for k in range(out.shape[0]):
        for c in range(out.shape[1]):
            total = 0.0
            for n in range(taps.shape[0]):
                total += taps[n] * rows[k * ratio + n, c]
            out[k, c] = total


@njit(cache=True)
def first_order(white: Floats, pole: float, last: float, out: Floats) -> float:
    """First-order autoregressive noise out[n] = pole out[n-1] + white[n]; returns the last value."""
    for n in range(white.shape[0]):
        last = pole * last + white[n]
        out[n] = last
    return last
