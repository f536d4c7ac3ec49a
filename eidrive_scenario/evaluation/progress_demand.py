"""Warning about criteria that a vehicle fulfills by standing still."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Set as AbstractSet

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.evaluation.criteria_parser import EXITS
from eidrive_scenario.evaluation.criterion import Criterion
from eidrive_scenario.openscenario import Scenario


def progress_warnings(
    scenario: Scenario, criteria: Iterable[Criterion], drivers: AbstractSet[str]
) -> tuple[Diagnostic, ...]:
    """Return a warning if no criterion demands progress of a vehicle that drives itself.

    criteria  all criteria of a run, including those that later events declare
    drivers   vehicles that a driving stack drives

    Without criteria, without drivers, and with an exit command of the scenario there is none.
    """
    declared = list(criteria)
    has_exit = any(command.type in EXITS for command in scenario.custom_commands)
    demanded = any(one.demands_progress and not drivers.isdisjoint(one.subjects) for one in declared)
    if not declared or not drivers or has_exit or demanded:
        return ()
    names = " or ".join(sorted(drivers))
    message = f"no criterion demands that {names} drives on: a vehicle that stands still passes"
    hint = f"add one such as driven_distance: {{of: {min(drivers)}, at_least: 50}}, reached_region or route_completion"
    return (Diagnostic(message, hint, str(scenario.path or "")),)
