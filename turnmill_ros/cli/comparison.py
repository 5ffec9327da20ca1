"""What the command forces prints of a recording: measured loads beside the predicted ones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnmill_ros.cli.output import console, print_json, progress, table

if TYPE_CHECKING:
    from turnmill_core.operation import Operation
    from turnmill_ros.force_compare import Compared

HEADER = ("measured", "component", "windows in the cut", "mean measured", "mean predicted", "scale (95 % interval)")


def show_comparison(bag: Path, operation: Operation | None, as_json: bool, report: Path | None) -> None:
    """Compare a recording and print what was found; `report` is a new file, `operation` replaces the recorded one."""
    from turnmill_ros.force_compare import compare

    with progress(f"comparing {bag.name}", quiet=as_json) as share:
        compared = compare(bag, operation, share)
    rows = _rows(compared)
    if report is not None:
        from turnmill_ros.compare_report import compare_report

        compare_report(report, compared, rows, HEADER)
    if as_json:
        print_json(_document(compared))
        return
    table(f"{bag.name}: {compared.operation.name}", HEADER, rows)
    if compared.refused:
        console.print(f"{compared.refused} axis states without a prediction: {compared.reason}", markup=False)


def _rows(compared: Compared) -> list[tuple[str, ...]]:
    from turnmill_ros.compare_report import components
    from turnmill_ros.force_compare import in_cut
    from turnmill_ros.measured import UNITS

    rows: list[tuple[str, ...]] = []
    for source, windows in compared.windows.items():
        cuts, last = in_cut(windows), windows[-1]
        scales = [w for w in windows if math.isfinite(w.scale)]
        shown = f"none: {last.reason}"
        if scales:
            shown = f"{scales[-1].scale:.4f} ({scales[-1].lower:.4f} to {scales[-1].upper:.4f})"
        unit = UNITS[source.quantity]
        for k, name in enumerate(components(source)):
            means = [f"{np.mean([getattr(w, which)[k] for w in cuts]):.4g} {unit}" if cuts else "-"
                     for which in ("measured", "predicted")]
            rows.append((source.name if k == 0 else "", f"{name}, {source.frame} frame" if source.components else name,
                         str(len(cuts)), *means, shown if k == 0 else ""))
    return rows


def _document(compared: Compared) -> dict[str, Any]:
    from turnmill_ros.compare_report import components

    return {
        "recording": str(compared.path), "operation": compared.operation.name,
        "operation_sha256": compared.operation.sha256, "axis_states_without_prediction": compared.refused,
        "sources": [{
            "name": source.name, "quantity": source.quantity,
            "frame": source.frame if source.quantity == "force" else None, "components": components(source),
            "windows": [{
                "time_s": (w.end_ns - compared.start_ns) * 1e-9,
                "measured": w.measured if len(w.measured) else None, "predicted": w.predicted, "offset": w.offset,
                "scale": w.scale, "lower": w.lower, "upper": w.upper, "windows": w.windows, "reason": w.reason or None,
            } for w in windows],
        } for source, windows in compared.windows.items()],
    }
