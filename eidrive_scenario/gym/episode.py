"""Episode: one run whose stations are controlled from outside, in steps that end with the perceptions after them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import msgspec

from eidrive_scenario.driving.stack import DrivingStack, StackContext, StackFactory
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.driving.step import AgentStep, StationAction, StationPerception
from eidrive_scenario.errors import NOT_JUDGED, PASSED
from eidrive_scenario.openscenario import ConcreteRun, Scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation
from eidrive_scenario.simulation.run_outcome import exit_code_of
from eidrive_scenario.simulation.scenario_options import select_planner
from eidrive_scenario.simulation.tick import TickStart
from eidrive_scenario.world.view import WorldView

Decide = Callable[[Mapping[str, StationPerception]], Mapping[str, StationAction]]
"""Returns the actions of stations for the tick that starts with these perceptions."""


class Transition(msgspec.Struct, frozen=True):
    """One tick: ground truth before and after it, and the steps of the stations in it."""

    before: WorldView
    after: WorldView
    steps: Mapping[str, AgentStep]


class Episode:
    """One run of a scenario. It is closed when it ends, or by `close`.

    planners       planners of stations that replace those of the scenario, by station
    colliding      stations whose first contact ends the run, by an added criterion `collision` that does not judge it
    """

    def __init__(
        self,
        source: Scenario | ConcreteRun,
        seed: int,
        settings: RunSettings,
        *,
        planners: Mapping[str, str],
        colliding: Collection[str],
        load_weights: bool = True,
    ) -> None:
        added = [{"collision": {"of": name, "fatal": True}} for name in colliding]
        self._colliding = frozenset(colliding)
        self.simulation = Simulation(
            source,
            seed=seed,
            settings=replace(settings, criteria=(*settings.criteria_sources, *added)),
            stack=stations_with_planners(planners),
            load_weights=load_weights,
        )
        self._added = frozenset(criterion.name for criterion in self.simulation.criteria[-len(added) :] if added)
        self.result: RunResult | None = None
        """Result of the run; None before its end."""
        self.last_frame: Frame | None = None
        """Frame of the last complete tick; None before the first one."""
        self.observers: list[Callable[[Episode], None]] = []
        """Functions that are called after each tick."""

    def begin(self) -> None:
        """Begin the first tick."""
        self.start: TickStart = self.simulation.begin_tick()

    @property
    def perceived(self) -> Mapping[str, StationPerception]:
        """Perceptions of the present stations, by name."""
        return self.start.perceived

    def limit_time(self, duration: float) -> None:
        """End the run after this duration from now on [s] at the latest."""
        simulation = self.simulation
        limit = min(simulation.settings.time_limit, self.start.view.time + duration)
        simulation.settings = replace(simulation.settings, time_limit=limit)
        simulation.resolved = replace(simulation.resolved, time_limit=limit)

    def close(self) -> None:
        """Free the world."""
        self.simulation.close()

    def advance(self, decide: Decide) -> Transition:
        """Execute one tick and begin the next one.

        If the run ends with the begun tick, whatever the stations decide, that tick is completed as well.
        """
        before = self.start.view
        steps, end = self._tick(decide)
        if end is None:
            self.start = self.simulation.begin_tick()
            if self.start.ends or self._has_collided(self.start.view):
                _, end = self._tick(decide)
                if end is None:
                    self.start = self.simulation.begin_tick()
        if end is not None:
            self.result = self._judge(self.simulation.result())
            self.simulation.close()
        for observe in self.observers:
            observe(self)
        return Transition(before, self.start.view, steps)

    def _judge(self, result: RunResult) -> RunResult:
        """Return the result with the outcome by criteria of scenario and settings: those of the episode only end it."""
        no_criteria = self.simulation.settings.no_criteria
        verdicts = [verdict for verdict in result.criteria if verdict.name not in self._added]
        is_judged = bool(verdicts) or no_criteria
        exit_code = exit_code_of(verdicts, result.end_reason, no_criteria=no_criteria) if is_judged else NOT_JUDGED
        return replace(result, passed=exit_code == PASSED, exit_code=exit_code)

    def _tick(self, decide: Decide) -> tuple[Mapping[str, AgentStep], str | None]:
        for name, action in decide(self.start.perceived).items():
            self.simulation.set_action(name, action)
        frame, end = self.simulation.tick()
        self.last_frame = frame
        return frame.steps, end

    def _has_collided(self, view: WorldView) -> bool:
        return any(contact.first in self._colliding or contact.second in self._colliding for contact in view.contacts)


def stations_with_planners(planners: Mapping[str, str]) -> StackFactory:
    """Return a factory of `Stations` in which some stations have another planner.

    The factory raises SettingError if a planner does not exist.
    """

    def build(context: StackContext) -> DrivingStack:
        scenario = context.scenario
        for name, planner in planners.items():
            scenario = select_planner(scenario, planner, only=name)
        return Stations(replace(context, scenario=scenario))

    return build
