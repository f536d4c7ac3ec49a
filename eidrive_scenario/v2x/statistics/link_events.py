"""What became of the messages of one tick: a sequence of events, which are made when somebody looks at them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.v2x.messages.message import LinkEvent

Places = NDArray[np.int64]


class OutcomeColumns(NamedTuple):
    """E fates of messages in columns, each as the attribute of LinkEvent with that name says.

    names      of stations;  senders, receivers   (E,) places in `names`
    outcomes   (outcome, reason);  outcome   (E,) places in `outcomes`
    number, size   (E,);  sent, arrives   (E,) [s]; what is lost arrives at infinity
    """

    names: tuple[str, ...]
    senders: Places
    receivers: Places
    outcomes: tuple[tuple[str, str], ...]
    outcome: Places
    number: Places
    sent: Array
    arrives: Array
    size: Places


class OutcomeBlock(ABC):
    """Outcomes of transmissions in columns. Iteration yields them as events."""

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def __iter__(self) -> Iterator[LinkEvent]: ...

    @abstractmethod
    def columns(self) -> OutcomeColumns:
        """The same in arrays, in the same order."""


class LinkEvents(Sequence[LinkEvent]):
    """Events of which most are made at the first look; what works on arrays need not look.

    It is equal to any tuple, list or LinkEvents of the same events in the same order. A channel may as well return a
    plain list of events: whoever reads `parts` takes any other sequence as the only part.
    """

    def __init__(self, parts: Iterable[Sequence[LinkEvent] | OutcomeBlock]) -> None:
        self.parts: tuple[Sequence[LinkEvent] | OutcomeBlock, ...] = tuple(part for part in parts if len(part))
        self._number = sum(map(len, self.parts))
        self._made: tuple[LinkEvent, ...] | None = None

    def __len__(self) -> int:
        return self._number

    def __iter__(self) -> Iterator[LinkEvent]:
        return iter(self._events())

    @overload
    def __getitem__(self, place: int) -> LinkEvent: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[LinkEvent]: ...
    def __getitem__(self, place: int | slice) -> LinkEvent | Sequence[LinkEvent]:
        return self._events()[place]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, tuple | list | LinkEvents):
            return NotImplemented
        return len(self) == len(other) and self._events() == tuple(other)

    def __hash__(self) -> int:
        return hash(self._events())

    def __repr__(self) -> str:
        return f"LinkEvents({list(self._events())!r})"

    def _events(self) -> tuple[LinkEvent, ...]:
        if self._made is None:
            self._made = tuple(event for part in self.parts for event in part)
        return self._made
