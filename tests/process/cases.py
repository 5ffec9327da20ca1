"""Operations and runs that several tests of the process simulator share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.conditions import with_cut
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Conditions, Material, Mode, Operation, Structure, Tool, Workpiece
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.sensors import SoundModel
from turnmill_core.process.simulation import Chunk, initial, simulate, step

Floats = NDArray[np.float64]

RPM = math.pi / 30
SILENT = SoundModel(panels=(), background=0.0, tones=())
ALUMINIUM = Material("aluminium", 600e6, 200e6, 70e6)
BENCHMARK_MODE = Mode(922.0, 0.011, 0.03993, (1.0, 0.0, 0.0))
STIFF = tuple(Mode(25e3, 0.5, 1.0, shape) for shape in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


def milling(
    modes: tuple[Mode, ...] = (BENCHMARK_MODE,), teeth: int = 2, speed: float = 5000 * RPM, depth: float = 2e-4,
    span: tuple[float, float] = (-5e-3, 5e-3), material: Material = ALUMINIUM, feed: float = 1e-4,
    workpiece_modes: tuple[Mode, ...] = (), **tool: object,
) -> Operation:
    """Milling with a tool of 10 mm; by default the full-immersion benchmark of Insperger and Stepan."""
    sense = "slot" if span == (-5e-3, 5e-3) else "up" if span[1] == 5e-3 else "down"
    return Operation(
        name="test", process="milling", machine="none",
        tool=Tool("end mill", 10e-3, teeth, structure=Structure(modes), **tool),  # type: ignore[arg-type]
        workpiece=Workpiece("block", length=10.0, width=span[1] - span[0], height=0.03,
                            structure=Structure(workpiece_modes, "machine")),
        material=material, milling_sense=sense, feed_per_tooth=feed,  # type: ignore[arg-type]
        conditions=Conditions(speed, 0.0, depth, feed * teeth * speed / (2 * math.pi), span),
    )


def turn_milling(
    modes: tuple[Mode, ...], workpiece_speed: float = 6 * RPM, speed: float = 3000 * RPM, depth: float = 2e-3,
    sense: str = "up", axial_feed: float = 8e-3, material: Material = ALUMINIUM, workpiece_modes: tuple[Mode, ...] = (),
    **tool: object,
) -> Operation:
    """Turn-milling of a bar of 46 mm with a tool of 20 mm."""
    span = (10e-3 - axial_feed, 10e-3) if sense == "up" else (-10e-3, -10e-3 + axial_feed)
    tool = {"teeth": 2, **tool}
    return Operation(
        name="test", process="turn-milling", machine="none",
        tool=Tool("end mill", 20e-3, structure=Structure(modes), **tool),  # type: ignore[arg-type]
        workpiece=Workpiece("bar", diameter=46e-3, length=0.2, structure=Structure(workpiece_modes, "tool")),
        material=material, milling_sense=sense, axial_feed=axial_feed,  # type: ignore[arg-type]
        conditions=Conditions(speed, workpiece_speed, depth, axial_feed * abs(workpiece_speed) / (2 * math.pi), span,
                              23e-3 - depth),
    )


def at(op: Operation, **cut: float) -> Operation:
    """`op` with another nominal cut (see machine.conditions.with_cut)."""
    return replace(op, conditions=with_cut(op, **cut))


def exact_config(
    rate: int = 100_000, channels: tuple[str, ...] = ("tool_x", "tool_y"), **other: object,
) -> SimulationConfig:
    """Every integration step is a sample, and no noise."""
    return SimulationConfig(sample_rate=rate, oversampling=1, channels=channels, displacement_noise=0.0,
                            force_noise=0.0, sound=SILENT, **other)  # type: ignore[arg-type]


def samples(chunks: Sequence[Chunk]) -> Floats:
    """All samples of all blocks, (n, channels)."""
    return np.concatenate([block.samples for chunk in chunks for block in chunk.blocks]).astype(np.float64)


def run(op: Operation, config: SimulationConfig, duration: float, seed: int = 0) -> Floats:
    """Samples of a simulation."""
    return samples(list(simulate(op, config, seed, duration=duration)))


def strobe(op: Operation, times: Sequence[float], kick: float, config: SimulationConfig) -> Floats:
    """Modal states (times, modes, 2), every mode displaced by `kick` [m] at the beginning."""
    modes = len(op.tool.structure.modes) + len(op.workpiece.structure.modes)
    state = initial(op, config, 0, np.tile([kick, 0.0], (modes, 1)))
    found = []
    for time in times:
        state, _ = step(config, state, [axis_state_at(op, time, round(time * 1e9))])
        found.append(state.modal[:modes])
    return np.array(found)


def multiplier(op: Operation, periods: int = 60, rate: int = 100_000) -> complex:
    """Leading Floquet multiplier of one tooth period, from how a perturbation of the linear cut develops.

    The difference of two runs, one kicked, obeys a linear map; its leading eigenvalue is found by
    dynamic mode decomposition of the energy-weighted modal states, four successive ones stacked: the
    largest of those that are left at the end.
    """
    config = exact_config(rate, loss_of_contact=False)
    period = 2 * math.pi / op.conditions.tool_speed / op.tool.teeth
    times = [i * period for i in range(periods + 1)]
    difference = strobe(op, times, 1.0, config) - strobe(op, times, 0.0, config)
    modes = (*op.tool.structure.modes, *op.workpiece.structure.modes)
    difference *= np.sqrt([[mode.stiffness, mode.mass] for mode in modes])
    rows = difference.reshape(len(times), -1)
    size = np.linalg.norm(rows, axis=1)
    rows = rows[: int(np.argmax(size < 1e-13 * size[0])) or len(rows)]
    rows = rows[len(rows) // 3 :]
    stacked = np.concatenate([rows[i : len(rows) - 4 + i] for i in range(4)], axis=1).T
    before, after = stacked[:, :-1], stacked[:, 1:]
    scale = np.linalg.norm(before, axis=0)
    left, values, right = np.linalg.svd(before / scale, full_matrices=False)
    keep = values > 1e-6 * values[0]
    values, vectors = np.linalg.eig(left[:, keep].T @ (after / scale) @ right[keep].T / values[keep])
    share = np.abs(np.linalg.solve(vectors, left[:, keep].T @ after[:, -1])) * np.linalg.norm(vectors, axis=0)
    left_over = values[share > 0.1 * share.max()]
    return complex(left_over[np.argmax(np.abs(left_over))])
