"""Writer of APT-CL path files; turnmill_core.machine.apt reads them back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from turnmill_core.machine.toolpath import PathPoint, Toolpath
from turnmill_core.operation import require

RPM = 60 / (2 * math.pi)
COLUMNS = 72
"""Longest line; longer statements are continued with $."""


def write_apt(path: Toolpath) -> str:
    """APT-CL text of a toolpath, in mm, rpm, mm/min and mm/rev.

    Positions are rounded to 1e-9 mm, axes to 15 decimals, feeds and speeds to 15 digits: read_apt returns the same
    path to that accuracy, and writing that again gives the same text but for a last digit of speeds. A name becomes the
    PARTNO line. Raises ValueError where a feed or a tool number is given first and missing later, which APT cannot say.
    """
    return "".join(f"{line}\n" for statement in _statements(path) for line in _lines(statement))


def _statements(path: Toolpath) -> Iterator[list[str]]:
    title = "".join(c for c in " ".join(path.name.split()) if c.isprintable() and c != "$")
    yield [f"PARTNO/{title}" if title else "PARTNO/turnmill"]
    yield ["UNITS/MM"]
    yield ["MULTAX/ON"]
    held = PathPoint((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    extras = _extras(path)
    for k, point in enumerate(path.points):
        yield from extras.get(k, ())
        yield from _changes(held, point, k)
        if point.rapid and k > 0:
            yield ["RAPID"]
        values = [f"{x * 1e3 + 0.0:.9f}" for x in point.tip] + [f"{x + 0.0:.15f}" for x in point.axis]
        yield [f"FROM/{values[0]}" if point.rapid and k == 0 else f"GOTO/{values[0]}", *values[1:]]
        held = point
    yield from extras.get(len(path.points), ())
    yield ["FINI"]


def _extras(path: Toolpath) -> dict[int, list[list[str]]]:
    """Cutters and notes by the point before which they stand."""
    found: dict[int, list[list[str]]] = {}
    for index, values in path.cutters:
        scale = [1e3] * 4 + [180 / math.pi] * 2 + [1e3]
        shown = [f"{v * s:.15g}" for v, s in zip(values, scale, strict=False)]
        found.setdefault(index, []).append([f"CUTTER/{shown[0]}", *shown[1:]])
    for index, text in path.notes:
        found.setdefault(index, []).append([f"PPRINT/{text}"])
    return found


def _changes(held: PathPoint, point: PathPoint, index: int) -> Iterator[list[str]]:
    """Statements for what differs from the point before."""
    if point.tool != held.tool:
        yield [f"LOADTL/{point.tool}"]
    if point.tool_speed != held.tool_speed:
        sense = "CLW" if point.tool_speed > 0 else "CCLW"
        yield ["SPINDL/OFF"] if point.tool_speed == 0 else ["SPINDL/RPM", f"{abs(point.tool_speed) * RPM:.15g}", sense]
    if point.workpiece_speed != held.workpiece_speed:
        yield [f"PPRINT/WORKPIECE SPEED {point.workpiece_speed * RPM:.15g} RPM"]
    if (point.feed, point.feed_per) != (held.feed, held.feed_per) and (point.feed or held.feed):
        require(point.feed > 0, f"feed of path point {index + 1}", point.feed, "", "a feed > 0 after one was given")
        per_time = point.feed_per == "time"
        yield ["FEDRAT/MMPM" if per_time else "FEDRAT/MMPR", f"{point.feed * (60e3 if per_time else 1e3):.15g}"]


def _lines(words: Sequence[str]) -> Iterator[str]:
    """A statement's words joined by commas, continued where a line gets long."""
    line = words[0]
    for word in words[1:]:
        if len(line) + len(word) + 3 > COLUMNS:
            yield f"{line},$"
            line = f"  {word}"
        else:
            line += f",{word}"
    yield line
