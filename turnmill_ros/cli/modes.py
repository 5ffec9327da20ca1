"""The command modes: vibration modes of tool or workpiece from measured frequency responses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
import yaml

from turnmill_ros.cli.output import JsonFlag, console, new_file, print_json, quantity, span, table, whole
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.operation import Operation
    from turnmill_ros.modal_fit import ReceptanceFit

COMPLEX = math.radians(15)
"""Phase [rad] of a residue from which the table calls a mode complex."""


def modes(
    file: Annotated[Path, typer.Argument(
        metavar="FRF", help="Universal file (.uff), or a table: frequency [Hz], xx real [m/N], xx imag [m/N], ...")],
    operation: Annotated[str | None, typer.Option(metavar="OP", help="Operation that the modes go into.")] = None,
    to: Annotated[Literal["tool", "workpiece"], typer.Option(help="What was measured.")] = "tool",
    frame: Annotated[Literal["tool", "machine"], typer.Option(help="Frame of the directions x, y, z.")] = "tool",
    band: Annotated[str | None, typer.Option(
        metavar="FROM..TO", help="Frequencies that are fitted, e.g. 200Hz..1500Hz [default: all].")] = None,
    near: Annotated[str | None, typer.Option(
        metavar="LIST", help="About where the modes are, e.g. 682Hz,800Hz [default: found].")] = None,
    node: Annotated[int | None, typer.Option(help="Cutting point in a universal file.")] = None,
    cross: Annotated[Literal["none", "symmetric", "rank-one"], typer.Option(
        help="How modes of cross receptances are read.")] = "symmetric",
    complex_residues: Annotated[bool, typer.Option("--complex", help="Keep the phases of complex residues.")] = False,
    order: Annotated[int, typer.Option(help="Largest order of the polynomial.")] = 40,
    write: Annotated[Path | None, typer.Option("--write", metavar="YAML", help="Write OP with these modes.")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write the fit as pictures.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Modes from frequency response functions measured at the cutting point; each receptance is fitted by itself.

    Example: turnmill modes tool_tip.uff --operation thesis_table_4_9 --band 300Hz..1500Hz --write mine.yaml
    """
    from turnmill_ros.frf_file import read_frfs
    from turnmill_ros.modal_fit import fit_modes
    from turnmill_ros.operations import find_operation

    output, html = (None if p is None else new_file(p) for p in (write, report))
    if output is not None and operation is None:
        raise InputError("--write: give the operation that the modes go into with --operation")
    base = None if operation is None else find_operation(operation)
    frfs = read_frfs(file, node)
    limits = None if band is None else span(band, "Hz", "--band")
    fits = fit_modes(frfs, limits, _list(near), whole(order, "--order", 4, 200))
    section = _section(fits, frame, cross, complex_residues)
    written = None if base is None else _placed(base, to, section, file.name)
    if html is not None:
        from turnmill_ros.modes_report import modes_report

        modes_report(html, file.name, fits, _rows(fits), frfs.notes)
    if output is not None and written is not None:
        from turnmill_ros.report import write_text

        write_text(output, written.text)
    if as_json:
        print_json(_document(fits, frfs.notes, section))
        return
    table(f"{file.name}: modes", ("receptance", "frequency", "damping", "mass", "stiffness", "phase"), _rows(fits))
    table("Fit", ("receptance", "band", "deviation"), (
        (f.pair, f"{f.frequency[0]:.0f} to {f.frequency[-1]:.0f} Hz", f"{f.error:.2%}") for f in fits))
    for note in frfs.notes:
        console.print(note)
    if output is not None:
        console.print(f"written: {output}")
    elif base is None:
        console.print(yaml.safe_dump({"structure": section}, sort_keys=False, width=100).rstrip(), markup=False)


def _list(text: str | None) -> list[float]:
    return [] if text is None else [quantity(part, "Hz", "--near") or 0.0 for part in text.split(",")]


def _rows(fits: tuple[ReceptanceFit, ...]) -> list[tuple[str, ...]]:
    return [(fit.pair, f"{m.frequency:.2f} Hz", f"{m.damping * 100:.3f} %", f"{m.mass:.4g} kg",
             f"{m.mass * (2 * math.pi * m.frequency) ** 2 / 1e6:.4g} N/um",
             f"{math.degrees(_from_real(m.phase, m.mass)):.1f} deg" + (
                 " (complex)" if abs(_from_real(m.phase, m.mass)) > COMPLEX else ""))
            for fit in fits for m in fit.modes]


def _from_real(phase: float, mass: float) -> float:
    """Phase [rad] from the real mode of the same sign."""
    return math.remainder(phase - (math.pi if mass < 0 else 0.0), 2 * math.pi)


def _section(fits: tuple[ReceptanceFit, ...], frame: str, cross: str, complex_residues: bool) -> dict[str, Any]:
    """The structure section of an operation file."""
    listed: list[dict[str, Any]] = []
    for fit in fits:
        for m in fit.modes:
            direct = fit.pair[0] == fit.pair[1]
            listed.append({
                "direction": fit.pair[0] if direct else ("-" if m.mass < 0 else "") + fit.pair,
                "frequency": f"{m.frequency:.6g} Hz", "damping": f"{m.damping * 100:.6g} %",
                "mass": f"{abs(m.mass):.6g} kg",
            } | ({"phase": f"{math.degrees(m.phase):.4g} deg"} if complex_residues and direct else {}))
    section: dict[str, Any] = {"frame": frame}
    if any(len(mode["direction"]) > 1 for mode in listed):
        section["cross_modes"] = cross
    return section | {"modes": listed}


def _placed(op: Operation, to: str, section: dict[str, Any], source: str) -> Operation:
    """The operation with these modes, once its structure is found possible."""
    from turnmill_core.machine.conditions import machine_from_tool
    from turnmill_core.structure.at import structure_at
    from turnmill_ros.operations import with_structure

    found = with_structure(op, to, section, f"Modes of the {to} identified from {source}.")
    structure_at(found, machine_from_tool(found, found.conditions), found.conditions)
    return found


def _document(fits: tuple[ReceptanceFit, ...], notes: tuple[str, ...], section: dict[str, Any]) -> dict[str, Any]:
    return {
        "receptances": [{
            "pair": fit.pair, "from_hz": fit.frequency[0], "to_hz": fit.frequency[-1], "deviation": fit.error,
            "modes": [{"frequency_hz": m.frequency, "damping": m.damping, "mass_kg": m.mass,
                       "phase_rad": _from_real(m.phase, m.mass)} for m in fit.modes],
        } for fit in fits],
        "notes": list(notes), "structure": section,
    }
