"""Entry point: collects the commands and turns errors into one line and an exit code.

Exit codes: 0 done, 1 internal failure, 2 bad input. TURNMILL_TRACEBACK=1 shows where an error arose.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

import typer
from rich.console import Console

from turnmill_ros.cli.chuck import chuck
from turnmill_ros.cli.delay import delay
from turnmill_ros.cli.detect_bench import detect_bench
from turnmill_ros.cli.engagement import engagement
from turnmill_ros.cli.forces import forces
from turnmill_ros.cli.identify import identify
from turnmill_ros.cli.lobes import lobes
from turnmill_ros.cli.modes import modes
from turnmill_ros.cli.online import doctor, live, replay
from turnmill_ros.cli.operation import operation
from turnmill_ros.cli.plan import plan
from turnmill_ros.cli.positions import positions
from turnmill_ros.cli.recordings import analyze_bags, import_recording, recover, simulate
from turnmill_ros.cli.stability import stability
from turnmill_ros.cli.surface import surface
from turnmill_ros.cli.toolpath import toolpath
from turnmill_ros.cli.vibration import vibration
from turnmill_ros.cli.workpiece import workpiece
from turnmill_ros.errors import InputError

# The base of typer's usage errors; newer ones carry their own click.
ClickException = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")

app = typer.Typer(
    name="turnmill",
    help="In-process monitoring of milling and turn-milling: forces, stability, chatter from recordings and live.",
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich",
)
PANELS: dict[str, dict[str, Callable[..., None]]] = {
    "Start": {"operation": operation, "doctor": doctor},
    "Recordings and the live twin": {
        "replay": replay, "live": live, "analyze": analyze_bags, "simulate": simulate, "import": import_recording,
        "recover": recover, "detect-bench": detect_bench},
    "Mechanics": {"forces": forces, "engagement": engagement, "toolpath": toolpath, "identify": identify},
    "Structures": {"modes": modes, "positions": positions, "workpiece": workpiece, "chuck": chuck},
    "Stability": {"stability": stability, "lobes": lobes, "delay": delay},
    "Vibration, surface and planning": {"vibration": vibration, "surface": surface, "plan": plan},
}
"""Every command by the panel of ``turnmill --help`` that it stands in."""

for panel, commands in PANELS.items():
    for command_name, function in commands.items():
        app.command(command_name, rich_help_panel=panel)(function)


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
