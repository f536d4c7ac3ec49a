"""Lint context of the rules without roads; results are computed once, on first use."""

from __future__ import annotations

from functools import cached_property

from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.checks.scenario_rules.reachability import ReachabilityAnalysis, TriggerAnalysis


class LintContext(Outline):
    """Outline of a scenario and the analysis of its triggers."""

    @cached_property
    def triggers(self) -> tuple[TriggerAnalysis, ...]:
        """Return the analyses of all triggers that are evaluated at some time."""
        return tuple(ReachabilityAnalysis(self).triggers())
