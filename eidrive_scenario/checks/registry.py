"""All rules of `eidrive check`, and what they find in a scenario that could be read."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from eidrive_scenario.checks.road_rules import ROAD_RULES, RoadLintContext
from eidrive_scenario.checks.scenario_rules import RULES, Level, Rule
from eidrive_scenario.errors import Diagnostic, InputError, SettingError, suggestion
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.roads import RoadNetwork

ALL_RULES: tuple[Rule[RoadLintContext], ...] = (*RULES, *ROAD_RULES)


def run_rules(scenario: Scenario, ignored: Collection[str] = ()) -> Iterator[tuple[Level, Diagnostic]]:
    """What the rules find, but for those whose names are ignored; without those on roads where these cannot be read.

    Raises SettingError if a rule is to be ignored that does not exist.
    """
    check_rule_names(ignored)
    chosen = ALL_RULES
    roads = None
    try:
        roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    except InputError:
        chosen = RULES
    context = RoadLintContext(scenario, roads)
    for rule in chosen:
        if rule.name not in ignored:
            for diagnostic in rule.run(context):
                yield rule.level, diagnostic


def check_rule_names(ignored: Collection[str]) -> None:
    """Raises SettingError if a rule is to be ignored that does not exist."""
    known = {rule.name for rule in ALL_RULES}
    for name in ignored:
        if name not in known:
            raise SettingError(Diagnostic(f"there is no rule {name!r}", suggestion(name, known)))
