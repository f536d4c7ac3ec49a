"""Simulation runs of generated scenario files, with their frames and results."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from street_scene import CAR, GROUP, NOTHING, OURS, STREET, TRIGGER, at

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation

FILE = """<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-01-01T00:00:00" description="scene" author="test"/>
  <MonitorDeclarations><MonitorDeclaration name="Passed" value="false"/></MonitorDeclarations>
  <CatalogLocations/><RoadNetwork><LogicFile filepath="street.xodr"/>{signals}</RoadNetwork>
  <Entities>{cars}{more}</Entities>
  <Storyboard><Init><Actions>{everywhere}{private}</Actions></Init>
    <Story name="story"><Act name="act">{groups}{start}</Act></Story>
    <StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
    <SimulationTimeCondition value="{end}" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
    </StopTrigger></Storyboard></OpenSCENARIO>"""


class RecordedRun:
    """Record of a run: its frames and result."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.during: Callable[[Frame], None] | None = None
        self.result: RunResult

    def observe(self, frame: Frame) -> None:
        self.frames.append(frame)
        if self.during is not None:
            self.during(frame)

    def close(self) -> None:
        """Nothing to finish."""

    def of(self, name: str, what: str) -> list[float]:
        """A quantity of an actor over all frames."""
        return [float(getattr(frame.view, what)[frame.view.rows[name]]) for frame in self.frames]

    def x(self, name: str) -> list[float]:
        return [float(frame.view.position[frame.view.rows[name], 0]) for frame in self.frames]

    def begun(self, element: str) -> list[float]:
        return [
            change.time
            for frame in self.frames
            for change in frame.changes
            if change.element == element and change.after.value == "runningState"
        ]


class Run:
    """Run of actions in the complete simulation: `run(end, (actor, action[, condition]), …)`.

    Ego is in lane -1 at 100 m, driven by default. With a condition `start` the act starts by that, and its triggering
    entities act in all groups.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(
        self,
        end: float,
        *steps: tuple[str, ...],
        ego: tuple[int, float, float] = (-1, 100.0, 20.0),
        driven: bool = True,
        others: dict[str, tuple[int, float, float]] | None = None,
        more: str = "",
        globally: str = "",
        signals: str = "",
        street: str = STREET,
        during: Callable[[Simulation, Frame], None] | None = None,
        settings: RunSettings | None = None,
        seed: int = 0,
        start: str = "",
        init: str = "",
        edge: str = "none",
        delay: float = 0.0,
    ) -> RecordedRun:
        (self._folder / "street.xodr").write_text(street)
        groups = "".join(
            GROUP.format(
                number=number,
                actor=actor,
                action=action,
                trigger=TRIGGER.format(edge=edge, condition=condition[0]) if condition else "",
            )
            for number, (actor, action, *condition) in enumerate(steps)
        )
        groups = groups.replace('delay="0"', f'delay="{delay}"')
        if start:
            start = TRIGGER.format(edge=edge, condition=start).replace('delay="0"', f'delay="{delay}"')
            groups = groups.replace('selectTriggeringEntities="false"', 'selectTriggeringEntities="true"')
        places = {"Ego": ego, **(others or {})}
        text = FILE.format(
            cars="".join(CAR.format(name=n, controller=OURS if driven and n == "Ego" else "") for n in places),
            more=more,
            everywhere=globally,
            private="".join(f'<Private entityRef="{name}">{at(*place)}</Private>' for name, place in places.items())
            + init,
            start=start,
            groups=groups or GROUP.format(number=0, actor="Ego", action=NOTHING, trigger=""),
            end=end,
            signals=signals,
        )
        path = self._folder / "scene.xosc"
        path.write_text(text)
        record = RecordedRun()
        simulation = Simulation(load_scenario(path), seed=seed, settings=settings or RunSettings(), observers=[record])
        record.during = None if during is None else lambda frame: during(simulation, frame)
        record.result = simulation.run()
        return record


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Return a function that runs actions in the complete simulation."""
    return Run(tmp_path)


def slope(values: list[float], start: float, end: float, dt: float = 0.05) -> float:
    """Mean change per second between two times."""
    first, last = round(start / dt), round(end / dt)
    return (values[last] - values[first]) / (end - start)
