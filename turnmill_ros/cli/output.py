"""What the commands share: JSON for machines, tables for people, quantities from the command line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from turnmill_ros.errors import InputError

console = Console(highlight=False)
JsonFlag = Annotated[bool, typer.Option("--json", help="Print JSON for machines (SI units, null where there is none).")]
OperationArgument = Annotated[
    str,
    typer.Argument(
        metavar="OP", help="Operation file (YAML), or the name of a shipped one: turnmill operation --list."
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change one value of the operation, e.g. tool.teeth=4. Repeatable."
    ),
]


def quantity(text: str | None, unit: str, option: str) -> float | None:
    """SI value of a command line quantity such as ``3350rpm``; None stays None."""
    if text is None:
        return None
    from turnmill_core.operation_file import parse_quantity

    return parse_quantity(text, unit, option)


def span(text: str, unit: str, option: str) -> tuple[float, float]:
    """Both ends, in SI, of a command line range such as ``200Hz..1500Hz``."""
    low, dots, high = text.partition("..")
    if not dots:
        raise InputError(option, value=text, expected="FROM..TO, each with its unit")
    ends = quantity(low, unit, option), quantity(high, unit, option)
    assert ends[0] is not None
    assert ends[1] is not None
    return ends[0], ends[1]


def values(text: str, unit: str, option: str, count: int | None = None) -> list[float]:
    """SI values of ``A,B,...`` as they stand, or of ``FROM..TO:COUNT``, equally spaced; COUNT defaults to `count`."""
    if ".." not in text:
        return [value for part in text.split(",") if (value := quantity(part.strip(), unit, option)) is not None]
    ends, colon, number = text.partition(":")
    if colon and not (number.strip().isdigit() and 2 <= int(number) <= 4000):
        raise InputError(option, value=text, expected="FROM..TO:COUNT with a count of 2 to 4000")
    points = int(number) if colon else count
    if points is None:
        raise InputError(option, value=text, expected="how many: FROM..TO:COUNT")
    low, high = span(ends, unit, option)
    if not low < high:
        raise InputError(option, value=text, expected="TO above FROM")
    return [float(value) for value in np.linspace(low, high, points)]


def whole(value: int, option: str, low: int, high: int | None = None) -> int:
    """Check that a whole number of the command line lies within its bounds; return it."""
    if value < low or (high is not None and value > high):
        raise InputError(option, value=value, expected=f"a whole number >= {low}" + (f" and <= {high}" if high else ""))
    return value


def plain(value: Any) -> Any:
    """JSON form: NaN and infinity become null, arrays lists."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return int(value)
    return value


def print_json(value: Any, indent: int | None = 2) -> None:
    """Print one JSON document on stdout."""
    typer.echo(json.dumps(plain(value), indent=indent, ensure_ascii=False, allow_nan=False))


def table(title: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table."""
    console.print(title, style="bold", soft_wrap=True, markup=False)
    shown = Table(header_style="bold")
    for k, name in enumerate(columns):
        shown.add_column(name, justify="left" if k == 0 else "right")
    for row in rows:
        shown.add_row(*row)
    console.print(shown)


def new_file(path: Path, force: bool = False) -> Path:
    """Check that an output file can be written and does not exist yet; return it."""
    if path.exists() and not force:
        raise InputError(f"{path}: exists already; choose another name or remove it first")
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    return path


@contextmanager
def progress(text: str, quiet: bool = False) -> Iterator[Callable[[float], None]]:
    """Progress bar on stderr where that is a terminal; the yielded function takes the done share in [0, 1]."""
    terminal = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn(),
        console=terminal, transient=True, disable=quiet or not terminal.is_terminal,
    ) as bars:
        task = bars.add_task(text, total=1.0)
        yield lambda share: bars.update(task, completed=min(1.0, share))
