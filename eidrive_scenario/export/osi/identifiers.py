"""Identifiers of OSI messages: one number per entity, unique and stable over the run."""

from __future__ import annotations


class Identifiers:
    """Numbers by kind and name, in the order of first use, from `first` on."""

    def __init__(self, first: int = 1) -> None:
        self._first = first
        self._numbers: dict[tuple[object, ...], int] = {}

    def of(self, *key: object) -> int:
        """Return the number of an entity, for example `of("actor", "Ego")`."""
        return self._numbers.setdefault(key, self._first + len(self._numbers))
