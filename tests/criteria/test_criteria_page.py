"""The page of criteria and the list of the command line name every registered criterion."""

import re
from pathlib import Path

from eidrive_scenario.evaluation.criterion import describe_criteria
from eidrive_scenario.extensions.registry import registry

PAGE = Path(__file__).parents[2] / "docs" / "criteria.md"


def test_page_defines_every_criterion_with_its_settings() -> None:
    rows = dict(re.findall(r"^\| `([a-z_]+)` \| (.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    assert set(rows) == set(registry("criteria"))
    for name, unit, settings, _ in describe_criteria():
        text = rows[name] + (PAGE.read_text(encoding="utf-8") if "parameters below" in rows[name] else "")
        for setting in settings.strip("{}").split(", "):
            assert f"`{re.split('[?:]', setting)[0]}" in text, f"{name}: {setting}"
        assert unit == "-" or f"[{unit}]" in rows[name], name


def test_list_describes_unit_settings_and_definition() -> None:
    found = {name: rest for name, *rest in describe_criteria()}
    unit, settings, text = found["time_headway"]
    assert (unit, settings) == ("s", "{of, to?, at_least?}")
    assert text.startswith("fails if the time headway falls below")
    assert all(text for *_, text in found.values())
