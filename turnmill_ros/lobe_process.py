"""Stability diagrams in a process of their own, so that margins keep their pace."""

from __future__ import annotations

import multiprocessing
import signal
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

import numpy as np

from turnmill_core.operation import Conditions, Operation
from turnmill_core.stability.lobes import Lobes, stability_lobes
from turnmill_core.stability.margin import searched_depth
from turnmill_core.structure.at import Position

DEPTHS = 32


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
        self._running: tuple[LobeRequest, BaseProcess, Connection] | None = None
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
        if self._running is None or not self._running[2].poll(wait):
            return None
        request, process, answers = self._running
        try:
            result: Lobes | str = answers.recv()
        except EOFError:
            result = f"the process of the diagram ended with exit code {process.exitcode}"
        self._end()
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
        spawn = multiprocessing.get_context("spawn")
        answers, sender = spawn.Pipe(duplex=False)
        process = spawn.Process(target=_compute, args=(sender, request), name="lobes", daemon=True)
        process.start()
        sender.close()
        self._running = request, process, answers

    def _end(self) -> None:
        if self._running is None:
            return
        _, process, answers = self._running
        self._running = None
        answers.close()
        process.terminate()
        process.join()


def _compute(sender: Connection, request: LobeRequest) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the node ends this process
    op = request.op
    speeds = op.conditions.tool_speed * np.linspace(0.7, 1.3, request.points)
    depths = np.linspace(0.0, searched_depth(op, request.cut), DEPTHS + 1)[1:]
    try:
        sender.send(stability_lobes(op, speeds, depths, request.cut.workpiece_speed, position=request.position))
    except ValueError as error:
        sender.send(str(error))
