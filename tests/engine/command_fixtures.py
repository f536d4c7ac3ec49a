"""The command line as a function."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from eidrive_scenario.cli import app

Eidrive = Callable[..., Result]


@pytest.fixture
def eidrive(monkeypatch: pytest.MonkeyPatch) -> Eidrive:
    """`eidrive("run", path, …)`: exit code, stdout and stderr; wide enough for a message on one line."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.delenv("EIDRIVE_TRACEBACK", raising=False)

    def invoke(*arguments: str | Path) -> Result:
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    return invoke


@pytest.fixture
def passing_by() -> Path:
    """The Ego passes a parked car at 5 m between the centers; `--param OtherY=0` makes them collide."""
    return Path(__file__).parents[1] / "data" / "passing_by.xosc"
