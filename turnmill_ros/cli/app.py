"""Entry point: collects the commands and turns errors into one line and an exit code.

Exit codes: 0 done, 1 internal failure, 2 bad input. TURNMILL_TRACEBACK=1 shows where an error arose.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

import typer
from rich.console import Console

from turnmill_ros.cli import (
    chuck,
    delay,
    detect_bench,
    engagement,
    forces,
    identify,
    lobes,
    model,
    modes,
    online,
    plan,
    positions,
    recordings,
    stability,
    surface,
    toolpath,
    vibration,
    workpiece,
)
from turnmill_ros.errors import InputError

# The base of typer's usage errors; newer ones carry their own click.
ClickException = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")

app = typer.Typer(
    name="turnmill",
    help="In-process monitoring of milling and turn-milling: forces, stability, chatter from recordings and live.",
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich",
)
for module in (
    model, forces, engagement, identify, modes, vibration, surface, stability, lobes, delay, recordings, online,
    toolpath, plan, positions, workpiece, chuck, detect_bench,
):
    module.register(app)


def main() -> None:
    """Run the command line and exit."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code; errors go to stderr as one line."""
    return guarded(lambda: app(args=arguments, prog_name="turnmill", standalone_mode=False))


def guarded(command: Callable[[], object]) -> int:
    """Call `command` and return an exit code: an int that it returns, 0, or the code of its error."""
    show = os.environ.get("TURNMILL_TRACEBACK") == "1"
    try:
        result = command()
        return result if isinstance(result, int) else 0
    except ClickException as error:
        context = getattr(error, "ctx", None)
        where = f"{context.command_path.removeprefix('turnmill ')}: " if context is not None else ""
        return _fail(f"{where}{error.format_message()} (--help tells more)", 2)
    except (typer.Abort, KeyboardInterrupt):
        return _fail("interrupted", 130)
    except (InputError, ValueError) as error:
        if show:
            raise
        return _fail(str(error), 2)
    except OSError as error:
        if show:
            raise
        return _fail(f"{error.filename or ''}: {error.strerror or error}".lstrip(": "), 2 if error.filename else 1)
    except Exception as error:
        if show:
            raise
        return _fail(f"internal failure: {type(error).__name__}: {error} (TURNMILL_TRACEBACK=1 shows where)", 1)


def _fail(text: str, code: int) -> int:
    Console(stderr=True, highlight=False, soft_wrap=True).print(f"turnmill: {' '.join(text.split())}", style="bold red",
                                                                markup=False)
    return code
