"""Measured frequency response functions from universal files (UFF 58) and tables."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from turnmill_ros.csv_table import numbers, read_cells, split_header
from turnmill_ros.errors import InputError

UNITS = {"m/N": (0, 1.0), "mm/N": (0, 1e-3), "um/N": (0, 1e-6), "m/s/N": (1, 1.0), "mm/s/N": (1, 1e-3),
         "m/s2/N": (2, 1.0), "m/s^2/N": (2, 1.0), "g/N": (2, 9.80665)}
"""Unit of a response: how often it is differentiated, and its size in SI."""
_ORDINATE = {8: 0, 11: 1, 12: 2}
_COLUMN = re.compile(r"(?P<pair>[xyz]{2}|[12]{2})[ _](?P<part>real|re|imag|im|magnitude|mag|phase)", re.IGNORECASE)
_PARTS = {"re": "real", "im": "imag", "mag": "magnitude"}


@dataclass(frozen=True)
class FrfFile:
    """Receptances at one point.

    frequency (k,) [Hz], evenly spaced, > 0; pairs: direction of response and of force, "xx", "xy", ..., or their points
    "11", "12", "22"; receptance (n, k) [m/N]; notes: what was done on reading.
    """

    frequency: NDArray[np.float64]
    pairs: tuple[str, ...]
    receptance: NDArray[np.complex128]
    notes: tuple[str, ...]


def read_frfs(file: Path, node: int | None = None) -> FrfFile:
    """FRFs of a file: universal (.uff, .unv, .bunv) or a table with a header.

    node: point of a universal file [default: the only one that was both struck and measured]. Columns of a table:
    frequency [Hz], then two for each pair of directions, "xx real [m/N]" and "xx imag [m/N]" or "xx magnitude [m/N]"
    and "xx phase [deg]"; mobilities (m/s/N) and accelerances (m/s2/N, g/N) are integrated. Raises InputError.
    """
    if not file.is_file():
        raise InputError("no such file", file=file)
    found = _universal(file, node) if file.suffix.lower() in (".uff", ".unv", ".bunv") else _table(file)
    frequency, order, pairs, values, notes = found
    keep = frequency > 0
    f = frequency[keep]
    if f.size < 16:
        raise InputError("too few frequencies", file=file, value=int(f.size), expected="at least 16 above 0 Hz")
    if np.any(np.abs(np.diff(f) - (f[-1] - f[0]) / (f.size - 1)) > 1e-3 * (f[1] - f[0])):
        raise InputError("frequencies are not evenly spaced", file=file, expected="the lines of a spectrum")
    receptance = np.stack([v[keep] / (2j * np.pi * f) ** n for v, n in zip(values, order, strict=True)])
    if not np.all(np.isfinite(receptance)):
        raise InputError("a value is missing or not finite", file=file, expected="numbers in every line")
    return _reciprocal(FrfFile(f, pairs, receptance, tuple(notes)))


def _reciprocal(frfs: FrfFile) -> FrfFile:
    """Response and force exchanged is the same receptance: one of each pair, the mean where both were measured."""
    merged: dict[str, NDArray[np.complex128]] = {}
    notes = list(frfs.notes)
    for pair, H in zip(frfs.pairs, frfs.receptance, strict=True):
        name = "".join(sorted(pair))
        if name in merged:
            apart = np.linalg.norm(merged[name] - H) / np.linalg.norm(H)
            notes.append(f"{name} and its reverse differ by {apart:.1%}: mean taken")
            H = (merged[name] + H) / 2
        merged[name] = H
    return FrfFile(frfs.frequency, tuple(merged), np.stack(list(merged.values())), tuple(notes))


_Found = tuple[NDArray[np.float64], list[int], tuple[str, ...], list[NDArray[np.complex128]], list[str]]


def _table(file: Path) -> _Found:
    header, rows = read_cells(file)
    names = [split_header(name) for name in header]
    at = next((k for k, (name, _) in enumerate(names) if name.lower() in ("frequency", "f", "freq")), None)
    if at is None or names[at][1] != "Hz":
        raise InputError("no column of frequencies", file=file, value=header, expected="a column frequency [Hz]")
    columns: dict[str, dict[str, int]] = {}
    for k, (name, _) in enumerate(names):
        match = _COLUMN.fullmatch(name)
        if match is None and k != at:
            raise InputError("unknown column", file=file, value=header[k],
                             expected='names such as "xx real [m/N]" and "xx imag [m/N]"')
        if match is not None:
            part = match["part"].lower()
            columns.setdefault(match["pair"].lower(), {})[_PARTS.get(part, part)] = k
    if not columns:
        raise InputError("no receptances", file=file, expected='columns such as "xx real [m/N]" and "xx imag [m/N]"')
    cells = numbers(file, header, rows, list(range(len(header))))
    orders, values = [], []
    for pair, parts in columns.items():
        if set(parts) not in ({"real", "imag"}, {"magnitude", "phase"}):
            raise InputError("half a receptance", file=file, key=pair, value=sorted(parts),
                             expected="real and imag, or magnitude and phase")
        first, second = (parts["real"], parts["imag"]) if "real" in parts else (parts["magnitude"], parts["phase"])
        order, scale = _unit(file, header[first], names[first][1])
        if "real" in parts:
            if names[second][1] != names[first][1]:
                raise InputError("two units in one receptance", file=file, key=pair, value=[names[first][1],
                                 names[second][1]], expected="the same unit")
            values.append(scale * (cells[:, first] + 1j * cells[:, second]))
        else:
            if names[second][1] not in ("deg", "rad"):
                raise InputError("unknown unit of phase", file=file, key=header[second], expected="deg or rad")
            turn = cells[:, second] if names[second][1] == "rad" else np.radians(cells[:, second])
            values.append(scale * cells[:, first] * np.exp(1j * turn))
        orders.append(order)
    return cells[:, at], orders, tuple(columns), values, []


def _unit(file: Path, column: str, unit: str | None) -> tuple[int, float]:
    if unit not in UNITS:
        raise InputError("unknown unit", file=file, key=column, value=unit, expected=", ".join(UNITS))
    return UNITS[unit]


def _universal(file: Path, node: int | None) -> _Found:
    try:
        import pyuff
    except ImportError as error:
        raise InputError("universal files need pyuff", file=file, hint="pip install 'turnmill[modal]'") from error
    try:
        sets = pyuff.UFF(str(file)).read_sets()
    except Exception as error:
        raise InputError("not a universal file", file=file, hint=str(error)) from error
    sets = sets if isinstance(sets, list) else [sets]
    for unit in (s for s in sets if s.get("type") == 164 and s.get("units_code") not in (None, 1)):
        raise InputError("units", file=file, value=unit.get("units_code"), expected="SI (units code 1)")
    frfs = [s for s in sets if s.get("type") == 58 and s.get("func_type") == 4]
    if not frfs:
        raise InputError("holds no frequency response function", file=file, expected="data sets 58, function type 4")
    struck = sorted({int(s["ref_node"]) for s in frfs} & {int(s["rsp_node"]) for s in frfs})
    if node is None and len(struck) != 1:
        raise InputError("which point is the cutting point", file=file, value=struck, expected="--node, one of them")
    point = struck[0] if node is None else node
    chosen = [s for s in frfs if int(s["ref_node"]) == int(s["rsp_node"]) == point]
    if not chosen:
        raise InputError("no FRF at that point", file=file, key="--node", value=node, expected=f"one of {struck}")
    found: dict[str, tuple[int, NDArray[np.complex128]]] = {}
    f = np.asarray(chosen[0]["x"], dtype=np.float64)
    for s in chosen:
        response, force = int(s["rsp_dir"]), int(s["ref_dir"])
        if not {abs(response), abs(force)} <= {1, 2, 3}:
            continue
        if s["ordinate_spec_data_type"] not in _ORDINATE:
            raise InputError("unknown quantity", file=file, value=s["ordinate_spec_data_type"],
                             expected="displacement (8), velocity (11) or acceleration (12)")
        if not np.array_equal(np.asarray(s["x"], dtype=np.float64), f):
            raise InputError("FRFs with different frequencies", file=file, expected="one set of lines")
        sign = np.sign(response) * np.sign(force)
        pair = "xyz"[abs(response) - 1] + "xyz"[abs(force) - 1]
        found[pair] = (_ORDINATE[s["ordinate_spec_data_type"]], sign * np.asarray(s["data"], dtype=np.complex128))
    notes = [f"point {point}, {len(found)} of {len(frfs)} FRFs"]
    return f, [n for n, _ in found.values()], tuple(found), [v for _, v in found.values()], notes
