"""Commands that run the ROS 2 graph: doctor, replay, live."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    console,
    new_file,
    print_json,
    progress,
    quantity,
    table,
    whole,
)
from turnmill_ros.cli.recordings import BagArgument, show_analysis
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.monitoring.verdict import ChatterKind, Verdict
    from turnmill_ros.analysis import Analysis
    from turnmill_ros.graph import GraphResult


def doctor(as_json: JsonFlag = False) -> None:
    """Check ROS, middleware, messages, domain and disk; exit code 1 where something is missing.

    Example: turnmill doctor
    """
    from turnmill_ros.doctor import checks

    found = checks()
    if as_json:
        print_json([{"check": c.name, "ok": c.ok, "found": c.found, "hint": c.hint} for c in found])
    else:
        table("turnmill doctor", ("check", "ok", "found"),
              ((c.name, "yes" if c.ok else "NO", c.found + (f" - {c.hint}" if c.hint else "")) for c in found))
    if not all(c.ok for c in found):
        raise typer.Exit(1)


def _need_ros() -> None:
    import importlib.util

    for module, what in (("rclpy", "ROS 2 (rclpy)"), ("turnmill_msgs", "the turnmill_msgs messages")):
        if importlib.util.find_spec(module) is None:
            raise InputError(f"{what} is not installed: this command runs ROS 2 nodes; "
                             "pip install 'turnmill[ros]' and ./msg_schemas/turnmill_msgs (turnmill doctor tells more)")


def _rate(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not rate > 0 or math.isinf(rate):
        raise InputError("--rate", value=text, expected="a number > 0, or max")
    return rate


def replay(
    bag: BagArgument,
    op_name: Annotated[
        str | None, typer.Option("--operation", metavar="OP", help="Instead of the one recorded.")
    ] = None,
    rate: Annotated[
        str, typer.Option(metavar="R|max", help="1 is real time; max is as fast as nothing is lost.")
    ] = "1",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="BAG", help="Record inputs and outputs.")
    ] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write a report.")] = None,
    separate: Annotated[bool, typer.Option("--separate-processes", help="Each node in its own process.")] = False,
    changes: SetOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Play a recording through the ROS 2 nodes: verdicts, forces and margins beside the sensor data.

    Example: turnmill replay bags/demo_turn_milling.mcap --rate max -o out.mcap --report out.html
    """
    import tempfile

    _need_ros()
    from turnmill_ros.analysis import analysis_of, trusted
    from turnmill_ros.operations import find_operation
    from turnmill_ros.replay import replay as run_replay

    speed = _rate(rate)
    operation = find_operation(op_name, changes or ()) if op_name else None
    if changes and op_name is None:
        raise InputError("--set needs --operation: it changes an operation, not the recording")
    for path in (output, report):
        if path is not None:
            new_file(path)
    trusted(bag)
    with tempfile.TemporaryDirectory(prefix="turnmill-") as folder:
        out = output or Path(folder) / "replay.mcap"
        with progress(f"replaying {bag.name}", quiet=as_json) as advance:
            result = run_replay(bag, operation, speed, out, separate_processes=separate, progress=advance)
        analysis = analysis_of(out, result.verdicts)
        if report is not None:
            from turnmill_ros.predictions import read_predictions
            from turnmill_ros.report import recording_report

            recording_report(report, analysis, read_predictions(out))
        _show_run(result, analysis, output, report, as_json)


def live(
    op_name: OperationArgument,
    duration: Annotated[str | None, typer.Option(help="How long, e.g. 30s; default: until Ctrl-C.")] = None,
    separate: Annotated[bool, typer.Option("--separate-processes", help="Each node in its own process.")] = False,
    output: Annotated[Path | None, typer.Option("--output", "-o", metavar="BAG", help="Record everything.")] = None,
    sample_rate: Annotated[str, typer.Option(help="Sample rate of the sensors.")] = "51.2 kHz",
    channels: Annotated[int | None, typer.Option(
        help="Number of channels in SI units; default: the operation's sensors in volts, 5 where it has none.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 0,
    dashboard: Annotated[int | None, typer.Option(
        metavar="PORT", help="Show it meanwhile at http://127.0.0.1:PORT/.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Run the twin next to a simulated controller; record and judge as it happens. Ctrl-C ends it cleanly.

    Example: turnmill live demo_turn_milling --duration 20s -o twin.mcap --dashboard 8080
    """
    import tempfile

    _need_ros()
    from turnmill_ros.analysis import analysis_of
    from turnmill_ros.dashboard import running
    from turnmill_ros.operations import find_operation
    from turnmill_ros.replay import run_live

    operation = find_operation(op_name, changes or ())
    if output is not None:
        new_file(output)
    port = None if dashboard is None else whole(dashboard, "--dashboard", 1, 65535)
    with tempfile.TemporaryDirectory(prefix="turnmill-") as folder, running(port):
        out = output or Path(folder) / "live.mcap"
        result = run_live(
            operation,
            duration=quantity(duration, "s", "--duration"),
            output=out,
            separate_processes=separate,
            sample_rate=quantity(sample_rate, "Hz", "--sample-rate"),
            channels=None if channels is None else whole(channels, "--channels", 1, 5),
            seed=whole(seed, "--seed", 0),
            on_verdict=None if as_json else _tell_changes(),
        )
        _show_run(result, analysis_of(out, result.verdicts), output, None, as_json)


def _tell_changes() -> Callable[[Verdict], None]:
    """A function that prints a line whenever the state of the cut changes."""
    last: list[ChatterKind] = []

    def tell(verdict: Verdict) -> None:
        if last and last[0] is verdict.state:
            return
        last[:] = [verdict.state]
        heard = f" at {verdict.chatter_frequency:.1f} Hz" if math.isfinite(verdict.chatter_frequency) else ""
        when = f"{datetime.fromtimestamp(verdict.window_end_ns * 1e-9):%H:%M:%S.%f}"[:-3]
        console.print(f"{when} {verdict.state.name}{heard}: {verdict.reason_text}", soft_wrap=True)

    return tell


def _show_run(result: GraphResult, analysis: Analysis, output: Path | None, report: Path | None, as_json: bool) -> None:
    counts = {"sent": result.sent, "received": result.received, "judged": result.judged, "recorded": result.recorded}
    if as_json:
        from turnmill_ros.analysis import analysis_json

        print_json({**analysis_json(analysis), "blocks": counts, "output": output and str(output)}, indent=None)
        return
    show_analysis(analysis)
    console.print("sensor blocks: " + ", ".join(f"{v} {k}" for k, v in counts.items()))
    for name, path in (("recorded", output), ("report", report)):
        if path is not None:
            console.print(f"{name}: {path}", soft_wrap=True)
