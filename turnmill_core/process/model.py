"""What the integrator needs to know of an operation, as arrays."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from turnmill_core.cutting.engagement import Engagement
from turnmill_core.cutting.tool import require_cylinder
from turnmill_core.machine.axes import AXES, AxisState
from turnmill_core.machine.conditions import conditions_from_axes, machine_from_tool
from turnmill_core.operation import RIGID, Conditions, Mode, Operation, Structure, require
from turnmill_core.operation_sensors import NO_SENSORS, Sensors
from turnmill_core.process._kernels import integrator
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.sensors import SoundModel, antialias_taps
from turnmill_core.process.truth import principal_turns
from turnmill_core.process.volts import signals_of
from turnmill_core.stability.threads import one_thread
from turnmill_core.structure.at import plain_structures
from turnmill_core.structure.complex_modes import checked_phases
from turnmill_core.structure.modal import contact_modes, into_tool

Floats = NDArray[np.float64]

SPINDLE = AXES.index("s")
LAG_PER_SLICE = 0.02
MOST_SLICES = 32
ARCS = 3
GENERAL_SLICES = 24  # where the engagement differs from height to height
TRUTH_HOP = 0.03  # s, about
SIGNALS = (*integrator.RAW, *(f"tool_acceleration_{axis}" for axis in "xyz"))
"""Raw signals: those of the integrator, and mean accelerations of the tool over each step."""


@dataclass(frozen=True, eq=False)
class ProcessModel:
    """Operation and configuration as the integrator wants them.

    dt [s]; modes (M, 21): see _kernels.integrator; tooth_angle, pitch [rad], runout [m] (teeth,); shape (4,):
    radius of tool and bar [m] (bar 0: a block), helix lag per height [rad/m], longest pitch [rad];
    coefficients (8,): Ktc, Krc, Kac [Pa], Kte, Kre, Kae per height instead of per edge length [N/m], process damping
    per height times the tool's speed [N/m2] and its friction [1]; slices, cells of the surface; taps: anti-alias
    filter; columns: of the raw signals, one per channel; teeth; turns: tool revolutions in a principal period;
    uneven: the teeth are not equally spaced; hop: principal periods from one window of the truth to the next;
    names: of the measured signals, one per column; sensors: that measure them in volts (none: in SI units).
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
    names: tuple[str, ...]
    sensors: Sensors

    @property
    def raw_columns(self) -> int:
        """Columns of the raw signals that are integrated: velocities only where a channel asks for them."""
        return len(integrator.RAW) if max(self.columns) >= integrator.FIRST_VELOCITY else integrator.FIRST_VELOCITY

    @property
    def accelerates(self) -> bool:
        """Whether the acceleration of the tool is measured; its columns follow those of the velocity."""
        return max(self.columns) >= len(integrator.RAW)

    @property
    def row_columns(self) -> int:
        """Columns of the raw signals."""
        return len(SIGNALS) if self.accelerates else self.raw_columns


def process_model(op: Operation, config: SimulationConfig) -> ProcessModel:
    """Arrays of `op` for the integrator.

    Raises ``ValueError`` for what it does not describe: a tool that is no cylinder or is tilted, modes that turn.
    """
    tool, material = op.tool, op.material
    require_cylinder(tool)
    require(op.tilt == 0, "tilt", op.tilt, "rad", "0 in the simulation")
    for name, frame in (("tool", tool.structure.frame), ("workpiece", op.workpiece.structure.frame)):
        require(frame != "rotating", f"{name} frame", frame, "", "modes that do not turn with the spindle")
    flank = op.process_damping
    damping = (flank.coefficient(1.0) / tool.radius, flank.friction) if flank else (0.0, 0.0)
    dt = 1.0 / (config.sample_rate * config.ratio)
    sensors = op.sensors if config.volts else NO_SENSORS
    names = signals_of(sensors) or config.channels
    pitch = np.array(tool.pitch)
    lag_per_depth = 2 * math.tan(tool.helix_angle) / tool.diameter
    edge = np.array([material.Kte, material.Kre, material.Kae]) / math.cos(tool.helix_angle)
    depths = [op.conditions.depth, *(p.depth for p in op.schedule)]
    lag = abs(lag_per_depth) * max(0.0, *depths)
    with one_thread():
        modes = _modes(op, config.sound, dt)
    speeds = [s for s in (op.conditions.tool_speed, *(p.tool_speed for p in op.schedule)) if s > 0]
    return ProcessModel(
        op=op, dt=dt, modes=modes,
        tooth_angle=np.concatenate([[0.0], np.cumsum(pitch)[:-1]]), pitch=pitch,
        runout=np.array(tool.runout or (0.0,) * tool.teeth),
        shape=np.array([tool.radius, op.workpiece.radius if op.process == "turn-milling" else 0.0, lag_per_depth,
                        pitch.max()]),
        coefficients=np.array([material.Ktc, material.Krc, material.Kac, *edge, *damping]),
        slices=config.slices or min(MOST_SLICES, max(GENERAL_SLICES if op.eccentricity else 1,
                                                     math.ceil(lag / LAG_PER_SLICE))),
        cells=int(np.clip(round(2 * math.pi / (min(speeds, default=100.0) * dt)), 360, 16384)),
        taps=antialias_taps(config.ratio), columns=tuple(SIGNALS.index(name) for name in names),
        names=names, sensors=sensors, teeth=tool.teeth, turns=principal_turns(tool),
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
    row[integrator.LEVER] = conditions.effective_radius
    tip, top = _arc(op, conditions, 0.0), _arc(op, conditions, max(1e-6, conditions.depth))
    slope = [(b - a) / max(1e-6, conditions.depth) for a, b in zip(tip, top, strict=True)]
    row[integrator.FEED_X], row[integrator.FEED_Y], row[integrator.START], row[integrator.EXIT] = tip
    row[integrator.FEED_X_SLOPE], _, row[integrator.START_SLOPE], row[integrator.EXIT_SLOPE] = slope
    return row


def general_engagement(model: ProcessModel, row: Floats, engagement: Engagement) -> tuple[Floats, Floats]:
    """A knot for a general engagement: `row` with the range of its arcs, and the arcs of every slice (slices, A, 2).

    engagement: start and exit angles [rad] by height, linear between; at most ARCS at a height. Raises ``ValueError``
    for more.
    """
    require(engagement.start.shape[1] <= ARCS, "arcs", engagement.start.shape[1], "", f"at most {ARCS} at a height")
    middle = (np.arange(model.slices) + 0.5) * max(0.0, row[integrator.DEPTH]) / model.slices
    order = np.argsort(engagement.height, kind="stable")
    height = engagement.height[order]
    arcs = np.zeros((model.slices, ARCS, 2))
    for side, values in enumerate((engagement.start[order], engagement.exit[order])):
        for arc, column in enumerate(values.T):
            arcs[:, arc, side] = np.interp(middle, height, column)
    arcs[middle > height[-1] + (height[-1] - height[0]) / len(height)] = 0.0
    cuts = arcs[..., 1] > arcs[..., 0]
    row = row.copy()
    row[integrator.START_SLOPE] = row[integrator.EXIT_SLOPE] = row[integrator.START] = row[integrator.EXIT] = 0.0
    if cuts.any():
        row[integrator.START], row[integrator.EXIT] = arcs[cuts, 0].min(), arcs[cuts, 1].max()
    return row, arcs


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


@lru_cache(maxsize=64)
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
    rows: list[Floats] = []
    structures = plain_structures(op, rotation, op.conditions)
    phases = checked_phases(contact_modes(*structures, rotation).modes).phase
    for structure, side, area in zip(structures, (1.0, -1.0), (sound.tool_area, sound.workpiece_area), strict=True):
        turn = into_tool(structure.frame, rotation)
        for mode, moves, drives in _oscillators(structure, op.conditions.depth):
            radiation = sound.radiation(area) * float(turn @ moves @ direction)
            phase = 0.0 if phases is None else float(phases[len(rows)])
            rows.append(_row(mode, side * (turn @ moves), side * (turn @ drives), side, radiation, dt, phase))
    for panel in sound.panels:
        shape = np.array(panel.shape)
        rows.append(_row(panel, shape, shape, 0.0, sound.radiation(sound.panel_area), dt))
    return np.array(rows).reshape(-1, integrator.MODE_COLUMNS)


def _oscillators(structure: Structure, depth: float) -> Iterator[tuple[Mode, Floats, Floats]]:
    """Every oscillator of a structure: its mode, the shape in which it moves, and the one through which it is driven.

    Several contact points are averaged over the engaged heights up to `depth` [m]; a symmetric cross mode is two
    oscillators, each driven along one direction and moving along the other.
    """
    shapes = contact_modes(replace(structure, cross_reading="none", frame="tool"), RIGID).lumped(max(depth, 0.0)).shapes
    for mode, lumped in zip(structure.modes, shapes.T, strict=True):
        shape = lumped * math.sqrt(mode.mass) if structure.heights else np.array(mode.shape)
        yield mode, shape, shape
    for cross in structure.cross_modes:
        first, second = (np.array(v) for v in cross.directions())
        if structure.cross_reading == "rank-one":
            yield cross.shared(), first + second, first + second
        elif structure.cross_reading == "symmetric":
            yield cross.shared(), first, second
            yield cross.shared(), second, first


def _row(
    mode: Mode, moves: Floats, drives: Floats, side: float, radiation: float, dt: float, phase: float = 0.0,
) -> Floats:
    """Exact transition of q'' + 2 zeta w q' + w^2 q = f / m over dt, f linear in time.

    From the exponential of the oscillator augmented with the force and its slope: the value at the
    end is A (q, v) + B f(start) + C f(end). A complex mode moves the point with q and q' (see ModalModel.weights).
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
    row[integrator.SHAPE_X : integrator.SHAPE_Z + 1] = moves
    row[integrator.SIDE], row[integrator.RADIATION] = side, radiation
    row[integrator.DRIVE_X : integrator.DRIVE_Z + 1] = drives
    wd = w * math.sqrt(1 - mode.damping**2)
    row[integrator.OF_DISPLACEMENT] = math.cos(phase) + mode.damping * w / wd * math.sin(phase)
    row[integrator.OF_VELOCITY] = math.sin(phase) / wd
    return row
