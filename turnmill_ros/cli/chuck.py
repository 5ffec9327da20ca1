"""The command chuck: the receptance of a chuck from a dummy workpiece, as a mode and a joint."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    console,
    new_file,
    print_json,
    quantity,
    span,
    table,
)
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.operation_structure import Chuck


def chuck(
    file: Annotated[Path, typer.Argument(
        metavar="FRF", help="Table: frequency [Hz], 11 real [m/N], 11 imag [m/N], 12 ..., 22 ... of the dummy.")],
    op_name: OperationArgument,
    changes: SetOption = None,
    points: Annotated[str, typer.Option(
        metavar="A,B", help="Points 1 and 2, from the free end of the dummy, e.g. 0mm,60mm.")] = "0mm,60mm",
    plane: Annotated[Literal["x", "y"], typer.Option(help="Plane of the machine that was measured.")] = "x",
    band: Annotated[str | None, typer.Option(
        metavar="FROM..TO", help="Frequencies that are used, e.g. 100Hz..2000Hz [default: all].")] = None,
    write: Annotated[Path | None, typer.Option("--write", metavar="YAML", help="Write OP with this chuck.")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Chuck from three receptances of a dummy workpiece: exact, with the rotation that cannot be measured.

    The workpiece of OP is the dummy (diameter, length, beam section with its material). The identified 2 x 2 receptance
    is shown beside one mode of the chuck's face and a joint, fitted to what was measured.

    Example: turnmill chuck dummy.csv thesis_table_4_7 --points 0mm,60mm --plane x --write mine.yaml
    """
    from turnmill_ros.chuck_fit import identify_chuck
    from turnmill_ros.frf_file import read_frfs
    from turnmill_ros.operations import find_operation, with_chuck

    output, html = (None if p is None else new_file(p) for p in (write, report))
    op = find_operation(op_name, changes or ())
    if op.workpiece.beam is None:
        raise InputError("workpiece.beam is missing: the dummy's material is not known",
                         hint="see docs/operation.md; shipped: thesis_table_4_7")
    places = [quantity(part, "m", "--points") for part in points.split(",")]
    if len(places) != 2 or places[0] is None or places[1] is None:
        raise InputError("--points", value=points, expected="two distances, such as 0mm,60mm")
    found = identify_chuck(op, read_frfs(file), (places[0], places[1]),
                           None if band is None else span(band, "Hz", "--band"))
    section = _section(found.chuck)
    if output is not None:
        from turnmill_ros.report import write_text

        write_text(output, with_chuck(op, plane, section, f"Chuck in {plane} identified from {file.name}.").text)
    if html is not None:
        from turnmill_ros.chuck_report import chuck_report

        chuck_report(html, file.name, op, found, _rows(found.chuck))
    if as_json:
        print_json({
            "plane": plane, "deviation": found.error, "chuck": section, "frequencies_hz": found.frequency,
            "receptance": [{"name": name, "real": H.real, "imag": H.imag} for name, H in found.parts()],
        }, indent=None)
        return
    table(f"{file.name}: chuck in {plane}", ("quantity", "value"), [*_rows(found.chuck),
          ("deviation of the fit", f"{found.error:.2%}")])
    if output is not None:
        console.print(f"written: {output}")


def _rows(chuck: Chuck) -> list[tuple[str, str]]:
    mode = chuck.modes[0]
    pivot = "no rotation" if math.isinf(mode.pivot) else f"{mode.pivot * 1e3:.4g} mm"
    return [
        ("natural frequency", f"{mode.frequency:.2f} Hz"), ("damping", f"{mode.damping:.3%}"),
        ("mass", f"{mode.mass:.4g} kg"),
        ("stiffness", f"{mode.mass * (2 * math.pi * mode.frequency) ** 2 / 1e6:.4g} N/um"),
        ("rocks about a point behind the face", pivot),
        ("joint against displacement", "rigid" if math.isinf(chuck.stiffness) else f"{chuck.stiffness / 1e6:.4g} N/um"),
        ("joint against rotation",
         "rigid" if math.isinf(chuck.rotational_stiffness) else f"{chuck.rotational_stiffness:.4g} N m/rad"),
    ]


def _section(chuck: Chuck) -> dict[str, Any]:
    """The chuck section of an operation file."""
    mode = chuck.modes[0]
    joint = {}
    if not math.isinf(chuck.stiffness):
        joint |= {"stiffness": f"{chuck.stiffness / 1e6:.6g} N/um", "damping": f"{chuck.damping:.6g} N*s/m"}
    if not math.isinf(chuck.rotational_stiffness):
        joint |= {"rotational_stiffness": f"{chuck.rotational_stiffness:.6g} N*m/rad",
                  "rotational_damping": f"{chuck.rotational_damping:.6g} N*m*s/rad"}
    return {
        "modes": [{"frequency": f"{mode.frequency:.6g} Hz", "damping": f"{mode.damping * 100:.6g} %",
                   "mass": f"{mode.mass:.6g} kg"}
                  | ({} if math.isinf(mode.pivot) else {"pivot": f"{mode.pivot * 1e3:.6g} mm"})],
    } | joint
