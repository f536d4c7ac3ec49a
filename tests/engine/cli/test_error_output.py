"""Internal errors: exit code 3, and a traceback on request only."""

import pytest
from command_fixtures import Eidrive

from eidrive_scenario.errors import RegistryError, SimulationError
from eidrive_scenario.extensions import library


def break_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def broken() -> list[str]:
        raise error

    monkeypatch.setattr(library, "scenarios", broken)


def test_internal_error_is_printed_without_traceback(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, ZeroDivisionError("division by zero"))
    result = eidrive("list")
    assert result.exit_code == 3
    assert result.stderr.splitlines()[0] == "internal error: ZeroDivisionError: division by zero"
    assert "--traceback" in result.stderr


def test_simulation_error_is_printed_as_aborted_run(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, SimulationError("the physics exploded"))
    result = eidrive("list")
    assert (result.exit_code, result.stderr) == (3, "run aborted: the physics exploded\n")


def test_registry_error_outside_of_a_run_names_no_run(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, RegistryError("detector 'mine' (mine:Mine) does not load"))
    result = eidrive("list")
    assert (result.exit_code, result.stderr) == (3, "aborted: detector 'mine' (mine:Mine) does not load\n")


def test_traceback_option_prints_traceback(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, ZeroDivisionError("division by zero"))
    asked = eidrive("--traceback", "list")
    assert asked.exit_code == 3
    assert "Traceback (most recent call last)" in asked.stderr
    assert asked.stderr.rstrip().endswith("ZeroDivisionError: division by zero")
    monkeypatch.setenv("EIDRIVE_TRACEBACK", "1")
    assert "Traceback (most recent call last)" in eidrive("list").stderr


def test_keyboard_interrupt_ends_with_exit_code_130(eidrive: Eidrive, monkeypatch: pytest.MonkeyPatch) -> None:
    break_with(monkeypatch, KeyboardInterrupt())
    assert eidrive("list").exit_code == 130


def test_unknown_command_or_option_is_invalid_input(eidrive: Eidrive) -> None:
    assert eidrive("rum").exit_code == 2
    assert eidrive("run", "--no-such-option").exit_code == 2


def test_unknown_value_of_a_list_has_a_suggestion(eidrive: Eidrive) -> None:
    for arguments, expected in (
        (("list", "critera"), "unknown value 'critera'; did you mean 'criteria'?"),
        (("list", "zzz"), "unknown value 'zzz'; known: scenarios, catalogs"),
        (("run", "coop/scenario_1", "--record", "alway"), "unknown value 'alway'; did you mean 'always'?"),
    ):
        done = eidrive(*arguments)
        text = " ".join(done.stderr.replace("│", " ").split())
        assert (done.exit_code, expected in text, "Value error" in text) == (2, True, False), text
