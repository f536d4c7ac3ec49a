"""Registry of all rules of `eidrive check`, and their evaluation on scenarios and road files."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from eidrive_scenario.checks.road_rules import ROAD_FILE_RULES, ROAD_RULES, RoadFileContext, RoadLintContext
from eidrive_scenario.checks.rule import Level, Rule, S
from eidrive_scenario.checks.scenario_rules import RULES
from eidrive_scenario.errors import Diagnostic, InputError, SettingError, suggestion
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.roads import RoadNetwork

ALL_RULES: tuple[Rule[RoadLintContext], ...] = (*RULES, *ROAD_RULES, *ROAD_FILE_RULES)
"""All rules; each name, level and summary is defined once."""


def run_rules(
    scenario: Scenario, ignored: Collection[str] = (), added: Iterable[str | Path] = ()
) -> Iterator[tuple[Level, Diagnostic]]:
    """Yield the diagnostics of all rules except `ignored`; if the road file is invalid, only of rules without roads.

    added  criteria and driving stacks of the run, YAML texts or files, which may refer to parameters

    Raise SettingError if `ignored` has an unknown name.
    """
    check_rule_names(ignored)
    rules = ALL_RULES
    roads = None
    try:
        roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    except InputError:
        rules = RULES
    yield from _run(rules, RoadLintContext(scenario, roads, tuple(added)), ignored)


def run_road_file_rules(roads: RoadNetwork, ignored: Collection[str] = ()) -> Iterator[tuple[Level, Diagnostic]]:
    """Yield the diagnostics of the rules about road files, except `ignored`.

    Raise SettingError if `ignored` has an unknown name.
    """
    check_rule_names(ignored)
    yield from _run(ROAD_FILE_RULES, RoadFileContext(roads), ignored)


def check_rule_names(ignored: Collection[str]) -> None:
    """Raise SettingError if `ignored` has an unknown name."""
    known = {rule.name for rule in ALL_RULES}
    for name in ignored:
        if name not in known:
            raise SettingError(Diagnostic(f"unknown rule {name!r}", suggestion(name, known)))


def _run(rules: Iterable[Rule[S]], context: S, ignored: Collection[str]) -> Iterator[tuple[Level, Diagnostic]]:
    for rule in rules:
        if rule.name not in ignored:
            for diagnostic in rule.run(context):
                yield rule.level, diagnostic
