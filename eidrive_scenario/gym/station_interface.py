"""Interface of a controlled station: its observations, actions and rewards."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Annotated, Any

from pydantic import Field

from eidrive_scenario.driving.planning.path import PathPart
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.step import AgentStep, StationPerception
from eidrive_scenario.errors import NOT_JUDGED, Diagnostic, SettingError, suggestion
from eidrive_scenario.evaluation.criteria_parser import EXITS
from eidrive_scenario.evaluation.nearest_actor import min_time_to_collision
from eidrive_scenario.extensions.settings import S, Settings, parse_settings
from eidrive_scenario.gym.actions import ActionDecoder
from eidrive_scenario.gym.episode import Episode, Transition
from eidrive_scenario.gym.observations import ObservationEncoder
from eidrive_scenario.gym.settings import (
    DRIVING,
    ActionSettings,
    MetaSpeed,
    ObservationSettings,
    TargetSpeed,
    parse_actions,
)
from eidrive_scenario.simulation import RunResult, Simulation
from eidrive_scenario.world.actor import Control
from eidrive_scenario.world.specs import actor_spec
from eidrive_scenario.world.view import WorldView


def parse_mapping(model: type[S], given: Any, source: str) -> S:
    """Return settings from a mapping, settings or None, which selects the defaults. Raise SettingError."""
    if isinstance(given, model):
        return given
    if given is not None and not isinstance(given, Mapping):
        raise SettingError(Diagnostic(f"{source} is {given!r}", f"give a mapping or {model.__name__}"))
    return parse_settings(model, given or {}, source=source)


class StationInterface:
    """Observations, actions and rewards of one station, over all episodes of an environment.

    actions     None: the target speed, or sending for a station that does not drive
    simulation  any run of the scenario, for entities and settings
    """

    def __init__(
        self,
        name: str,
        observation: ObservationSettings,
        actions: tuple[ActionSettings, ...] | None,
        reward: RewardSettings,
        simulation: Simulation,
    ) -> None:
        self.name = name
        drives = name in simulation.stack.possible_drivers
        self.actions = actions or parse_actions("target_speed" if drives else "send")
        driving = [action.kind for action in self.actions if action.kind in DRIVING]
        if driving and not drives:
            message = f"action {driving[0]!r} drives, and the station {name!r} does not"
            raise SettingError(Diagnostic(message, "give the action send or share"))
        senders = [station for station in simulation.stack.controllable if station != name]
        self.encoder = ObservationEncoder(observation, senders)
        self.decoder = ActionDecoder(self.actions)
        self.rewards = Rewards(reward, name)
        self._needs_route = drives and (self.encoder.needs_route or reward.progress != 0.0)
        self._planner: RoutePlanner | None = None
        self._route: tuple[float, PathPart | None] = -1.0, None
        self._control: Control | None = None

    @property
    def planner(self) -> str | None:
        """Planner of the station that replaces the one of the scenario; None to keep it."""
        chosen = [action.planner for action in self.actions if isinstance(action, TargetSpeed | MetaSpeed)]
        return chosen[0] if chosen else None

    def begin(self, episode: Episode) -> None:
        """Begin an episode in which the station is present."""
        simulation, perceived = episode.simulation, episode.perceived[self.name]
        spec = actor_spec(self.name, simulation.scenario.entities[self.name])
        self._control, self._planner, self._route = None, None, (-1.0, None)
        if self._needs_route:
            own = simulation.stack.settings[self.name].model_copy(update={"obey_signals": False})
            dt, seed = simulation.settings.dt, simulation.seed
            self._planner = RoutePlanner(own, spec, simulation.roads, dt=dt, seed=seed)
        requested = None if perceived.goal is None else perceived.goal.speed
        speed = perceived.ego.speed if requested is None else requested
        self.decoder.reset(speed, spec.max_steering)

    def receive(self, episode: Episode) -> None:
        """Register the messages that the station receives in the current tick; forget all while it is not present."""
        perceived = episode.perceived.get(self.name)
        if perceived is None:
            self.encoder.reset()
        else:
            self.encoder.receive(perceived)

    def observe(self, episode: Episode) -> Any:
        """Return the observation; zeros if the station is not present."""
        perceived = episode.perceived.get(self.name)
        if perceived is None:
            return self.encoder.zeros()
        return self.encoder.encode(perceived, self.route(perceived), self._control)

    def reward_terms(self, transition: Transition, route: PathPart | None, episode: Episode) -> dict[str, float]:
        """Return the terms of the reward of one tick, and register its control.

        route  the one before the tick
        """
        step = transition.steps.get(self.name)
        if step is not None:
            self._control = step.control
        attached = episode.simulation.world.attached(self.name)
        return self.rewards.terms_of_tick(transition.before, transition.after, step, route, attached)

    def route(self, perceived: StationPerception) -> PathPart | None:
        """Return the route ahead in the world frame, None for a station that does not drive."""
        if self._planner is None:
            return None
        if self._route[0] != perceived.time:
            self._route = perceived.time, self._planner.path_ahead(perceived.ego, perceived.goal)
        return self._route[1]


def sum_terms(terms: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the sums of terms by name."""
    total: dict[str, float] = {}
    for of_source in terms:
        for name, value in of_source.items():
            total[name] = total.get(name, 0.0) + value
    return total


class RewardSettings(Settings):
    """Weights of the terms of a reward. Each term is its weight times its quantity in the step.

    progress           distance along the route [m]
    collision          number of contacts that begin
    comfort            acceleration², without gravity, times the duration [m²/s³]
    time_to_collision  max(0, 1 - TTC / ttc_limit) times the duration [s]; TTC is the smallest one to any other actor
    communication      size of the sent messages [kB]
    time               duration [s]
    passed, failed     1 at the end of the run if it has passed or not; both 0 if no criterion judges it
    criteria           by the name of a criterion: 1 at the end of the run if it has passed
    ttc_limit          time to collision from which on there is no term for it [s]
    """

    progress: float = 0.1
    collision: float = -10.0
    comfort: float = -0.001
    time_to_collision: float = -1.0
    communication: float = 0.0
    time: float = 0.0
    passed: float = 5.0
    failed: float = 0.0
    criteria: dict[str, float] = Field(default_factory=dict)
    ttc_limit: Annotated[float, Field(gt=0.0)] = 3.0


class Rewards:
    """Rewards of one station."""

    def __init__(self, settings: RewardSettings, station: str) -> None:
        self.settings = settings
        self._station = station

    def check_criteria(self, names: Collection[str]) -> None:
        """Raise SettingError if the criteria of the run do not have a weighted name."""
        unknown = next((name for name in self.settings.criteria if name not in names), None)
        if unknown is not None:
            message = f"reward: the run has no criterion {unknown!r}"
            raise SettingError(Diagnostic(message, suggestion(unknown, names)))

    def terms_of_tick(
        self,
        before: WorldView,
        after: WorldView,
        step: AgentStep | None,
        route: PathPart | None,
        attached: Collection[str] = (),
    ) -> dict[str, float]:
        """Return the terms of one tick. The views are the ground truth before and after it.

        step      step of the station in this tick
        route     route ahead of the vehicle before the tick; None if there is none
        attached  trailers of the station, which are no other actors for the time to collision
        """
        name, weight = self._station, self.settings
        terms = dict.fromkeys(("progress", "collision", "comfort", "time_to_collision", "communication", "time"), 0.0)
        if name not in before or name not in after or before is after:
            return terms
        was, now = before.states[before.row(name)], after.states[after.row(name)]
        duration = after.time - before.time
        terms["time"] = weight.time * duration
        if route is not None:
            _, _, ahead_x, ahead_y, square = route.segments[0]
            covered = ((now.x - was.x) * ahead_x + (now.y - was.y) * ahead_y) / math.sqrt(square)
            terms["progress"] = weight.progress * covered
        contacts = sum(name in (contact.first, contact.second) for contact in after.contacts)
        terms["collision"] = weight.collision * contacts
        felt = now.acceleration_x**2 + now.acceleration_y**2
        terms["comfort"] = weight.comfort * felt * duration
        if weight.time_to_collision:
            left = min_time_to_collision(after, name, weight.ttc_limit, attached)
            terms["time_to_collision"] = weight.time_to_collision * max(0.0, 1.0 - left / weight.ttc_limit) * duration
        if step is not None:
            terms["communication"] = weight.communication * sum(message.size for message in step.outbox) / 1000.0
        return terms

    def terms_of_end(self, result: RunResult) -> dict[str, float]:
        """Return the terms of the end of a run. Raise SettingError if the run has no criterion of a weighted name."""
        # A command that was not executed has no verdict.
        verdicts = {**dict.fromkeys(EXITS, False), **{verdict.name: verdict.passed for verdict in result.criteria}}
        self.check_criteria(verdicts)
        weights = self.settings
        terms = {f"criteria.{name}": weight * verdicts[name] for name, weight in weights.criteria.items()}
        terms["passed"] = weights.passed * result.passed
        terms["failed"] = weights.failed * (not result.passed and result.exit_code != NOT_JUDGED)
        return terms
