"""Criterion: giving way to an emergency vehicle from behind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from eidrive_criteria.folds import exceeds, require_two_actors
from eidrive_criteria.pairs import SurroundedCriterion
from eidrive_scenario.api.common import LaneLocation, WorldView
from eidrive_scenario.api.criteria import CriterionSettings, Frame, Surroundings, Verdict, actor_never_present

SAME_WAY = math.cos(math.radians(45.0))
"""Cosine of the largest angle between the headings on two roads that have the same direction."""
BEHIND, AHEAD = 200.0, 100.0
"""Maximum distances along roads [m]. In a junction, on an overlapping road, the way may lead around a block."""


class Pursuit(NamedTuple):
    """Position of the emergency vehicle: distance of its center ahead of that of the actor, negative behind, and the
    gap between the bodies [m]; whether it drives in the direction of the actor.
    """

    ahead: float
    gap: float
    is_same_way: bool


class YieldToEmergencyVehicleSettings(CriterionSettings):
    """Settings: `{of: Ego, to: Ambulance, within: 50, at_most: 15}` with distance [m] and time [s].

    within   gap from which on an emergency vehicle behind has to be let past [m]
    at_most  maximum time until it is past [s]; None: until the end of the run
    """

    of: str
    to: str
    within: Annotated[float, Field(gt=0, le=200)] = 50.0
    at_most: Annotated[float, Field(gt=0)] | None = None

    _two_actors = model_validator(mode="after")(require_two_actors)


class YieldToEmergencyVehicle(SurroundedCriterion):
    """Criterion that fails if an emergency vehicle that approaches from behind does not get past the actor.

    It approaches when it drives in the direction of the actor, at most `within` behind it along connected roads, in any
    lane. The approach ends when its center is ahead of that of the actor, or when it leaves a junction on another road
    than those to the actor. It continues if the vehicle falls farther behind or either of both is removed.
    """

    settings_type = YieldToEmergencyVehicleSettings
    name = "yield_to_emergency_vehicle"
    unit = "s"

    def __init__(self, settings: YieldToEmergencyVehicleSettings) -> None:
        super().__init__(settings, settings.of, settings.to)
        self._settings = settings
        self._since: float | None = None
        """Start of the present approach [s]; None without one."""
        self._longest: float | None = None
        """Longest time from the start of an approach until the emergency vehicle was past, or until now [s]."""
        self._violated: float | None = None
        self._gap = 0.0
        """Last gap to the emergency vehicle during the present approach [m]."""
        self._outcome = ""
        """Description of the end of the last approach."""
        self._removed = False
        """Whether either of both is absent since the present approach."""
        self._locations: dict[str, LaneLocation | None] = {}
        """Last location of each actor on the roads."""
        self._road = ""
        """Last road of the emergency vehicle from which roads led to the actor."""
        self._straight = Surroundings(None)

    def observe(self, frame: Frame) -> None:
        view, settings = frame.view, self._settings
        if self.missing:
            self.missing.difference_update(view.names)
        self._removed = not (settings.of in view.rows and settings.to in view.rows)
        if self._removed:
            return
        pursuit = self._pursuit(view)
        if self._since is None:
            approaches = (
                pursuit is not None
                and pursuit.is_same_way
                and pursuit.ahead <= 0.0
                and not exceeds(pursuit.gap, settings.within)
            )
            self._since = view.time if approaches else None
        if self._since is None:
            return
        waited = view.time - self._since
        self._longest = waited if self._longest is None else max(self._longest, waited)
        if self._violated is None and exceeds(waited, settings.at_most):
            self._violated = view.time
        if pursuit is None:
            # One that had fallen back is out of range. Overlapping roads of a junction do not show a way.
            if self._gap <= settings.within and self._has_left_way():
                self._since, self._outcome = None, "took another way than"
            return
        self._gap, self._road = pursuit.gap, self._present_road()
        if pursuit.ahead > 0.0:
            self._since, self._outcome = None, "was past"

    def _pursuit(self, view: WorldView) -> Pursuit | None:
        """Return the position of the emergency vehicle; None if no near road leads it to the actor or back.

        Away from all roads, distances are those along the heading of the actor.
        """
        settings, roads = self._settings, self.roads
        own, other = (view.row(name) for name in (settings.of, settings.to))
        here, there = (self._locate(view, row) for row in (own, other))
        if roads is None or here is None or there is None:
            relation = next(self._straight.relations(view, settings.of, self.others), None)
            if relation is None or relation.side_gap > BEHIND:
                return None
            return Pursuit(relation.ahead, relation.gap, relation.other_speed > 0.0)
        distance, runs = roads.distance(here, there), roads.orientation(here, there)
        if distance is None or runs is None:
            return None
        boxes, speed = view.plain_boxes, float(view.speed[other])
        yaw, other_yaw = boxes[own][6], boxes[other][6]
        along, other_along = (
            math.cos(angle - roads.road_pose_at(place.road, place.s).h)
            for angle, place in ((yaw, here), (other_yaw, there))
        )
        direction = along * other_along * runs
        ahead = math.copysign(distance[0], distance[0] * along * roads.driving_direction(here.road, here.lane))
        if not -BEHIND <= ahead <= AHEAD or (here.road != there.road and direction < 0.0):
            return None
        is_turned = here.road != there.road and math.cos(yaw - other_yaw) < SAME_WAY
        is_same_way = direction * speed > 0.0 and not is_turned
        return Pursuit(ahead, max(abs(ahead) - (boxes[own][3] + boxes[other][3]) / 2.0, 0.0), is_same_way)

    def _locate(self, view: WorldView, row: int) -> LaneLocation | None:
        if self.roads is None:
            return None
        (x, y, *_), name = view.plain_boxes[row], view.names[row]
        self._locations[name] = self.roads.locate_at(x, y, self._locations.get(name), view.states[row].z)
        return self._locations[name]

    def _present_road(self) -> str:
        """Return the road of the emergency vehicle; "" in junctions and away from all roads."""
        location = self._locations.get(self._settings.to)
        if self.roads is None or location is None:
            return ""
        return location.road if self.roads.road(location.road).junction_id is None else ""

    def _has_left_way(self) -> bool:
        """Return whether the emergency vehicle is on another road than when a road last led to the actor."""
        return self.roads is None or self._present_road() not in ("", self._road)

    def verdict(self) -> Verdict:
        settings = self._settings
        of, to = settings.of, settings.to
        if self.missing:
            reason = actor_never_present(self.missing)
        elif self._longest is None:
            reason = f"{to} never approached {of} from behind within {settings.within:g} m"
        elif self._since is not None:
            reason = f"{to} was still behind {of}, {self._longest:.2f} s after it had approached"
            reason += ", when one of both was removed" if self._removed else ""
        else:
            reason = f"{to} {self._outcome} {of} {self._longest:.2f} s after it had approached"
        return self.conclude(
            not self.missing and self._since is None and self._violated is None,
            reason,
            value=self._longest,
            limit=settings.at_most,
            first_violation=self._violated,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the longest time until the emergency vehicle was past [s]; empty without an approach."""
        return {} if self._longest is None else {f"{self.name}.{self._settings.of}": self._longest}
