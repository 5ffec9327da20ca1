"""Time-domain simulation of the regenerative cut, with loss of contact (thesis 4.3.6.1, Eq. 4.121-4.129).

Tool and workpiece vibrate in their modes; every tooth cuts the surface that all teeth before it left.
The chip is h = max(0, n . r + runout - surface), r the displacement of the tool relative to the
workpiece and the surface the outermost of everything that earlier teeth left there, moved on by the
feed of each pass. The surface is stored by the angle of the material, so that speeds may change; the
regeneration delay is the mean one, Td (1 + |Omega_c| / Omega_t) (Eq. 4.88, erratum D1).

State in, state out: `simulate` is a loop over `step`, and however the axis states are cut into
chunks, the same samples come out, bit by bit. See docs/model_process.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.engagement import Engagement
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes
from turnmill_core.machine.controller import axis_state_at, schedule_duration
from turnmill_core.monitoring.blocks import SensorBlock
from turnmill_core.operation import Operation, require
from turnmill_core.process._kernels import integrator
from turnmill_core.process._kernels.filters import decimate
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.engagement_path import steady_engagement
from turnmill_core.process.model import ARCS, GENERAL_SLICES, ProcessModel, general_engagement, knot, process_model
from turnmill_core.process.sensors import CHANNELS, ambient_sound, white_noise
from turnmill_core.process.truth import MARKS_PER_TURN, Truth, join_truth, truth_of_marks
from turnmill_core.process.volts import channels_of, volts

Floats = NDArray[np.float64]

__all__ = ["Chunk", "SimulationConfig", "SimulationState", "initial", "simulate", "step"]


@dataclass(frozen=True, eq=False)
class SimulationState:
    """Everything that the next step needs; made by `initial`, returned by `step`, never changed.

    steps: index of the last integration step; base_ns: stamp of step 0; knot: last axis state as the
    integrator sees it (empty before the first), arcs: its general engagement, if any; modal (M, 2),
    force (5,), scalars (5,), surface (teeth, slices, cells, 2): see integrator.advance; rows: raw signals
    that the anti-alias filter still needs; next_sample: the sample that they centre on; samples: measured
    but not yet in a block; next_block: index of the block's first sample; background: last value of the
    noise filter; casing (3, 2): motion of the probes' fixture; marks: displacements that the truth still needs.
    """

    model: ProcessModel
    seed: int
    steps: int
    base_ns: int
    knot: Floats
    arcs: Floats
    modal: Floats
    force: Floats
    scalars: Floats
    surface: Floats
    rows: Floats
    next_sample: int
    samples: NDArray[np.float32]
    next_block: int
    background: float
    casing: Floats
    marks: Floats
    first_mark_skip: int


@dataclass(frozen=True)
class Chunk:
    """What one step gave: the axis states it ran over, the blocks that became full, and the truth."""

    axes: tuple[AxisState, ...]
    blocks: tuple[SensorBlock, ...]
    truth: Truth


def initial(op: Operation, config: SimulationConfig, seed: int, modal: Floats | None = None) -> SimulationState:
    """State at rest before the first axis state.

    seed: of all noise, >= 0; modal (M, 2): initial displacement [m] and velocity [m/s] of the modes,
    tool modes first (None: at rest). Raises ``ValueError`` for a wrong shape or seed.
    """
    require(seed >= 0, "seed", seed, "", "an integer >= 0")
    model = process_model(op, config)
    count = len(model.modes)
    start = np.zeros((count, 2))
    if modal is not None:
        require(np.shape(modal)[1:] == (2,) and np.shape(modal)[0] <= count, "modal state shape", np.shape(modal), "",
                f"(at most {count}, 2)")
        start[: len(modal)] = modal
    surface = np.zeros((model.teeth, model.slices, model.cells * (2 if model.teeth == 1 else 1), 2))
    half = len(model.taps) // 2
    return SimulationState(
        model=model, seed=seed, steps=0, base_ns=0, knot=np.zeros((0, integrator.KNOT_COLUMNS)),
        arcs=np.zeros((0, model.slices, ARCS, 2)), modal=start,
        force=np.zeros(integrator.LOADS), scalars=np.zeros(integrator.SCALARS), surface=surface,
        rows=np.zeros((half, model.row_columns)), next_sample=0,
        samples=np.zeros((0, len(model.sensors.channels or config.channels)), dtype=np.float32), next_block=0,
        background=0.0, casing=np.zeros((3, 2)), marks=np.zeros((0, 4)), first_mark_skip=-1,
    )


def step(
    config: SimulationConfig, state: SimulationState, axes: Sequence[AxisState],
    engagements: Sequence[Engagement] | None = None,
) -> tuple[SimulationState, Chunk]:
    """Integrate over the axis states `axes`, which follow those of earlier steps.

    engagements: where the edges are in the cut at each axis state, in place of the closed form (in every step, or in
    none; None for an eccentric tool: those of the steady cut).

    The first axis state of all is time 0, and the first sample is taken there. Samples come out a
    few milliseconds behind the axis states, because the anti-alias filter looks ahead; their stamps
    are true. Raises ``ValueError`` when stamps do not ascend.
    """
    chunk = tuple(axes)
    if not chunk:
        return state, Chunk((), (), join_truth(()))
    base_ns = state.base_ns if len(state.knot) else chunk[0].stamp_ns
    rows = [knot(state.model, a, base_ns) for a in chunk]
    arcs: list[Floats] = []
    op = state.model.op
    if engagements is None and op.eccentricity:
        engagements = [steady_engagement(op, conditions_from_axes(op, a)) for a in chunk]
    if engagements is not None:
        require(len(engagements) == len(chunk), "engagements", len(engagements), "",
                f"one per axis state, {len(chunk)}")
        general = [general_engagement(state.model, *pair) for pair in zip(rows, engagements, strict=True)]
        rows, arcs = [row for row, _ in general], [found[None] for _, found in general]
    elif len(state.arcs):
        raise ValueError("engagements are None, expected one per axis state as in the steps before")
    knots = np.concatenate([state.knot, np.array(rows)])
    around = np.concatenate([state.arcs, *arcs])
    stamps = knots[:, integrator.TIME]
    if np.any(np.diff(stamps) <= 0):
        at = int(np.argmax(np.diff(stamps) <= 0))
        raise ValueError(f"axis state stamp is {stamps[at + 1]} s since the start, after one at {stamps[at]} s, "
                         "expected ascending stamps")
    if not len(state.knot):
        state = _begin(state, knots[0], base_ns)
    return _finish_chunk(config, *_integrate(config, state, knots, around), chunk)


def block_due_ns(config: SimulationConfig, state: SimulationState) -> int:
    """Stamp [ns] that axis states must reach for the next block to come out of `step`; before the first: since it.

    That of the block's last sample, and what the anti-alias filter looks ahead.
    """
    last = state.next_block + config.block_samples - 1
    return state.base_ns + round((last * config.ratio + len(state.model.taps) // 2) * state.model.dt * 1e9)


def simulate(
    op: Operation, config: SimulationConfig, seed: int, axes_at: Callable[[float, int], AxisState] | None = None,
    duration: float | None = None, engagement_at: Callable[[AxisState], Engagement] | None = None,
) -> Iterator[Chunk]:
    """Chunks of one block each, until `duration` [s] (None: the schedule's).

    axes_at: axis state for a time [s] and a stamp [ns] (None: the operation's schedule, by
    controller.axis_state_at). engagement_at: where the edges cut at an axis state, called in order of time (None: the
    closed form); see engagement_path.along_path. The last chunks carry no axis states beyond the duration.
    """
    if axes_at is None:
        def axes_at(time: float, stamp_ns: int) -> AxisState:
            return axis_state_at(op, time, stamp_ns)
    end = schedule_duration(op) if duration is None else duration
    require(end > 0, "duration", end, "s", "a number > 0 (the operation has no schedule)")
    blocks = int(end * config.sample_rate + 1e-6) // config.block_samples
    if engagement_at is not None and not config.slices:
        config = replace(config, slices=GENERAL_SLICES)
    state = initial(op, config, seed)
    per_chunk = max(1, round(config.axes_rate * config.block_samples / config.sample_rate))
    index = made = 0
    while made < blocks:
        times = [(index + i) / config.axes_rate for i in range(per_chunk)]
        index += per_chunk
        states = [axes_at(t, config.start_ns + round(t * 1e9)) for t in times]
        cuts = None if engagement_at is None else [engagement_at(a) for a in states]
        state, chunk = step(config, state, states, cuts)
        kept = chunk.blocks[: blocks - made]
        made += len(kept)
        shown = tuple(a for a, t in zip(chunk.axes, times, strict=True) if t <= end + 1e-9)
        if shown or kept:
            yield replace(chunk, axes=shown, blocks=kept)


def _begin(state: SimulationState, first: Floats, base_ns: int) -> SimulationState:
    """State at the first axis state: angles set, one row of raw signals at time 0."""
    next_mark = math.floor(first[integrator.TOOL_ANGLE] * MARKS_PER_TURN / (2 * math.pi)) + 1
    scalars = np.array([first[integrator.TOOL_ANGLE], 0.0, max(0.0, first[integrator.DEPTH]), 0.0, next_mark])
    row = np.zeros((1, state.model.row_columns))
    row[0, 0] = first[integrator.TOOL_ANGLE]
    modes = state.model.modes
    for side, column in ((1.0, 2), (-1.0, 5)):
        chosen = modes[:, integrator.SIDE] == side
        shapes = side * modes[chosen][:, integrator.SHAPE_X : integrator.SHAPE_Z + 1]
        row[0, column : column + 3] = state.modal[chosen, 0] @ shapes
    period = MARKS_PER_TURN * state.model.turns
    return replace(state, base_ns=base_ns, scalars=scalars, rows=np.concatenate([state.rows, row]),
                   first_mark_skip=-next_mark % period)


def _integrate(
    config: SimulationConfig, state: SimulationState, knots: Floats, arcs: Floats,
) -> tuple[SimulationState, Floats]:
    """Run the kernel to the last knot; the marks that it wrote."""
    model = state.model
    dt = model.dt
    last = knots[-1, integrator.TIME] + integrator.TIME_TOLERANCE
    end = int(last / dt) + 1
    while end * dt > last:
        end -= 1
    count = max(0, end - state.steps) if len(knots) > 1 else 0
    raw = np.empty((count, model.raw_columns))
    turned = float(knots[:, integrator.TOOL_ANGLE].max() - state.scalars[integrator.ANGLE])
    marks = np.empty((int(max(0.0, turned) * MARKS_PER_TURN / (2 * math.pi)) + count + 2, 4))
    modal, force, scalars, surface = (a.copy() for a in (state.modal, state.force, state.scalars, state.surface))
    written = 0
    if count:
        written = integrator.advance(
            state.steps, dt, knots, arcs, model.modes, model.tooth_angle, model.pitch, model.runout, model.shape,
            model.coefficients, config.loss_of_contact, modal, force, scalars, surface, raw, MARKS_PER_TURN, marks,
        )
    if model.accelerates:
        speeds = slice(integrator.FIRST_VELOCITY, integrator.FIRST_VELOCITY + 3)
        gained = np.diff(np.concatenate([state.rows[-1:, speeds], raw[:, speeds]]), axis=0)
        raw = np.concatenate([raw, gained / dt], axis=1)
    advanced = replace(state, steps=state.steps + count, knot=knots[-1:], arcs=arcs[-1:], modal=modal, force=force,
                       scalars=scalars, surface=surface, rows=np.concatenate([state.rows, raw]))
    return advanced, marks[:written]


def _finish_chunk(
    config: SimulationConfig, state: SimulationState, marks: Floats, axes: tuple[AxisState, ...],
) -> tuple[SimulationState, Chunk]:
    """Measure, cut into blocks, and tell the truth."""
    skipped = min(state.first_mark_skip, len(marks))
    kept = np.concatenate([state.marks, marks[skipped:]]) if config.truth else state.marks
    truth, rest = truth_of_marks(kept, state.model.teeth, state.model.turns, state.model.uneven,
                                 state.model.hop)
    state = replace(state, marks=rest, first_mark_skip=state.first_mark_skip - skipped)
    state = _measure(config, state)
    size = config.block_samples
    measured = channels_of(state.model.sensors) or tuple(CHANNELS[name] for name in config.channels)
    blocks: list[SensorBlock] = []
    samples = state.samples
    while len(samples) >= size:
        first = state.next_block + len(blocks) * size
        blocks.append(SensorBlock(
            stamp_ns=state.base_ns + round(first * 1e9 / config.sample_rate), device=config.device,
            stream_id=config.stream_id, first_sample=first, sample_rate=float(config.sample_rate),
            channels=measured, samples=samples[:size].copy(),
        ))
        samples = samples[size:]
    state = replace(state, samples=samples, next_block=state.next_block + len(blocks) * size)
    return state, Chunk(axes, tuple(blocks), truth)


def _measure(config: SimulationConfig, state: SimulationState) -> SimulationState:
    """Filter and decimate all rows that the filter can reach, and add noise and ambient sound."""
    model = state.model
    ratio = config.ratio
    width = len(model.taps)
    count = max(0, (len(state.rows) - width) // ratio + 1)
    if not count:
        return state
    length = count + (width - 1) // ratio
    used = np.zeros((len(model.columns), length * ratio))
    taken = state.rows[: length * ratio, model.columns]
    used[:, : len(taken)] = taken.T
    phases = np.ascontiguousarray(used.reshape(len(model.columns), length, ratio).transpose(0, 2, 1))
    filtered = np.empty((len(model.columns), count))
    decimate(phases, model.taps, filtered)
    background, casing = state.background, state.casing
    angle = state.rows[width // 2 :: ratio, 0][:count]
    if "sound" in model.names:
        ambient, background = ambient_sound(config.sound, state.seed, state.next_sample, float(config.sample_rate),
                                            angle, background)
        filtered[model.names.index("sound")] += ambient
    if model.sensors.channels:
        samples, casing = volts(model.sensors, dict(zip(model.names, filtered, strict=True)), angle,
                                float(config.sample_rate), state.seed, state.next_sample, casing)
    else:
        for c, name in enumerate(model.names):
            level = {"force": config.force_noise, "displacement": config.displacement_noise}.get(
                CHANNELS[name].quantity, 0.0)
            if name != "sound":
                filtered[c] += level * white_noise(state.seed, 1 + list(CHANNELS).index(name), state.next_sample, count)
        samples = filtered.T.astype(np.float32)
    return replace(state, rows=state.rows[count * ratio :], next_sample=state.next_sample + count,
                   background=background, casing=casing, samples=np.concatenate([state.samples, samples]))
