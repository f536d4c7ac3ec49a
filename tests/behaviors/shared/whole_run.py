"""Simulation runs of generated scenario files, with their frames and results."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from openscenario_xml import road_file_xml, round_car_xml, scenario_xml
from storyboard_xml import act_xml, acts_xml, condition_xml, end_xml, init_xml, trigger_xml
from street_scene import AGENT, NOTHING, STREET, at, groups_of

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation

MONITOR = '<MonitorDeclarations><MonitorDeclaration name="Passed" value="false"/></MonitorDeclarations>'


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
    """Runner of actions in the complete simulation: `run(end, (actor, action[, condition]), …)`.

    Ego starts in lane -1 at 100 m, driven by default. With a condition `start` the act starts by that, and its
    triggering entities act in all groups.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

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
        performance: str = "",
    ) -> RecordedRun:
        (self.folder / "street.xodr").write_text(street)
        places = {"Ego": ego, **(others or {})}
        controllers = {name: AGENT if driven and name == "Ego" else "" for name in places}
        groups = groups_of(steps or [("Ego", NOTHING)], edge=edge, delay=delay, selecting=bool(start))
        begins = trigger_xml(condition_xml(start, edge, delay)) if start else ""
        path = self.folder / "scene.xosc"
        path.write_bytes(
            scenario_xml(
                declarations=MONITOR,
                road=road_file_xml("street.xodr") + signals,
                entities="".join(round_car_xml(*car, limits=performance) for car in controllers.items()) + more,
                init=globally + "".join(init_xml(name, at(*place)) for name, place in places.items()) + init,
                story=acts_xml(act_xml(groups, begins)),
                stop=end_xml(end),
            )
        )
        record = RecordedRun()
        simulation = Simulation(load_scenario(path), seed=seed, settings=settings or RunSettings(), observers=[record])
        record.during = None if during is None else lambda frame: during(simulation, frame)
        record.result = simulation.run()
        return record


def slope(values: list[float], start: float, end: float) -> float:
    """Mean change per second between two times."""
    first, last = round(start / 0.05), round(end / 0.05)
    return (values[last] - values[first]) / (end - start)
