"""Triggers that are not evaluated while nothing changes that their conditions read."""

from __future__ import annotations

from collections import Counter
from itertools import product

import pytest
from openscenario_xml import object_xml, scenario_xml, variables_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    by_entity_xml,
    condition_xml,
    element_state_xml,
    end_xml,
    event_xml,
    group_xml,
    init_xml,
    maneuver_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.storyboard.state.element_states import ElementTransition, StateChange
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, TriggerHistory

CONDITIONS = {
    "fast": by_entity_xml('<SpeedCondition rule="greaterThan" value="5"/>'),
    "slow": by_entity_xml('<SpeedCondition rule="lessThan" value="5"/>'),
    "relative": by_entity_xml('<RelativeSpeedCondition entityRef="Other" rule="greaterThan" value="2"/>'),
    "braking": by_entity_xml('<AccelerationCondition rule="lessThan" value="-1" direction="longitudinal"/>'),
    "standing": by_entity_xml('<StandStillCondition duration="0.55"/>'),
    "far": by_entity_xml('<TraveledDistanceCondition value="6"/>'),
    "time": time_xml(2.35, "lessThan"),
    "exact time": time_xml(2.0, "equalTo"),
    "drive runs": element_state_xml("event", "drive", "runningState"),
    "drive ends": element_state_xml("event", "drive", "endTransition"),
    "stop starts": element_state_xml("event", "stop", "startTransition"),
}
"""Conditions on Ego, which drives from 1 s on and stops at 3 s, beside the standing car Other."""
NOTE = '<UserDefinedAction><CustomCommandAction type="note">text</CustomCommandAction></UserDefinedAction>'
EDGES = ("none", "rising", "falling", "risingOrFalling")


def noted(name: str, *conditions: str) -> str:
    """Return an event that starts with one group of conditions."""
    return event_xml(name, NOTE, trigger_xml("".join(conditions)))


def events() -> str:
    """Return events with each condition alone, and with pairs of conditions."""
    alone = [
        noted(f"{name}, {edge}, {delay}", condition_xml(inside, edge, delay))
        for (name, inside), edge, delay in product(CONDITIONS.items(), EDGES, (0, 0.3))
    ]
    pairs = [
        noted(f"{name}, {edge} and {other}", condition_xml(CONDITIONS[name], edge), condition_xml(CONDITIONS[other]))
        for name, edge, other in product(CONDITIONS, EDGES[1:3], ("slow", "time"))
    ]
    return "".join([*alone, *pairs])


def simulation() -> Simulation:
    """Return a run of 5 s with all events."""
    drive = event_xml("drive", speed_xml(8, 0.5), trigger_xml(condition_xml(time_xml(1, "greaterOrEqual"))))
    stop = event_xml("stop", speed_xml(0, 0.5), trigger_xml(condition_xml(time_xml(3, "greaterOrEqual"))))
    text = scenario_xml(
        declarations=variables_xml(),
        entities=object_xml("Ego") + object_xml("Other"),
        init=init_xml("Ego", teleport_xml(world_position_xml(0)))
        + init_xml("Other", teleport_xml(world_position_xml(0, 9))),
        story=acts_xml(act_xml(group_xml(maneuver_xml(drive + stop + events())))),
        stop=end_xml(5.0),
    )
    return Simulation(load_scenario(text), settings=RunSettings(dt=0.05, no_criteria=True))


def changes(run: Simulation) -> list[StateChange]:
    """Return all state changes of a run."""
    found: list[StateChange] = []
    end = None
    while end is None:
        frame, end = run.tick()
        found += frame.changes
    run.close()
    return found


def test_resting_triggers_fire_as_triggers_that_are_evaluated_in_every_tick() -> None:
    watched = simulation()
    for element in watched.storyboard.root.iterate():
        if (leaf := getattr(element, "start_leaf", None)) is not None:
            TriggerHistory(leaf.trigger)  # an observed trigger does not rest
    expected, found = changes(watched), changes(simulation())
    assert sum(change.kind == "event" for change in expected) > 100
    assert found == expected


@pytest.mark.parametrize("others", [0, 99])
@pytest.mark.parametrize(
    ("inside", "most"),
    [
        (by_entity_xml('<SpeedCondition rule="greaterThan" value="5"/>', "Other"), 5),
        (time_xml(9.0), 5),
        (by_entity_xml('<EndOfRoadCondition duration="1"/>', "Other"), 101),
    ],
    ids=["standing car", "time", "every step"],
)
def test_condition_is_evaluated_only_after_changes_of_what_it_reads(
    monkeypatch: pytest.MonkeyPatch, inside: str, most: int, others: int
) -> None:
    counts: Counter[str] = Counter()
    evaluate = ConditionEvaluator.evaluate

    def count(evaluator: ConditionEvaluator, context: object) -> bool:
        counts[evaluator.name] += 1
        return evaluate(evaluator, context)  # type: ignore[arg-type]

    monkeypatch.setattr(ConditionEvaluator, "evaluate", count)
    events = [noted(f"{n}", condition_xml(time_xml(0.05 * n), name="other")) for n in range(others)]
    text = scenario_xml(
        entities=object_xml("Ego") + object_xml("Other"),
        init=init_xml("Ego", teleport_xml(world_position_xml(0)), speed_xml(9))
        + init_xml("Other", teleport_xml(world_position_xml(0, 9))),
        story=acts_xml(
            act_xml(
                group_xml(maneuver_xml("".join([noted("waiting", condition_xml(inside, name="waiting")), *events])))
            )
        ),
        stop=end_xml(5.0),
    )
    executed = changes(Simulation(load_scenario(text), settings=RunSettings(dt=0.05, no_criteria=True)))
    assert sum(c.kind == "event" and c.transition is ElementTransition.END for c in executed) == others
    assert 2 <= counts["waiting"] <= most
