"""Traffic actions: swarms, sources, sinks and areas of background traffic, and their stop."""

from __future__ import annotations

from abc import abstractmethod

from py_trees.common import Status

from eidrive_behaviors.actions.following import check_presence
from eidrive_scenario.api.actions import (
    ActionBehaviour,
    ResolvedPosition,
    model,
    resolve_position,
    traffic,
)
from eidrive_scenario.api.common import Diagnostic, InputError, ScenarioError, counted


class TrafficInstanceAction(ActionBehaviour):
    """Base class of actions that start a generator of background traffic.

    It has no regular end. It runs until a TrafficStopAction, or the stop of the action itself, stops the generator.
    Vehicles that are present then continue.
    """

    parent_element: model.TrafficAction

    immediate = True

    def configure(self) -> None:
        """Require a road network and check the settings."""
        self._generator: traffic.TrafficGenerator | None = None
        self._roads = self.require_roads()
        self.check()

    @property
    def traffic_name(self) -> str:
        """Name of the traffic, which prefixes the names of its road users."""
        return self.parent_element.traffic_name or type(self.action).__name__.removesuffix("Action")

    @property
    def background(self) -> traffic.BackgroundTraffic:
        """Background traffic of the run."""
        return self.context.background_traffic

    def check(self) -> None:
        """Check the settings of the action before the run. Raise ScenarioError if they are invalid."""

    @abstractmethod
    def build_generator(self) -> traffic.TrafficGenerator:
        """Return the generator in its state at the start of the action."""

    def initialise(self) -> None:
        """Discard the generator of the previous execution."""
        self._generator = None

    def update(self) -> Status:
        """Run until the generator is stopped."""
        if self._generator is None:
            self._generator = self.build_generator()
            self._generator.element = self.action
            self.context.start_traffic(self._generator)
        return Status.RUNNING if self._generator.active else Status.SUCCESS

    def terminate(self, new_status: Status) -> None:
        """Stop the generator if the action is stopped."""
        if new_status is Status.INVALID and self._generator is not None:
            self._generator.active = False

    def check_not_negative(self, **numbers: float | None) -> None:
        """Raise ScenarioError for a negative number."""
        for name, value in numbers.items():
            if value is not None and not value >= 0.0:
                raise self.error(f"{name} is out of range (got {value:g}; expected at least 0)")

    def traffic_mix(self) -> traffic.TrafficMix:
        """Return the mix of road users."""
        return traffic.TrafficMix(
            self.context.scenario,
            getattr(self.action, "traffic_definition", None),
            getattr(self.action, "traffic_distribution", None),
        )


class TrafficSwarmAction(TrafficInstanceAction):
    """Number of vehicles between a circle and an ellipse around an entity."""

    action: model.TrafficSwarmAction

    def check(self) -> None:
        """Check numbers, shares and traffic mix."""
        action = self.action
        self.check_not_negative(
            innerRadius=action.inner_radius,
            semiMajorAxis=action.semi_major_axis,
            semiMinorAxis=action.semi_minor_axis,
            velocity=action.velocity,
        )
        speeds = self._speeds()
        if speeds is not None and not 0.0 <= speeds[0] <= speeds[1]:
            text = f"got {speeds[0]:g} to {speeds[1]:g} m/s; expected 0 <= lower <= upper"
            raise self.error(f"the speed range is invalid ({text})")
        for shares in (self._directions(), self._sectors()):
            if shares is not None and (min(shares) < 0.0 or not sum(shares) > 0.0):
                listed = ", ".join(f"{share:g}" for share in shares)
                raise self.error(f"the shares are invalid (got {listed}; expected values of at least 0, not all 0)")
        self._traffic_mix = self.traffic_mix()

    def build_generator(self) -> traffic.Swarm:
        """Return the swarm."""
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
            mixture=self._traffic_mix,
            speeds=self._speeds(),
            directions=self._directions(),
            sectors=self._sectors(),
        )

    def update(self) -> Status:
        """Run until the swarm is stopped, or its central object leaves the world."""
        check_presence(self, self.action.central_object.entity_ref)
        return super().update()

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
        """Describe number and central entity."""
        return f"swarm of {self.action.number_of_vehicles} around {self.action.central_object.entity_ref}"


class TrafficSourceAction(TrafficInstanceAction):
    """Generation of vehicles at a rate around a position."""

    action: model.TrafficSourceAction

    def check(self) -> None:
        """Check numbers and traffic mix."""
        self.check_not_negative(radius=self.action.radius, rate=self.action.rate, speed=self._speed())
        self._traffic_mix = self.traffic_mix()

    def build_generator(self) -> traffic.Source:
        """Return the source. Raise ScenarioError if no lane is near."""
        center: ResolvedPosition = resolve_position(self.action.position, self.context, None)
        lanes, ground = self.background.fleet.lanes, self.background.population.ground
        x, y, radius = center.pose.x, center.pose.y, self.action.radius
        driving, walking = (
            traffic.sites_within_radius(lanes, sites, x, y, radius, center.location)
            for sites in (ground.driving, ground.walking)
        )
        if not len(driving) and not len(walking):
            raise self.error(f"no lane is near x = {x:.1f} m, y = {y:.1f} m", "move the position to a lane")
        return traffic.Source(
            self.traffic_name,
            self.background.key(self.traffic_name),
            sites=lambda participant: walking if participant.walks else driving,
            rate=self.action.rate,
            mixture=self._traffic_mix,
            speed=self._speed(),
            started=self.context.time,
        )

    def _speed(self) -> float | None:
        return self.action.velocity if self.action.speed is None else self.action.speed

    def describe(self) -> str:
        """Describe the rate."""
        return f"source of {self.action.rate:g} vehicles per second"


class TrafficSinkAction(TrafficInstanceAction):
    """Removal of background traffic around a position. Entities of the scenario remain."""

    action: model.TrafficSinkAction

    def check(self) -> None:
        """Check numbers and traffic mix."""
        self.check_not_negative(radius=self.action.radius, rate=self.action.rate)
        self._traffic_mix = self.traffic_mix() if self.action.traffic_definition is not None else None

    def build_generator(self) -> traffic.Sink:
        """Return the sink."""
        center = resolve_position(self.action.position, self.context, None)
        return traffic.Sink(
            self.traffic_name,
            self.background.key(self.traffic_name),
            position=(center.pose.x, center.pose.y),
            radius=self.action.radius,
            rate=float("inf") if self.action.rate is None else self.action.rate,
            categories=None if self._traffic_mix is None else self._traffic_mix.categories,
        )

    def describe(self) -> str:
        """Describe rate and radius."""
        rate = "all" if self.action.rate is None else f"{self.action.rate:g} per second of the"
        return f"sink of {rate} vehicles within {self.action.radius:g} m"


class TrafficAreaAction(TrafficInstanceAction):
    """Number of road users in an area, added once or continuously. A single addition ends at once."""

    action: model.TrafficAreaAction

    def check(self) -> None:
        """Check the traffic mix and the roads of the ranges."""
        self._traffic_mix = self.traffic_mix()
        if self.action.traffic_area.polygon is None:
            self._road_ranges()

    def build_generator(self) -> traffic.Area:
        """Return the area."""
        outline = self.action.traffic_area.polygon
        if outline is None:
            covers = traffic.stretches_cover(self.background.fleet.lanes, self._road_ranges())
        else:
            corners = [resolve_position(position, self.context, None).pose for position in outline.position]
            covers = traffic.polygon([(corner.x, corner.y) for corner in corners])
        return traffic.Area(
            self.traffic_name,
            self.background.key(self.traffic_name),
            count=self.action.number_of_entities,
            continuous=self.action.continuous,
            mixture=self._traffic_mix,
            covers=covers,
        )

    def update(self) -> Status:
        """Run the generator; an area that is not continuous is filled in this time step and complete."""
        status = super().update()
        return status if self.action.continuous else Status.SUCCESS

    def _road_ranges(self) -> list[traffic.Stretch]:
        ranges = []
        for road_range in self.action.traffic_area.road_range:
            cursors = [
                traffic.Cursor(cursor.road_id, cursor.s, tuple(lane.id for lane in cursor.lane))
                for cursor in road_range.road_cursor
            ]
            try:
                ranges += traffic.road_range(self._roads, cursors, road_range.length)
            except InputError as error:
                diagnostics = [Diagnostic.at(road_range, d.message, d.hint) for d in error.diagnostics]
                raise ScenarioError(diagnostics) from error
        return ranges

    def describe(self) -> str:
        """Describe the number."""
        return f"{counted(self.action.number_of_entities, 'participant')} in an area"


class TrafficStopAction(ActionBehaviour):
    """Stop of all generators of a name, or of all traffic without a name. The vehicles continue."""

    immediate = True
    action: model.TrafficStopAction
    parent_element: model.TrafficAction

    def update(self) -> Status:
        """Stop the generators."""
        self.context.stop_traffic(self.parent_element.traffic_name)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the traffic."""
        return f"stop traffic {self.parent_element.traffic_name or ''}".rstrip()
