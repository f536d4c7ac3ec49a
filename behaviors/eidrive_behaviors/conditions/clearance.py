"""RelativeClearanceCondition: nobody in the lanes around."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.api.actions import EntityCondition, RuntimeContext, entity_box, facing, model
from eidrive_scenario.api.common import LaneLocation, footprint


class RelativeClearanceCondition(EntityCondition):
    """No (named) entity is within a stretch ahead and behind, in a range of lanes counted from the own one to the left.

    The range must exist: an entity beside which there is no such lane has no clearance there. Lanes whose traffic comes
    towards the entity, as it faces, count only with `oppositeLanes`; its own lane always counts. The stretch is
    measured from the reference point of the entity along the road; with `freeSpace` whoever reaches into it with any
    part of its box is in it, else whose reference point lies there.
    """

    element: model.RelativeClearanceCondition

    def holds_for(self, context: RuntimeContext, entity: str) -> bool:
        """Look for anybody in the area."""
        here = context.location(entity)
        if here is None or context.roads is None:
            return False
        return self._exists(context, entity, here) and not self._within(context, entity, here)

    def explain_for(self, context: RuntimeContext, entity: str) -> str:
        """Who is in the area."""
        here = context.location(entity)
        found = self._within(context, entity, here) if here is not None else []
        return f"{entity}: {', '.join(found)} within its clearance" if found else f"{entity}: clear around"

    def describe_for(self) -> str:
        """The stretch."""
        ahead, behind = self.element.distance_forward or 0.0, self.element.distance_backward or 0.0
        return f"clear {ahead:g} m ahead, {behind:g} m behind"

    def _within(self, context: RuntimeContext, entity: str, here: LaneLocation) -> list[str]:
        names = [ref.entity_ref for ref in self.element.entity_ref] or list(context.view.names)
        return [
            name
            for name in names
            if name != entity and name in context.view and self._blocks(context, entity, here, name)
        ]

    def _blocks(self, context: RuntimeContext, entity: str, here: LaneLocation, name: str) -> bool:
        places = self._places(context, name)
        if not places or not any(self._in_range(context, entity, here, there) for there in lanes_of(places)):
            return False
        assert context.roads is not None
        found = [context.roads.distance(here, there) for there in places]
        turn = facing(context, entity, here)
        along = [offset[0] * turn for offset in found if offset is not None]
        ahead, behind = self.element.distance_forward or 0.0, self.element.distance_backward or 0.0
        return bool(along) and min(along) <= ahead and max(along) >= -behind

    def _places(self, context: RuntimeContext, name: str) -> list[LaneLocation]:
        """Where somebody is: the reference point, with `freeSpace` the corners of the box too."""
        there = context.location(name)
        if there is None:
            return []
        if not self.element.free_space:
            return [there]
        assert context.roads is not None
        outline = footprint(np.array(entity_box(context, name))).tolist()
        corners = (context.roads.locate_at(x, y, there) for x, y in outline)
        return [there, *(corner for corner in corners if corner is not None)]

    def _exists(self, context: RuntimeContext, entity: str, here: LaneLocation) -> bool:
        assert context.roads is not None
        lanes = context.roads.lane_ids(here.road, here.s, drivable=True)
        return any(self._in_range(context, entity, here, here._replace(lane=lane)) for lane in lanes)

    def _in_range(self, context: RuntimeContext, entity: str, here: LaneLocation, there: LaneLocation) -> bool:
        assert context.roads is not None
        runs = context.roads.orientation(here, there)
        if runs is None:
            return False
        way = context.roads.driving_direction(here.road, here.lane) * facing(context, entity, here)
        lane = there.lane * runs
        same = lane == here.lane or context.roads.driving_direction(there.road, there.lane) * runs == way
        if not same and not self.element.opposite_lanes:
            return False
        steps = lane - here.lane
        if (lane > 0) != (here.lane > 0):
            steps -= 1 if steps > 0 else -1
        left = steps * way
        ranges = self.element.relative_lane_range
        return not ranges or any(
            (bounds.from_ is None or left >= bounds.from_) and (bounds.to is None or left <= bounds.to)
            for bounds in ranges
        )


def lanes_of(places: list[LaneLocation]) -> list[LaneLocation]:
    """A place in each of the lanes that a box covers between its corners, lane 0 left out."""
    found = {(place.road, place.lane): place for place in places}
    for road in {place.road for place in places}:
        lanes = [lane for name, lane in found if name == road]
        for lane in range(min(lanes) + 1, max(lanes)):
            if lane != 0:
                found.setdefault((road, lane), found[road, lanes[0]]._replace(lane=lane))
    return list(found.values())
