"""Errors that are nobody's input end with exit code 3, and tell where on demand only."""

from collections.abc import Callable

import pytest
from typer.testing import Result

from eidrive_scenario import library
from eidrive_scenario.errors import SimulationError

Eidrive = Callable[..., Result]


def break_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def broken() -> list[str]:
        raise error

    monkeypatch.setattr(library, "scenarios", broken)


def test_an_internal_error_is_short(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, ZeroDivisionError("division by zero"))
    result = eidrive("list")
    assert result.exit_code == 3
    assert result.stderr.splitlines()[0] == "internal error: ZeroDivisionError: division by zero"
    assert "--traceback" in result.stderr


def test_a_broken_run_says_so(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, SimulationError("the physics exploded"))
    result = eidrive("list")
    assert (result.exit_code, result.stderr) == (3, "the run broke: the physics exploded\n")


def test_on_demand_it_shows_where(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, ZeroDivisionError("division by zero"))
    asked = eidrive("--traceback", "list")
    assert asked.exit_code == 3
    assert "Traceback (most recent call last)" in asked.stderr
    assert asked.stderr.rstrip().endswith("ZeroDivisionError: division by zero")
    monkeypatch.setenv("EIDRIVE_TRACEBACK", "1")
    assert "Traceback (most recent call last)" in eidrive("list").stderr


def test_an_interrupt_is_no_verdict(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, KeyboardInterrupt())
    assert eidrive("list").exit_code == 130


def test_a_wrong_command_is_a_wrong_input(eidrive: Eidrive) -> None:
    assert eidrive("rum").exit_code == 2
    assert eidrive("run", "--no-such-option").exit_code == 2
