"""Large storyboards: work grows with the number of elements, not with its square."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import pytest

from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.checks.scenario_rules.reachability import ReachabilityAnalysis
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.openscenario.validation.storyboard_names import ReferenceMatch, is_suffix
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.storyboard.state.states import ElementState
from eidrive_scenario.storyboard.tree.events import EventElement

FILE = """<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-01-01T00:00:00" description="many" author="test"/>
  <VariableDeclarations><VariableDeclaration name="Count" variableType="integer" value="0"/></VariableDeclarations>
  <CatalogLocations/><RoadNetwork/><Entities/><Storyboard><Init><Actions/></Init>
  <Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
  <Actors selectTriggeringEntities="false"/><Maneuver name="maneuver">{events}</Maneuver></ManeuverGroup></Act></Story>
  </Storyboard></OpenSCENARIO>"""
EVENT = """<Event name="event {number}" priority="{priority}"><Action name="action {number}"><GlobalAction>
  <VariableAction variableRef="Count"><ModifyAction><Rule><AddValue value="1"/></Rule></ModifyAction></VariableAction>
  </GlobalAction></Action><StartTrigger><ConditionGroup><Condition name="c" delay="0" conditionEdge="none">
  <ByValueCondition>{condition}</ByValueCondition></Condition></ConditionGroup></StartTrigger></Event>"""
AT = '<SimulationTimeCondition value="{time}" rule="greaterOrEqual"/>'
BEHIND = """<StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="{reference}"
  state="completeState"/>"""


def chain(length: int, order: Callable[[list[int]], Any], reference: str = "event {}") -> bytes:
    """Return events of which each starts by the end of the previous one, in a given order."""
    conditions = [AT.format(time=0.5), *(BEHIND.format(reference=reference.format(n)) for n in range(length - 1))]
    events = [EVENT.format(number=n, priority="parallel", condition=conditions[n]) for n in range(length)]
    return FILE.format(events="".join(events[number] for number in order(list(range(length))))).encode()


def zigzag(numbers: list[int]) -> list[int]:
    return [*numbers[1::2], *reversed(numbers[0::2])]


@pytest.mark.parametrize("order", [list, reversed, zigzag])
def test_interval_analysis_of_chain_has_linear_cost(
    monkeypatch: pytest.MonkeyPatch, order: Callable[[list[int]], Any]
) -> None:
    looked: list[Any] = []
    advance = ReachabilityAnalysis._advance

    def counted(self: ReachabilityAnalysis, node: Any) -> Any:
        looked.append(node)
        return advance(self, node)

    monkeypatch.setattr(ReachabilityAnalysis, "_advance", counted)
    outline = Outline(load_scenario(chain(60, order)))
    reach = ReachabilityAnalysis(outline)
    assert all(reach.start[node] == pytest.approx(0.5, abs=1e-5) for node in outline.nodes if "event" in node.path[-1])
    assert len(looked) < 6 * len(outline.nodes)


def test_overriding_event_reads_running_events_only(monkeypatch: pytest.MonkeyPatch) -> None:
    events = "".join(
        EVENT.format(number=n, priority="override", condition=AT.format(time=0.01 * n)) for n in range(200)
    )
    scenario = load_scenario(FILE.format(events=events).encode())
    asked: list[EventElement] = []

    def counted(self: EventElement) -> ElementState | None:
        asked.append(self)
        return self.record.state

    monkeypatch.setattr(EventElement, "state", property(counted))
    with Simulation(scenario, settings=RunSettings(dt=1.0)) as simulation:
        simulation.tick()
        simulation.tick()
        simulation.tick()
        assert simulation.storyboard.context.variables["Count"] == "200"
    assert len(asked) < 50 * 200


@pytest.mark.parametrize("reference", ["event {}", "maneuver::event {}", "act/event {}", "story::group/event {}"])
def test_reference_may_omit_levels_and_use_slashes(reference: str) -> None:
    with Simulation(load_scenario(chain(3, list, reference)), settings=RunSettings(dt=0.5)) as simulation:
        end = None
        while end is None:
            _, end = simulation.tick()
        assert end == "storyboard complete"
        assert simulation.world.tick < 3
        assert simulation.storyboard.context.variables["Count"] == "3"


def test_reference_match_equals_exhaustive_search() -> None:
    names = ["a", "b", "a/b", "b::a", "a::", ""]
    paths = [tuple(path) for length in (1, 2, 3) for path in product(names, repeat=length)]
    meant = ReferenceMatch((path, path) for path in paths)
    references = [
        *names,
        *(mark.join(pair) for pair in product(names, repeat=2) for mark in ("/", "::")),
        "c",
        "/",
        "::a",
    ]
    for reference in references:
        assert meant.by(reference) == [path for path in paths if is_suffix(reference, path)]
