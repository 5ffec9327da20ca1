"""Vibration, forces, torque and power that follow from the states of the linear map (Eq. 4.129, 4.121)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.chip import feed_per_tooth
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.process.linear import LinearMap, MapState, advance, at_rest
from turnmill_core.process.linear_cut import LinearCut, delays_at, load_matrices, load_rows, static_chip_of
from turnmill_core.stability.problem import TWO_PI

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Vibration:
    """Vibration and loads at m times (Eq. 4.129, 4.121), tool frame.

    time (m,) [s]; angle (m,) [rad] of the tool, 0: the first tooth's tip on +y_T. tool, workpiece (m, 3) [m] and
    tool_velocity, workpiece_velocity (m, 3) [m/s] at the cutting point; force (m, 3) [N] on the tool (the opposite
    acts on the workpiece); tool_torque, workpiece_torque (m,) [N m], resisting their spindle; tool_power,
    workpiece_power (m,) [W]. states (m, n): modal displacements, then modal velocities; change (N, m, 2) [m]:
    displacement now minus that which the tooth before each left.
    """

    cut: LinearCut
    time: Floats
    angle: Floats
    states: Floats
    tool: Floats
    workpiece: Floats
    tool_velocity: Floats
    workpiece_velocity: Floats
    force: Floats
    tool_torque: Floats
    workpiece_torque: Floats
    change: Floats

    @property
    def relative(self) -> Floats:
        """Displacement of the tool relative to the workpiece [m] (m, 3)."""
        return np.asarray(self.tool - self.workpiece, dtype=np.float64)

    @property
    def relative_velocity(self) -> Floats:
        """Velocity of the tool relative to the workpiece [m/s] (m, 3)."""
        return np.asarray(self.tool_velocity - self.workpiece_velocity, dtype=np.float64)

    @property
    def tool_power(self) -> Floats:
        """Power of the tool spindle [W] (m,)."""
        return np.asarray(self.tool_torque * self.cut.conditions.tool_speed, dtype=np.float64)

    @property
    def workpiece_power(self) -> Floats:
        """Power of the workpiece spindle [W] (m,), negative where the cut drives it."""
        return np.asarray(self.workpiece_torque * abs(self.cut.conditions.workpiece_speed), dtype=np.float64)


def vibration(step_map: LinearMap, states: Floats, contact: Floats) -> Vibration:
    """Physical quantities (Eq. 4.129) of what `advance` returned, without the last state.

    states (m + 1, n), contact (back + m + 1, 2) [m]: see linear.advance.
    """
    cut, k = step_map.cut, step_map.steps
    count, back = len(states) - 1, len(contact) - len(states)
    at = np.arange(count) % k
    loads = load_matrices(cut, step_map.dt * cut.problem.tool_speed * np.arange(k))
    delays = delays_at(cut.problem, step_map.dt * cut.problem.tool_speed * (np.arange(k + 1) - 0.5)) / step_map.dt
    place = np.arange(back + count)
    change = np.empty((len(delays), count, 2))
    for j, lag in enumerate(delays):
        for axis in range(2):
            then = np.interp(back + np.arange(count) - lag[at], place, contact[: back + count, axis])
            change[j, :, axis] = contact[back : back + count, axis] - then
    x = states[:count]
    C, CA = cut.problem.structure.C, cut.problem.structure.C @ cut.problem.structure.A
    of_tool = np.tile(np.arange(cut.modes.modes.size) < cut.tool_modes, 2)
    tool, workpiece, tool_velocity, workpiece_velocity = (
        x[:, part] @ (sign * matrix[:, part]).T for matrix in (C, CA) for part, sign in ((of_tool, 1), (~of_tool, -1)))
    velocity = (tool_velocity - workpiece_velocity)[:, :2]
    rows = loads.static[at] + np.einsum("jtra,jta->tr", loads.gain[:, at], change)
    rows += np.einsum("tra,ta->tr", loads.damping[at], velocity)
    time = np.asarray(step_map.dt * np.arange(count), dtype=np.float64)
    angle = np.asarray(time * cut.problem.tool_speed, dtype=np.float64)
    return Vibration(cut, time, angle, x, tool, workpiece, tool_velocity, workpiece_velocity, rows[:, :3], rows[:, 3],
                     rows[:, 4], change)


def time_solution(step_map: LinearMap, periods: int, state: MapState | None = None) -> tuple[Vibration, MapState]:
    """Vibration over `periods` periods of the map, from rest or from `state`, and the state after them."""
    require(periods >= 1, "periods", periods, "", "an integer >= 1")
    after, states, contact = advance(step_map, state or at_rest(step_map), periods * step_map.steps)
    return vibration(step_map, states, contact), after


def displacement_at(solution: Vibration, height: float) -> tuple[Floats, Floats]:
    """Displacement [m] (m, 3) of tool and workpiece at the contact point at `height` [m] above the tip.

    Differs from that at the cutting point only where the modes give shapes at several heights (Eq. 4.129).
    """
    modes, size = solution.cut.modes, solution.cut.modes.modes.size
    shapes = np.array([[np.interp(height, modes.heights, modes.shapes[:, axis, n]) for n in range(size)]
                       for axis in range(3)])
    first, second = modes.modes.weights()
    q = solution.states[:, :size] * first + solution.states[:, size:] * second
    n = solution.cut.tool_modes
    return np.asarray(q[:, :n] @ shapes[:, :n].T), np.asarray(-q[:, n:] @ shapes[:, n:].T)


def chip_at(solution: Vibration, height: float) -> tuple[Floats, Floats]:
    """Chip and force density at the contact points at `height` [m] above the tip, for every tooth.

    Returns chip (m, N) [m], negative where the linear solution leaves the material and NaN where the point is not in
    the cut, and force (m, N, 3) [N/m] on the tool per height, tool frame (0 where it is not in the cut).
    """
    cut, problem = solution.cut, solution.cut.problem
    e = problem.engagement
    require(0 <= height <= e.depth, "height", height, "m", f"within the depth of cut {e.depth} m")
    start, stop = (np.array([np.interp(height, e.height, arc) for arc in side.T]) for side in (e.start, e.exit))
    chip = np.full((solution.time.size, len(problem.pitch)), np.nan)
    force = np.zeros((*chip.shape, 3))
    for j, offset in enumerate(problem.tooth_angles):
        local = np.mod(solution.angle + offset - problem.helix_lag * height, TWO_PI)
        turned = np.mod(local[:, None] - start, TWO_PI)
        inside = np.any(turned < stop - start, axis=1)
        normal = np.stack([np.sin(local), np.cos(local)])
        tall = np.full(local.size, height)
        h = static_chip_of(cut, j, tall, normal) + np.einsum("ta,at->t", solution.change[j], normal)
        rows = load_rows(cut, tall, normal)[:3]
        density = (rows @ np.array(problem.coefficients)) * h + rows @ cut.edge
        chip[inside, j] = h[inside]
        force[inside, j] = density.T[inside]
    return chip, force


def smallest_chip(solution: Vibration, heights: int = 9) -> float:
    """Smallest chip over largest static feed per tooth [1]; below 0 the tool would leave the material.

    Sought at `heights` heights of the edge. Where the static chip itself vanishes at entry or exit, so does this.
    """
    depth = solution.cut.problem.engagement.depth
    found = [np.nanmin(chip) for chip in (chip_at(solution, z)[0] for z in np.linspace(0, depth, heights))
             if not np.all(np.isnan(chip))]
    return float(min(found) / feed_per_tooth(solution.cut.op, solution.cut.conditions))


def in_frame(vectors: Floats, op: Operation, conditions: Conditions, frame: str, time: Floats) -> Floats:
    """Tool-frame `vectors` (m, 3) at times `time` [s] (m,) in another frame.

    frame: "tool", "machine", or "workpiece", which turns with the C axis and is the machine frame at time 0.
    """
    require(frame in ("tool", "machine", "workpiece"), "frame", frame, "", "tool, machine or workpiece")
    if frame == "tool":
        return vectors
    machine = vectors @ machine_from_tool(op, conditions).T
    if frame == "workpiece":
        angle = conditions.workpiece_speed * time
        c, s = np.cos(angle), np.sin(angle)
        machine = np.stack([c * machine[:, 0] + s * machine[:, 1], c * machine[:, 1] - s * machine[:, 0],
                            machine[:, 2]], axis=1)
    return np.asarray(machine, dtype=np.float64)

