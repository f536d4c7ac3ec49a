"""Report of the damage of a recording: each kind once, with its first locations and its count."""

from __future__ import annotations

_SHOWN = 3
"""Number of locations that are listed for each kind of damage."""
_MAX_KINDS = 50
"""Maximum number of kinds of damage that are listed separately."""


class DamageReport:
    """Collector of damage that is found while a file is read. Its size does not grow with the damage."""

    def __init__(self) -> None:
        self._locations: dict[str, list[str]] = {}
        self._counts: dict[str, int] = {}

    def add(self, kind: str, location: str = "") -> None:
        """Add one case of damage of this kind, with its location in the file."""
        if kind not in self._counts and len(self._counts) >= _MAX_KINDS:
            kind = "further damage"
        self._counts[kind] = self._counts.get(kind, 0) + 1
        locations = self._locations.setdefault(kind, [])
        if location and len(locations) < _SHOWN:
            locations.append(location)

    def __bool__(self) -> bool:
        return bool(self._counts)

    def lines(self) -> tuple[str, ...]:
        """Return one line for each kind of damage."""
        return tuple(self._line(kind, count) for kind, count in self._counts.items())

    def _line(self, kind: str, count: int) -> str:
        locations = self._locations[kind]
        more = f" and {count - len(locations)} more" if locations and count > len(locations) else ""
        return f"{kind}: {', '.join(locations)}{more}" if locations else kind
