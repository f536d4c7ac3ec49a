"""Elements that the rules report as unreachable never start: runs of random storyboards."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import pytest
from msgspec.structs import replace
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    element_state_xml,
    event_xml,
    group_xml,
    maneuver_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.checks.scenario_rules.context import ReachabilityAnalysis
from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.storyboard.state.element_states import ElementTransition
from eidrive_scenario.storyboard.storyboard import Storyboard

TICKS = 60
PLACE = teleport_xml(world_position_xml(0))
RULES = ("greaterThan", "greaterOrEqual", "lessThan", "lessOrEqual", "equalTo", "notEqualTo")
EDGES = ("none", "rising", "falling", "risingOrFalling")
STATES = (
    *("endTransition", "startTransition", "stopTransition", "skipTransition"),
    *("runningState", "completeState", "standbyState"),
    *("endTransition", "completeState"),
)


class Storyteller:
    """Generator of random stories with two acts and a few events."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.names = [
            ("act", ["one", "two"]),
            ("maneuverGroup", ["one group", "two group"]),
            ("event", [f"{act} {number}" for act in ("one", "two") for number in range(3)]),
            ("action", [f"{act} {number} action" for act in ("one", "two") for number in range(3)]),
        ]

    def story(self) -> str:
        return acts_xml(*(self.act(name) for name in ("one", "two")))

    def act(self, name: str) -> str:
        events = "".join(self.event(f"{name} {number}") for number in range(3))
        maneuver = maneuver_xml(events, f"{name} maneuver")
        group = group_xml(maneuver, "A", name=f"{name} group", count=self.chance.choice([1, 1, 2]))
        return act_xml(group, self.trigger("StartTrigger", 0.6) + self.trigger("StopTrigger", 0.3), name)

    def event(self, name: str) -> str:
        seconds, speed = self.chance.choice([0, 0.3, 1]), self.chance.choice([5, 10])
        priority = self.chance.choice(["override", "parallel", "skip"])
        start = self.trigger("StartTrigger", 0.85)
        action = speed_xml(speed, seconds, shape="linear")
        return event_xml(name, action, start, priority=priority, count=self.chance.choice([1, 1, 2]))

    def trigger(self, kind: str, likely: float) -> str:
        if self.chance.random() > likely:
            return ""
        return trigger_xml(*(self.group() for _ in range(self.chance.choice([1, 1, 2]))), kind=kind)

    def group(self) -> str:
        return "".join(self.condition() for _ in range(self.chance.choice([1, 1, 2])))

    def condition(self) -> str:
        chance = self.chance
        if chance.random() < 0.5:
            value = chance.choice([-1, 0, 0.5, 1, 2])
            inside = time_xml(value, chance.choice(RULES))
        else:
            kind, names = chance.choice(self.names)
            inside = element_state_xml(kind, chance.choice(names), chance.choice(STATES))
        return condition_xml(inside, chance.choice(EDGES), chance.choice([0, 0, 0.3]))


def starts(storyboard: Storyboard) -> dict[tuple[str, ...], float]:
    """Return the first start of each element [s]."""
    storyboard.initial()
    first: dict[tuple[str, ...], float] = {}
    for tick in range(TICKS):
        storyboard.tick(replace(storyboard.context.view, time=tick * 0.1, tick=tick))
        for change in storyboard.changes:
            if change.transition is ElementTransition.START:
                first.setdefault(tuple(change.path.split("/")), change.time)
    return first


@pytest.mark.statistical
@pytest.mark.parametrize("seed", range(10))
def test_elements_start_not_before_their_earliest_time(build: Callable[..., Storyboard], seed: int) -> None:
    unreachable = reached = 0
    for number in range(30):
        storyboard = build(PLACE, story=Storyteller(1000 * seed + number).story())
        outline = Outline(storyboard.scenario)
        earliest = ReachabilityAnalysis(outline).start
        happened = starts(storyboard)
        for node in outline.nodes[1:]:
            bound, time = earliest[node], happened.get(node.path, math.inf)
            assert time >= bound - 1e-9, f"{node.title} of seed {seed}, {number} starts at {time}, not before {bound}"
            unreachable += bound == math.inf
            reached += time < math.inf
    assert unreachable > 20
    assert reached > 20
