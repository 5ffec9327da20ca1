"""The demonstration: replay the shipped recording through real ROS 2 nodes and hold the verdicts against the truth.

Writes the recorded MCAP, the verdict table and the report to a folder, by default ``out``.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from turnmill_core.monitoring.verdict import ChatterKind
from turnmill_ros.analysis import Analysis, Segment, analysis_json, analysis_of, timeline
from turnmill_ros.cli.output import console, plain, table
from turnmill_ros.cli.recordings import show_analysis
from turnmill_ros.errors import InputError
from turnmill_ros.predictions import read_predictions
from turnmill_ros.replay import replay
from turnmill_ros.report import recording_report, write_text

EXPECTED = (ChatterKind.AIR, ChatterKind.STABLE, ChatterKind.HOPF, ChatterKind.STABLE)
TOLERANCE_S = 0.3


@dataclass(frozen=True)
class Change:
    """One change of state: what the truth says and when, and when the verdict came [s]."""

    what: str
    truth_s: float
    verdict_s: float

    @property
    def ok(self) -> bool:
        """True where the verdict came within the tolerance."""
        return abs(self.verdict_s - self.truth_s) <= TOLERANCE_S


def changes(analysis: Analysis, truth: dict[str, Any]) -> list[Change]:
    """Changes of the timeline beside the truth: entry into the cut, and each passing of the 20 % line.

    Raises InputError where the timeline is not air, stable, Hopf, stable.
    """
    seen = timeline(analysis.segments)
    states = tuple(s.state for s in seen[: len(EXPECTED)])
    if states != EXPECTED:
        raise InputError("the timeline is " + ", ".join(s.state.name for s in seen),
                         expected=", ".join(k.name for k in EXPECTED))
    moments = [
        next(t for t, touched in zip(truth["time_s"], truth["touched"], strict=True) if touched),
        next(c["t_s"] for c in truth["crossings"] if c["rising"]),
        next(c["t_s"] for c in truth["crossings"] if not c["rising"]),
    ]
    air, _, hopf = seen[:3]
    names = ("enters the cut", "chatter begins", "chatter is gone")
    told = (air.end_ns, hopf.start_ns, hopf.end_ns)
    return [Change(n, t, analysis.seconds(v)) for n, t, v in zip(names, moments, told, strict=True)]


def run(bag: Path, folder: Path) -> None:
    """Replay `bag`, print the table, and leave demo.mcap, verdicts.json and report.html in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    outputs = recorded, verdicts, report = folder / "demo.mcap", folder / "verdicts.json", folder / "report.html"
    for path in outputs:
        path.unlink(missing_ok=True)
        path.with_name(path.name + ".part").unlink(missing_ok=True)
    began = time.monotonic()
    console.print(f"replaying {bag} through ROS 2 nodes ...", soft_wrap=True)
    result = replay(bag, rate=math.inf, output=recorded)
    analysis = analysis_of(recorded, result.verdicts)
    show_analysis(analysis)
    truth_path = bag.with_name(bag.name.removesuffix(".mcap") + ".truth.json")
    truth = json.loads(truth_path.read_text(encoding="utf-8"))
    rows = changes(analysis, truth)
    table("Verdict beside the simulator's truth (20 % asynchronous amplitude)",
          ("change", "truth [s]", "verdict [s]", "difference [s]"),
          ((c.what, f"{c.truth_s:.2f}", f"{c.verdict_s:.2f}", f"{c.verdict_s - c.truth_s:+.2f}") for c in rows))
    hopf: Segment = timeline(analysis.segments)[2]
    true_frequency = truth["chatter_frequency_hz"]
    console.print(f"chatter frequency {hopf.chatter_frequency:.2f} Hz, truth {true_frequency:.2f} Hz "
                  f"({100 * (hopf.chatter_frequency / true_frequency - 1):+.2f} %)")
    console.print(f"sensor blocks: {result.sent} sent, {result.received} received, {result.judged} judged, "
                  f"{result.recorded} recorded")
    write_text(verdicts, json.dumps(plain(analysis_json(analysis)), indent=1))
    recording_report(report, analysis, read_predictions(recorded))
    console.print(f"took {time.monotonic() - began:.1f} s; look at:")
    for path in outputs:
        console.print(f"  {path} ({path.stat().st_size / 1e6:.1f} MB)", soft_wrap=True)
    late = [c.what for c in rows if not c.ok]
    if late:
        raise InputError(f"verdict more than {TOLERANCE_S} s from the truth: {', '.join(late)}")


def main(
    bag: Annotated[Path, typer.Option(help="Recording to replay.")] = Path("bags/demo_turn_milling.mcap"),
    folder: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for the results; old ones are replaced.")
    ] = Path("out"),
) -> None:
    """Replay the demo recording through ROS 2 nodes.

    Example: python -m turnmill_ros.demo -o out
    """
    run(bag, folder)


if __name__ == "__main__":
    from turnmill_ros.cli.app import guarded

    application = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    application.command()(main)
    raise SystemExit(guarded(lambda: application(standalone_mode=False)))
