"""Extensions by name: the built-in ones come through the same entry points as a third party's package."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from inspect import isabstract
from typing import Any

from eidrive_scenario.errors import Problem, RegistryError, SettingError, suggestion

GROUPS = ("actions", "conditions", "criteria", "detectors", "channels", "fusion", "planners", "controllers")


class Registry:
    """The extensions of one kind, found by their entry points `eidrive_scenario.<kind>`.

    Raises RegistryError if two of them claim one name; an extension is imported when it is first asked for.
    """

    def __init__(self, kind: str, found: list[EntryPoint] | None = None) -> None:
        self.kind = kind
        self._points: dict[str, EntryPoint] = {}
        for point in entry_points(group=f"eidrive_scenario.{kind}") if found is None else found:
            other = self._points.get(point.name)
            if other is not None and other.value != point.value:
                raise RegistryError(
                    f"two {kind} are named {point.name!r}: {other.value} and {point.value}; rename or uninstall one"
                )
            self._points[point.name] = point

    def __contains__(self, name: str) -> bool:
        return name in self._points

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._points))

    def value(self, name: str) -> str:
        """The module and object behind a name, as `package.module:Object`."""
        return self._points[name].value

    def load(self, name: str) -> Any:
        """The extension of that name. Raises SettingError if there is none, RegistryError if it does not import
        or leaves out a method that its base class asks for."""
        point = self._points.get(name)
        if point is None:
            singular = self.kind.removesuffix("s")
            raise SettingError(Problem(f"unknown {singular} {name!r}", suggestion(name, self._points)))
        try:
            found = point.load()
        except (ImportError, AttributeError) as error:
            raise RegistryError(f"{self.kind} {name!r} ({point.value}) does not load: {error}") from error
        if isabstract(found):
            missing = ", ".join(sorted(found.__abstractmethods__))
            raise RegistryError(f"{self.kind} {name!r} ({point.value}) lacks {missing}")
        return found


@cache
def registry(kind: str) -> Registry:
    """The registry of one kind, read once per process."""
    return Registry(kind)
