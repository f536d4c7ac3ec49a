"""Workers of sweeps that execute calls in the process of a test."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any


class InProcess:
    """Workers that execute a call at once in this process; `calls` is the number of calls."""

    capacity = 1

    def __init__(self) -> None:
        self.calls = 0

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future[Any]:
        self.calls += 1
        future: Future[Any] = Future()
        future.set_result(function(*arguments))
        return future

    def is_crash(self, error: BaseException) -> bool:
        return False

    def close(self) -> None:
        """Do nothing."""
