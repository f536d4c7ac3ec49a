"""Large storyboards: work grows with the number of elements, not with its square."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import pytest
from openscenario_xml import scenario_xml, variables_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    element_state_xml,
    event_xml,
    group_xml,
    maneuver_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.checks.scenario_rules.context import ReachabilityAnalysis
from eidrive_scenario.checks.scenario_rules.outline import Outline
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.openscenario.validation.names import ReferenceMatch, is_suffix
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.storyboard.state.element_states import ElementState
from eidrive_scenario.storyboard.tree.events import EventElement

ADD_ONE = """<GlobalAction><VariableAction variableRef="Count"><ModifyAction><Rule><AddValue value="1"/></Rule>
  </ModifyAction></VariableAction></GlobalAction>"""


def scenario_of(events: str) -> bytes:
    """Return a scenario without entities with these events."""
    return scenario_xml(
        declarations=variables_xml(Count=("integer", "0")),
        entities="",
        story=acts_xml(act_xml(group_xml(maneuver_xml(events), ""))),
    )


def counting(number: int, condition: str, priority: str = "parallel") -> str:
    """Return an event that adds 1 to the variable Count."""
    return event_xml(f"event {number}", ADD_ONE, trigger_xml(condition_xml(condition)), priority=priority)


def at_time(value: float) -> str:
    return time_xml(value, "greaterOrEqual")


def chain(length: int, order: Callable[[list[int]], Any], reference: str = "event {}") -> bytes:
    """Return events of which each starts by the end of the previous one, in a given order."""
    ends = (element_state_xml("event", reference.format(n), "completeState") for n in range(length - 1))
    events = [counting(number, condition) for number, condition in enumerate([at_time(0.5), *ends])]
    return scenario_of("".join(events[number] for number in order(list(range(length)))))


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
    events = "".join(counting(n, at_time(0.01 * n), "override") for n in range(200))
    scenario = load_scenario(scenario_of(events))
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
