"""Compiled loop of the process simulator: the nonlinear cut.

`advance.py_func` is the plain version of the integrator; tests/process compare the two bit by bit,
and hold both against independent solutions.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from turnmill_core.process._kernels.interpolation import hermite, past, surface_at

Floats = NDArray[np.float64]

# Columns of `knots`, one row per axis state.
TIME, TOOL_ANGLE, TOOL_SPEED, SLIP, DEPTH, FEED_X, FEED_X_SLOPE, FEED_Y = range(8)
START, START_SLOPE, EXIT, EXIT_SLOPE, LEVER = range(8, 13)
KNOT_COLUMNS = 13
# SLIP: relative lengthening of the delay; START, EXIT [rad] of the arc across the feed, the end of the
# bar left out; FEED_X [m/s], START and EXIT at the tool tip and their SLOPE along the tool axis; LEVER
# [m]: distance of the tip from the C axis, 0 in milling.
# Columns of `modes`: exact transition of one oscillator over one step with a force linear in time.
A11, A12, A21, A22, B1, C1, B2, C2, STIFFNESS, DAMPING, INVERSE_MASS = range(11)
SHAPE_X, SHAPE_Y, SHAPE_Z, SIDE, RADIATION = range(11, 16)
DRIVE_X, DRIVE_Y, DRIVE_Z, OF_DISPLACEMENT, OF_VELOCITY = range(16, 21)
MODE_COLUMNS = 21
# SIDE: +1 on the tool, -1 on the workpiece, 0 radiates only (does not move the cutting point). DRIVE: shape
# through which the force drives the mode; OF_...: weights of q [1] and q' [s] in what moves the point (a real mode:
# 1 and 0).
# Columns of `raw`, one row per step.
RAW = (
    "angle", "sound", "tool_x", "tool_y", "tool_z", "workpiece_x", "workpiece_y", "workpiece_z",
    "force_x", "force_y", "force_z", "tool_torque", "workpiece_torque", "tool_velocity_x", "tool_velocity_y",
    "tool_velocity_z", "workpiece_velocity_x", "workpiece_velocity_y", "workpiece_velocity_z",
)
LOADS = 5
FIRST_VELOCITY = RAW.index("tool_velocity_x")
# Entries of `scalars`, carried from step to step.
ANGLE, PSI, LAST_DEPTH, CHIP, NEXT_MARK = range(5)
SCALARS = 5
TIME_TOLERANCE = 0.5e-9


@njit(cache=True, error_model="numpy")
def _cut(
    now: Floats, arcs: Floats, turned: float, psi: float, px: float, py: float, vx: float, vy: float,
    tooth_angle: Floats, pitch: Floats, runout: Floats, shape: Floats, coefficients: Floats, contact: bool,
    surface: Floats, place: Floats, force: Floats,
) -> float:
    """Cutting force on the tool [N] and torques [N m] (5,) for displacement px, py [m]; returns the largest chip [m].

    vx, vy [m/s]: velocity of the displacement, for process damping. now: a row of knots at this instant;
    arcs (slices, A, 2) [rad]: general engagement, see advance; turned [rad]: tool angle of the step; psi [rad]:
    angle of the tool in the material. place (teeth, slices, 4) receives what _leave_surface needs: sine and
    cosine of the tooth's angle, middle height of the engaged part of the slice [m] (-1: no chip is
    cut), and 1 near the cut, else 0. Entry and exit of a slice are taken with its share that has passed,
    averaged with a hat of one step's width, which keeps impulse and moment of the force when an edge
    falls inside a step. contact: a chip is
    never negative; without it the force stays linear.
    """
    teeth, slices = surface.shape[0], surface.shape[1]
    cells = surface.shape[2] // 2 if teeth == 1 else surface.shape[2]
    radius, bar_radius, lag_per_depth, longest_pitch = shape[0], shape[1], shape[2], shape[3]
    cell = 2.0 * math.pi / cells
    depth = max(0.0, now[DEPTH])
    start, leave = now[START], now[EXIT]
    lag_step = lag_per_depth * depth / slices
    lag_all = (slices - 1) * lag_step
    margin = 0.5 * abs(lag_step) + 4.0 * max(cell, turned) + 1.5 * longest_pitch * now[SLIP]
    margin += depth * max(abs(now[START_SLOPE]), abs(now[EXIT_SLOPE]))
    first = start - margin
    cos_step, sin_step = 2.0, 0.0  # found once a tooth is near the cut
    length = abs(lag_step) / turned
    chip = fx = fy = fz = torque = moment = 0.0
    damping = coefficients[6] / now[TOOL_SPEED]
    for j in range(teeth):
        for s in range(slices):
            place[j, s, 3] = 0.0
        period = pitch[j] / now[TOOL_SPEED]
        ahead = j + 1 if j + 1 < teeth else 0
        leading = now[TOOL_ANGLE] + tooth_angle[j] - 0.5 * lag_step + max(0.0, -lag_all)
        leading -= 2.0 * math.pi * math.floor((leading - first) / (2.0 * math.pi))
        if leading - abs(lag_all) > leave + margin:
            continue
        if cos_step > 1.0:
            cos_step, sin_step = math.cos(lag_step), math.sin(lag_step)
        phi = leading - max(0.0, -lag_all) + lag_step
        sin, cos = math.sin(phi), math.cos(phi)
        for s in range(slices):
            phi -= lag_step
            sin, cos = sin * cos_step - cos * sin_step, cos * cos_step + sin * sin_step
            if phi < first or phi > leave + margin:
                continue
            place[j, s, 0], place[j, s, 1], place[j, s, 2], place[j, s, 3] = sin, cos, -1.0, 1.0
            low, high = depth * s / slices, depth * (s + 1) / slices
            if bar_radius > 0.0 and arcs.shape[0] == 0:
                reach = radius * sin
                high = min(high, math.sqrt(max(0.0, bar_radius * bar_radius - reach * reach)) - bar_radius + depth)
            if high <= low:
                continue
            height = 0.5 * (low + high)
            if arcs.shape[0] == 0:
                enter, go = start + height * now[START_SLOPE], leave + height * now[EXIT_SLOPE]
                width = (high - low) * (past((phi - enter) / turned, length) - past((phi - go) / turned, length))
            else:
                width = 0.0
                for a in range(arcs.shape[1]):
                    width += (high - low) * (past((phi - arcs[s, a, 0]) / turned, length)
                                             - past((phi - arcs[s, a, 1]) / turned, length))
            if width <= 0.0:
                continue
            place[j, s, 2] = height
            feed = (now[FEED_X] + now[FEED_X_SLOPE] * height) * sin + now[FEED_Y] * cos
            position = (psi + tooth_angle[j] - (s + 0.5) * lag_step) / cell
            left = surface_at(surface[ahead, s], position - cells if teeth == 1 else position, sin, cos)
            h = runout[j] + px * sin + py * cos + feed * period - left
            if contact and h <= 0.0:
                continue
            chip = max(chip, h)
            tangential = width * (coefficients[0] * h + coefficients[3])
            radial = width * (coefficients[1] * h + coefficients[4])
            axial = width * (coefficients[2] * h + coefficients[5])
            if damping > 0.0:
                pressed = width * damping * (vx * sin + vy * cos)
                radial += pressed
                tangential += coefficients[7] * pressed
            fx -= radial * sin + tangential * cos
            fy -= radial * cos - tangential * sin
            fz -= axial
            torque += radius * tangential
            if now[LEVER] > 0.0:
                moment += (now[LEVER] + height) * (radial * sin + tangential * cos) - radius * sin * axial
    force[0], force[1], force[2], force[3], force[4] = fx, fy, fz, torque, moment
    return chip


@njit(cache=True, error_model="numpy")
def _leave_surface(
    now: Floats, turned: float, dt: float, psi0: float, psi1: float, depth0: float, motion: Floats,
    tooth_angle: Floats, pitch: Floats, runout: Floats, lag_per_depth: float, contact: bool, place: Floats,
    surface: Floats,
) -> None:
    """Store the surface that each tooth leaves at every node of material angle passed in the step.

    surface (teeth, slices, cells of a turn, 2) [m], two turns for a tool with one tooth: where the edge
    was that cut it last, as displacement x, y of the tool against the material, moved on by the feed
    of every pass that missed it. A later pass sees it along its own normal, which is the chip
    n . (d(t) - d(t - tau)) of the linear theory.
    motion (2, 4): displacement x, y [m] and velocity x, y [m/s] at the beginning and the end of the
    step; psi0, psi1 and depth0, now[DEPTH]: angle in the material and depth there. Where no chip is
    due, the surface is taken to be where the edge is, so that material that comes into the cut looks
    as if the tooth before had left it.
    """
    teeth, slices = surface.shape[0], surface.shape[1]
    cells = surface.shape[2] // 2 if teeth == 1 else surface.shape[2]
    cell = 2.0 * math.pi / cells
    lag0 = lag_per_depth * depth0 / slices
    lag1 = lag_per_depth * max(0.0, now[DEPTH]) / slices
    for j in range(teeth):
        period = pitch[j] / now[TOOL_SPEED]
        ahead = j + 1 if j + 1 < teeth else 0
        for s in range(slices):
            if place[j, s, 3] == 0.0:
                continue
            before = (psi0 + tooth_angle[j] - (s + 0.5) * lag0) / cell
            after = (psi1 + tooth_angle[j] - (s + 0.5) * lag1) / cell
            node = math.floor(before) + 1.0
            while node <= after:
                part = (node - before) / (after - before)
                back = (1.0 - part) * turned
                square = back * back
                sin_back = back * (1.0 - square / 6.0 * (1.0 - square / 20.0))
                cos_back = 1.0 - square / 2.0 * (1.0 - square / 12.0)
                sin = place[j, s, 0] * cos_back - place[j, s, 1] * sin_back
                cos = place[j, s, 1] * cos_back + place[j, s, 0] * sin_back
                x = sin * runout[j] + hermite(motion[0, 0], motion[0, 2], motion[1, 0], motion[1, 2], dt, part)
                y = cos * runout[j] + hermite(motion[0, 1], motion[0, 3], motion[1, 1], motion[1, 3], dt, part)
                here = int(node) % surface.shape[2]
                if contact and place[j, s, 2] >= 0.0:
                    old = here if teeth > 1 else int(node - cells) % surface.shape[2]  # one tooth: a revolution ago
                    feed_x = now[FEED_X] + now[FEED_X_SLOPE] * place[j, s, 2]
                    old_x = surface[ahead, s, old, 0] - feed_x * period
                    old_y = surface[ahead, s, old, 1] - now[FEED_Y] * period
                    if (old_x - x) * sin + (old_y - y) * cos > 0.0:
                        x, y = old_x, old_y
                surface[j, s, here, 0], surface[j, s, here, 1] = x, y
                node += 1.0


@njit(cache=True, error_model="numpy")
def _move(modes: Floats, modal: Floats, force: Floats, motion: Floats) -> None:
    """Relative displacement and velocity (4,) of the tool against the workpiece from the modal state and the force."""
    x = y = vx = vy = 0.0
    for m in range(modes.shape[0]):
        if modes[m, SIDE] != 0.0:
            moved, velocity = modal[m, 0], modal[m, 1]
            if modes[m, OF_VELOCITY] != 0.0:
                load = modes[m, DRIVE_X] * force[0] + modes[m, DRIVE_Y] * force[1] + modes[m, DRIVE_Z] * force[2]
                rate = modes[m, INVERSE_MASS] * (load - modes[m, STIFFNESS] * moved - modes[m, DAMPING] * velocity)
                moved = modes[m, OF_DISPLACEMENT] * moved + modes[m, OF_VELOCITY] * velocity
                velocity = modes[m, OF_DISPLACEMENT] * velocity + modes[m, OF_VELOCITY] * rate
            x += modes[m, SHAPE_X] * moved
            y += modes[m, SHAPE_Y] * moved
            vx += modes[m, SHAPE_X] * velocity
            vy += modes[m, SHAPE_Y] * velocity
    motion[0], motion[1], motion[2], motion[3] = x, y, vx, vy


@njit(cache=True, error_model="numpy")
def advance(
    first: int, dt: float, knots: Floats, arcs: Floats, modes: Floats, tooth_angle: Floats, pitch: Floats,
    runout: Floats, shape: Floats, coefficients: Floats, contact: bool, modal: Floats, force: Floats,
    scalars: Floats, surface: Floats, raw: Floats, marks_per_turn: int, marks: Floats,
) -> int:
    """Integrate the cut over len(raw) steps of `dt`, from step index `first`; returns the marks written.

    knots (K, 13): axis states, times ascending; arcs (K, slices, A, 2) [rad]: start and exit of the arcs in which each
    slice of the edge cuts at each knot, in place of the closed form (no rows: the closed form); modes (M, 21);
    tooth_angle, pitch [rad], runout [m] (teeth,); shape (4,): radius of tool and bar [m] (bar 0: a block), helix lag
    per height [rad/m], longest pitch; coefficients (8,): Ktc, Krc, Kac [Pa], Kte, Kre, Kae [N/m], process damping per
    height times the tool's speed [N/m2] and its friction [1]; contact: the tool can leave the material.
    Updated in place: modal (M, 2) displacement and velocity, force (5,) on the tool and torques, scalars (5,),
    surface (teeth, slices, cells, 2) [m], see _leave_surface. Written: raw (steps, 19), see RAW, 13
    columns without velocities; marks (n, 4): time, relative displacement x, y, and largest chip since the last mark,
    at every 2 pi / marks_per_turn of the tool angle.
    """
    mark_angle = 2.0 * math.pi / marks_per_turn
    now = np.empty(knots.shape[1])
    free = np.empty((modes.shape[0], 2))
    motion = np.empty((2, 4))
    place = np.zeros((surface.shape[0], surface.shape[1], 4))
    around = np.zeros((arcs.shape[1] if arcs.shape[0] > 0 else 0, arcs.shape[2], 2))
    _move(modes, modal, force, motion[1])
    written = 0
    k = 0
    for i in range(raw.shape[0]):
        time = (first + i + 1) * dt
        while k + 2 < knots.shape[0] and time > knots[k + 1, TIME] + TIME_TOLERANCE:
            k += 1
        span = knots[k + 1, TIME] - knots[k, TIME]
        u = (time - knots[k, TIME]) / span
        for c in range(knots.shape[1]):
            now[c] = (1.0 - u) * knots[k, c] + u * knots[k + 1, c]
        for s in range(around.shape[0]):
            for c in range(around.shape[1]):
                for e in range(2):
                    around[s, c, e] = (1.0 - u) * arcs[k, s, c, e] + u * arcs[k + 1, s, c, e]
        now[TOOL_ANGLE] = hermite(knots[k, TOOL_ANGLE], knots[k, TOOL_SPEED], knots[k + 1, TOOL_ANGLE],
                                   knots[k + 1, TOOL_SPEED], span, u)
        turned = now[TOOL_ANGLE] - scalars[ANGLE]
        psi0 = scalars[PSI]
        psi1 = psi0 + turned / (1.0 + now[SLIP])
        turning = turned > 0.0 and now[TOOL_SPEED] > 0.0 and now[EXIT] > now[START]

        # The step without the force's change, and the displacement at its end with the force held:
        # the chip is then right to third order in dt.
        px = py = vx = vy = 0.0
        for m in range(modes.shape[0]):
            load = modes[m, DRIVE_X] * force[0] + modes[m, DRIVE_Y] * force[1] + modes[m, DRIVE_Z] * force[2]
            free[m, 0] = modes[m, A11] * modal[m, 0] + modes[m, A12] * modal[m, 1] + modes[m, B1] * load
            free[m, 1] = modes[m, A21] * modal[m, 0] + modes[m, A22] * modal[m, 1] + modes[m, B2] * load
            if modes[m, SIDE] != 0.0:
                moved, velocity = free[m, 0] + modes[m, C1] * load, free[m, 1] + modes[m, C2] * load
                if modes[m, OF_VELOCITY] != 0.0:
                    rate = modes[m, INVERSE_MASS] * (load - modes[m, STIFFNESS] * moved - modes[m, DAMPING] * velocity)
                    moved = modes[m, OF_DISPLACEMENT] * moved + modes[m, OF_VELOCITY] * velocity
                    velocity = modes[m, OF_DISPLACEMENT] * velocity + modes[m, OF_VELOCITY] * rate
                px += modes[m, SHAPE_X] * moved
                py += modes[m, SHAPE_Y] * moved
                vx += modes[m, SHAPE_X] * velocity
                vy += modes[m, SHAPE_Y] * velocity
        chip = 0.0
        for c in range(LOADS):
            force[c] = 0.0
        if turning:
            chip = _cut(now, around, turned, psi1, px, py, vx, vy, tooth_angle, pitch, runout, shape, coefficients,
                        contact, surface, place, force)

        # The modes at the end of the step, the force linear over it.
        for c in range(1, raw.shape[1]):
            raw[i, c] = 0.0
        for m in range(modes.shape[0]):
            load = modes[m, DRIVE_X] * force[0] + modes[m, DRIVE_Y] * force[1] + modes[m, DRIVE_Z] * force[2]
            q = free[m, 0] + modes[m, C1] * load
            v = free[m, 1] + modes[m, C2] * load
            modal[m, 0], modal[m, 1] = q, v
            rate = modes[m, INVERSE_MASS] * (load - modes[m, STIFFNESS] * q - modes[m, DAMPING] * v)
            raw[i, 1] += modes[m, RADIATION] * rate
            side = modes[m, SIDE]
            if side != 0.0:
                column, velocity_column = (2, FIRST_VELOCITY) if side > 0.0 else (5, FIRST_VELOCITY + 3)
                if modes[m, OF_VELOCITY] != 0.0:
                    q, v = (modes[m, OF_DISPLACEMENT] * q + modes[m, OF_VELOCITY] * v,
                            modes[m, OF_DISPLACEMENT] * v + modes[m, OF_VELOCITY] * rate)
                for c in range(3):
                    raw[i, column + c] += side * modes[m, SHAPE_X + c] * q
                if raw.shape[1] > FIRST_VELOCITY:
                    for c in range(3):
                        raw[i, velocity_column + c] += side * modes[m, SHAPE_X + c] * v
        raw[i, 0] = now[TOOL_ANGLE]
        for c in range(LOADS):
            raw[i, 8 + c] = force[c]
        for c in range(4):
            motion[0, c] = motion[1, c]
        _move(modes, modal, force, motion[1])
        if turning:
            _leave_surface(now, turned, dt, psi0, psi1, scalars[LAST_DEPTH], motion, tooth_angle, pitch, runout,
                           shape[2], contact, place, surface)

        # Relative displacement at equal angles of the tool, for the truth.
        scalars[CHIP] = max(scalars[CHIP], chip)
        if turned > 0.0:
            mark = scalars[NEXT_MARK]
            while mark * mark_angle <= now[TOOL_ANGLE]:
                part = (mark * mark_angle - scalars[ANGLE]) / turned
                marks[written, 0] = time - (1.0 - part) * dt
                marks[written, 1] = hermite(motion[0, 0], motion[0, 2], motion[1, 0], motion[1, 2], dt, part)
                marks[written, 2] = hermite(motion[0, 1], motion[0, 3], motion[1, 1], motion[1, 3], dt, part)
                marks[written, 3] = scalars[CHIP]
                scalars[CHIP] = 0.0
                written += 1
                mark += 1.0
            scalars[NEXT_MARK] = mark
        scalars[ANGLE] = now[TOOL_ANGLE]
        scalars[PSI] = psi1
        scalars[LAST_DEPTH] = max(0.0, now[DEPTH])
    return written
