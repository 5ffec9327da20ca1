"""Pages of forces: one cut over a revolution, and a path."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any

from turnmill_core.cutting.along_path import PathLoads
from turnmill_core.cutting.forces import EdgeLoads
from turnmill_core.cutting.loads import CuttingLoads
from turnmill_core.operation import Conditions, Operation
from turnmill_ros import force_figures, report

RPM = 60 / (2 * math.pi)


def forces_report(
    output: Path, op: Operation, cut: Conditions, loads: CuttingLoads, force_machine: Any, edges: EdgeLoads | None,
    rows: list[tuple[str, str]],
) -> None:
    """Write the page of one cut; force_machine [N] (n, 3) over the revolution; edges: None without contact."""
    plots: list[tuple[str, Any]] = [("Over one tool revolution" if k == 0 else "", p) for k, p in enumerate(
        force_figures.revolution(loads.angle, loads.force_tool, force_machine, loads.tool_torque))]
    if edges is not None:
        plots += [("Tooth by tooth" if k == 0 else "", p) for k, p in enumerate(force_figures.by_tooth(edges))]
        plots += [("Engagement", force_figures.engagement(loads.engagement)), ("", force_figures.along_edge(edges))]
    report.write_page(output, f"turnmill forces: {op.name}", [
        f"<h1>{escape(op.name)}</h1>",
        f"<p class=note>tool {cut.tool_speed * RPM:g} rpm, workpiece {cut.workpiece_speed * RPM:g} rpm, "
        f"depth {cut.depth * 1e3:g} mm{'' if loads.in_cut else ', no contact'}</p>",
        report.html_table([(escape(a), escape(b)) for a, b in rows], ("quantity", "value")),
    ], plots, [report.operation_tables(op)])


def path_report(
    output: Path, op: Operation, name: str, loads: PathLoads, rows: list[tuple[str, str, str]], header: tuple[str, ...]
) -> None:
    """Write the page of a path; rows: the table of the command."""
    plots: list[tuple[str, Any]] = [
        ("Along the path" if k == 0 else "", p) for k, p in enumerate(force_figures.path(loads))]
    tail = [report.operation_tables(op)]
    if loads.refused:
        tail.insert(0, "<p class=note>No prediction where the first picture is grey: "
                       f"{escape(loads.refused[0][1])}</p>")
    report.write_page(output, f"turnmill forces: {name}", [
        f"<h1>{escape(name)}</h1>", f"<p class=note>{escape(op.name)}</p>",
        report.html_table([tuple(map(escape, row)) for row in rows], header)], plots, tail)
