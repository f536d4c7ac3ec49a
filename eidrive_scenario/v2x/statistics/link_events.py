"""Outcomes of the transmissions of one tick: a sequence whose events are created on first access."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple, overload

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.messages.message import LinkEvent


class OutcomeColumns(NamedTuple):
    """Outcomes of E transmissions in columns, named after the attributes of `LinkEvent`.

    names      names of stations;  senders, receivers   (E,) indices into `names`
    outcomes   pairs of outcome and reason;  outcome   (E,) indices into `outcomes`
    number, size   (E,);  sent, arrives   (E,) [s]; `arrives` is infinity for lost messages
    """

    names: tuple[str, ...]
    senders: Integers
    receivers: Integers
    outcomes: tuple[tuple[str, str], ...]
    outcome: Integers
    number: Integers
    sent: Array
    arrives: Array
    size: Integers


class OutcomeBlock(ABC):
    """Outcomes of transmissions in columns. Iteration yields them as events."""

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def __iter__(self) -> Iterator[LinkEvent]: ...

    @abstractmethod
    def columns(self) -> OutcomeColumns:
        """Return the outcomes as arrays, in the order of iteration."""


class LinkEvents(Sequence[LinkEvent]):
    """Sequence of events that are created on first access. Code that works on arrays reads `parts` instead.

    It is equal to any tuple, list or LinkEvents of the same events in the same order. A channel may also return a
    plain list of events, which is then the only part.
    """

    def __init__(self, parts: Iterable[Sequence[LinkEvent] | OutcomeBlock]) -> None:
        self.parts: tuple[Sequence[LinkEvent] | OutcomeBlock, ...] = tuple(part for part in parts if len(part))
        self._number = sum(map(len, self.parts))

    def __len__(self) -> int:
        return self._number

    def __iter__(self) -> Iterator[LinkEvent]:
        return iter(self._events)

    @overload
    def __getitem__(self, index: int) -> LinkEvent: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[LinkEvent]: ...
    def __getitem__(self, index: int | slice) -> LinkEvent | Sequence[LinkEvent]:
        return self._events[index]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, tuple | list | LinkEvents):
            return NotImplemented
        return len(self) == len(other) and self._events == tuple(other)

    def __hash__(self) -> int:
        return hash(self._events)

    def __repr__(self) -> str:
        return f"LinkEvents({list(self._events)!r})"

    @cached_property
    def _events(self) -> tuple[LinkEvent, ...]:
        return tuple(event for part in self.parts for event in part)
