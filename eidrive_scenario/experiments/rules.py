"""All rules of `eidrive check`, and what they find in a scenario that could be read."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from eidrive_scenario.errors import InputError, Problem, SettingError, suggestion
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.lint import RULES, Level, Rule
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.lint import ROAD_RULES, RoadSurvey

ALL_RULES: tuple[Rule[RoadSurvey], ...] = (*RULES, *ROAD_RULES)


def broken_rules(scenario: Scenario, ignored: Collection[str] = ()) -> Iterator[tuple[Level, Problem]]:
    """What the rules find, but for those whose names are ignored; without those on roads where these cannot be read.

    Raises SettingError if a rule is to be ignored that does not exist.
    """
    check_names(ignored)
    chosen = ALL_RULES
    roads = None
    try:
        roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    except InputError:
        chosen = RULES
    survey = RoadSurvey(scenario, roads)
    for rule in chosen:
        if rule.name not in ignored:
            for problem in rule.findings(survey):
                yield rule.level, problem


def check_names(ignored: Collection[str]) -> None:
    """Raises SettingError if a rule is to be ignored that does not exist."""
    known = {rule.name for rule in ALL_RULES}
    for name in ignored:
        if name not in known:
            raise SettingError(Problem(f"there is no rule {name!r}", suggestion(name, known)))
