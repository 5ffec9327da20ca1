"""Time to follow a structure: table of modes, bar while it is cut, and the margin that uses it.

    python benchmarks/bench_structure.py [--json]

Cases: thesis_table_4_5 (modes over the ram's stroke) and thesis_table_4_7 (aluminium bar on its chuck), at places that
were not asked for before; one chuck from 600 lines of a dummy's receptances.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from common import calibration, run

from turnmill_core.machine.conditions import machine_from_tool, nominal_axes
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.stability.margin import stability_margin
from turnmill_core.structure.at import Position, structure_at
from turnmill_core.structure.beam import free_bar, on_chuck, receptances
from turnmill_core.structure.profile import stock_profile
from turnmill_core.structure.receptance import chuck_from_dummy


def took(work: Callable[[], object]) -> float:
    """Processor time of `work` [s]."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def followed(op: Operation, label: str) -> dict[str, float]:
    """Structure and margin of an operation at places along its path."""
    rotation, start = machine_from_tool(op, op.conditions), nominal_axes(op).position

    def place(k: int) -> Position:
        return (start[0], start[1] + 1e-4 * k, start[2] - 5e-4 * k, *start[3:])

    structures = [took(lambda k=k: structure_at(op, rotation, op.conditions, place(k))) for k in range(100)]
    stability_margin(op, op.conditions, position=place(0))
    margins = [took(lambda k=k: stability_margin(op, op.conditions, position=place(k))) for k in range(100, 140)]
    return {f"{label}_structure_median_ms": 1e3 * float(np.median(structures)),
            f"{label}_margin_median_ms": 1e3 * float(np.median(margins))}


def chuck(op: Operation) -> float:
    """The chuck of an operation's bar from 600 lines of its receptances [s], best of 5."""
    beam = op.workpiece.beam
    assert beam is not None
    bar, f = free_bar(stock_profile(op.workpiece), beam.material), np.linspace(50, 3000, 600)
    held = on_chuck(bar, beam.chuck_x)
    H = receptances(held, np.vstack([held.row(0.0), held.row(0.06)]), f)
    return min(took(lambda: chuck_from_dummy(bar, (0.0, 0.06), f, H[:, 0, 0], H[:, 0, 1], H[:, 1, 1]))
               for _ in range(5))


def measure() -> dict[str, float]:
    """What is measured, by name with its unit."""
    table, bar = (read_operation(shipped_operations()[name]) for name in ("thesis_table_4_5", "thesis_table_4_7"))
    return {"calibration_s": calibration(), **followed(table, "mode_table"), **followed(bar, "bar_in_process"),
            "chuck_from_600_lines_ms": 1e3 * chuck(bar)}


if __name__ == "__main__":
    run(measure, __doc__)
