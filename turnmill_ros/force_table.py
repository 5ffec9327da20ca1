"""Average forces of milling tests as a table of text, units in the header."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.identification import AverageForces
from turnmill_core.operation import Tool
from turnmill_core.operation_file import parse_quantity
from turnmill_ros.csv_table import numbers, read_cells, split_header
from turnmill_ros.errors import InputError

Column = NDArray[np.float64]
Sense = Literal["up", "down", "slot", "centred"]

NAMES = {
    "feed": ("feed", "f", "feed per tooth", "fz", "ft", "c"), "speed": ("speed", "tool speed", "spindle speed", "n"),
    "depth": ("depth", "axial depth", "ap", "a"), "start": ("start", "start angle", "entry"),
    "exit": ("exit", "exit angle"), "width": ("radial immersion", "width", "radial depth", "ae"),
    "Fx": ("fx", "mean fx", "fx mean"), "Fy": ("fy", "mean fy", "fy mean"), "Fz": ("fz", "mean fz", "fz mean"),
}
"""What a column may be called; the force called fz is told from the feed per tooth by its unit."""

UNITS = {"speed": "rad/s", "depth": "m", "start": "rad", "exit": "rad", "width": "m", "Fx": "N", "Fy": "N", "Fz": "N"}


def read_force_table(
    file: Path, tool: Tool, sense: Sense, depth: float | None, width: float | None, on_workpiece: bool = False
) -> AverageForces:
    """Tests of a table, one a row.

    Columns, each with its unit as in ``Fx [N]``: feed (per tooth as a length, per revolution, or per time with a
    column speed), Fx, Fy, Fz, means over whole tool revolutions; depth; and the engagement, start and exit or the
    radial immersion. What the engagement lacks follows from `sense`; a depth or radial immersion that is the same in
    all tests may be given here instead.

    Args:
        file: the table.
        tool: the end mill.
        sense: side on which the radial immersion lies.
        depth: axial depth [m] of all tests, where there is no such column.
        width: radial immersion [m] of all tests, where there is no such column.
        on_workpiece: the forces are those on the workpiece (a dynamometer below it), and change their signs.

    Raises InputError or ValueError, naming the column or the row.
    """
    header, rows = read_cells(file)
    found = _columns(file, header)
    for name in ("feed", "Fx", "Fy", "Fz"):
        if name not in found:
            raise InputError("no such column", file=file, key=name, value=header,
                             expected="feed, Fx, Fy and Fz with their units, as in Fx [N]")
    order = list(found)
    table = numbers(file, header, rows, [found[name] for name in order])
    if not np.isfinite(table).all():
        row, column = np.argwhere(~np.isfinite(table))[0].tolist()
        raise InputError("a number is missing", file=file, key=f"row {row + 2}, column {header[found[order[column]]]}")
    units = {name: str(split_header(header[found[name]])[1]) for name in order}
    values = {name: table[:, k] * (1.0 if name == "feed" else _scale(units[name], UNITS[name], header[found[name]]))
              for k, name in enumerate(order)}
    feed = _feed_per_tooth(file, values, units["feed"], tool)
    start, stop = _engagement(file, values, tool, sense, width)
    along = values.get("depth", np.full(len(feed), np.nan if depth is None else depth))
    if np.isnan(along).any():
        raise InputError("no depth of cut", file=file, expected="a column depth [mm], or --depth")
    force = np.stack([values["Fx"], values["Fy"], values["Fz"]], axis=1)
    return AverageForces(feed, along, start, stop, -force if on_workpiece else force)


def _scale(unit: str, wanted: str, name: str) -> float:
    return parse_quantity(f"1 {unit}", wanted, f"unit of column {name}")


def _columns(file: Path, header: list[str]) -> dict[str, int]:
    """Where each quantity stands."""
    found: dict[str, int] = {}
    for k, text in enumerate(header):
        name, unit = split_header(text)
        plain = " ".join(name.lower().replace("_", " ").split())
        matches = [key for key, names in NAMES.items() if plain in names]
        if len(matches) == 2:
            matches = ["Fz" if unit is not None and "N" in unit else "feed"]
        if not matches:
            continue
        if unit is None:
            raise InputError("a column has no unit", file=file, key=text, expected=f"as in {text} [mm], or {text} [N]")
        if matches[0] in found:
            raise InputError("two columns for one quantity", file=file, key=matches[0],
                             value=[header[found[matches[0]]], text])
        found[matches[0]] = k
    return found


def _feed_per_tooth(file: Path, values: dict[str, Column], unit: str, tool: Tool) -> Column:
    feed, unit = values["feed"], unit.removesuffix("/tooth")
    for wanted, per in (("m", 1.0), ("m/rev", 1.0 / tool.teeth), ("m/s", None)):
        try:
            scale = _scale(unit, wanted, "feed")
        except ValueError:
            continue
        if per is not None:
            return feed * scale * per
        if "speed" not in values:
            raise InputError("a feed per time needs the spindle speed", file=file, key="feed", value=unit,
                             expected="a column speed [rpm]")
        return feed * scale * 2 * np.pi / (tool.teeth * values["speed"])
    raise InputError("unknown unit of the feed", file=file, value=unit,
                     expected="mm (per tooth), mm/rev, or mm/min with a column speed [rpm]")


def _engagement(
    file: Path, values: dict[str, Column], tool: Tool, sense: Sense, width: float | None
) -> tuple[Column, Column]:
    """Start and exit angles [rad] from +y_T towards +x_T."""
    if "start" in values and "exit" in values:
        return values["start"], values["exit"]
    radius, rows = tool.radius, len(values["feed"])
    if sense == "slot":
        return np.zeros(rows), np.full(rows, np.pi)
    wide = values.get("width", np.full(rows, np.nan if width is None else width))
    if np.isnan(wide).any():
        raise InputError("no engagement", file=file,
                         expected="columns start [deg] and exit [deg], or radial immersion [mm], or --radial-immersion")
    if not ((wide > 0) & (wide <= 2 * radius)).all():
        raise InputError("radial immersion out of bounds", file=file, value=[float(w) for w in wide],
                         expected=f"above 0 and at most the tool diameter {2 * radius} m")
    if sense == "centred":
        half = np.arcsin(wide / (2 * radius))
        return np.pi / 2 - half, np.pi / 2 + half
    arc = np.arccos(1 - wide / radius)
    return (np.zeros(rows), arc) if sense == "up" else (np.pi - arc, np.full(rows, np.pi))
