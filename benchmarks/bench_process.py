"""Speed of the process simulator: simulated seconds per second on one core.

    python benchmarks/bench_process.py [--json]

Case: thesis Table 4.9, all direct modes, 2 teeth, helix, 1.2 mm, with sound and four displacements at
51.2 kHz in blocks of 20 ms, and the demonstration with two channels at 12.8 kHz, from air into chatter.
Then the linear time solution of the same case, its periodic orbit, and the finished surface of one workpiece
revolution with axial vibration (six points to a tooth pass, 200 along the bar).
"""

from __future__ import annotations

import time
from collections.abc import Callable

from common import calibration, run

from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.process._kernels import integrator
from turnmill_core.process.linear import linear_map
from turnmill_core.process.linear_cut import linear_cut
from turnmill_core.process.periodic_orbit import periodic_orbit
from turnmill_core.process.scenarios import SCENARIOS
from turnmill_core.process.simulation import SimulationConfig, initial, simulate, step
from turnmill_core.process.surface import form_error
from turnmill_core.process.surface_map import surface_map
from turnmill_core.process.vibration import time_solution

FIVE = SimulationConfig(sample_rate=51200, channels=("sound", "tool_x", "tool_y", "workpiece_x", "workpiece_y"))


def real_time_factor(op: Operation, config: SimulationConfig, duration: float, runs: int = 3) -> float:
    """Simulated seconds per second of processor time, best of `runs`, compiled before."""
    list(simulate(op, config, 0, duration=0.1))
    times = []
    for _ in range(runs):
        begin = time.process_time()
        made = sum(len(chunk.blocks) for chunk in simulate(op, config, 0, duration=duration))
        times.append(time.process_time() - begin)
        assert made == int(duration / config.block_duration + 1e-6)
    return duration / min(times)


def kernel_share(op: Operation, config: SimulationConfig, duration: float) -> float:
    """Share of the processor time of `step` that the integrator takes."""
    spent = [0.0]
    advance = integrator.advance

    def timed(*arguments: object) -> int:
        begin = time.process_time()
        written: int = advance(*arguments)
        spent[0] += time.process_time() - begin
        return written

    per_block = round(config.axes_rate * config.block_duration)
    axes = [axis_state_at(op, i / config.axes_rate, round(i * 1e9 / config.axes_rate))
            for i in range(int(duration * config.axes_rate))]
    state = initial(op, config, 0)
    integrator.advance = timed
    begin = time.process_time()
    for i in range(0, len(axes), per_block):
        state, _ = step(config, state, axes[i : i + per_block])
    total = time.process_time() - begin
    integrator.advance = advance
    return spent[0] / total


def processor_time(call: Callable[[], object], runs: int = 3) -> float:
    """Processor time [s] of a call, best of `runs`, compiled before."""
    call()
    times = []
    for _ in range(runs):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return min(times)


def linear_figures(op: Operation) -> dict[str, float]:
    """Map, march and periodic orbit of the linear cut."""
    cut = linear_cut(op, op.conditions)
    step_map = linear_map(cut)
    periods = 400
    return {
        "linear_map_s": processor_time(lambda: linear_map(cut)),
        "linear_solution_times_real_time": periods * cut.period / processor_time(
            lambda: time_solution(step_map, periods)),
        "periodic_orbit_s": processor_time(lambda: periodic_orbit(step_map)),
    }


def surface_figures() -> dict[str, float]:
    """Finished surface of a workpiece revolution, and the form error for a search."""
    op = read_operation(shipped_operations()["turn_milling_axial_mode"])
    return {
        "surface_revolution_s": processor_time(lambda: surface_map(op, op.conditions), 2),
        "form_error_ms": 1e3 * processor_time(lambda: form_error(op, op.conditions), 20),
    }


def measure() -> dict[str, float]:
    """All figures: name with unit -> value."""
    case = read_operation(shipped_operations()["thesis_table_4_9"])
    demo = SCENARIOS["demo"]
    drift = read_operation(next(p for p in shipped_operations().values() if p.name == demo.operation))
    return {
        "calibration_s": calibration(),
        "table_4_9_5_channels_51200_hz_times_real_time": real_time_factor(case, FIVE, 4.0),
        "table_4_9_5_channels_51200_hz_integrator_share": kernel_share(case, FIVE, 2.0),
        "demo_2_channels_12800_hz_times_real_time": real_time_factor(drift, demo.config, demo.duration, 1),
        "demo_5_channels_51200_hz_times_real_time": real_time_factor(drift, FIVE, demo.duration, 1),
        **linear_figures(case), **surface_figures(),
    }


if __name__ == "__main__":
    run(measure, __doc__)
