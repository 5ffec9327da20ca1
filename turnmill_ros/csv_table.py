"""Tables of samples as text: header, units, time column, gaps."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pint
from numpy.typing import NDArray

from turnmill_ros.bag_check import UNITS
from turnmill_ros.errors import InputError

START_NS = 1_000_000_000
_JITTER = 0.1
_HEADER_UNIT = re.compile(r"^(?P<name>.*?)\s*[(\[](?P<unit>[^()\[\]]+)[)\]]\s*$")
_QUANTITY = {unit: quantity for quantity, unit in UNITS.items()}
_PINT = {"Pa": "Pa", "m": "m", "m/s2": "m/s**2", "N": "N", "N m": "N*m", "W": "W", "V": "V"}


@dataclass(frozen=True)
class Table:
    """Samples of a table.

    channels: name, quantity, SI unit; samples float32 (n, channels) in SI; index int64 (n,): sample number, which
    jumps at gaps; sample_rate [Hz]; start_ns: time of sample 0; time_name: the time column, None without one.
    """

    channels: tuple[tuple[str, str, str], ...]
    samples: NDArray[np.float32]
    index: NDArray[np.int64]
    sample_rate: float
    start_ns: int
    time_name: str | None
    notes: tuple[str, ...]


def read_table(
    file: Path, time_column: str | None, columns: Sequence[str] | None, sample_rate: float | None, unit: str | None,
    quantity: str | None,
) -> Table:
    """Read a table of samples; sample_rate [Hz] serves where there is no time column. See importers.import_csv."""
    header, rows = read_cells(file)
    names = [split_header(name)[0] for name in header]
    time = _time_column(file, header, names, time_column)
    if time is None and sample_rate is None:
        raise InputError("no time column", file=file, expected="a column called time, --time-column or --sample-rate",
                         value=names)
    chosen, notes = _chosen(file, header, names, time, columns)
    channels, scales = [], []
    for k in chosen:
        si, scale = _si_unit(file, header[k], unit)
        channels.append((names[k], _quantity(file, names[k], si, quantity), si))
        scales.append(scale)
    values = numbers(file, header, rows, [*chosen, *([] if time is None else [time])])
    samples = (values[:, : len(chosen)] * scales).astype(np.float32)
    if time is None:
        index, rate, start_ns = np.arange(len(values)), float(sample_rate or 0.0), START_NS
    else:
        seconds = values[:, -1] * _time_scale(file, header[time])
        index, rate, start = _uniform(file, header[time], seconds, notes)
        start_ns = round(start * 1e9)
        if start_ns <= 0:
            start_ns = START_NS
            notes.append("times begin at or before 0: the first sample is stamped 1970-01-01T00:00:01Z")
    if time is None:
        notes.append("no time column: the first sample is stamped 1970-01-01T00:00:01Z")
    return Table(tuple(channels), samples, index, rate, start_ns, None if time is None else names[time], tuple(notes))


def read_cells(file: Path) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table separated by comma, semicolon (then with decimal commas) or tabulator."""
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            first = stream.readline()
            if not first.strip():
                raise InputError("the table is empty", file=file)
            delimiter = max(",;\t", key=first.count)
            header = [cell.strip() for cell in next(csv.reader([first], delimiter=delimiter))]
            rows = [row for row in csv.reader(stream, delimiter=delimiter) if any(cell.strip() for cell in row)]
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror}", file=file) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError("not a table of text", file=file) from error
    if any(_is_number(cell) for cell in header):
        raise InputError("no header line", file=file, value=first.strip()[:60], expected="names of the columns")
    if len(set(header)) != len(header):
        raise InputError("two columns have the same name", file=file, value=header)
    if len(rows) < 2:
        raise InputError("too few samples", file=file, value=len(rows), expected="at least 2 rows")
    if delimiter == ";":
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
    return header, rows


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def split_header(header: str) -> tuple[str, str | None]:
    """Name and unit of "name (unit)" or "name [unit]"."""
    match = _HEADER_UNIT.match(header)
    return (match["name"].strip(), match["unit"].strip()) if match else (header, None)


def _time_column(file: Path, header: list[str], names: list[str], wanted: str | None) -> int | None:
    if wanted is not None:
        return _find(file, header, names, wanted, "time column")
    for k, name in enumerate(names):
        if name.lower() in ("time", "t", "timestamp", "zeit"):
            return k
    return None


def _find(file: Path, header: list[str], names: list[str], wanted: str, key: str) -> int:
    for candidates in (header, names):
        if wanted in candidates:
            return candidates.index(wanted)
    raise InputError("no such column", file=file, key=key, value=wanted, expected=", ".join(names))


def _chosen(
    file: Path, header: list[str], names: list[str], time: int | None, columns: Sequence[str] | None,
) -> tuple[list[int], list[str]]:
    others = [k for k in range(len(header)) if k != time]
    if columns:
        return [_find(file, header, names, name.strip(), "column") for name in columns], []
    with_unit = [k for k in others if split_header(header[k])[1] is not None]
    chosen = with_unit or others
    left = [names[k] for k in others if k not in chosen]
    if not chosen:
        raise InputError("no column to import", file=file, value=names)
    return chosen, [f"columns without a unit were left out: {', '.join(left)}"] if left else []


def _si_unit(file: Path, header: str, declared: str | None) -> tuple[str, float]:
    """SI unit of a column, and the factor that brings its numbers there."""
    written = split_header(header)[1]
    if declared is not None or written is None:
        return declared or "1", 1.0
    text = "standard_gravity" if written == "g" else re.sub(r"(?<=[a-z])2", "**2", written.replace("²", "**2"))
    try:
        found = pint.application_registry.get().parse_units(text)
        for si, name in _PINT.items():
            if found.is_compatible_with(name):
                return si, float(pint.application_registry.get().Quantity(1.0, found).to(name).magnitude)
    except (pint.errors.PintError, ValueError, TypeError, AttributeError) as error:
        raise InputError("unknown unit", file=file, key=header, value=written, expected=", ".join(_PINT)) from error
    raise InputError("no unit of a sensor", file=file, key=header, value=written, expected=", ".join(_PINT))


def _quantity(file: Path, name: str, unit: str, declared: str | None) -> str:
    if declared is not None:
        return declared
    if unit not in _QUANTITY:
        raise InputError("what was measured is unknown", file=file, key=name,
                         expected="--quantity and --unit, for example acceleration and m/s2")
    return _QUANTITY[unit]


def _time_scale(file: Path, header: str) -> float:
    scales = {None: 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
    unit = split_header(header)[1]
    if unit not in scales:
        raise InputError("unknown unit of time", file=file, key=header, value=unit, expected="s, ms, us or ns")
    return scales[unit]


def numbers(file: Path, header: list[str], rows: list[list[str]], columns: list[int]) -> NDArray[np.float64]:
    """Numbers of some columns, (rows, columns); NaN where a cell is empty."""
    values = np.empty((len(rows), len(columns)))
    for i, row in enumerate(rows):
        for j, k in enumerate(columns):
            cell = row[k].strip() if k < len(row) else ""
            try:
                values[i, j] = float(cell) if cell else np.nan
            except ValueError as error:
                where = f"row {i + 2}, column {header[k]}"
                raise InputError("not a number", file=file, key=where, value=cell) from error
    return values


def _uniform(
    file: Path, header: str, seconds: NDArray[np.float64], notes: list[str],
) -> tuple[NDArray[np.int64], float, float]:
    """Sample numbers, rate [Hz] and time of sample 0 [s] of a time column; gaps become jumps of the number."""
    if not np.isfinite(seconds).all():
        row = int(np.argmin(np.isfinite(seconds))) + 2
        raise InputError("a time is missing", file=file, key=f"row {row}, column {header}")
    intervals = np.diff(seconds)
    if (intervals <= 0).any():
        row = int(np.argmax(intervals <= 0)) + 3
        raise InputError("times do not ascend", file=file, key=f"row {row}, column {header}",
                         value=float(seconds[row - 2]), expected=f"more than {seconds[row - 3]:.9g} s")
    steps = np.maximum(1, np.round(intervals / np.median(intervals))).astype(np.int64)
    index = np.concatenate([[0], np.cumsum(steps)])
    slope, start = np.polyfit(index - index.mean(), seconds, 1)
    start -= slope * index.mean()
    deviation = np.abs(seconds - (start + slope * index)) / slope
    if np.quantile(deviation, 0.99) > _JITTER and np.quantile(np.abs(intervals / slope - steps), 0.99) > _JITTER:
        raise InputError("samples are not uniform in time", file=file, key=header,
                         value=f"{100 * float(np.quantile(deviation, 0.99)):.0f} % of a sample period off",
                         expected=f"at most {100 * _JITTER:.0f} %, apart from gaps")
    if deviation.max() > 0.01:
        notes.append(f"times lie up to {100 * deviation.max():.0f} % of a sample period off an even grid")
    gaps = int((steps > 1).sum())
    if gaps:
        notes.append(f"{gaps} gaps with {int((steps - 1).sum())} missing samples")
    return index, float(f"{1 / slope:.12g}"), float(start)
