"""The traffic actions: swarms, sources, sinks and areas of background traffic, and their end."""

from __future__ import annotations

from abc import abstractmethod

from py_trees.common import Status

from eidrive_scenario.api.actions import (
    ActionBehaviour,
    ResolvedPosition,
    RuntimeContext,
    model,
    resolve_position,
    traffic,
)
from eidrive_scenario.api.common import Diagnostic, InputError, ScenarioError


class TrafficInstanceAction(ActionBehaviour):
    """Starts an instance of background traffic.

    It has no regular ending: it runs until a TrafficStopAction, or whatever stops the action itself, ends the instance.
    The cars that are there then drive on.
    """

    parent_element: model.TrafficAction

    immediate = True

    def __init__(
        self,
        action: model.Element,
        context: RuntimeContext,
        *,
        actor: str | None = None,
        parent: model.Element | None = None,
    ) -> None:
        super().__init__(action, context, actor=actor, parent=parent)
        self._instance: traffic.TrafficGenerator | None = None
        if context.roads is None:
            raise self.error("needs lanes to drive on", "name an OpenDRIVE file in RoadNetwork/LogicFile")
        self.check()

    @property
    def traffic_name(self) -> str:
        """What the traffic is called; its cars are called after it."""
        return self.parent_element.traffic_name or type(self.action).__name__.removesuffix("Action")

    @property
    def background(self) -> traffic.BackgroundTraffic:
        """All background traffic of the run."""
        return self.context.traffic.traffic

    def check(self) -> None:
        """Find what is wrong with the action before the run."""

    @abstractmethod
    def make(self) -> traffic.TrafficGenerator:
        """The instance, as it is at the start of the action."""

    def initialise(self) -> None:
        """A new execution makes a new instance."""
        self._instance = None

    def update(self) -> Status:
        """Run as long as the instance does."""
        if self._instance is None:
            self._instance = self.make()
            self.context.traffic.start(self._instance)
        return Status.RUNNING if self._instance.active else Status.SUCCESS

    def terminate(self, new_status: Status) -> None:
        """Who stops the action stops the traffic."""
        if new_status is Status.INVALID and self._instance is not None:
            self._instance.active = False

    def at_least_zero(self, **numbers: float | None) -> None:
        """Raises ScenarioError for a number below 0."""
        for name, value in numbers.items():
            if value is not None and not value >= 0.0:
                raise self.error(f"has {name}={value:g}", "give a number of at least 0")

    def mixture(self) -> traffic.TrafficMix:
        """Who the traffic is made of."""
        return traffic.TrafficMix(
            self.context.scenario,
            getattr(self.action, "traffic_definition", None),
            getattr(self.action, "traffic_distribution", None),
        )


class TrafficSwarmAction(TrafficInstanceAction):
    """Keeps a number of vehicles between a circle and an ellipse around an entity."""

    action: model.TrafficSwarmAction

    def check(self) -> None:
        """Numbers, shares, and who is in the middle."""
        action = self.action
        self.at_least_zero(
            innerRadius=action.inner_radius,
            semiMajorAxis=action.semi_major_axis,
            semiMinorAxis=action.semi_minor_axis,
            velocity=action.velocity,
        )
        speeds = self._speeds()
        if speeds is not None and not 0.0 <= speeds[0] <= speeds[1]:
            raise self.error(f"has speeds from {speeds[0]:g} to {speeds[1]:g} m/s", "give 0 <= lower <= upper")
        for shares in (self._directions(), self._sectors()):
            if shares is not None and (min(shares) < 0.0 or not sum(shares) > 0.0):
                listed = ", ".join(f"{share:g}" for share in shares)
                raise self.error(f"has the shares {listed}", "give shares of at least 0, not all 0")
        self._mixture = self.mixture()

    def make(self) -> traffic.Swarm:
        """The swarm."""
        action = self.action
        return traffic.Swarm(
            self.traffic_name,
            self.background.key(self.traffic_name),
            center=action.central_object.entity_ref,
            inner=action.inner_radius,
            major=action.semi_major_axis,
            minor=action.semi_minor_axis,
            offset=action.offset,
            count=action.number_of_vehicles,
            mixture=self._mixture,
            speeds=self._speeds(),
            directions=self._directions(),
            sectors=self._sectors(),
        )

    def _speeds(self) -> tuple[float, float] | None:
        between = self.action.initial_speed_range or self.action.speed_range
        if between is not None:
            return between.lower_limit, between.upper_limit
        return None if self.action.velocity is None else (self.action.velocity, self.action.velocity)

    def _directions(self) -> tuple[float, float] | None:
        shares = self.action.direction_of_travel_distribution
        return None if shares is None else (shares.same, shares.opposite)

    def _sectors(self) -> tuple[float, float, float, float] | None:
        shares = self.action.area_distribution
        return None if shares is None else (shares.front, shares.rear, shares.left, shares.right)

    def describe(self) -> str:
        """How many, around whom."""
        return f"swarm of {self.action.number_of_vehicles} around {self.action.central_object.entity_ref}"


class TrafficSourceAction(TrafficInstanceAction):
    """Lets vehicles appear at a rate around a position."""

    action: model.TrafficSourceAction

    def check(self) -> None:
        """Numbers and shares."""
        self.at_least_zero(radius=self.action.radius, rate=self.action.rate, speed=self._speed())
        self._mixture = self.mixture()

    def make(self) -> traffic.Source:
        """The source. Raises ScenarioError where no lane is near."""
        place: ResolvedPosition = resolve_position(self.action.position, self.context, None)
        lanes, ground = self.background.fleet.lanes, self.background.ground
        x, y, radius = place.pose.x, place.pose.y, self.action.radius
        driving, walking = (
            traffic.sites_within_radius(lanes, sites, x, y, radius, place.location)
            for sites in (ground.driving, ground.walking)
        )
        if not len(driving) and not len(walking):
            raise self.error(f"lies at x = {x:.1f} m, y = {y:.1f} m, where no lane is near", "move it to a lane")
        return traffic.Source(
            self.traffic_name,
            self.background.key(self.traffic_name),
            place=(x, y),
            sites=lambda participant: walking if participant.walks else driving,
            rate=self.action.rate,
            mixture=self._mixture,
            speed=self._speed(),
            started=self.context.time,
        )

    def _speed(self) -> float | None:
        return self.action.velocity if self.action.speed is None else self.action.speed

    def describe(self) -> str:
        """How many."""
        return f"source of {self.action.rate:g} vehicles per second"


class TrafficSinkAction(TrafficInstanceAction):
    """Lets vehicles of background traffic disappear around a position; entities of the scenario stay."""

    action: model.TrafficSinkAction

    def check(self) -> None:
        """Numbers and shares."""
        self.at_least_zero(radius=self.action.radius, rate=self.action.rate)
        self._mixture = self.mixture() if self.action.traffic_definition is not None else None

    def make(self) -> traffic.Sink:
        """The sink."""
        place = resolve_position(self.action.position, self.context, None)
        return traffic.Sink(
            self.traffic_name,
            self.background.key(self.traffic_name),
            place=(place.pose.x, place.pose.y),
            radius=self.action.radius,
            rate=float("inf") if self.action.rate is None else self.action.rate,
            categories=None if self._mixture is None else self._mixture.categories,
        )

    def describe(self) -> str:
        """How many."""
        rate = "all" if self.action.rate is None else f"{self.action.rate:g} per second of the"
        return f"sink of {rate} vehicles within {self.action.radius:g} m"


class TrafficAreaAction(TrafficInstanceAction):
    """Brings a number of participants into an area, once or again and again; done at once it ends immediately."""

    action: model.TrafficAreaAction

    def check(self) -> None:
        """Shares, and roads of the ranges."""
        self._mixture = self.mixture()
        if self.action.traffic_area.polygon is None:
            self._stretches()

    def make(self) -> traffic.Area:
        """The area."""
        outline = self.action.traffic_area.polygon
        if outline is None:
            covers = traffic.stretches_cover(self.background.fleet.lanes, self._stretches())
        else:
            places = [resolve_position(position, self.context, None).pose for position in outline.position]
            covers = traffic.polygon([(place.x, place.y) for place in places])
        return traffic.Area(
            self.traffic_name,
            self.background.key(self.traffic_name),
            count=self.action.number_of_entities,
            continuous=self.action.continuous,
            mixture=self._mixture,
            covers=covers,
        )

    def update(self) -> Status:
        """Where it is not continuous its instance fills the area in this tick, and the action is done."""
        status = super().update()
        return status if self.action.continuous else Status.SUCCESS

    def _stretches(self) -> list[traffic.Stretch]:
        assert self.context.roads is not None
        found = []
        for entry in self.action.traffic_area.road_range:
            cursors = [
                traffic.Cursor(cursor.road_id, cursor.s, tuple(lane.id for lane in cursor.lane))
                for cursor in entry.road_cursor
            ]
            try:
                found += traffic.road_range(self.context.roads, cursors, entry.length)
            except InputError as error:
                found_problems = [
                    Diagnostic(one.message, one.hint, entry.source, entry.line) for one in error.diagnostics
                ]
                raise ScenarioError(found_problems) from error
        return found

    def describe(self) -> str:
        """How many."""
        return f"{self.action.number_of_entities} participants in an area"


class TrafficStopAction(ActionBehaviour):
    """Ends all instances of the traffic of its name, or of all traffic where it has none; the cars drive on."""

    immediate = True
    action: model.TrafficStopAction
    parent_element: model.TrafficAction

    def update(self) -> Status:
        """End them."""
        self.context.traffic.stop(self.parent_element.traffic_name)
        return Status.SUCCESS

    def describe(self) -> str:
        """Which."""
        return f"stop traffic {self.parent_element.traffic_name or ''}".rstrip()
