"""A suggestion computed in a process of its own: `python -m turnmill_ros.replan`, JSON in and out.

The planner node starts it, so that the search takes no time from the nodes of the graph; it runs with the lowest
priority. stdin: one object with `operation` (YAML text) and the fields of :class:`Request`; stdout: one object with
the fields of turnmill_msgs/PlanSuggestion, or `error`.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation
from turnmill_core.process.cut_values import feed_of
from turnmill_core.process.robust import Observation
from turnmill_core.process.suggestion import Suggestion, suggest, with_modes
from turnmill_ros.plan_text import suggestion_reasons

NICE = 10


@dataclass(frozen=True)
class Request:
    """What a suggestion is asked for: the present cut, what was observed, modes measured anew, and the draws."""

    present: Observation | None = None
    observations: tuple[Observation, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_dampings: tuple[float, ...] = ()
    share: float = 0.9
    samples: int = 24
    seed: int = 0

    def json(self, operation_text: str) -> str:
        """The request as the process reads it."""
        return json.dumps({"operation": operation_text, **dataclasses.asdict(self)})


def answer(operation: Operation, request: Request) -> dict[str, Any]:
    """Fields of a PlanSuggestion without its header. Raises ValueError for what the models do not describe."""
    changed = with_modes(operation, request.mode_frequencies, request.mode_dampings)
    found = suggest(changed, request.present, request.observations, request.samples, request.seed, request.share)
    return fields(found, request, operation.sha256)


def fields(found: Suggestion, request: Request, operation_hash: str) -> dict[str, Any]:
    """Fields of a PlanSuggestion without its header."""
    choice, nan = found.choice, math.nan
    cut = choice and choice.conditions
    margins = sorted(choice.margins, key=lambda m: float(m.margin)) if choice else []
    changed = [f"{name} measured anew" for name in ("mode_frequencies", "mode_dampings") if getattr(request, name)]
    return {
        "feasible": choice is not None,
        "tool_speed": cut.tool_speed if cut else nan, "workpiece_speed": cut.workpiece_speed if cut else nan,
        "depth": cut.depth if cut else nan, "feed": feed_of(choice.op) if choice else nan,
        "material_removal_rate": choice.rate if choice else nan, "present_removal_rate": found.present_rate,
        "form_error": choice.form_error if choice else nan, "share_feasible": choice.share if choice else nan,
        "draws": len(found.draws.operations), "widened": found.draws.widened,
        "limits": [m.name for m in margins], "margins": [float(m.margin) for m in margins],
        "reasons": [c.replace("_", " ") for c in changed] + suggestion_reasons(found, request.observations),
        "operation_hash": operation_hash,
    }


def start(request: str) -> subprocess.Popen[str]:
    """A process at work on a request (JSON); its answer is on stdout when it has ended."""
    process = subprocess.Popen([sys.executable, "-m", "turnmill_ros.replan"], stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stdin is not None
    process.stdin.write(request)
    process.stdin.close()
    process.stdin = None  # communicate() writes nothing more
    return process


def main() -> None:
    """Read one request, write one answer."""
    os.nice(NICE)
    given = json.loads(sys.stdin.read())
    operation = parse_operation(given.pop("operation"), "the loaded operation")
    present = given.pop("present")
    request = Request(**{
        **{k: tuple(v) if isinstance(v, list) else v for k, v in given.items()},
        "present": Observation(**present) if present else None,
        "observations": tuple(Observation(**o) for o in given["observations"])})
    try:
        result = answer(operation, request)
    except ValueError as error:
        result = {"error": str(error)}
    sys.stdout.write(json.dumps(result))


if __name__ == "__main__":
    main()
