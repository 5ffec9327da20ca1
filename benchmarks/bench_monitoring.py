"""Cost of the chatter monitor: CPU seconds per second of signal, and memory over a long stream.

    python benchmarks/bench_monitoring.py [--json]

Signal: five channels at 51.2 kHz in blocks of 20 ms, axis states at 250 Hz, 4 teeth at 3350 rpm; a tooth
passing comb with noise, and the same with a chatter family; and, without axis states, the comb at a slow
speed (1500 rpm: windows of 0.4 s). One channel is judged, all five are carried. And the eight channels of
demo_sensors in volts at 51.2 kHz, from air into chatter, with the tool tip found from two probes judged.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from common import calibration

from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.monitoring.chatter import ChatterConfig, SpindleSpeed, config_from_operation, initial, update
from turnmill_core.monitoring.verdict import ChatterKind
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.simulation import simulate

RATE = 51200.0
CHANNELS = tuple(Channel(f"ch{k}", "displacement", "m") for k in range(5))
BLOCK = 1024


def items(seconds: float, rpm: float, chatter: float, axes: bool) -> Iterator[SensorBlock | SpindleSpeed]:
    """Blocks and spindle speeds in order of stamp."""
    rng = np.random.default_rng(1)
    speed = rpm * 2 * math.pi / 60
    for k in range(int(seconds * RATE / BLOCK)):
        t = (k * BLOCK + np.arange(BLOCK)) / RATE
        tooth = 4 * speed * t
        x = sum(np.cos(n * tooth + n) / n for n in range(1, 8))
        x = x + chatter * np.cos(2 * math.pi * 871.3 * t) * (1 + 0.4 * np.cos(tooth))
        samples = (1e-6 * (x[:, None] + 0.1 * rng.standard_normal((BLOCK, 5)))).astype(np.float32)
        yield SensorBlock(round(k * BLOCK * 1e9 / RATE), "daq", 1, k * BLOCK, RATE, CHANNELS, samples)
        for j in range(5 if axes else 0):
            yield SpindleSpeed(round((k + (j + 1) / 5) * BLOCK * 1e9 / RATE), speed)


def simulated(op: Operation, seconds: float) -> Iterator[SensorBlock | SpindleSpeed]:
    """Blocks in volts and spindle speeds of an operation's schedule."""
    for chunk in simulate(op, SimulationConfig(sample_rate=round(RATE), volts=True, truth=False), 1, duration=seconds):
        yield from (SpindleSpeed(a.stamp_ns, a.velocity[5], a.position[5]) for a in chunk.axes)
        yield from chunk.blocks


def cost(config: ChatterConfig, given: list[SensorBlock | SpindleSpeed], seconds: float,
         expected: ChatterKind) -> tuple[float, float]:
    """CPU seconds per second of signal, and the longest single update [ms]."""
    state, worst = initial(config), 0.0
    for item in given[: len(given) // 4]:
        state, _ = update(config, state, item)
    state, verdicts = initial(config), []
    begin = time.process_time()
    for item in given:
        since = time.perf_counter()
        state, found = update(config, state, item)
        worst = max(worst, time.perf_counter() - since)
        verdicts.extend(found)
    spent = (time.process_time() - begin) / seconds
    if not verdicts or verdicts[-1].state is not expected:
        raise SystemExit(f"the monitor does not say {expected.name}: nothing was measured")
    return spent, 1e3 * worst


def growth(seconds: float) -> float:
    """Growth of the peak memory [MB] while a stream of `seconds` passes, after its first tenth."""
    config = ChatterConfig(teeth=4, nominal_speed=3350 * 2 * math.pi / 60)
    state, early = initial(config), 0
    for item in items(seconds, 3350, 0.3, True):
        state, _ = update(config, state, item)
        if not early and item.stamp_ns > seconds * 1e8:
            early = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - early) / 1e3


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--long", type=float, default=60.0, help="seconds of signal for the memory figure")
    args = parser.parse_args()
    figures: dict[str, float] = {"calibration_s": calibration()}
    cases: dict[str, tuple[ChatterConfig, list[SensorBlock | SpindleSpeed], float, ChatterKind]] = {}
    for name, rpm, chatter, axes in (("stable", 3350.0, 0.0, True), ("chatter", 3350.0, 0.5, True),
                                     ("slow_nominal_speed", 1500.0, 0.0, False)):
        config = ChatterConfig(teeth=4, nominal_speed=rpm * 2 * math.pi / 60, expect_axes=axes)
        cases[name] = (config, list(items(6.0, rpm, chatter, axes)), 6.0,
                       ChatterKind.HOPF if chatter else ChatterKind.STABLE)
    op = read_operation(shipped_operations()["demo_sensors"])
    cases["tool_tip"] = (replace(config_from_operation(op), channel="tip_x"), list(simulated(op, 6.0)), 6.0,
                         ChatterKind.HOPF)
    for name, case in cases.items():
        cpu, worst = min(cost(*case) for _ in range(3))
        figures[f"{name}_cpu_s_per_s"] = cpu
        figures[f"{name}_longest_update_ms"] = worst
    figures["memory_growth_mb"] = growth(args.long)
    print(json.dumps(figures) if args.json else "\n".join(f"{k:32s} {v:.4g}" for k, v in figures.items()))


if __name__ == "__main__":
    main()
