"""Attribution of errors to extensions: the extension that raised an exception, its station or actor, and the line.

The stack of the exception contains this information: the frame of a method of an extension has the extension as first
argument, and the outer frames belong to the station, action or condition that called it. An object on the stack states
its station, actor or element by its property `error_subject`. Runs without errors need no additional time.
"""

from __future__ import annotations

import ast
import functools
import importlib.util
import inspect
import os
import re
import sys
import traceback
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, ParamSpec, TypeVar

from eidrive_scenario.base.wall_limit import Limit, LimitReached, current_limit
from eidrive_scenario.errors import ExtensionError, ExtensionPlace, InputError, InvalidResult, WallLimitError
from eidrive_scenario.extensions.project import GROUPS
from eidrive_scenario.extensions.registry import (
    Registration,
    is_built_in,
    registration,
    registry,
    singular,
    third_party_files,
)
from eidrive_scenario.files.encodable import encodable

_ABSENT = object()
_CONTROL_FLOW = ("_pytest", "asyncio")
"""Packages whose exceptions end a test or task on purpose, wherever they are raised."""


class _Call(NamedTuple):
    """A frame of a stack with the line that it executes."""

    frame: FrameType
    line: int

    @property
    def subject(self) -> Any:
        """First argument: the object or class of a method."""
        code = self.frame.f_code
        return self.frame.f_locals.get(code.co_varnames[0], _ABSENT) if code.co_argcount else _ABSENT

    @property
    def file(self) -> str:
        return self.frame.f_code.co_filename

    @property
    def function(self) -> str:
        return self.frame.f_code.co_name


def report_extension(error: BaseException, *, time: float | None = None, observers: Collection[object] = ()) -> None:
    """Raise ExtensionError from `error` if an extension raised it; return otherwise.

    time       simulated time [s]; None before the run
    observers  of the run: those that are no part of this project count as extensions

    Raise WallLimitError instead if the wall limit of the run was reached. Errors of the input, interruptions by the
    user and errors that are attributed already are left as they are.
    """
    if isinstance(error, InputError | KeyboardInterrupt | ExtensionError | WallLimitError):
        return
    calls = [_Call(frame, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    if isinstance(error, LimitReached):
        limit = current_limit()
        seconds = 0.0 if limit is None else limit.seconds
        if limit is not None:
            limit.disarm()
        raise _wall_limit_error(calls, seconds, time, observers) from error
    if isinstance(error, InvalidResult):
        raise ExtensionError(_place_of_method(error, calls, time), encodable(str(error))) from error.__cause__
    place = _extension_place(calls, time, observers)
    if place is None or type(error).__module__.partition(".")[0] in _CONTROL_FLOW:
        return
    raise ExtensionError(place, encodable(_diagnostic(error, calls, place))) from error


Result = TypeVar("Result")
Parameters = ParamSpec("Parameters")


def attributed(method: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Let a method of a Simulation raise ExtensionError where an extension that it calls raises an exception."""

    @functools.wraps(method)
    def call(*given: Parameters.args, **named: Parameters.kwargs) -> Result:
        try:
            return method(*given, **named)
        except BaseException as error:
            simulation: Any = given[0]
            simulation.attribute(error)
            raise

    return call


def wall_limit_error(
    frame: FrameType | None, limit: float, *, time: float | None = None, observers: Collection[object] = ()
) -> WallLimitError:
    """Return the error of a run that executes this frame when its limit of wall time [s] is reached."""
    calls = [_Call(caller, line) for caller, line in traceback.walk_stack(frame)][::-1]
    return _wall_limit_error(calls, limit, time, observers)


def _extension_place(
    calls: Sequence[_Call], time: float | None, observers: Collection[object]
) -> ExtensionPlace | None:
    """Return the outermost extension of a stack, a third-party one if there is one; None without extensions."""
    extensions: list[tuple[int, Registration]] = []
    for index, call in enumerate(calls):
        subject = call.subject
        if any(subject is observer for observer in observers) and not is_built_in(type(subject)):
            extensions.append((index, Registration("observer", type(subject).__name__, "")))
        elif subject is not _ABSENT and (registered := registration(_class_of(subject))) is not None:
            extensions.append((index, registered))
    third_party = [entry for entry in extensions if not is_built_in(_class_of(calls[entry[0]].subject))] or _by_file(
        calls
    )
    if not third_party and not extensions:
        return None
    index, (kind, name, value) = (third_party or extensions)[0]
    at = _innermost_own(calls, index)
    file, line = _definition(calls[index].subject) if at is None else (at.file, at.line)
    function = (at or calls[index]).function
    return ExtensionPlace(kind, name, value, _subject_of(calls), time, file, line, function)


def _wall_limit_error(
    calls: Sequence[_Call], limit: float, time: float | None, observers: Collection[object]
) -> WallLimitError:
    calls = [call for call in calls if Path(call.file).name not in ("wall_limit.py", "threading.py")]
    place = _extension_place(calls, time, observers)
    last = calls[-1] if calls else None
    where = "" if last is None else f"{last.file}:{last.line} in {last.function}"
    return WallLimitError(limit, place, time, where)


def traceback_from_extension(error: ExtensionError) -> str:
    """Return the traceback of the exception that an extension raised, from the extension's own frames on."""
    cause = error.__cause__
    if cause is None:
        return ""
    entries = traceback.extract_tb(cause.__traceback__)
    first = next((index for index, entry in enumerate(entries) if entry.filename == error.place.file), 0)
    shown = traceback.format_list(entries[first:]) + traceback.format_exception_only(type(cause), cause)
    return "".join(shown)


def _class_of(subject: Any) -> type:
    return subject if isinstance(subject, type) else type(subject)


def _by_file(calls: Sequence[_Call]) -> list[tuple[int, Registration]]:
    """Return the calls in modules of third parties without an object, such as static methods, with their extensions."""
    files = third_party_files()
    extensions = []
    for index, call in enumerate(calls):
        if classes := files.get(call.file):
            owner = call.frame.f_code.co_qualname.rpartition(".")[0]
            extensions.append((index, classes.get(owner) or next(iter(classes.values()))))
    return extensions


def _innermost_own(calls: Sequence[_Call], index: int) -> _Call | None:
    """Return the last call within the package of an extension, from its first frame on."""
    subject = calls[index].subject
    if calls[index].file in third_party_files():
        own = _files_of(str(calls[index].frame.f_globals.get("__name__")))
    else:
        own = _files_of(_class_of(subject).__module__)
    return next((call for call in reversed(calls[index:]) if _is_within(call, own)), None)


def _definition(subject: Any) -> tuple[str, int | None]:
    """Return file and line of the class of an extension, or of one of its methods."""
    definition = subject if isinstance(subject, type) or inspect.isroutine(subject) else type(subject)
    try:
        return inspect.getsourcefile(definition) or "", inspect.getsourcelines(definition)[1]
    except (OSError, TypeError):
        return "", None


def _files_of(module: str) -> tuple[str, ...]:
    """Return the file of a module, or the folders of its topmost package, which end with a slash."""
    top = sys.modules.get(module.partition(".")[0])
    paths = [*getattr(top, "__path__", ())]
    file = getattr(sys.modules.get(module), "__file__", None)
    return tuple(str(Path(path)) + "/" for path in paths) or ((str(file),) if file else ())


def _is_within(call: _Call, own: tuple[str, ...]) -> bool:
    return any(call.file == path or (path.endswith("/") and call.file.startswith(path)) for path in own)


def _subject_of(calls: Sequence[_Call]) -> str:
    """Return the station, actor or element that the innermost call with an `error_subject` states; "" without one."""
    return next((text for call in reversed(calls) if (text := _error_subject(call.subject))), "")


def _error_subject(instance: Any) -> str:
    """Return the property `error_subject` of an object; "" for other objects, and before its attributes are set."""
    if not isinstance(getattr(type(instance), "error_subject", None), property):
        return ""
    try:
        return str(instance.error_subject)
    except AttributeError:
        return ""


def _place_of_method(error: InvalidResult, calls: Sequence[_Call], time: float | None) -> ExtensionPlace:
    """Return the definition of the method that returned an invalid result."""
    extension = error.extension
    kind, name, value = registration(_class_of(extension)) or ("extension", type(extension).__name__, "")
    subject = _error_subject(extension) or _subject_of(calls)
    method = getattr(extension, error.method, None)
    file, line = _definition(method if inspect.isroutine(method) else extension)
    return ExtensionPlace(kind, name, value, subject, time, file, line, error.method)


def _diagnostic(error: BaseException, calls: Sequence[_Call], place: ExtensionPlace) -> str:
    """Return the exception in one line, and the location of the raise if it is not in the extension's own code."""
    text = "".join(traceback.format_exception_only(type(error), error)).strip()
    if isinstance(error, SystemExit):
        text = f"SystemExit: {error.code!r} (an extension cannot end the process)"
    last = calls[-1]
    if (last.file, last.line) != (place.file, place.line):
        text += f" (raised at {last.file}:{last.line})"
    return text


_ENGINE = Path(__file__).parents[1]
_FOLDERS = tuple(f'File "{_ENGINE / package}{os.sep}' for package in ("simulation", "checks"))
"""Beginnings of lines of faulthandler that only the thread of a run or a check has: files of these packages."""
_DUMPED = re.compile(r'^  File "(.+)", line (\d+) in (.+)$', re.MULTILINE)


def describe_hung_run(limit: Limit, frame: FrameType | None) -> WallLimitError:
    """Return the error of a run that executes this frame, and close the files of its observers."""
    try:
        for caller, _ in traceback.walk_stack(frame):
            run: Any = caller.f_locals.get("self")
            if hasattr(type(run), "describe_hang") and hasattr(run, "world"):
                error: WallLimitError = run.describe_hang(limit.seconds, frame)
                return error
        return wall_limit_error(frame, limit.seconds)
    except Exception:  # the thread of the run may change what is read here, and the report must not be lost
        return WallLimitError(limit.seconds)


def describe_dump(limit: float, dump: str) -> WallLimitError:
    """Return the error of a run or check that ended with a dump of its stack by faulthandler."""
    threads = re.split(r"^(?:Current thread|Thread) .*$", dump, flags=re.MULTILINE)
    of_run = next((text for text in threads if any(folder in text for folder in _FOLDERS)), dump)
    calls = [(file, int(line), function) for file, line, function in _DUMPED.findall(of_run)]
    for file, line, function in calls:
        for kind, name, value in _extensions_at(file, line):
            place = ExtensionPlace(kind, name, value, file=file, line=line, function=function)
            return WallLimitError(limit, place)
    where = "{}:{} in {}".format(*calls[0]) if calls else ""
    return WallLimitError(limit, where=where)


def _extensions_at(file: str, line: int) -> Iterator[Registration]:
    """Yield third-party extensions whose class contains a line; if there is none, those of the module."""
    of_module = []
    for group in GROUPS:
        registered = registry(group)
        for name in registered:
            value = registered.value(name)
            module, _, attribute = value.partition(":")
            if _file_of(module) != file:
                continue
            of_module.append(Registration(singular(group), name, value))
            if line in _lines_of(file).get(attribute.strip(), range(0)):
                yield of_module[-1]
    yield from of_module


@cache
def _file_of(module: str) -> str:
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return ""
    return (spec.origin or "") if spec is not None else ""


@cache
def _lines_of(file: str) -> dict[str, range]:
    """Return the line range of each class of a module."""
    try:
        tree = ast.parse(Path(file).read_bytes())
    except (OSError, SyntaxError, ValueError):
        return {}
    return {
        node.name: range(node.lineno, (node.end_lineno or node.lineno) + 1)
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    }
