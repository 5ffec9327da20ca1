"""APT-CL path files: reader and writer.

Known words: GOTO, FROM, FEDRAT, SPINDL, RAPID, LOADTL, LOAD/TOOL, CUTTER, UNITS, MULTAX, PPRINT, and words without
effect on the path (PARTNO, REMARK, FINI ...). `$$` begins a comment, `$` at the end continues a statement on the next
line. Lengths are mm (inch after UNITS/INCHES), feeds per minute (MMPM, IPM) or per revolution (MMPR, IPR), spindle
speeds rpm, CLW positive. The speed of the workpiece spindle, for which CL data has no word, stands in
``PPRINT/WORKPIECE SPEED 6.0 RPM``, signed about +z.

Every other word is counted and reported with its lines. A known word that makes no sense raises ValueError with the
line's number and text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from turnmill_core.machine.toolpath import MAX_COORDINATE, PathPoint, Toolpath
from turnmill_core.operation import Vector

RPM = 2 * math.pi / 60
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?", re.ASCII)
WORKPIECE = re.compile(r"WORKPIECE SPEED\s+(\S+)\s+RPM", re.ASCII | re.IGNORECASE)
SILENT = frozenset({"PARTNO", "REMARK", "MACHIN", "FINI", "END", "COOLNT", "TOOL PATH", "END-OF-PATH", "PAINT",
                    "TLDATA", "OPSKIP", "INSERT", "SEQNO", "DISPLY", "TPRINT"})
GEOMETRY = frozenset({"GODLTA", "CIRCLE", "CYCLE", "ARCSLP", "COPY", "TRACUT", "ORIGIN", "TRANS", "MSYS", "INDIRV",
                      "MOVARC", "NURBS", "ROTABL", "ROTHED", "TLAXIS", "DELAY"})
"""Words that would change the path or its time but are not followed."""

MAX_LINES_KEPT = 20
UNITS = {"MM": 1e-3, "MILLIMETERS": 1e-3, "INCH": 0.0254, "INCHES": 0.0254}
FEED_UNITS = {"MMPM": ("time", 1e-3), "MMPR": ("revolution", 1e-3), "IPM": ("time", 0.0254),
              "IPR": ("revolution", 0.0254)}


@dataclass(frozen=True)
class UnknownWord:
    """A word that the reader does not know: how often it stands in the file, the first lines that hold it (from 1),
    and whether it is known to change the path, so that the path read may be wrong."""

    word: str
    count: int
    lines: tuple[int, ...]
    changes_path: bool


@dataclass(frozen=True)
class AptFile:
    """A path file: its toolpath and the words that were not understood, in the order of their first line."""

    path: Toolpath
    unknown: tuple[UnknownWord, ...]


def read_apt(text: str, name: str = "<text>") -> AptFile:
    """Toolpath of an APT-CL `text`; name: what it is called in the path and in errors.

    GOTO and FROM without a tool axis keep the last one, (0, 0, 1) at first. RAPID holds for the next GOTO. A GOTO
    before any feed is read with feed 0; path_motion then asks for one. Axis vectors may be off length 1 by 1 %.
    Raises ValueError with line number and text for a known word that makes no sense, and where there is no point.
    """
    reader = _Reader()
    for number, statement in _statements(text, name):
        head, slash, rest = statement.partition("/")
        word = " ".join(head.split("=")[-1].upper().split())
        if not slash and word not in _KNOWN and word not in SILENT:
            word = word.split(" ")[0].split(",")[0]
        rest = rest.strip()
        arguments = [rest] if word == "PPRINT" else [a.strip().upper() for a in rest.split(",")] if rest else []
        try:
            if word in _KNOWN:
                _KNOWN[word](reader, arguments)
            elif word not in SILENT:
                reader.unknown.setdefault(word[:32], []).append(number)
        except ValueError as error:
            raise ValueError(f"{name}, line {number}: {error}: {_shown(statement)}") from None
    if not reader.points:
        raise ValueError(f"{name}: no GOTO or FROM in {text.count(chr(10)) + 1} lines, expected a path file (APT-CL)")
    unknown = tuple(UnknownWord(w, len(n), tuple(n[:MAX_LINES_KEPT]), w in GEOMETRY) for w, n in reader.unknown.items())
    return AptFile(Toolpath(tuple(reader.points), name, tuple(reader.cutters), tuple(reader.notes)), unknown)


def _shown(statement: str) -> str:
    return repr(statement if len(statement) <= 80 else statement[:77] + "...")


def _statements(text: str, name: str) -> Iterator[tuple[int, str]]:
    """Number of the first line and text of every statement, comments taken off and continued lines joined."""
    parts: list[str] = []
    first = number = 0
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), 1):
        code, dollar, after = line.partition("$")
        parts.append(code.strip())
        first = first or number
        if dollar and not after.startswith("$"):
            continue
        if any(parts):
            yield first, " ".join(parts).strip()
        parts, first = [], 0
    if any(parts):
        raise ValueError(f"{name}, line {first}: continued with $ beyond the end of the file: "
                         + _shown(" ".join(parts)))


def _number(text: str) -> float:
    if NUMBER.fullmatch(text) is None:
        raise ValueError(f"{text[:40]!r} is not a number")
    value = float(text.replace("D", "E").replace("d", "e"))
    if not math.isfinite(value):
        raise ValueError(f"{text[:40]} is too large")
    return value


@dataclass
class _Reader:
    """What holds at the present line."""

    points: list[PathPoint] = field(default_factory=list)
    cutters: list[tuple[int, tuple[float, ...]]] = field(default_factory=list)
    notes: list[tuple[int, str]] = field(default_factory=list)
    unknown: dict[str, list[int]] = field(default_factory=dict)
    length: float = 1e-3
    axis: Vector = (0.0, 0.0, 1.0)
    feed: float = 0.0
    feed_per: str = "time"
    feed_unit: str = ""
    spindle: float = 0.0
    clockwise: bool = True
    spindle_on: bool = True
    workpiece_speed: float = 0.0
    rapid_next: bool = False
    tool: int = 0

    def goto(self, arguments: list[str]) -> None:
        self._move(arguments, self.rapid_next)
        self.rapid_next = False

    def start(self, arguments: list[str]) -> None:
        self._move(arguments, True)

    def _move(self, arguments: list[str], rapid: bool) -> None:
        if len(arguments) not in (3, 6):
            raise ValueError(f"{len(arguments)} values, expected x, y, z or x, y, z, i, j, k")
        values = [_number(a) for a in arguments]
        x, y, z = (v * self.length for v in values[:3])
        if not all(abs(v) <= MAX_COORDINATE for v in (x, y, z)):
            raise ValueError(f"position beyond {MAX_COORDINATE:g} m")
        if len(values) == 6:
            self.axis = _axis(values[3:])
        spindle = (self.spindle if self.clockwise else -self.spindle) if self.spindle_on else 0.0
        self.points.append(PathPoint(
            (x, y, z), self.axis, self.feed, "revolution" if self.feed_per == "revolution" else "time", spindle,
            self.workpiece_speed, rapid, self.tool))

    def fedrat(self, arguments: list[str]) -> None:
        words = [a for a in arguments if NUMBER.fullmatch(a) is None]
        numbers = [_number(a) for a in arguments if NUMBER.fullmatch(a)]
        if len(numbers) != 1 or len(words) > 1 or (words and words[0] not in FEED_UNITS):
            raise ValueError(f"expected a feed and {', '.join(FEED_UNITS)}")
        if words:
            self.feed_unit = words[0]
        per, factor = FEED_UNITS[self.feed_unit or ("MMPM" if self.length == 1e-3 else "IPM")]
        if not 0 < numbers[0] * factor <= MAX_COORDINATE * 60:
            raise ValueError(f"feed is {numbers[0]:g}, expected a number > 0 (and at most 1 km/s)")
        self.feed, self.feed_per = numbers[0] * factor / (60 if per == "time" else 1), per

    def spindl(self, arguments: list[str]) -> None:
        words = [a for a in arguments if NUMBER.fullmatch(a) is None]
        numbers = [_number(a) for a in arguments if NUMBER.fullmatch(a)]
        allowed = {"RPM", "CLW", "CCLW", "ON", "OFF"}
        if not arguments or len(numbers) > 1 or not set(words) <= allowed or {"CLW", "CCLW"} <= set(words):
            raise ValueError("expected a speed, RPM and CLW or CCLW, or ON, or OFF")
        if numbers:
            if not 0 <= numbers[0] <= 1e6:
                raise ValueError(f"spindle speed is {numbers[0]:g} rpm, expected 0 to 1e6")
            self.spindle = numbers[0] * RPM
        if {"CLW", "CCLW"} & set(words):
            self.clockwise = "CLW" in words
        self.spindle_on = "OFF" not in words

    def rapid(self, arguments: list[str]) -> None:
        self.rapid_next = True

    def loadtl(self, arguments: list[str]) -> None:
        number = _number(arguments[0]) if arguments else -1.0
        if number != int(number) or not 0 <= number <= 1e9:
            raise ValueError("expected a tool number, a whole number >= 0")
        self.tool = int(number)

    def load(self, arguments: list[str]) -> None:
        if arguments[:1] != ["TOOL"]:
            raise ValueError("expected TOOL and its number")
        self.loadtl(arguments[1:])

    def cutter(self, arguments: list[str]) -> None:
        if not 1 <= len(arguments) <= 7:
            raise ValueError(f"{len(arguments)} values, expected 1 to 7")
        values = [_number(a) for a in arguments]
        if not 0 < values[0] * self.length <= MAX_COORDINATE:
            raise ValueError(f"cutter diameter is {values[0]:g}, expected a number > 0")
        scale = [self.length] * 4 + [math.pi / 180] * 2 + [self.length]
        self.cutters.append((len(self.points), tuple(v * s for v, s in zip(values, scale, strict=False))))

    def units(self, arguments: list[str]) -> None:
        if len(arguments) != 1 or arguments[0] not in UNITS:
            raise ValueError(f"expected one of {', '.join(UNITS)}")
        self.length = UNITS[arguments[0]]

    def multax(self, arguments: list[str]) -> None:
        if len(arguments) > 1 or not set(arguments) <= {"ON", "OFF"}:
            raise ValueError("expected nothing, ON or OFF")
        if arguments == ["OFF"]:
            self.axis = (0.0, 0.0, 1.0)

    def pprint(self, arguments: list[str]) -> None:
        note = " ".join("".join(c if c.isprintable() else " " for c in arguments[0]).split())
        if note.upper().startswith("WORKPIECE SPEED"):
            match = WORKPIECE.fullmatch(note)
            if match is None:
                raise ValueError("expected PPRINT/WORKPIECE SPEED, a number and RPM")
            speed = _number(match[1])
            if abs(speed) > 1e6:
                raise ValueError(f"workpiece speed is {speed:g} rpm, expected -1e6 to 1e6")
            self.workpiece_speed = speed * RPM
        elif note:
            self.notes.append((len(self.points), note))


def _axis(values: list[float]) -> Vector:
    length = math.hypot(*values)
    if not abs(length - 1) <= 0.01:
        raise ValueError(f"tool axis has the length {length:.6g}, expected 1")
    if abs(length - 1) <= 1e-12:
        return values[0], values[1], values[2]
    return values[0] / length, values[1] / length, values[2] / length


_KNOWN: dict[str, Callable[[_Reader, list[str]], None]] = {
    "GOTO": _Reader.goto, "FROM": _Reader.start, "FEDRAT": _Reader.fedrat, "SPINDL": _Reader.spindl,
    "RAPID": _Reader.rapid, "LOADTL": _Reader.loadtl, "LOAD": _Reader.load, "CUTTER": _Reader.cutter,
    "UNITS": _Reader.units, "MULTAX": _Reader.multax, "PPRINT": _Reader.pprint,
}
