"""Fixtures that execute the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import pytest
from typer.testing import CliRunner, Result

from eidrive_scenario.cli import app


class Eidrive(Protocol):
    """A function that executes a command line and returns its result."""

    def __call__(self, *arguments: str | Path | float) -> Result: ...


@pytest.fixture
def eidrive(monkeypatch: pytest.MonkeyPatch) -> Eidrive:
    """Return a function that executes `eidrive("run", path, …)`, with a console of 200 columns."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.delenv("EIDRIVE_TRACEBACK", raising=False)

    def invoke(*arguments: str | Path | float) -> Result:
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    return invoke


@pytest.fixture
def passing_by() -> Path:
    """Return a scenario in which Ego passes a parked car with 5 m between the centers; OtherY=0 is a collision."""
    return Path(__file__).parents[2] / "data" / "passing_by.xosc"
