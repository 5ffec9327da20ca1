"""The command detect-bench: how well the monitor hears, on labelled signals that it has not seen."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from turnmill_ros.cli.output import JsonFlag, console, new_file, print_json, progress, table, whole


def detect_bench(
    quick: Annotated[bool, typer.Option("--quick", help="A few cuts, no hours of quiet signal.")] = False,
    hours: Annotated[float | None, typer.Option(
        help="Hours of signal without chatter; default: 10.2, with --quick none.")] = None,
    train: Annotated[bool, typer.Option("--train", help="Signals to develop with, not those to test with.")] = False,
    jobs: Annotated[int | None, typer.Option(help="Processes; default: one per processor.")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Hear a seeded corpus of simulated cuts, labelled by their noise-free motion; published indicators stand beside.

    Confusion, ROC area, alarm delay, false alarms with the hours behind them, CPU per second of signal. The
    full run takes about an hour of processor time.

    Example: turnmill detect-bench --quick --report hearing.html
    """
    from dataclasses import replace

    from turnmill_core.detection.bench import FULL, QUICK, run, tally
    from turnmill_ros.detection_report import (
        behind,
        comparison_rows,
        confusion_rows,
        detection_report,
        figures_json,
        summary_rows,
    )

    plan = QUICK if quick else FULL
    if hours is not None:
        plan = replace(plan, hours=hours)
    if train:
        plan = replace(plan, first=0)
    if report is not None:
        new_file(report)
    processes = min(os.cpu_count() or 1, 64) if jobs is None else whole(jobs, "--jobs", 1, 256)
    with progress("hearing", quiet=as_json) as advance:
        heard = run(plan, processes, advance)
    found = tally(heard)
    if report is not None:
        detection_report(report, plan, found)
    if as_json:
        print_json(figures_json(plan, found))
        return
    header, rows = confusion_rows(found)
    table("Windows by what they truly are (rows) and what was said", header, rows)
    table("Detection", ("what", "found", "wanted"), summary_rows(found))
    table("Beside published indicators, each at its operating point", *comparison_rows(found))
    console.print(f"fewer false alarms than ours: {'; '.join(behind(found)) or 'none, at any recall'}")
    if report is not None:
        console.print(f"report: {report}", soft_wrap=True)
