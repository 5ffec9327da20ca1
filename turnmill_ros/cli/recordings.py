"""Commands on recordings, without ROS: simulate, import, analyze, recover."""

from __future__ import annotations

import math
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
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_ros.analysis import Analysis

OutputOption = Annotated[
    Path, typer.Option("--output", "-o", metavar="BAG", help="MCAP file to write; must not exist.")
]
BagArgument = Annotated[Path, typer.Argument(metavar="BAG", help="Recording (MCAP).")]


def simulate(
    op_name: OperationArgument, output: OutputOption,
    duration: Annotated[str | None, typer.Option(help="How long, e.g. 10s; default: the operation's schedule.")] = None,
    sample_rate: Annotated[str, typer.Option(help="Sample rate of the sensors, e.g. 12.8kHz.")] = "12.8 kHz",
    channels: Annotated[int | None, typer.Option(
        help="In SI units: 1 sound, 2 to 5 displacement of tool x, y, workpiece x, y too; default: the operation's "
             "sensors in volts, 2 where it has none.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 0,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Simulate the operation's schedule in time and write a recording with its truth beside it.

    Example: turnmill simulate demo_turn_milling -o cut.mcap
    """
    from turnmill_ros.operations import find_operation
    from turnmill_ros.simulate import simulate_to_bag

    op = find_operation(op_name, changes or ())
    new_file(output)
    with progress(f"simulating {op.name}", quiet=as_json) as advance:
        done = simulate_to_bag(
            op,
            output,
            duration=quantity(duration, "s", "--duration"),
            sample_rate=quantity(sample_rate, "Hz", "--sample-rate"),
            channels=None if channels is None else whole(channels, "--channels", 1, 5),
            seed=whole(seed, "--seed", 0),
            progress=advance,
        )
    report = {
        "bag": str(done.path),
        "truth": str(done.truth_path),
        "blocks": done.blocks,
        "axis_states": done.axis_states,
        "duration_s": done.duration,
        "size_bytes": done.path.stat().st_size,
    }
    if as_json:
        print_json(report)
    else:
        table("Simulated recording", ("what", "value"), ((k, f"{v:g}" if isinstance(v, float) else str(v))
                                                         for k, v in report.items()))


def import_recording(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Sound (.wav, .flac) or table (.csv) of samples.")],
    op_name: Annotated[str, typer.Option("--operation", metavar="OP", help="Operation file or shipped name.")],
    output: OutputOption,
    sample_rate: Annotated[str | None, typer.Option(help="Declared sample rate, checked against the file.")] = None,
    measured: Annotated[str | None, typer.Option("--quantity", help="What was measured, e.g. sound_pressure.")] = None,
    unit: Annotated[str | None, typer.Option(help="SI unit of the samples, '1' where the scale is unknown.")] = None,
    time_column: Annotated[str | None, typer.Option(help="CSV: name of the time column (seconds).")] = None,
    columns: Annotated[
        str | None, typer.Option(help="CSV: columns to import, comma separated; default: all others.")
    ] = None,
    changes: SetOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Make a recording (MCAP) from a sound or table file and an operation.

    Example: turnmill import cut.wav --operation face_mill_6_teeth --set cut.tool_speed='1656 rpm' -o cut.mcap
    """
    from turnmill_ros.importers import import_csv, import_sound
    from turnmill_ros.operations import find_operation

    op = find_operation(op_name, changes or ())
    new_file(output)
    if not file.is_file():
        raise InputError("no such file", file=file)
    rate = quantity(sample_rate, "Hz", "--sample-rate")
    with progress(f"importing {file.name}", quiet=as_json) as advance:
        if file.suffix.lower() == ".csv":
            done = import_csv(file, op, output, sample_rate=rate, quantity=measured, unit=unit, time_column=time_column,
                              columns=columns.split(",") if columns else None, progress=advance)
        else:
            done = import_sound(file, op, output, sample_rate=rate, quantity=measured, unit=unit, progress=advance)
    report = {"bag": str(output), "channels": list(done.channels), "sample_rate_hz": done.sample_rate,
              "samples": done.samples, "duration_s": done.samples / done.sample_rate, "notes": list(done.notes)}
    if as_json:
        print_json(report)
    else:
        table("Imported recording", ("what", "value"), ((k, str(v)) for k, v in report.items()))


def analyze_bags(
    bags: Annotated[list[Path], typer.Argument(metavar="BAG...", help="Recordings (MCAP).")],
    op_name: Annotated[
        str | None, typer.Option("--operation", metavar="OP", help="Instead of the one recorded.")
    ] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write a report (one bag).")] = None,
    changes: SetOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Verdicts on recordings, without ROS. With --json one object per bag, each on one line.

    Example: turnmill analyze cut.mcap --report cut.html
    """
    from turnmill_ros.analysis import analysis_json, analyze
    from turnmill_ros.operations import find_operation

    if report is not None and len(bags) != 1:
        raise InputError("--report takes one BAG", value=len(bags), expected="1")
    if report is not None:
        new_file(report)
    if changes and op_name is None:
        raise InputError("--set needs --operation: it changes an operation, not the recording")
    operation = find_operation(op_name, changes or ()) if op_name else None
    for bag in bags:
        with progress(f"analyzing {bag.name}", quiet=as_json) as advance:
            analysis = analyze(bag, operation, advance)
        if as_json:
            print_json(analysis_json(analysis), indent=None)
        else:
            show_analysis(analysis)
        if report is not None:
            from turnmill_ros.predictions import read_predictions
            from turnmill_ros.report import recording_report

            recording_report(report, analysis, read_predictions(bag))
            if not as_json:
                console.print(f"report: {report}", soft_wrap=True)


def show_analysis(analysis: Analysis) -> None:
    """Print timeline and summary of one analysed recording."""
    from turnmill_ros.analysis import summary, timeline
    from turnmill_ros.bag_check import describe

    for finding in analysis.findings:
        console.print(describe(finding), soft_wrap=True, markup=False)
    if not analysis.verdicts:
        console.print(f"{analysis.path}: shorter than one window, no verdict", soft_wrap=True, markup=False)
        return
    rows = []
    for s in timeline(analysis.segments):
        frequency = f"{s.chatter_frequency:.1f}" if math.isfinite(s.chatter_frequency) else ""
        rows.append(
            (
                s.state.name,
                f"{analysis.seconds(s.start_ns):.2f}",
                f"{analysis.seconds(s.end_ns):.2f}",
                frequency,
                f"{s.confidence:.2f}",
            )
        )
    table(
        f"{analysis.path}: {analysis.operation.name}",
        ("state", "from [s]", "to [s]", "chatter [Hz]", "confidence"),
        rows,
    )
    values = summary(analysis)
    shares = ", ".join(f"{name} {length:.1f} s" for name, length in values["durations_s"].items() if length > 0)
    console.print(f"{values['verdict_count']} verdicts over {values['duration_s']:.1f} s: {shares}", soft_wrap=True)


def recover(
    bag: BagArgument,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="BAG", help="Default: NAME.recovered.mcap.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Save all that can be read from a truncated recording into a new file; the old one is kept.

    Example: turnmill recover cut.mcap.part -o cut.mcap
    """
    from turnmill_ros.bag import recover as recover_bag

    if output is None:
        output = bag.with_name(bag.name.removesuffix(".part").removesuffix(".mcap") + ".recovered.mcap")
    new_file(output)
    done = recover_bag(bag, output)
    report = {"bag": str(output), "messages": done.messages, "duration_s": done.duration, "complete": done.complete,
              "lost": done.lost}
    if as_json:
        print_json(report)
    else:
        table("Recovered recording", ("what", "value"), ((k, str(v)) for k, v in report.items()))
