"""Registry of extensions by name; built-in and third-party ones are found through the same entry points."""

from __future__ import annotations

import importlib
import inspect
import sys
import traceback
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, NamedTuple

from eidrive_scenario.errors import Diagnostic, InvalidResult, RegistryError, SettingError, quoted, suggestion
from eidrive_scenario.extensions.project import (
    GROUPS,
    entry_points_of,
    modules_of,
    project_entry_points,
    selected_project,
)

_SINGULAR = {
    "criteria": "criterion",
    "fusion": "fusion method",
    "controllers": "controller model",
    "vehicle_controllers": "vehicle controller",
}
_BUILT_IN = ("eidrive_scenario", "eidrive_behaviors", "eidrive_criteria", "eidrive_reports")


class Registration(NamedTuple):
    """Entry point of an extension: kind (singular of the group), name, and value `package.module:Object`."""

    kind: str
    name: str
    value: str


_loaded: dict[Any, Registration] = {}
"""Registration of each loaded extension."""


class Registry:
    """Extensions of one kind, found by their entry points `eidrive_scenario.<kind>`, installed or of the project.

    An extension is imported on its first use. Raise RegistryError if two extensions have the same name.
    """

    def __init__(self, kind: str, points: list[EntryPoint] | None = None) -> None:
        self.kind = kind
        self._points: dict[str, EntryPoint] = {}
        for point in _declared(kind) if points is None else points:
            self._check_name(point, "rename or uninstall one")
            self._points[point.name] = point

    def __contains__(self, name: str) -> bool:
        return name in self._points

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._points))

    def add(self, name: str, value: str) -> None:
        """Add an extension `package.module:Object` that is not installed. Raise RegistryError for another one."""
        point = EntryPoint(name, value, f"eidrive_scenario.{self.kind}")
        self._check_name(point, "rename one")
        self._points.setdefault(name, point)

    def _check_name(self, point: EntryPoint, hint: str) -> None:
        other = self._points.get(point.name, point).value
        if other != point.value:
            described = f"{singular(self.kind)} {point.name!r} is registered twice: {other} and {point.value}"
            raise RegistryError(f"{described}; {hint}")

    def value(self, name: str) -> str:
        """Return module and object of an extension as `package.module:Object`."""
        return self._points[name].value

    def describe(self, name: str) -> str:
        """Return an extension for messages, such as `detector 'oracle' (package.module:Object)`."""
        return f"{singular(self.kind)} {name!r} ({self.value(name)})"

    def distribution(self, name: str) -> str | None:
        """Return package, version and entry point of an extension; None if it is built-in or unknown.

        Extensions of a project that is not installed have no package.
        """
        point = self._points.get(name)
        if point is None or point.value.split(".")[0].split(":")[0] in _BUILT_IN:
            return None
        return f"{point.dist.name} {point.dist.version} ({point.value})" if point.dist is not None else point.value

    def unknown(self, name: str, *, also: Iterable[str] = (), source: str = "", line: int | None = None) -> Diagnostic:
        """Return the diagnostic of a name that no extension has; hints list the names in `also` as well."""
        hint = suggestion(name, [*self._points, *also])
        return Diagnostic(f"unknown {singular(self.kind)} {quoted(name)}", hint, source, line)

    def load(self, name: str, base: type | None = None) -> Any:
        """Return the extension of that name, a class derived from `base`.

        Raise SettingError if there is none. Raise RegistryError if it does not import, is not derived from `base`,
        lacks an abstract method of its base class, or defines one with an incompatible signature.
        """
        point = self._points.get(name)
        if point is None:
            raise SettingError(self.unknown(name))
        extension = self._import(point)
        if extension in _checked.get((self.kind, name, base), ()):
            return extension
        described = self.describe(name)
        if base is not None and not (isinstance(extension, type) and issubclass(extension, base)):
            got = extension.__name__ if isinstance(extension, type) else f"an object of type {type(extension).__name__}"
            raise RegistryError(f"{described} is not a class derived from {base.__name__} (got {got})")
        if inspect.isabstract(extension):
            missing = ", ".join(sorted(extension.__abstractmethods__))
            raise RegistryError(f"{described} lacks {missing}")
        if isinstance(extension, type) or inspect.isfunction(extension):
            _loaded.setdefault(extension, Registration(singular(self.kind), name, point.value))
        if isinstance(extension, type):
            for mismatch in _signature_mismatches(extension):
                raise RegistryError(f"{described}: {mismatch}")
            _checked[self.kind, name, base] = (extension,)
        return extension

    def _import(self, point: EntryPoint) -> Any:
        try:
            return point.load()
        except (Exception, SystemExit) as error:
            location = _raised_at(error)
            text = str(error) if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: {error}"
            location = f" ({location})" if location else ""
            raise RegistryError(f"{self.describe(point.name)} does not load: {text}{location}") from error


_checked: dict[tuple[str, str, type | None], tuple[Any, ...]] = {}
"""Extensions that passed all checks, by kind, name and base class."""


def _declared(kind: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of one kind, of installed packages and of the selected project."""
    own = project_entry_points().get(kind, ())
    return (*_installed(tuple(sys.path)).get(kind, ()), *own)


@cache
def _installed(folders: tuple[str, ...]) -> dict[str, tuple[EntryPoint, ...]]:
    """Return the entry points of all packages in the folders of `sys.path` by kind; each file is read once."""
    installed = entry_points()
    return {kind: tuple(installed.select(group=f"eidrive_scenario.{kind}")) for kind in GROUPS}


_registries: dict[str, Registry] = {}
_imported: set[Path] = set()
"""Folders of projects whose modules are imported, or are being imported."""
_callers: dict[tuple[str, str], set[str]] = {}
"""Modules that registered an extension in code, by its kind and name."""


def registry(kind: str) -> Registry:
    """Return the registry of one kind; it is read once per process.

    The first call imports the modules that the selected project names, which may register extensions.
    """
    if kind not in _registries:
        folder = selected_project()
        if folder is not None:
            project_entry_points()  # puts the folders of the modules on the path of imports
            _import_modules(folder)
        if kind not in _registries:  # a module of the project may have called this function
            _registries[kind] = Registry(kind)
    return _registries[kind]


def _import_modules(folder: Path) -> None:
    """Import the modules of a project once. Raise RegistryError if one does not import."""
    if folder in _imported:
        return
    _imported.add(folder)
    for name in modules_of(folder):
        try:
            importlib.import_module(name)
        except BaseException as error:
            _imported.discard(folder)
            if not isinstance(error, Exception | SystemExit):
                raise
            location = _raised_at(error)
            text = f"{type(error).__name__}: {error}" + (f" ({location})" if location else "")
            if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
                text += "; name its folder in pythonpath"
            raise RegistryError(f"module {name!r} of the project {folder} does not import: {text}") from error


def register(kind: str, name: str, value: str) -> None:
    """Register an extension of a project that is not installed, such as in `conftest.py`.

    kind   group of its entry point, such as `criteria`
    value  `package.module:Object`; the module must be importable

    Raise RegistryError for an unknown kind, a value of another form, or a name that another extension has.
    """
    if kind not in GROUPS:
        raise RegistryError(f"unknown kind of extensions {kind!r}; {suggestion(kind, GROUPS)}")
    if EntryPoint.pattern.match(value) is None or ":" not in value:
        raise RegistryError(f"extension {name!r}: {value!r} is not an object (expected package.module:Object)")
    registry(kind).add(name, value)
    _callers.setdefault((kind, name), set()).add(sys._getframe(1).f_globals.get("__name__", ""))


def has_unnamed_registrations() -> bool:
    """Whether code that the selected project does not name has registered an extension, such as a `conftest.py`.

    Another process, such as `eidrive run`, does not know these extensions.
    """
    folder = selected_project()
    modules = () if folder is None else modules_of(folder)
    points = {} if folder is None else entry_points_of(folder)
    named = {(kind, point.name) for kind, several in points.items() for point in several}
    return any(
        key not in named and key[1] in registry(key[0]) and callers.isdisjoint(modules)
        for key, callers in _callers.items()
    )


def use_project(folder: str) -> None:
    """Use the extensions of a project in a process that may have read its registries before.

    Raise SettingError for an invalid project, and RegistryError if another extension has one of the names.
    """
    for kind, points in entry_points_of(Path(folder)).items():
        for point in points:
            registry(kind).add(point.name, point.value)
    _import_modules(Path(folder))


def distributions(used: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return the distributions of third-party extensions by `group.name`, of these pairs of group and name."""
    by_extension = {f"{kind}.{name}": registry(kind).distribution(name) for kind, name in sorted(used)}
    return {name: distribution for name, distribution in by_extension.items() if distribution is not None}


def singular(kind: str) -> str:
    """Return the noun for one extension of a kind, such as `detector`."""
    return _SINGULAR.get(kind, kind.removesuffix("s"))


def construct(extension_class: Any, *arguments: Any, **keywords: Any) -> Any:
    """Return an instance of an extension. Raise InvalidResult if its constructor does not take these arguments."""
    try:
        return extension_class(*arguments, **keywords)
    except TypeError as error:
        if error.__traceback__ is not None and error.__traceback__.tb_next is None:
            raise InvalidResult(extension_class, "__init__", f"cannot be called: TypeError: {error}") from error
        raise


def third_party_files() -> dict[str, dict[str, Registration]]:
    """Return the registrations of loaded third-party extensions, by file and qualified name of their classes."""
    files: dict[str, dict[str, Registration]] = {}
    for extension_class, registered in _loaded.items():
        file = getattr(sys.modules.get(extension_class.__module__), "__file__", None)
        if file is not None and not is_built_in(extension_class):
            files.setdefault(file, {})[extension_class.__qualname__] = registered
    return files


def registration(extension_class: type) -> Registration | None:
    """Return the registration of a class or of its nearest loaded base class, or None."""
    for base in extension_class.__mro__:
        if base in _loaded:
            return _loaded[base]
    return None


def is_built_in(extension_class: type) -> bool:
    """Whether a class is part of this project."""
    return extension_class.__module__.partition(".")[0] in _BUILT_IN


def _signature_mismatches(extension_class: type) -> Iterator[str]:
    """Yield methods of a third-party class that cannot be called like the methods that they override."""
    bases = [base for base in extension_class.__mro__ if is_built_in(base)]
    for own_class in extension_class.__mro__:
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
            elif difference := _signature_difference(own, plain, expected):
                yield f"{name}{difference}"


def _signature_difference(own: Any, plain: Any, expected: Any) -> str:
    """Return why a call of a method with the signature of its base class fails; "" if it succeeds."""
    wanted = inspect.signature(expected)
    try:
        given = inspect.signature(plain)
    except (TypeError, ValueError):
        return ""
    parameters = wanted.parameters.values()
    named = {parameter.name: None for parameter in parameters if parameter.kind is parameter.KEYWORD_ONLY}
    positional = [
        None
        for parameter in parameters
        if parameter.kind in (parameter.POSITIONAL_ONLY, parameter.POSITIONAL_OR_KEYWORD)
    ]
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
