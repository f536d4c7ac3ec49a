"""Commands by name: those of the engine, and those of other packages by their entry points `eidrive_scenario.commands`.

The module of a command is imported when the command is executed or described.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any

import typer
from typer.main import get_command

from eidrive_scenario.cli.short_help import ShortHelp
from eidrive_scenario.registry import registry

FUNCTIONS = {
    "run": "run:run",
    "check": "check:check",
    "list": "show:list_names",
    "tree": "show:tree",
    "view": "show:view",
    "judge": "judge:judge",
    "export": "export:export",
    "report": "show:report",
    "sweep": "sweep:sweep",
    "results": "sweep:results",
    "compare": "compare:compare",
    "init": "init:init",
}
"""Module of this package and function of each command, in the order of the help."""
_SHORT = frozenset({"run", "check", "sweep"})
"""Commands with options that only `--help-all` describes."""


class CommandTable(Mapping[str, Any]):
    """Commands of the command line by name, each created on its first access."""

    def __init__(self) -> None:
        self._created: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        """Return a command. Raise KeyError if none has this name."""
        if name not in self._created:
            self._created[name] = _create(name, _function(name))
        return self._created[name]

    def __iter__(self) -> Iterator[str]:
        return iter([*FUNCTIONS, *(name for name in registry("commands") if name not in FUNCTIONS)])

    def __len__(self) -> int:
        return len(list(iter(self)))


def _function(name: str) -> Callable[..., Any]:
    """Return the function of a command. Those of the engine come first, so that no package replaces them."""
    if name not in FUNCTIONS:
        if name not in registry("commands"):
            raise KeyError(name)
        function: Callable[..., Any] = registry("commands").load(name)
        return function
    module, _, function_name = FUNCTIONS[name].partition(":")
    return getattr(import_module(f"eidrive_scenario.cli.{module}"), function_name)  # type: ignore[no-any-return]


def _create(name: str, function: Callable[..., Any]) -> Any:
    app = typer.Typer(add_completion=False)
    app.command(name=name, cls=ShortHelp if name in _SHORT else None)(function)
    return get_command(app)
