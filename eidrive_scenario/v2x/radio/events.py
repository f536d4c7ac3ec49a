"""The fates of many messages, made into events when somebody looks at them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.v2x.message import LinkEvent
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.budget import Budget
from eidrive_scenario.v2x.radio.reception import CAUSES, DELIVERED, QUEUE, Receptions
from eidrive_scenario.v2x.surroundings import STATES


class Batch:
    """T messages that have left the air: their receptions, who listens, and when they arrive."""

    def __init__(self, ended: Sequence[Transmission], receptions: Receptions, budget: Budget) -> None:
        self.ended = ended
        self.receptions = receptions
        self.budget = budget
        self.receivers: list[NDArray[np.int64]] = []
        """For each message the rows of those who listen."""
        self.arrivals = np.full(receptions.causes.shape, np.nan)
        """(T, N) [s]"""

    def __len__(self) -> int:
        return sum(len(rows) for rows in self.receivers)

    def __iter__(self) -> Iterator[LinkEvent]:
        budget, receptions = self.budget, self.receptions
        for place, (entry, receivers) in enumerate(zip(self.ended, self.receivers, strict=True)):
            message, sender = entry.message, int(receptions.senders[place])
            for row, cause, arrives, loss, snr, state in zip(
                receivers.tolist(),
                receptions.causes[place, receivers].tolist(),
                self.arrivals[place, receivers].tolist(),
                budget.loss[sender, receivers].tolist(),
                receptions.snr[place, receivers].tolist(),
                budget.states[sender, receivers].tolist(),
                strict=True,
            ):
                delivered = cause == DELIVERED
                event = LinkEvent.__new__(LinkEvent)
                event.__dict__.update(  # a third of the time that a frozen dataclass takes to set as many fields
                    sender=message.sender,
                    receiver=budget.names[row],
                    number=message.number,
                    sent=entry.sent,
                    outcome="delivered" if delivered else "lost",
                    arrives=arrives if delivered else None,
                    reason="" if delivered else CAUSES[cause],
                    size=message.size,
                    path_loss_db=loss,
                    snr_db=snr,
                    los=STATES[state],
                    blockers=self._in_order(sender, row) if state else (),
                )
                yield event

    def _in_order(self, sender: int, receiver: int) -> tuple[str, ...]:
        """The bodies in between, from the sender on."""
        if sender < receiver:
            return self.budget.blockers.get((sender, receiver), ())
        return self.budget.blockers.get((receiver, sender), ())[::-1]


class Dropped:
    """A message that its queue threw out."""

    def __init__(self, entry: Transmission, receivers: Sequence[str]) -> None:
        self._entry = entry
        self._receivers = receivers

    def __len__(self) -> int:
        return len(self._receivers)

    def __iter__(self) -> Iterator[LinkEvent]:
        message, sent = self._entry.message, self._entry.sent
        for name in self._receivers:
            yield LinkEvent(message.sender, name, message.number, sent, "lost", None, CAUSES[QUEUE], message.size)


class LinkEvents(Sequence[LinkEvent]):
    """A sequence of events that are made at the first look; a run of hundreds of stations need not look."""

    def __init__(self, made: Sequence[LinkEvent], batches: Sequence[Batch | Dropped]) -> None:
        self._made = list(made)
        self._batches = list(batches)

    def __len__(self) -> int:
        return len(self._made) + sum(map(len, self._batches))

    def __iter__(self) -> Iterator[LinkEvent]:
        return iter(self._all())

    @overload
    def __getitem__(self, place: int) -> LinkEvent: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[LinkEvent]: ...
    def __getitem__(self, place: int | slice) -> LinkEvent | Sequence[LinkEvent]:
        return self._all()[place]

    def _all(self) -> list[LinkEvent]:
        for batch in self._batches:
            self._made.extend(batch)
        self._batches.clear()
        return self._made
