"""Damage of a recording, in words: each kind once, with its first places and its count."""

from __future__ import annotations

_SHOWN = 3
"""Places that are named of each kind of damage."""
_MOST_KINDS = 50


class DamageReport:
    """Collects damage while a file is read; its size does not grow with the damage."""

    def __init__(self) -> None:
        self._places: dict[str, list[str]] = {}
        self._counts: dict[str, int] = {}

    def add(self, what: str, place: str = "") -> None:
        """Note one damage: its kind, and where it is."""
        if what not in self._counts and len(self._counts) >= _MOST_KINDS:
            what = "further damage"
        self._counts[what] = self._counts.get(what, 0) + 1
        places = self._places.setdefault(what, [])
        if place and len(places) < _SHOWN:
            places.append(place)

    def __bool__(self) -> bool:
        return bool(self._counts)

    def lines(self) -> tuple[str, ...]:
        """One line for each kind of damage."""
        return tuple(self._line(what, count) for what, count in self._counts.items())

    def _line(self, what: str, count: int) -> str:
        places = self._places[what]
        more = f" and {count - len(places)} more" if places and count > len(places) else ""
        return f"{what}: {', '.join(places)}{more}" if places else what
