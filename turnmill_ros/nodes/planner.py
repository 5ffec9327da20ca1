"""Suggests a cut from the present state, on request; it commands nothing."""

from __future__ import annotations

import json
import math
import subprocess
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState
from turnmill_msgs.srv import Replan

from turnmill_core.operation import require
from turnmill_core.prediction import PredictedType
from turnmill_core.process.suggestion import with_modes
from turnmill_ros import replan, topics
from turnmill_ros.conversions import (
    margin_from_message,
    suggestion_to_message,
    verdict_from_message,
)
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.observed import Observed
from turnmill_ros.operation_track import OperationTrack

POLL_S = 0.2
"""Pause between looks at whether a search has ended."""


class Planner(LifecycleNode):
    """Remembers what verdicts and margins showed; searches for a better cut in a process of its own when asked."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("planner", **kwargs)
        self._match, lossless = support.declare_common(self)
        self._operations, self._observed = OperationTrack(), Observed()
        self._search: tuple[subprocess.Popen[str], int] | None = None
        self._asked = self._suggested = 0
        self._refused = ""
        self._out = support.publisher(self, topics.PLAN_SUGGESTION, keep_all=lossless)
        self.diagnostics = support.Diagnostics(self, self._values, lambda: self._refused or None, paced=lossless)
        support.subscription(self, topics.OPERATION, self.on_operation)
        support.subscription(self, topics.STABILITY_MARGIN, self.on_margin)
        support.subscription(self, topics.CHATTER_STATE, self.on_verdict)
        self.create_service(Replan, "replan", self.on_replan)
        self.create_timer(POLL_S, self._send_suggestion, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def on_operation(self, message: Any) -> None:
        """Plan for another operation from its stamp on."""
        support.accept_operation(self._operations.add, message)

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Wait for the operation."""
        support.wait_for_operation(self, self._operations)

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Listen."""
        support.wait_until_matched(self, self._match)
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Stop; a search that goes on is ended."""
        support.drain(self)
        self.hurry()
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def hurry(self) -> None:
        """End a search that goes on."""
        if self._search is not None:
            self._search[0].kill()
            self._search[0].communicate()
            self._search = None

    def on_margin(self, message: Any) -> None:
        """Remember the present cut."""
        margin = margin_from_message(message)
        in_cut = margin["predicted_type"] is not PredictedType.NO_CUT
        self._observed.cut(
            margin["stamp_ns"], margin["tool_speed"], margin["workpiece_speed"], margin["depth"], in_cut)

    def on_verdict(self, message: Any) -> None:
        """Remember what the monitor heard in it."""
        self._observed.verdict(verdict_from_message(message))

    def on_replan(self, request: Any, response: Any) -> Any:
        """Start a search; one that goes on is dropped."""
        now = self.get_clock().now().nanoseconds
        operation = self._operations.at(now)
        if operation is None:
            response.accepted, response.message = False, "no operation is loaded"
            return response
        try:
            require(math.isfinite(request.share) and 0 <= request.share <= 1, "share", request.share, "",
                    "a ratio in [0, 1]")
            with_modes(operation, request.mode_frequencies, request.mode_dampings)
        except ValueError as error:
            response.accepted, response.message = False, str(error)
            return response
        seen = () if request.forget_measured else self._observed.observations()
        asked = replan.Request(
            self._observed.present, seen, tuple(request.mode_frequencies), tuple(request.mode_dampings),
            request.share or 0.9, min(request.samples, 400) or 24, request.seed)
        self.hurry()
        self._search, self._asked = (replan.start(asked.json(operation.text)), now), self._asked + 1
        response.accepted = True
        response.message = f"searching, with {len(seen)} observed cuts; the answer comes on plan_suggestion"
        return response

    def _send_suggestion(self) -> None:
        """Publish the answer of a search that has ended."""
        if self._search is None or self._search[0].poll() is None:
            return
        (process, stamp_ns), self._search = self._search, None
        answer, _ = process.communicate()
        result = json.loads(answer) if process.returncode == 0 else {"error": "the search ended without an answer"}
        self._refused = f"no suggestion: {result['error']}" if "error" in result else ""
        if not self._refused:
            support.send(self._out, suggestion_to_message(result, stamp_ns, ros_types()))
            self._suggested += 1

    def _values(self) -> dict[str, object]:
        return {"cuts_observed": len(self._observed.observations()), "searches_asked": self._asked,
                "suggestions_sent": self._suggested}


if __name__ == "__main__":
    support.main(Planner)
