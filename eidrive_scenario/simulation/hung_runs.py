"""Error reports of runs and checks that cannot be interrupted.

The source is the frame of a thread, or the stack that faulthandler wrote.
"""

from __future__ import annotations

import ast
import importlib.util
import os
import re
import traceback
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import FrameType

from eidrive_scenario.errors import ExtensionPlace, WallLimitError
from eidrive_scenario.registry import GROUPS, Registration, registry, singular
from eidrive_scenario.simulation.attribution import wall_limit_error
from eidrive_scenario.simulation.simulation import Simulation
from eidrive_scenario.wall_limit import Limit

_ENGINE = Path(__file__).parents[1]
_FOLDERS = tuple(f'File "{_ENGINE / package}{os.sep}' for package in ("simulation", "checks"))
"""Beginnings of lines of faulthandler that only the thread of a run or a check has: files of these packages."""
_DUMPED = re.compile(r'^  File "(.+)", line (\d+) in (.+)$', re.MULTILINE)


def describe_hung_run(limit: Limit, frame: FrameType | None) -> WallLimitError:
    """Return the error of a run that executes this frame, and close the files of its observers."""
    try:
        for one, _ in traceback.walk_stack(frame):
            simulation = one.f_locals.get("self")
            if isinstance(simulation, Simulation) and hasattr(simulation, "world"):
                return simulation.describe_hang(limit.seconds, frame)
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
        known = registry(group)
        for name in known:
            value = known.value(name)
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
