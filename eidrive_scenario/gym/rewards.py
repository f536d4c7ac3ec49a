"""Rewards: weighted terms of driving, communication and criteria."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Annotated

from pydantic import Field

from eidrive_scenario.driving.planning.path import PathPart
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.errors import Diagnostic, SettingError, suggestion
from eidrive_scenario.evaluation.nearest_actor import min_time_to_collision
from eidrive_scenario.exit_codes import NOT_JUDGED
from eidrive_scenario.settings import Settings
from eidrive_scenario.simulation import RunResult
from eidrive_scenario.world.view import WorldView


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

    @property
    def needs_route(self) -> bool:
        """Whether a term depends on the route."""
        return self.settings.progress != 0.0

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
        verdicts = {verdict.name: verdict.passed for verdict in result.criteria}
        self.check_criteria(verdicts)
        weights = self.settings
        terms = {f"criteria.{name}": weight * verdicts[name] for name, weight in weights.criteria.items()}
        terms["passed"] = weights.passed * result.passed
        terms["failed"] = weights.failed * (not result.passed and result.exit_code != NOT_JUDGED)
        return terms
