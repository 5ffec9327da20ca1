"""What the integrator needs to know of an operation, as arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from turnmill_core.machine.axes import AXES, AxisState
from turnmill_core.machine.conditions import conditions_from_axes, machine_from_tool
from turnmill_core.operation import Conditions, Mode, Operation
from turnmill_core.process._kernels import integrator
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.sensors import SoundModel, antialias_taps
from turnmill_core.process.truth import principal_turns

Floats = NDArray[np.float64]

SPINDLE = AXES.index("s")
LAG_PER_SLICE = 0.02
MOST_SLICES = 32
TRUTH_HOP = 0.03  # s, about


@dataclass(frozen=True, eq=False)
class ProcessModel:
    """Operation and configuration as the integrator wants them.

    dt [s]; modes (M, 16): see _kernels.integrator; tooth_angle, pitch [rad], runout [m] (teeth,); shape (4,):
    radius of tool and bar [m] (bar 0: a block), helix lag per height [rad/m], longest pitch [rad];
    coefficients (6,): Ktc, Krc, Kac [Pa], and Kte, Kre, Kae per height instead of per edge length
    [N/m]; slices, cells of the surface; taps: anti-alias filter; columns: of the raw signals, one per
    channel; teeth; turns: tool revolutions in a principal period; uneven: the teeth are not equally
    spaced; hop: principal periods from one window of the truth to the next.
    """

    op: Operation
    dt: float
    modes: Floats
    tooth_angle: Floats
    pitch: Floats
    runout: Floats
    shape: Floats
    coefficients: Floats
    slices: int
    cells: int
    taps: Floats
    columns: tuple[int, ...]
    teeth: int
    turns: int
    uneven: bool
    hop: int


def process_model(op: Operation, config: SimulationConfig) -> ProcessModel:
    """Arrays of `op` for the integrator."""
    tool, material = op.tool, op.material
    dt = 1.0 / (config.sample_rate * config.ratio)
    pitch = np.array(tool.pitch)
    lag_per_depth = 2 * math.tan(tool.helix_angle) / tool.diameter
    edge = np.array([material.Kte, material.Kre, material.Kae]) / math.cos(tool.helix_angle)
    depths = [op.conditions.depth, *(p.depth for p in op.schedule)]
    lag = abs(lag_per_depth) * max(0.0, *depths)
    speeds = [s for s in (op.conditions.tool_speed, *(p.tool_speed for p in op.schedule)) if s > 0]
    return ProcessModel(
        op=op, dt=dt, modes=_modes(op, config.sound, dt),
        tooth_angle=np.concatenate([[0.0], np.cumsum(pitch)[:-1]]), pitch=pitch,
        runout=np.array(tool.runout or (0.0,) * tool.teeth),
        shape=np.array([tool.radius, op.workpiece.radius if op.process == "turn-milling" else 0.0, lag_per_depth,
                        pitch.max()]),
        coefficients=np.array([material.Ktc, material.Krc, material.Kac, *edge]),
        slices=config.slices or min(MOST_SLICES, max(1, math.ceil(lag / LAG_PER_SLICE))),
        cells=int(np.clip(round(2 * math.pi / (min(speeds, default=100.0) * dt)), 360, 16384)),
        taps=antialias_taps(config.ratio), columns=tuple(integrator.RAW.index(name) for name in config.channels),
        teeth=tool.teeth, turns=principal_turns(tool),
        uneven=bool(np.ptp(pitch) > 1e-9),
        hop=max(1, round(TRUTH_HOP * op.conditions.tool_speed / (2 * math.pi * principal_turns(tool)))),
    )


def knot(model: ProcessModel, axes: AxisState, base_ns: int) -> Floats:
    """One row of integrator.advance's knots from an axis state: what the cut looks like at that instant."""
    op = model.op
    conditions = conditions_from_axes(op, axes)
    row = np.zeros(integrator.KNOT_COLUMNS)
    row[integrator.TIME] = (axes.stamp_ns - base_ns) * 1e-9
    row[integrator.TOOL_ANGLE] = axes.position[SPINDLE]
    row[integrator.TOOL_SPEED] = conditions.tool_speed
    if conditions.tool_speed > 0:
        row[integrator.SLIP] = abs(conditions.workpiece_speed) / conditions.tool_speed
    row[integrator.DEPTH] = conditions.depth
    tip, top = _arc(op, conditions, 0.0), _arc(op, conditions, max(1e-6, conditions.depth))
    slope = [(b - a) / max(1e-6, conditions.depth) for a, b in zip(tip, top, strict=True)]
    row[integrator.FEED_X], row[integrator.FEED_Y], row[integrator.START], row[integrator.EXIT] = tip
    row[integrator.FEED_X_SLOPE], _, row[integrator.START_SLOPE], row[integrator.EXIT_SLOPE] = slope
    return row


def _arc(op: Operation, conditions: Conditions, height: float) -> tuple[float, float, float, float]:
    """Feed [m/s] along x_T and y_T, start and exit angle [rad] at `height` [m] above the tool tip.

    What cutting.feed and cutting.engagement say, without arrays (an axis state comes every few
    milliseconds), and as if the bar were wide: the kernel lets the cut end where the bar does.
    """
    radius = op.tool.radius
    lower, upper = conditions.cross_feed_span
    if op.process == "milling":
        start, leave = (math.acos(max(-1.0, min(1.0, y / radius))) for y in (upper, lower))
        return conditions.feed_speed, 0.0, start, leave
    speed, lever = abs(conditions.workpiece_speed), conditions.effective_radius + height
    sense = 1.0 if lower + upper >= 0 else -1.0
    if sense < 0:
        lower, upper = -upper, -lower
    if speed == 0:
        lower, upper = -radius, radius
    epsilon = math.atan2(conditions.feed_speed, speed * lever)
    start, leave = (_crossing(y, radius, lever, conditions.feed_speed / speed if speed else 0.0, epsilon)
                    for y in (upper, lower))
    if sense < 0:
        start, leave = math.pi - leave, math.pi - start
    return speed * lever, sense * conditions.feed_speed, start, leave


def _crossing(wall: float, radius: float, lever: float, lead: float, epsilon: float) -> float:
    """Angle [rad] at which the tool's flank crosses a wall across the feed (see cutting.engagement.axial_place)."""
    phi = math.acos(max(-1.0, min(1.0, wall / radius))) - epsilon
    if abs(wall) >= radius * (1 - 1e-12) or lead == 0.0:
        return phi
    for _ in range(8):
        x, y = radius * math.sin(phi), radius * math.cos(phi)
        beyond = radius * (math.sqrt(1 + lead**2 / (lever**2 + x**2)) - 1)
        excess = y - lead * math.atan2(x, lever) - beyond - wall
        phi = math.acos(max(-1.0, min(1.0, math.cos(phi + epsilon) - excess / radius))) - epsilon
        if abs(excess) < 1e-10 * radius:
            break
    return phi


def _modes(op: Operation, sound: SoundModel, dt: float) -> Floats:
    """Rows of integrator.advance's modes: tool, workpiece, then the panels that only radiate."""
    rotation = machine_from_tool(op, op.conditions)
    direction = np.array(sound.direction)
    rows = []
    for structure, side, area in ((op.tool.structure, 1.0, sound.tool_area),
                                  (op.workpiece.structure, -1.0, sound.workpiece_area)):
        turn = np.eye(3) if structure.frame == "tool" else rotation.T
        for mode in structure.modes:
            shape = turn @ np.array(mode.shape)
            rows.append(_row(mode, side * shape, side, sound.radiation(area) * float(shape @ direction), dt))
    for panel in sound.panels:
        rows.append(_row(panel, np.array(panel.shape), 0.0, sound.radiation(sound.panel_area), dt))
    return np.array(rows).reshape(-1, integrator.MODE_COLUMNS)


def _row(mode: Mode, shape: Floats, side: float, radiation: float, dt: float) -> Floats:
    """Exact transition of q'' + 2 zeta w q' + w^2 q = f / m over dt, f linear in time.

    From the exponential of the oscillator augmented with the force and its slope: the value at the
    end is A (q, v) + B f(start) + C f(end).
    """
    w = 2 * math.pi * mode.frequency
    system = np.zeros((4, 4))
    system[0, 1] = 1.0
    system[1, :3] = -(w**2), -2 * mode.damping * w, 1 / mode.mass
    system[2, 3] = 1.0
    flow = expm(system * dt)
    row = np.zeros(integrator.MODE_COLUMNS)
    row[integrator.A11], row[integrator.A12], row[integrator.A21], row[integrator.A22] = flow[:2, :2].ravel()
    row[integrator.C1], row[integrator.C2] = flow[:2, 3] / dt
    row[integrator.B1], row[integrator.B2] = flow[:2, 2] - flow[:2, 3] / dt
    row[integrator.STIFFNESS], row[integrator.DAMPING] = mode.stiffness, 2 * mode.damping * w * mode.mass
    row[integrator.INVERSE_MASS] = 1 / mode.mass
    row[integrator.SHAPE_X : integrator.SHAPE_Z + 1] = shape
    row[integrator.SIDE], row[integrator.RADIATION] = side, radiation
    return row
