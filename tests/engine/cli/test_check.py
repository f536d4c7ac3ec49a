"""`eidrive check`: every mistake of every file."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

Eidrive = Callable[..., Result]


@pytest.fixture
def folder(tmp_path: Path, passing_by: Path) -> Callable[..., Path]:
    """A folder with the scenario, and with copies in which one text stands in place of another."""

    def fill(**replacements: tuple[str, str]) -> Path:
        text = passing_by.read_text(encoding="utf-8")
        (tmp_path / "right.xosc").write_text(text, encoding="utf-8")
        for name, (old, new) in replacements.items():
            assert old in text
            (tmp_path / f"{name}.xosc").write_text(text.replace(old, new, 1), encoding="utf-8")
        return tmp_path

    return fill


def test_nothing_wrong(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    result = eidrive("check", folder())
    assert (result.exit_code, result.stdout) == (0, "1 file, 0 problems, 0 warnings\n")


def test_all_mistakes_of_all_files(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    place = folder(
        criterion=("min_distance: {of: Ego, to: Parked", "min_distance: {of: Ego, to: Parkd"),
        command=('type="eidrive.criterion"', 'type="eidrive.criterium"'),
        dynamics=('dynamicsShape="step"', 'dynamicsShape="stp"'),
    )
    result = eidrive("check", place)
    assert result.exit_code == 2, result.output
    lines = result.stdout.splitlines()
    assert any(line.startswith(f"{place}/criterion.xosc:47: ") and "did you mean 'Parked'?" in line for line in lines)
    assert any(line.startswith(f"{place}/command.xosc:45: ") and "'eidrive.criterion'?" in line for line in lines)
    assert any(line.startswith(f"{place}/dynamics.xosc:61: ") and "'step'?" in line for line in lines)
    assert lines[-1] == "4 files, 3 problems, 0 warnings"
    assert result.stderr == ""


def test_what_is_not_judged_is_a_warning(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    condition = (
        '<Condition name="criteria_KeepLaneTest" delay="0" conditionEdge="rising"><ByValueCondition>'
        '<ParameterCondition parameterRef="" value="" rule="lessThan"/></ByValueCondition></Condition>'
    )
    place = folder(runner=("<ConditionGroup>", f"<ConditionGroup>{condition}"))
    result = eidrive("check", place / "runner.xosc")
    assert result.exit_code == 0, result.output
    assert "criterion 'KeepLaneTest' is not judged" in result.stdout
    assert result.stdout.splitlines()[-1] == "1 file, 0 problems, 1 warning"


def test_a_folder_without_scenarios(eidrive: Eidrive, tmp_path: Path) -> None:
    result = eidrive("check", tmp_path)
    assert result.exit_code == 2
    assert "no .xosc file in" in result.stderr
