"""Rules about the road file itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from eidrive_scenario.checks.road_rules.context import RoadLintContext
from eidrive_scenario.errors import Diagnostic


def map_warning_rule(rule: str) -> Callable[[RoadLintContext], Iterator[Diagnostic]]:
    """What the road network itself finds doubtful in its file, of one rule."""

    def check(context: RoadLintContext) -> Iterator[Diagnostic]:
        if context.roads is not None:
            yield from (diagnostic for diagnostic in context.roads.map_warnings if diagnostic.rule == rule)

    return check
