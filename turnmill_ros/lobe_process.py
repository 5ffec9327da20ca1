"""Stability diagrams in a process of their own, so that margins keep their pace.

The process is `python -m turnmill_ros.lobe_process`: a pickled request on stdin, the pickled answer on stdout.
"""

from __future__ import annotations

import os
import pickle
import select
import subprocess
import sys
from dataclasses import dataclass

import numpy as np

from turnmill_core.operation import Conditions, Operation
from turnmill_core.stability.lobes import Lobes, stability_lobes
from turnmill_core.stability.margin import searched_depth
from turnmill_core.structure.at import Position

DEPTHS = 32
"""Depths of a diagram."""
NICE = 10
"""How much lower the priority of its process is."""


@dataclass(frozen=True, eq=False)
class LobeRequest:
    """A diagram that is wanted: operation, the cut and axis positions of an instant, and its stamp [ns].

    points: tool speeds of the diagram, from 0.7 to 1.3 times the nominal one.
    """

    op: Operation
    cut: Conditions
    position: Position
    stamp_ns: int
    points: int


class LobeProcess:
    """Computes one diagram at a time; of those that wait the newest is next."""

    def __init__(self) -> None:
        self._running: tuple[LobeRequest, subprocess.Popen[bytes]] | None = None
        self._waiting: LobeRequest | None = None

    @property
    def busy(self) -> bool:
        """True while a diagram is being computed."""
        return self._running is not None

    def want(self, request: LobeRequest) -> None:
        """Ask for a diagram."""
        self._waiting = request
        self._start()

    def found(self, wait: float = 0.0) -> tuple[LobeRequest, Lobes | str] | None:
        """The diagram that was finished, or why there is none; None where none is ready within `wait` [s]."""
        if self._running is None:
            return None
        request, process = self._running
        if not select.select([process.stdout], [], [], wait)[0]:
            return None
        answer, _ = process.communicate()
        result: Lobes | str = (pickle.loads(answer) if process.returncode == 0
                               else f"the process of the diagram ended with exit code {process.returncode}")
        self._running = None
        self._start()
        return request, result

    def close(self) -> None:
        """Give up what is being computed and what waits."""
        self._waiting = None
        self._end()

    def _start(self) -> None:
        if self._running is not None or self._waiting is None:
            return
        request, self._waiting = self._waiting, None
        process = subprocess.Popen([sys.executable, "-m", "turnmill_ros.lobe_process"], stdin=subprocess.PIPE,
                                   stdout=subprocess.PIPE, start_new_session=True)  # Ctrl-C is for the node
        assert process.stdin is not None
        process.stdin.write(pickle.dumps(request))
        process.stdin.close()
        process.stdin = None  # communicate() writes nothing more
        self._running = request, process

    def _end(self) -> None:
        if self._running is None:
            return
        _, process = self._running
        self._running = None
        process.kill()
        process.communicate()


def diagram(request: LobeRequest) -> Lobes | str:
    """The diagram that is asked for, or why there is none."""
    op = request.op
    speeds = op.conditions.tool_speed * np.linspace(0.7, 1.3, request.points)
    depths = np.linspace(0.0, searched_depth(op, request.cut), DEPTHS + 1)[1:]
    try:
        return stability_lobes(op, speeds, depths, request.cut.workpiece_speed, position=request.position)
    except ValueError as error:
        return str(error)


if __name__ == "__main__":
    os.nice(NICE)
    sys.stdout.buffer.write(pickle.dumps(diagram(pickle.load(sys.stdin.buffer))))
