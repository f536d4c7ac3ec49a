"""Elements that the rules report as unreachable never start: runs of random storyboards."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace

import pytest

from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.checks.scenario_rules.reachability import ReachabilityAnalysis
from eidrive_scenario.storyboard.state.states import ElementTransition
from eidrive_scenario.storyboard.storyboard import Storyboard

TICKS = 60
PLACE = """<PrivateAction><TeleportAction><Position><WorldPosition x="0" y="0"/></Position></TeleportAction>
</PrivateAction>"""
ACTION = """<Action name="{}"><PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="{}"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{}"/></SpeedActionTarget>
</SpeedAction></LongitudinalAction></PrivateAction></Action>"""
ACT = """<Act name="{name}"><ManeuverGroup name="{name} group" maximumExecutionCount="{count}">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="A"/></Actors>
<Maneuver name="{name} maneuver">{events}</Maneuver></ManeuverGroup>{start}{stop}</Act>"""
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
        acts = "".join(self.act(name) for name in ("one", "two"))
        return f'<Story name="story">{acts}</Story>'

    def act(self, name: str) -> str:
        events = "".join(self.event(f"{name} {number}") for number in range(3))
        return ACT.format(
            name=name,
            count=self.chance.choice([1, 1, 2]),
            events=events,
            start=self.trigger("StartTrigger", 0.6),
            stop=self.trigger("StopTrigger", 0.3),
        )

    def event(self, name: str) -> str:
        chance = self.chance
        action = ACTION.format(f"{name} action", chance.choice([0, 0.3, 1]), chance.choice([5, 10]))
        priority = chance.choice(["override", "parallel", "skip"])
        start = self.trigger("StartTrigger", 0.85)
        return (
            f'<Event name="{name}" priority="{priority}" maximumExecutionCount="{chance.choice([1, 1, 2])}">'
            f"{action}{start}</Event>"
        )

    def trigger(self, kind: str, likely: float) -> str:
        if self.chance.random() > likely:
            return ""
        groups = "".join(self.group() for _ in range(self.chance.choice([1, 1, 2])))
        return f"<{kind}>{groups}</{kind}>"

    def group(self) -> str:
        conditions = "".join(self.condition() for _ in range(self.chance.choice([1, 1, 2])))
        return f"<ConditionGroup>{conditions}</ConditionGroup>"

    def condition(self) -> str:
        chance = self.chance
        if chance.random() < 0.5:
            value = chance.choice([-1, 0, 0.5, 1, 2])
            inside = f'<SimulationTimeCondition rule="{chance.choice(RULES)}" value="{value}"/>'
        else:
            kind, names = chance.choice(self.names)
            inside = (
                f'<StoryboardElementStateCondition storyboardElementType="{kind}" '
                f'storyboardElementRef="{chance.choice(names)}" state="{chance.choice(STATES)}"/>'
            )
        edge, delay = chance.choice(EDGES), chance.choice([0, 0, 0.3])
        return (
            f'<Condition name="c" delay="{delay}" conditionEdge="{edge}"><ByValueCondition>{inside}</ByValueCondition>'
            "</Condition>"
        )


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


@pytest.mark.parametrize("seed", range(10))
def test_elements_start_not_before_their_earliest_time(build: Callable[..., Storyboard], seed: int) -> None:
    unreachable = reached = 0
    for number in range(30):
        storyboard = build(PLACE, stop=f"{Storyteller(1000 * seed + number).story()}<StopTrigger/>")
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
