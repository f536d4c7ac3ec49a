"""Extensions by name: the built-in ones come through the same entry points as a third party's package."""

from __future__ import annotations

import inspect
import sys
import traceback
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from eidrive_scenario.errors import Diagnostic, InvalidResult, RegistryError, SettingError, suggestion

GROUPS = (
    "actions",
    "conditions",
    "criteria",
    "detectors",
    "channels",
    "fusion",
    "planners",
    "sensors",
    "controllers",
    "trackers",
    "vehicle_controllers",
)
_SINGULAR = {
    "criteria": "criterion",
    "fusion": "fusion method",
    "controllers": "controller model",
    "vehicle_controllers": "vehicle controller",
}
_BUILT_IN = ("eidrive_scenario", "eidrive_behaviors", "eidrive_criteria")
_loaded: dict[type, tuple[str, str, str]] = {}
"""Kind, name and value of the entry point of each extension that was loaded."""


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

    def distribution(self, name: str) -> str | None:
        """Package, version and entry point of an extension; None for a built-in one, or where there is none."""
        point = self._points.get(name)
        if point is None or point.value.split(".")[0].split(":")[0] in _BUILT_IN:
            return None
        package = f"{point.dist.name} {point.dist.version}" if point.dist is not None else "unknown package"
        return f"{package} ({point.value})"

    def load(self, name: str, base: type | None = None) -> Any:
        """The extension of that name, a class derived from `base`.

        Raises SettingError if there is none. Raises RegistryError if it does not import, is no such class, leaves out
        a method that its base class asks for, or defines one that cannot be called in the same way.
        """
        point = self._points.get(name)
        if point is None:
            what = self.kind.removesuffix("s")
            raise SettingError(Diagnostic(f"unknown {what} {name!r}", suggestion(name, self._points)))
        found = self._import(point)
        if found in _checked.get((self.kind, name, base), ()):
            return found
        described = f"{self.kind} {name!r} ({point.value})"
        if base is not None and not (isinstance(found, type) and issubclass(found, base)):
            what = found.__name__ if isinstance(found, type) else f"an object of type {type(found).__name__}"
            raise RegistryError(f"{described} is no class derived from {base.__name__} (got {what})")
        if inspect.isabstract(found):
            missing = ", ".join(sorted(found.__abstractmethods__))
            raise RegistryError(f"{described} lacks {missing}")
        if isinstance(found, type):
            for diagnostic in _mismatches(found):
                raise RegistryError(f"{described}: {diagnostic}")
            _loaded.setdefault(found, (singular(self.kind), name, point.value))
            _checked[self.kind, name, base] = (found,)
        return found

    def _import(self, point: EntryPoint) -> Any:
        try:
            return point.load()
        except (Exception, SystemExit) as error:
            place = _raised_at(error)
            text = str(error) if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: {error}"
            described = f"{self.kind} {point.name!r} ({point.value})"
            raise RegistryError(f"{described} does not load: {text}{f' ({place})' if place else ''}") from error


_checked: dict[tuple[str, str, type | None], tuple[Any, ...]] = {}


@cache
def registry(kind: str) -> Registry:
    """The registry of one kind, read once per process."""
    return Registry(kind)


def distributions(used: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return the distributions of third-party extensions by `group.name`, of these pairs of group and name."""
    found = {f"{kind}.{name}": registry(kind).distribution(name) for kind, name in sorted(used)}
    return {name: distribution for name, distribution in found.items() if distribution is not None}


def singular(kind: str) -> str:
    """Return what one extension of a kind is called."""
    return _SINGULAR.get(kind, kind.removesuffix("s"))


def construct(extension_class: Any, *given: Any, **named: Any) -> Any:
    """Return an instance of an extension. Raise InvalidResult if its constructor does not take these arguments."""
    try:
        return extension_class(*given, **named)
    except TypeError as error:
        if error.__traceback__ is not None and error.__traceback__.tb_next is None:
            raise InvalidResult(extension_class, "__init__", f"cannot be called: TypeError: {error}") from error
        raise


def third_party_files() -> dict[str, dict[str, tuple[str, str, str]]]:
    """Return kind, name and value of the loaded extensions of others, by file and qualified name of their classes."""
    found: dict[str, dict[str, tuple[str, str, str]]] = {}
    for extension_class, known in _loaded.items():
        file = getattr(sys.modules.get(extension_class.__module__), "__file__", None)
        if file is not None and not is_built_in(extension_class):
            found.setdefault(file, {})[extension_class.__qualname__] = known
    return found


def registration(extension_class: type) -> tuple[str, str, str] | None:
    """Return kind, name and value of the entry point through which a class was loaded, or None."""
    for one in extension_class.__mro__:
        if one in _loaded:
            return _loaded[one]
    return None


def is_built_in(extension_class: type) -> bool:
    """Whether a class is part of this project."""
    return extension_class.__module__.partition(".")[0] in _BUILT_IN


def _mismatches(found: type) -> Iterator[str]:
    """Methods of a third party's class that cannot be called as those of this project that they override."""
    bases = [one for one in found.__mro__ if is_built_in(one)]
    for own_class in found.__mro__:
        if own_class in bases:
            continue
        for name, own in vars(own_class).items():
            expected = next((vars(base)[name] for base in bases if name in vars(base)), None)
            if name.startswith("_") or not inspect.isfunction(expected):
                continue
            plain = own.__func__ if isinstance(own, staticmethod | classmethod) else own
            if not callable(plain):
                yield f"{name} is an object of type {type(plain).__name__} (expected a method)"
            elif inspect.isgeneratorfunction(plain) or inspect.iscoroutinefunction(plain):
                yield f"{name} is a generator or coroutine (expected a method that returns its result)"
            elif diagnostic := _signature_problem(own, plain, expected):
                yield f"{name}{diagnostic}"


def _signature_problem(own: Any, plain: Any, expected: Any) -> str:
    """How the signature of a method differs from that of its base class, so that a call fails; "" if it does not."""
    wanted = inspect.signature(expected)
    try:
        given = inspect.signature(plain)
    except (TypeError, ValueError):
        return ""
    parameters = wanted.parameters.values()
    named = {entry.name: None for entry in parameters if entry.kind is entry.KEYWORD_ONLY}
    positional = [None for entry in parameters if entry.kind in (entry.POSITIONAL_ONLY, entry.POSITIONAL_OR_KEYWORD)]
    try:
        given.bind(*positional[isinstance(own, staticmethod) :], **named)
    except TypeError as error:
        return f"{given} cannot be called as {expected.__qualname__}{wanted}: {error}"
    return ""


def _raised_at(error: BaseException) -> str:
    """Return `file:line` of the raise in the imported module; "" if the import itself failed."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}:{error.lineno}"
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "importlib" not in frame.filename]
    own = [frame for frame in frames if frame.filename != __file__]
    return f"{own[-1].filename}:{own[-1].lineno}" if own else ""
