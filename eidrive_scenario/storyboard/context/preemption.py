"""Interfaces of elements that hold control domains of actors, or await an absent entity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class PreemptableAction(Protocol):
    """Element whose behaviours hold domains that a later action can acquire."""

    def linked_behaviours(self, behaviour: DomainHolder) -> Sequence[DomainHolder]:
        """Return the behaviours that lose their domains together with this one, including it."""

    def preempt(self, behaviour: DomainHolder, why: str) -> None:
        """Stop a behaviour whose domain another action has acquired."""


class PendingAction(Protocol):
    """Element that awaits an absent entity until all elements are updated at an instant."""

    def abort(self) -> None:
        """Stop the actions whose entity is still absent."""


class DomainHolder(Protocol):
    """Behaviour that holds control domains of an actor (ASAM OpenSCENARIO XML 1.3.1, 7.5.1)."""

    @property
    def name(self) -> str:
        """Name of the behaviour."""

    @property
    def resource(self) -> str:
        """Part of the domain that it holds; empty for the whole domain."""
