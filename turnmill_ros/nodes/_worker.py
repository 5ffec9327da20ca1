"""A thread that computes while callbacks run."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any


class Worker:
    """Runs calls one after another in a thread that does not keep the process alive."""

    def __init__(self, name: str) -> None:
        self._calls: queue.SimpleQueue[tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]] = queue.SimpleQueue()
        threading.Thread(target=self._run, name=name, daemon=True).start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Queue a call."""
        job: Future[Any] = Future()
        self._calls.put((job, function, arguments))
        return job

    def _run(self) -> None:
        while True:
            job, function, arguments = self._calls.get()
            if job.set_running_or_notify_cancel():
                try:
                    job.set_result(function(*arguments))
                except Exception as error:  # noqa: BLE001 - handed on to whoever asks for the result
                    job.set_exception(error)
