"""The command identify: cutting force coefficients from a table of average forces."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    console,
    new_file,
    print_json,
    quantity,
    table,
)

if TYPE_CHECKING:
    from turnmill_core.cutting.identification import AverageForces, Identification

UNITS = {"c": ("MPa", 1e-6), "e": ("N/mm", 1e-3)}
"""Unit and scale of a coefficient by the last letter of its name."""


def identify(
    file: Annotated[Path, typer.Argument(
        metavar="TABLE", help="Table of tests, one a row: feed, depth, engagement, mean Fx, Fy, Fz; units in the "
        "header, as in Fx [N].")],
    op_name: OperationArgument,
    changes: SetOption = None,
    sense: Annotated[Literal["up", "down", "slot", "centred"] | None, typer.Option(
        help="Side of the radial immersion [default: that of the operation].")] = None,
    depth: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Axial depth of all tests, where there is no such column.")] = None,
    radial_immersion: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Radial immersion of all tests, where there is no such column.")] = None,
    measured_on: Annotated[Literal["tool", "workpiece"], typer.Option(
        help="What the forces act on; a dynamometer below the workpiece measures those on the workpiece.")] = "tool",
    confidence: Annotated[float, typer.Option(help="Probability of the intervals.")] = 0.95,
    name: Annotated[str, typer.Option(help="Name of the material, for --write.")] = "identified",
    write: Annotated[Path | None, typer.Option(
        "--write", metavar="YAML", help="Write OP with the identified coefficients.")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Cutting force coefficients with confidence intervals from average forces of milling tests.

    The tool of OP is the one of the tests; forces are in its frame (x along the feed, y across, z along the tool).

    Example: turnmill identify slots.csv thesis_table_3_1 --sense slot --depth 1mm --write identified.yaml
    """
    from turnmill_core.cutting.identification import NAMES
    from turnmill_core.cutting.identification import identify as fit
    from turnmill_ros.force_table import read_force_table
    from turnmill_ros.operations import find_operation, with_material

    output, html = (None if p is None else new_file(p) for p in (write, report))
    op = find_operation(op_name, changes or ())
    tests = read_force_table(file, op.tool, sense or op.milling_sense, quantity(depth, "m", "--depth"),
                             quantity(radial_immersion, "m", "--radial-immersion"), measured_on == "workpiece")
    found = fit(op.tool, tests, confidence)
    if output is not None:
        from turnmill_ros.report import write_text

        written = with_material(op, {"name": name} | {
            key: f"{found.value[k] * UNITS[key[-1]][1]:.9g} {UNITS[key[-1]][0]}" for k, key in enumerate(NAMES)},
            f"Coefficients identified from {len(tests.force)} tests of average forces in {file.name}.")
        write_text(output, written.text)
    if html is not None:
        from turnmill_ros.identify_report import identify_report

        identify_report(html, file.name, op, tests, found, _rows(found), confidence)
    if as_json:
        print_json(_document(tests, found, confidence))
        return
    table(f"{file.name}: {len(tests.force)} tests with {op.tool.name}",
          ("coefficient", "value", f"{confidence * 100:g} % interval", "unit"), _rows(found))
    table("Scatter of the residuals (standard deviation)", ("force", "value"), (
        ("Fx and Fy", f"{found.scatter[0]:.3g} N"), ("Fz", f"{found.scatter[1]:.3g} N")))
    if output is not None:
        console.print(f"written: {output}")


def _rows(found: Identification) -> list[tuple[str, str, str, str]]:
    from turnmill_core.cutting.identification import NAMES

    rows = []
    for k, key in enumerate(NAMES):
        unit, scale = UNITS[key[-1]]
        low, value, high = (x * scale for x in (found.lower[k], found.value[k], found.upper[k]))
        rows.append((key, f"{value:.4g}", f"{low:.4g} to {high:.4g}", unit))
    return rows


def _document(tests: AverageForces, found: Identification, confidence: float) -> dict[str, object]:
    from turnmill_core.cutting.identification import NAMES

    suffix = {"c": "pa", "e": "n_m"}
    return {
        "confidence": confidence, "tests": len(tests.force),
        "coefficients": {f"{key}_{suffix[key[-1]]}": {
            "value": found.value[k], "lower": found.lower[k], "upper": found.upper[k]} for k, key in enumerate(NAMES)},
        "scatter_fx_fy_n": found.scatter[0], "scatter_fz_n": found.scatter[1],
        "feed_per_tooth_m": tests.feed_per_tooth, "depth_m": tests.depth, "start_rad": tests.start,
        "exit_rad": tests.exit, "force_n": tests.force, "residual_n": found.residual,
    }
