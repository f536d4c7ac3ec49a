"""What the rules ask about a scenario; worked out once, when first asked."""

from __future__ import annotations

from functools import cached_property

from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.checks.scenario_rules.reachability import ReachabilityAnalysis, TriggerAnalysis


class LintContext(Outline):
    """The outline of a scenario, and what its triggers can ever see."""

    @cached_property
    def watches(self) -> tuple[TriggerAnalysis, ...]:
        """All triggers that are asked at all."""
        return tuple(ReachabilityAnalysis(self).watches())
