"""State of one entity: its controllers, its motion and its histories."""

from __future__ import annotations

import math

from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.conventions import is_agent_controller
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork
from eidrive_scenario.storyboard.kinematics.motion import Motion
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, TrajectoryProgress
from eidrive_scenario.world.view import ActorState, WorldView

STANDSTILL = 1e-3
"""Maximum speed of a standing actor [m/s]."""

END_REACH = 1.0
"""Distance before the end of its lane at which a driven vehicle has reached it [m]: it stops there as well as it can,
while a scripted actor stops exactly at the end."""

Entity = model.Vehicle | model.Pedestrian | model.MiscObject


class Actor:
    """One entity of the scenario.

    An eidrive controller drives it while the controller is active in both domains; otherwise its motion is scripted.

    keeps_controller  whether actions cannot assign or switch its controllers
    present    whether it is in the world; `RuntimeContext.add_actor` and `remove_actor` set it
    traveled   distance covered without teleports [m]
    standing_since, end_of_road_since, off_road_since  start of the state [s], None outside of it; `off_road_since`, and
               `end_of_road_since` of a driven vehicle, are updated after `track_off_road` or `track_end_of_road` only
    tracks_off_road, tracks_end_of_road  whether they are updated
    last_state  state in the last view that it was in; None before
    """

    def __init__(
        self,
        name: str,
        entity: Entity,
        controllers: tuple[model.Controller, ...],
        roads: RoadNetwork | None,
        *,
        keeps_controller: bool = False,
    ) -> None:
        self.name = name
        self.keeps_controller = keeps_controller
        self.entity = entity
        self._controllers: tuple[model.Controller, ...] = ()
        self._has_agent_controller = False
        self.motion = Motion(roads)
        self.present = False
        for controller in controllers:
            self.assign(controller)
        self._lateral = self._longitudinal = self._has_agent_controller
        self._goal: Goal | None = None
        self._progress: TrajectoryProgress | None = None
        self._trailer: str | None = None
        self.traveled = 0.0
        self.standing_since: float | None = None
        self.end_of_road_since: float | None = None
        self.off_road_since: float | None = None
        self.tracks_off_road = self.tracks_end_of_road = False
        self.last_state: ActorState | None = None
        self._location: LaneLocation | None = None
        self._location_tick = -1

    @property
    def controllers(self) -> tuple[model.Controller, ...]:
        """Controllers that are assigned to it."""
        return self._controllers

    def assign(self, controller: model.Controller) -> None:
        """Assign one more controller."""
        self._controllers = (*self._controllers, controller)
        self._has_agent_controller = self._has_agent_controller or is_agent_controller(controller)

    @property
    def lateral(self) -> bool:
        """Whether its own controller is active in the lateral domain."""
        return self._lateral

    @property
    def longitudinal(self) -> bool:
        """Whether its own controller is active in the longitudinal domain."""
        return self._longitudinal

    def activate_controller(self, lateral: bool | None, longitudinal: bool | None) -> None:
        """Activate or deactivate its own controller in each domain; None leaves a domain unchanged."""
        self._lateral = self._lateral if lateral is None else lateral
        self._longitudinal = self._longitudinal if longitudinal is None else longitudinal

    @property
    def goal(self) -> Goal | None:
        """Request to its agent while it is driven; None without one."""
        return self._goal

    def set_goal(self, goal: Goal) -> None:
        """Set the request to its agent."""
        self._goal = goal

    def end_path(self, path: Array, before: Goal) -> None:
        """End a path of the request to its agent: the route of an earlier request continues, without one the lane.

        A path that another request has replaced has ended already.
        """
        goal = self._goal
        if goal is not None and goal.path is path:
            route = before if before.is_route else Goal()
            self._goal = replace(goal, path=route.path, lap=route.lap, is_route=route.is_route)

    @property
    def progress(self) -> TrajectoryProgress | None:
        """Progress along the trajectory that it follows; None without one."""
        return self._progress

    def set_progress(self, progress: TrajectoryProgress | None) -> None:
        """Set the progress along the trajectory that it follows from now on; None without one."""
        self._progress = progress

    @property
    def trailer(self) -> str | None:
        """Name of its trailer; None without one."""
        return self._trailer

    def set_trailer(self, name: str | None) -> None:
        """Connect a trailer; None disconnects it."""
        self._trailer = name

    @property
    def trajectory(self) -> TrajectoryCurve | None:
        """Trajectory that it follows; None without one."""
        return None if self._progress is None else self._progress.layout

    @property
    def driven(self) -> bool:
        """Whether its eidrive controller drives it."""
        return self._lateral and self._longitudinal and self._has_agent_controller

    def limits(self) -> tuple[float, float, float]:
        """Return maximum speed [m/s], acceleration and deceleration [m/s²]; infinite without Performance."""
        if not isinstance(self.entity, model.Vehicle):
            return math.inf, math.inf, math.inf
        performance = self.entity.performance
        return performance.max_speed, performance.max_acceleration, performance.max_deceleration

    def observe(self, view: WorldView, row: int) -> bool:
        """Update the histories by a new view. Return whether its state differs from that in the last one."""
        state, last, motion = view.states[row], self.last_state, self.motion
        teleported, end_of_road = motion.teleported, motion.end_of_road
        if state is last and not teleported and not end_of_road:
            return False  # a standing actor whose histories are up to date
        self.last_state = state
        if teleported:
            motion.clear_teleported()
        elif last is not None:
            self.traveled += math.hypot(state.x - last.x, state.y - last.y)
        speed = state.speed
        if not -STANDSTILL < speed < STANDSTILL:
            self.standing_since = None
        elif self.standing_since is None:
            self.standing_since = view.time
        if self.driven:
            motion.set_observed_state(Pose(*state[:6]), speed)
        elif end_of_road or self.end_of_road_since is not None:
            self._set_at_end_of_road(end_of_road, view.time)
        return True

    def track_off_road(self) -> None:
        """Update `off_road_since` in every tick from now on."""
        self.tracks_off_road = True

    def update_off_road(self, roads: RoadNetwork | None, view: WorldView) -> None:
        """Update `off_road_since` by the reference point. Lanes of type `none` are not part of the road."""
        here = None if roads is None else self.location(roads, view.tick)
        if roads is not None and here is not None and _on_road(roads, here):
            self.off_road_since = None
        elif self.off_road_since is None:
            self.off_road_since = view.time

    def track_end_of_road(self) -> None:
        """Update `end_of_road_since` of a driven vehicle in every tick from now on."""
        self.tracks_end_of_road = True

    def update_end_of_road(self, roads: RoadNetwork | None, view: WorldView) -> None:
        """Update `end_of_road_since` of a driven vehicle: its reference point is at most END_REACH before the end."""
        here = None if roads is None else self.location(roads, view.tick)
        if roads is None or here is None:
            self._set_at_end_of_road(False, view.time)
            return
        heading = roads.lane_pose_at(here.road, here.lane, here.s).h
        along = roads.driving_direction(here.road, here.lane) * math.cos(self.motion.pose.h - heading) >= 0.0
        self._set_at_end_of_road(roads.advance(here, END_REACH if along else -END_REACH) is None, view.time)

    def _set_at_end_of_road(self, at_end: bool, time: float) -> None:
        if not at_end:
            self.end_of_road_since = None
        elif self.end_of_road_since is None:
            self.end_of_road_since = time

    def enter_world(self) -> None:
        """Enter the world; the durations of states restart."""
        self.present = True
        self.standing_since = self.off_road_since = self.end_of_road_since = None

    def leave_world(self) -> None:
        """Leave the world: speed, route and request to its agent end, so that an entity that is added again stands."""
        self.present = False
        self._goal = None
        self.motion.set_speed(0.0)
        self.motion.set_route(None)

    def location(self, roads: RoadNetwork, tick: int) -> LaneLocation | None:
        """Return its lane location, None without a road nearby. It is computed once per tick."""
        if self._location_tick != tick:
            x, y, z, h, _, _ = self.motion.pose
            if self.driven or self.motion.location is None:
                self._location = roads.locate_pose(x, y, h, z, self._location)
            else:
                self._location = roads.locate_at(x, y, self.motion.location)
            self._location_tick = tick
        return self._location

    def invalidate_location(self) -> None:
        """Discard the lane location of this tick after a teleport."""
        self._location_tick = -2


def _on_road(roads: RoadNetwork, here: LaneLocation) -> bool:
    return roads.lane_type(here.road, here.lane, here.s) != "none" and roads.on_road(here)
