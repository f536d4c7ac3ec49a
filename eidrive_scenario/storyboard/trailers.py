"""Trailers: what is hitched to a vehicle rolls after its hitch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.storyboard.actor import Actor


def declared_trailer(entity: model.Element) -> str | None:
    """The name of what an entity draws from the start, None where it draws nothing."""
    if not isinstance(entity, model.Vehicle) or entity.trailer is None:
        return None
    if entity.trailer.trailer is not None:
        return entity.trailer.trailer.name
    return entity.trailer.trailer_ref.entity_ref or None if entity.trailer.trailer_ref is not None else None


def pairs(actors: Mapping[str, Actor]) -> Iterator[tuple[Actor, Actor]]:
    """Drawing and drawn actors, from the front of each train to its end."""
    drawn = {actor.trailer for actor in actors.values() if actor.trailer is not None}
    if not drawn:
        return
    for name, front in actors.items():
        actor = front
        while name not in drawn and actor.trailer is not None and actor.trailer in actors:
            yield actor, actors[actor.trailer]
            actor = actors[actor.trailer]


def pose_behind(front: Actor, back: Actor, *, straight: bool = False) -> Pose:
    """Where the back one stands once the front one is at its place.

    The coupler is at the hitch, and the trailer's reference point (its axle) follows the hitch like a wheel on a rod,
    as a single-track model without slip has it. `straight` puts it in line.
    """
    pose = front.motion.pose
    hitch, reach = _hitch(front), _coupler(back)
    x, y = pose.x + hitch * math.cos(pose.h), pose.y + hitch * math.sin(pose.h)
    before = back.motion.pose
    heading = pose.h if straight else math.atan2(y - before.y, x - before.x)
    return Pose(x - reach * math.cos(heading), y - reach * math.sin(heading), pose.z, heading, pose.p, pose.r)


def _hitch(actor: Actor) -> float:
    entity = actor.entity
    return entity.trailer_hitch.dx if isinstance(entity, model.Vehicle) and entity.trailer_hitch is not None else 0.0


def _coupler(actor: Actor) -> float:
    entity = actor.entity
    return (
        entity.trailer_coupler.dx if isinstance(entity, model.Vehicle) and entity.trailer_coupler is not None else 0.0
    )
