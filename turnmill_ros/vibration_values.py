"""Vibration of a cut as the command tells it: signals of three solutions in one form, their figures, JSON and CSV."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import Conditions, Operation
from turnmill_core.process.linear import linear_map
from turnmill_core.process.linear_cut import linear_cut
from turnmill_core.process.periodic_orbit import periodic_orbit
from turnmill_core.process.sensors import SoundModel
from turnmill_core.process.simulation import SimulationConfig, simulate
from turnmill_core.process.vibration import Vibration, displacement_at, in_frame, smallest_chip, time_solution
from turnmill_core.stability.margin import StabilityPoint, stability_point

Floats = NDArray[np.float64]
Solution = Literal["steady", "linear", "nonlinear"]
Frame = Literal["tool", "machine", "workpiece"]
SIDES = ("tool", "workpiece")
NONLINEAR_RATE = 102_400
VECTORS = ("tool", "workpiece", "tool_velocity", "workpiece_velocity", "force")


@dataclass(frozen=True, eq=False)
class Signals:
    """What vibrates, over time: time (m,) [s], angle (m,) [rad] of the tool, vectors (m, 3) in `frame`, torques (m,).

    per_turn: samples in a tool revolution; smallest_chip: over the feed per tooth, NaN for the nonlinear solution;
    point: stability of the cut.
    """

    op: Operation
    cut: Conditions
    solution: Solution
    frame: Frame
    time: Floats
    angle: Floats
    tool: Floats
    workpiece: Floats
    tool_velocity: Floats
    workpiece_velocity: Floats
    force: Floats
    tool_torque: Floats
    workpiece_torque: Floats
    per_turn: int
    smallest_chip: float
    point: StabilityPoint

    @property
    def last_turn(self) -> slice:
        """The samples of the last tool revolution."""
        return slice(max(0, self.time.size - self.per_turn), self.time.size)


def signals(
    op: Operation, cut: Conditions, solution: Solution, turns: int, frame: Frame = "tool", height: float | None = None,
) -> Signals:
    """Vibration of the cut: steady over one tool revolution, or from rest over `turns` tool revolutions."""
    found = _nonlinear(op, cut, turns) if solution == "nonlinear" else _linear(op, cut, solution, turns, height)
    vectors = {name: in_frame(getattr(found, name), op, cut, frame, found.time) for name in VECTORS}
    return replace(found, frame=frame, **vectors)


def _linear(op: Operation, cut: Conditions, solution: Solution, turns: int, height: float | None) -> Signals:
    step_map = linear_map(linear_cut(op, cut))
    per_turn = round(2 * math.pi / (cut.tool_speed * step_map.dt))
    found: Vibration = periodic_orbit(step_map) if solution == "steady" else (
        time_solution(step_map, turns * round(per_turn / step_map.steps))[0])
    tool, workpiece = (found.tool, found.workpiece) if height is None else displacement_at(found, height)
    return Signals(op, cut, solution, "tool", found.time, found.angle, tool, workpiece, found.tool_velocity,
                   found.workpiece_velocity, found.force, found.tool_torque, found.workpiece_torque, per_turn,
                   smallest_chip(found), stability_point(op, cut))


def _nonlinear(op: Operation, cut: Conditions, turns: int) -> Signals:
    period = 2 * math.pi / cut.tool_speed
    channels = (*(f"{side}_{axis}" for side in SIDES for axis in "xyz"),
                *(f"{side}_velocity_{axis}" for side in SIDES for axis in "xyz"),
                *(f"force_{axis}" for axis in "xyz"), "tool_torque", "workpiece_torque")
    config = SimulationConfig(sample_rate=NONLINEAR_RATE, channels=channels, oversampling=1, block_duration=period,
                              displacement_noise=0.0, force_noise=0.0, truth=False,
                              sound=SoundModel(panels=(), background=0.0, tones=()))
    held = replace(op, conditions=cut, schedule=())
    chunks = simulate(held, config, 0, duration=turns * period + 1 / NONLINEAR_RATE)
    values = np.concatenate([block.samples for chunk in chunks for block in chunk.blocks]).astype(np.float64)
    time = np.arange(len(values)) / NONLINEAR_RATE
    parts = np.split(values[:, :15], 5, axis=1)
    return Signals(op, cut, "nonlinear", "tool", time, time * cut.tool_speed, *parts, values[:, 15], values[:, 16],
                   round(period * NONLINEAR_RATE), math.nan, stability_point(op, cut))


def warnings(found: Signals) -> list[str]:
    """What a reader must know before believing the figures."""
    said = []
    if found.point.spectral_radius >= 1:
        chatter = found.point.chatter_frequency
        said.append(f"this cut chatters (|multiplier| {found.point.spectral_radius:.3f}, {chatter:.0f} Hz)"
                    + ("" if found.solution == "nonlinear" else ": a machine shows --solution nonlinear"))
    if found.solution != "nonlinear" and found.smallest_chip < -0.01:
        said.append("the chip comes out negative: the tool leaves the material, which only --solution nonlinear tells")
    return said


def document(found: Signals) -> dict[str, object]:
    """JSON form: figures of the last tool revolution, SI units."""
    last = found.last_turn
    parts: dict[str, object] = {
        "operation": found.op.name, "operation_sha256": found.op.sha256, "solution": found.solution,
        "frame": found.frame, "tool_speed_rad_s": found.cut.tool_speed,
        "workpiece_speed_rad_s": found.cut.workpiece_speed, "depth_m": found.cut.depth,
        "duration_s": float(found.time[-1]), "spectral_radius": found.point.spectral_radius,
        "smallest_chip_per_feed": found.smallest_chip, "warnings": warnings(found),
    }
    for name, values, unit in (
        ("tool_displacement", found.tool, "m"), ("workpiece_displacement", found.workpiece, "m"),
        ("relative_displacement", found.tool - found.workpiece, "m"), ("tool_velocity", found.tool_velocity, "m_s"),
        ("workpiece_velocity", found.workpiece_velocity, "m_s"), ("force", found.force, "n"),
        ("tool_torque", found.tool_torque, "n_m"), ("workpiece_torque", found.workpiece_torque, "n_m"),
        ("tool_power", found.tool_torque * found.cut.tool_speed, "w"),
        ("workpiece_power", found.workpiece_torque * abs(found.cut.workpiece_speed), "w"),
    ):
        turn = values[last]
        parts[f"{name}_mean_{unit}"] = turn.mean(axis=0)
        parts[f"{name}_peak_to_peak_{unit}"] = np.ptp(turn, axis=0)
        parts[f"{name}_rms_{unit}"] = turn.std(axis=0)
    return parts


def rows(found: Signals) -> list[tuple[str, ...]]:
    """Table: quantity, mean, peak to peak and rms about the mean over the last tool revolution."""
    last = found.last_turn
    table: list[tuple[str, ...]] = []

    def add(name: str, values: Floats, factor: float, unit: str, digits: int) -> None:
        turn = values[last] * factor
        table.append((f"{name}, {unit}", *(f"{v:.{digits}f}" for v in (turn.mean(), np.ptp(turn), turn.std()))))

    for what, values, factor, unit, digits in (
        ("tool displacement", found.tool, 1e6, "um", 3), ("workpiece displacement", found.workpiece, 1e6, "um", 3),
        ("relative displacement", found.tool - found.workpiece, 1e6, "um", 3),
        ("tool velocity", found.tool_velocity, 1e3, "mm/s", 3),
        ("workpiece velocity", found.workpiece_velocity, 1e3, "mm/s", 3), ("force on the tool", found.force, 1, "N", 2),
    ):
        for k, axis in enumerate("xyz"):
            if values[:, k].any():
                add(f"{what} {axis}", values[:, k], factor, unit, digits)
    add("tool torque", found.tool_torque, 1, "N m", 4)
    add("tool power", found.tool_torque * found.cut.tool_speed, 1, "W", 2)
    add("workpiece torque", found.workpiece_torque, 1, "N m", 4)
    add("workpiece power", found.workpiece_torque * abs(found.cut.workpiece_speed), 1, "W", 3)
    return table


def csv_text(found: Signals) -> str:
    """All samples as CSV, SI units in the column names."""
    names = ["time_s", "tool_angle_rad"]
    names += [f"{name}_{axis}_{unit}" for name, unit in zip(
        ("tool", "workpiece", "tool_velocity", "workpiece_velocity", "force"), ("m", "m", "m_s", "m_s", "n"),
        strict=True) for axis in "xyz"]
    names += ["tool_torque_n_m", "workpiece_torque_n_m"]
    columns = np.column_stack([found.time, found.angle, *(getattr(found, name) for name in VECTORS),
                               found.tool_torque, found.workpiece_torque])
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([f"{v:.9g}" for v in line] for line in columns)
    return out.getvalue()
