"""Kinematics of trailers that are connected to a towing vehicle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.kinematics.actor import Actor
from eidrive_scenario.world.view import WorldView

MAX_GAP = 1.0
"""Maximum distance between hitch and coupler at which a trailer is not teleported to the hitch [m]."""


class Displacement(NamedTuple):
    """Displacement in the horizontal plane [m] and change of heading [rad]."""

    x: float
    y: float
    heading: float


NO_DISPLACEMENT = Displacement(0.0, 0.0, 0.0)


class Coupling(NamedTuple):
    """Connection of a towing vehicle and its trailer.

    hitch  distance of the hitch ahead of the reference point of the vehicle [m]
    reach  distance of the coupler ahead of the reference point of the trailer [m]
    bar    distance of the coupler ahead of the equivalent axle of the trailer [m]
    """

    front: Actor
    back: Actor
    hitch: float
    reach: float
    bar: float

    @classmethod
    def of(cls, front: Actor, back: Actor) -> Coupling:
        """Return the connection of two actors."""
        hitch = front.entity.trailer_hitch if isinstance(front.entity, model.Vehicle) else None
        coupler = back.entity.trailer_coupler if isinstance(back.entity, model.Vehicle) else None
        reach = coupler.dx if coupler is not None else 0.0
        return cls(front, back, hitch.dx if hitch is not None else 0.0, reach, bar(back.entity, reach))

    @property
    def is_apart(self) -> bool:
        """Whether the coupler is so far from the hitch that the trailer is teleported there."""
        (x, y, _, h, _, _), (u, v, _, turn, _, _) = self.front.motion.pose, self.back.motion.pose
        hitch, reach = self.hitch, self.reach
        dx = x + hitch * math.cos(h) - u - reach * math.cos(turn)
        dy = y + hitch * math.sin(h) - v - reach * math.sin(turn)
        return dx * dx + dy * dy > MAX_GAP * MAX_GAP

    def next_pose(self, displacement: Displacement = NO_DISPLACEMENT, *, straight: bool = False) -> Pose:
        """Return the pose of the trailer behind its towing vehicle after a displacement of the vehicle.

        The coupler is at the hitch. The axle of the trailer follows the hitch as in a single-track model without slip:
        it is at the reference point, with several axles at the end of `bar`. `straight` aligns the trailer with the
        vehicle. If one of them is on a slope or bank, the trailer lies in the surface of the road.
        """
        front, back, hitch, reach, bar = self
        pose, before = front.motion.pose, back.motion.pose
        dx, dy, turn = displacement
        heading = pose.h + turn
        x, y = pose.x + dx + hitch * math.cos(heading), pose.y + dy + hitch * math.sin(heading)
        if not straight:
            axle_x, axle_y = before.x, before.y
            if offset := bar - reach:
                axle_x, axle_y = axle_x - offset * math.cos(before.h), axle_y - offset * math.sin(before.h)
            heading = math.atan2(y - axle_y, x - axle_x)
        x, y = x - reach * math.cos(heading), y - reach * math.sin(heading)
        if pose.p == pose.r == 0.0 and before.p == before.r == 0.0:
            return Pose(x, y, pose.z, heading, 0.0, 0.0)
        return _pose_on_surface(front, x, y, heading)


def declared_trailer(entity: model.Element) -> str | None:
    """Return the name of the trailer that an entity has from the start; None without one."""
    trailer = entity.trailer if isinstance(entity, model.Vehicle) else None
    if trailer is not None and trailer.trailer is not None:
        return trailer.trailer.name
    return (trailer.trailer_ref.entity_ref or None) if trailer is not None and trailer.trailer_ref is not None else None


def couplings(actors: Mapping[str, Actor]) -> Iterator[Coupling]:
    """Yield the connections of towing vehicles and trailers, from front to end of each train.

    A trailer has one towing vehicle.
    """
    drawn = {actor.trailer for actor in actors.values() if actor.trailer is not None}
    if not drawn:
        return
    hitched: set[str] = set()
    for name, front in actors.items():
        actor = front
        while name not in drawn and actor.trailer is not None and actor.trailer not in hitched:
            back = actors.get(actor.trailer)
            if back is None:
                break
            hitched.add(back.name)
            yield Coupling.of(actor, back)
            actor = back


def check_acyclic(actors: Mapping[str, Actor]) -> None:
    """Raise ScenarioError if an entity is its own trailer, directly or through others."""
    diagnostics = []
    for name, actor in actors.items():
        if name in trailers_behind(actors, name):
            message = f"entity {name!r} is its own trailer"
            diagnostics.append(Diagnostic.at(actor.entity, message, "remove a connection"))
    if diagnostics:
        raise ScenarioError(diagnostics)


def next_displacement(front: Actor, view: WorldView, dt: float) -> Displacement:
    """Return the displacement of a driven vehicle until the next view, at constant acceleration and yaw rate.

    The physics moves it after the placement of its trailer. Other actors have their next poses already.
    """
    if not front.driven or front.motion.teleported or front.name not in view:
        return NO_DISPLACEMENT
    state, half = view.states[view.row(front.name)], 0.5 * dt * dt
    return Displacement(
        state.velocity_x * dt + state.acceleration_x * half,
        state.velocity_y * dt + state.acceleration_y * half,
        state.yaw_rate * dt,
    )


def _pose_on_surface(front: Actor, x: float, y: float, heading: float) -> Pose:
    """Return the pose at the same height above the road as the vehicle; without a road in the plane of the vehicle."""
    roads, pose = front.motion.roads, front.motion.pose
    here = None if roads is None else roads.locate_at(pose.x, pose.y, front.motion.location, pose.z)
    if roads is not None and here is not None:
        there = roads.locate_at(x, y, here)
        if there is not None:
            below, ground = roads.lane_pose_at(*here[:4]), roads.lane_pose_at(*there[:4])
            _, p, r = ground.turned(wrap_angle(heading - ground.h))[3:]
            return Pose(x, y, pose.z + ground.z - below.z, heading, p, r)
    ahead = (x - pose.x) * math.cos(pose.h) + (y - pose.y) * math.sin(pose.h)
    return Pose(x, y, pose.z - ahead * math.tan(pose.p), heading, pose.p, pose.r)


def bar(entity: model.Element, reach: float) -> float:
    """Return the distance between coupler and equivalent single axle [m]: with one axle `reach`.

    The lateral forces of the fixed axles are proportional to their slip angles. They have no moment about the coupler,
    as the trailer turns freely. Axles at distances d from the coupler are thus equivalent to one at Σd² / Σd.
    """
    if not isinstance(entity, model.Vehicle) or not entity.axles.additional_axle:
        return reach
    extra = [axle.position_x for axle in entity.axles.additional_axle if axle.max_steering == 0.0]
    distances = [reach - x for x in (entity.axles.rear_axle.position_x, *extra)]
    total = sum(distances)
    return sum(d * d for d in distances) / total if total > 0.0 else reach


def towing_vehicle(actors: Mapping[str, Actor], name: str) -> str | None:
    """Return the name of the vehicle that tows an actor; None without one."""
    return next((front for front, actor in actors.items() if actor.trailer == name), None)


def trailers_behind(actors: Mapping[str, Actor], name: str) -> list[str]:
    """Return the names of the trailers of an actor from front to end; its own name if it is in a ring."""
    behind: list[str] = []
    while (trailer := actors[name].trailer) is not None and trailer in actors and trailer not in behind:
        behind.append(trailer)
        name = trailer
    return behind


def road_train(actors: Mapping[str, Actor], name: str) -> list[str]:
    """Return the names of the road train of an actor from front to end: vehicles that tow it, itself and trailers."""
    while (front := towing_vehicle(actors, name)) is not None:
        name = front
    return [name, *trailers_behind(actors, name)]
