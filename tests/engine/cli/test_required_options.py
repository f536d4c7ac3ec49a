"""Options that have no effect without another one."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_fixtures import Eidrive


@pytest.mark.parametrize(
    ("command", "option", "required"),
    [
        ("run", ("--confidence", "0.9"), "--success-rate"),
        ("run", ("--record", "always"), "--out"),
        ("sweep", ("--bound", "0.9"), "--find-boundary"),
        ("sweep", ("--tolerance", "0.1"), "--find-boundary"),
        ("sweep", ("--objective", "wall_s"), "--falsify"),
    ],
)
def test_option_without_the_one_it_belongs_to_is_refused(
    eidrive: Eidrive, passing_by: Path, command: str, option: tuple[str, str], required: str
) -> None:
    store = ("--store", passing_by.with_name("s.db"), "--dry-run") if command == "sweep" else ()
    result = eidrive(command, passing_by, *store, *option)
    assert result.exit_code == 2
    assert f"{option[0]} without {required} has no effect" in result.stderr
