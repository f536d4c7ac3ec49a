"""Outcomes of radio transmissions in columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio.access import Transmission
from eidrive_scenario.v2x.radio.budget import Budget
from eidrive_scenario.v2x.radio.reception import CAUSES, DELIVERED, QUEUE, Receptions
from eidrive_scenario.v2x.radio_environment import STATES
from eidrive_scenario.v2x.statistics.link_events import OutcomeBlock, OutcomeColumns

OUTCOMES = tuple(("delivered", "") if code == DELIVERED else ("lost", cause) for code, cause in enumerate(CAUSES))
"""Outcome and reason, by code of the cause."""


class ReceptionBlock(OutcomeBlock):
    """Outcomes of T ended transmissions at their receivers, E in total, sorted by transmission.

    receivers  rows of the receivers, by message
    places     (E,) indices into `ended`;  senders, reached_receivers  (E,) rows;  causes  (E,) codes
    arrives    (E,) times of arrival [s]; infinity for lost messages
    """

    def __init__(
        self, ended: Sequence[Transmission], receptions: Receptions, budget: Budget, receivers: Sequence[Integers]
    ) -> None:
        self.ended = ended
        self.receptions = receptions
        self.budget = budget
        self.receivers = receivers
        self.places = np.repeat(np.arange(len(ended)), [len(rows) for rows in receivers])
        self.reached_receivers = np.concatenate(receivers)
        self.senders = receptions.senders[self.places]
        self.causes = receptions.causes[self.places, self.reached_receivers].astype(np.int64)
        self.arrives = np.full(len(self.places), np.inf)

    def __len__(self) -> int:
        return len(self.places)

    def __iter__(self) -> Iterator[LinkEvent]:
        budget, senders, reached = self.budget, self.senders, self.reached_receivers
        for place, sender, row, cause, arrives, loss, snr, state in zip(
            self.places.tolist(),
            senders.tolist(),
            reached.tolist(),
            self.causes.tolist(),
            self.arrives.tolist(),
            budget.loss[senders, reached].tolist(),
            self.receptions.snr[self.places, reached].tolist(),
            budget.states[senders, reached].tolist(),
            strict=True,
        ):
            entry = self.ended[place]
            message, (outcome, reason) = entry.message, OUTCOMES[cause]
            yield LinkEvent(
                sender=message.sender,
                receiver=budget.names[row],
                number=message.number,
                sent=entry.sent,
                outcome=outcome,
                arrives=arrives if cause == DELIVERED else None,
                reason=reason,
                size=message.size,
                path_loss_db=loss,
                snr_db=snr,
                los=STATES[state],
                blockers=budget.bodies_between(sender, row) if state else (),
            )

    def columns(self) -> OutcomeColumns:
        number, sent, size = _of_messages(self.ended)
        return OutcomeColumns(
            self.budget.names,
            self.senders,
            self.reached_receivers,
            OUTCOMES,
            self.causes,
            number[self.places],
            sent[self.places],
            self.arrives,
            size[self.places],
        )


class DroppedBlock(OutcomeBlock):
    """Outcomes of a message that was dropped from its queue; `sender` and `receivers` are rows of `names`."""

    def __init__(self, entry: Transmission, names: tuple[str, ...], sender: int, receivers: Integers) -> None:
        self._entry = entry
        self._names = names
        self._sender = sender
        self._receivers = receivers

    def __len__(self) -> int:
        return len(self._receivers)

    def __iter__(self) -> Iterator[LinkEvent]:
        message, sent = self._entry.message, self._entry.sent
        for row in self._receivers.tolist():
            yield LinkEvent(
                message.sender, self._names[row], message.number, sent, "lost", None, CAUSES[QUEUE], message.size
            )

    def columns(self) -> OutcomeColumns:
        number, sent, size = _of_messages([self._entry])
        all_of_one = np.zeros(len(self._receivers), dtype=np.int64)
        return OutcomeColumns(
            self._names,
            all_of_one + self._sender,
            self._receivers,
            OUTCOMES,
            all_of_one + QUEUE,
            number[all_of_one],
            sent[all_of_one],
            np.full(len(all_of_one), np.inf),
            size[all_of_one],
        )


def _of_messages(entries: Sequence[Transmission]) -> tuple[Integers, Array, Integers]:
    """Return numbers, times of sending [s] and sizes [bytes], (T,) each."""
    return (
        np.array([entry.message.number for entry in entries], dtype=np.int64),
        np.array([entry.sent for entry in entries], dtype=float),
        np.array([entry.message.size for entry in entries], dtype=np.int64),
    )
