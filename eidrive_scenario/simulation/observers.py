"""Observers of one run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, suppress
from typing import Protocol

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation.result import RunResult


class Observer(Protocol):
    """Observer of a run that does not change it, such as a recorder, a CSV writer or a collector of images.

    It may have the methods `begin(simulation)`, called before its first frame, and `conclude(result)`, which
    `Simulation.run` calls with the result of a completed run.
    """

    def observe(self, frame: Frame) -> None:
        """Process one frame."""

    def close(self) -> None:
        """Finish after the last frame."""


def checked_observers(observers: Iterable[Observer]) -> tuple[Observer, ...]:
    """Return observers. Raise SettingError for an object that is no list of them, such as a single one."""
    if not isinstance(observers, Iterable):
        raise SettingError(Diagnostic(f"observers is {quoted(observers)}", "give a list of observers"))
    return tuple(observers)


class Observers:
    """The observers of one run. Each is closed exactly once."""

    def __init__(self) -> None:
        self._observers: tuple[Observer, ...] = ()
        self._unclosed: list[Observer] = []
        self._waiting: list[Observer] = []

    def __iter__(self) -> Iterator[Observer]:
        return iter(self._observers)

    def add(self, *observers: Observer) -> None:
        """Add observers of all frames from now on. Raise SettingError if one lacks a method."""
        for observer in observers:
            if isinstance(observer, type):
                raise SettingError(Diagnostic(f"observer {observer.__name__} is a class", "give an instance of it"))
            for method in ("observe", "close"):
                if not callable(getattr(observer, method, None)):
                    message = f"observer {type(observer).__name__} has no method {method}"
                    raise SettingError(Diagnostic(message, "define observe(frame) and close()"))
            self._observers = (*self._observers, observer)
            self._unclosed.append(observer)
            self._waiting.append(observer)

    def begin(self, simulation: object) -> None:
        """Pass the simulation to the observers that have a method for it, each once, before their first frame."""
        while self._waiting:
            begin = getattr(self._waiting.pop(0), "begin", None)
            if callable(begin):
                begin(simulation)

    def observe(self, frame: Frame) -> None:
        """Pass a frame to all observers, in the order in which they were added."""
        for observer in self._observers:
            observer.observe(frame)

    def conclude(self, result: RunResult) -> None:
        """Pass the result of a completed run to the observers that have a method for it."""
        for observer in self._observers:
            conclude = getattr(observer, "conclude", None)
            if callable(conclude):
                conclude(result)

    def close(self, stack: ExitStack) -> None:
        """Register the closing of all open observers with `stack`, so that an exception of one does not skip others."""
        while self._unclosed:
            stack.callback(self._unclosed.pop().close)

    def close_silently(self) -> None:
        """Close all open observers and ignore their exceptions."""
        while self._unclosed:
            with suppress(Exception):
                self._unclosed.pop(0).close()
