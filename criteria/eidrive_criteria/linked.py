"""Base class of criteria on the links between stations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from pydantic import model_validator

from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, actor_never_present
from eidrive_scenario.api.v2x import LinkEvent, ReceivedMessage

Link = tuple[str, str]
"""Sender and receiver."""


class LinkSettings(CriterionSettings):
    """Settings: `{receiver: Ego}` for all links to a station, `{sender: RSU}` for all from it, or both for one link."""

    sender: str | None = None
    receiver: str | None = None

    @model_validator(mode="after")
    def _some_link(self) -> Self:
        if self.sender is None and self.receiver is None:
            raise ValueError("neither 'sender' nor 'receiver' is given (expected one or both)")
        return self


class LinkCriterion(Criterion):
    """Criterion on some links. The link of a station to itself counts only if it is both sender and receiver."""

    def __init__(self, settings: LinkSettings) -> None:
        super().__init__(settings)
        self.sender, self.receiver = settings.sender, settings.receiver
        self.subjects = tuple(dict.fromkeys(name for name in (settings.sender, settings.receiver) if name is not None))
        self.missing = set(self.subjects)
        """Required stations that were never present so far."""
        self.time = 0.0
        """Time of the last frame [s]."""

    @property
    def where(self) -> str:
        """Description of the links for reasons."""
        if self.sender is None or self.receiver is None:
            return f"to {self.receiver}" if self.sender is None else f"from {self.sender}"
        return f"from {self.sender} to {self.receiver}"

    def concerns(self, sender: str, receiver: str) -> bool:
        """Return whether the criterion evaluates a link."""
        if sender == receiver and not self.sender == self.receiver == sender:
            return False
        return self.sender in (None, sender) and self.receiver in (None, receiver)

    def observe(self, frame: Frame) -> None:
        if self.missing:
            self.missing.difference_update(frame.view.names)
        self.time = frame.view.time
        self._add_outcomes(frame.links)
        for receiver, step in frame.steps.items():
            if self.receiver not in (None, receiver):
                continue
            for received in step.inbox:
                if self.concerns(received.message.sender, receiver):
                    self.add_reception((received.message.sender, receiver), received)

    def observe_final_links(self, events: Sequence[LinkEvent]) -> None:
        self._add_outcomes(events)

    def _add_outcomes(self, events: Sequence[LinkEvent]) -> None:
        for event in events:
            if self.concerns(event.sender, event.receiver):
                self.add_outcome(event)

    def add_outcome(self, event: LinkEvent) -> None:
        """Process the outcome of a message, which is known before its arrival."""

    def add_reception(self, link: Link, received: ReceivedMessage) -> None:
        """Process a message that has arrived."""

    def nothing(self, what: str) -> str:
        """Return the reason of a verdict without a value."""
        return actor_never_present(self.missing) if self.missing else f"there was no {what} {self.where}"
