"""RelativeClearanceCondition: no entity in the surrounding lanes."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.api.actions import ConditionContext, EntityCondition, entity_box, facing, model, road_train
from eidrive_scenario.api.common import LaneLocation, footprint


class RelativeClearanceCondition(EntityCondition):
    """No (named) entity within a range ahead and behind, in a range of lanes counted to the left of the own lane.

    The range must exist: without such a lane beside the entity there is no clearance. Lanes of oncoming traffic, with
    respect to the entity's heading, count only with `oppositeLanes`; its own lane always counts. The range is measured
    along the road from the reference point of the entity. With `freeSpace` every part of another box counts, else only
    its reference point. Unless entities are named, background traffic counts, but not the rest of the own road train.
    """

    element: model.RelativeClearanceCondition

    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """Return True if the lanes exist and no entity is in the area."""
        here = context.location(entity)
        if here is None or context.roads is None:
            return False
        return self._range_exists(context, entity, here) and not self._entities_within(context, entity, here)

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the entities in the area."""
        here = context.location(entity)
        entities = self._entities_within(context, entity, here) if here is not None else []
        return f"{entity}: {', '.join(entities)} within its clearance" if entities else f"{entity}: clear around"

    def describe_for(self) -> str:
        """Describe the range."""
        ahead, behind = self.element.distance_forward or 0.0, self.element.distance_backward or 0.0
        return f"clear {ahead:g} m ahead, {behind:g} m behind"

    def _entities_within(self, context: ConditionContext, entity: str, here: LaneLocation) -> list[str]:
        own = road_train(context.actors, entity)
        names = [ref.entity_ref for ref in self.element.entity_ref]
        names = names or [name for name in context.view.names if name not in own]
        return [
            name
            for name in names
            if name != entity and name in context.view and self._blocks(context, entity, here, name)
        ]

    def _blocks(self, context: ConditionContext, entity: str, here: LaneLocation, name: str) -> bool:
        locations = self._locations(context, name)
        if not locations or not any(self._in_range(context, entity, here, other) for other in covered_lanes(locations)):
            return False
        assert context.roads is not None
        offsets = [context.roads.distance(here, other, along_lane=True) for other in locations]
        turn = facing(context, entity, here)
        along = [offset[0] * turn for offset in offsets if offset is not None]
        ahead, behind = self.element.distance_forward or 0.0, self.element.distance_backward or 0.0
        return bool(along) and min(along) <= ahead and max(along) >= -behind

    def _locations(self, context: ConditionContext, name: str) -> list[LaneLocation]:
        """Return locations of an entity: its reference point, and with `freeSpace` the corners of its box."""
        assert context.roads is not None
        view, is_traffic = context.view, name not in context.actors
        x, y, z = view.position[view.row(name)].tolist()
        other = context.roads.locate_at(x, y, z=z) if is_traffic else context.location(name)
        if other is None:
            return []
        if not self.element.free_space:
            return [other]
        box = view.boxes[view.row(name)] if is_traffic else np.array(entity_box(context, name))
        outline = footprint(box).tolist()
        corners = (context.roads.locate_at(x, y, other) for x, y in outline)
        return [other, *(corner for corner in corners if corner is not None)]

    def _range_exists(self, context: ConditionContext, entity: str, here: LaneLocation) -> bool:
        assert context.roads is not None
        lanes = context.roads.lane_ids(here.road, here.s, drivable=True)
        return any(self._in_range(context, entity, here, here._replace(lane=lane)) for lane in lanes)

    def _in_range(self, context: ConditionContext, entity: str, here: LaneLocation, other: LaneLocation) -> bool:
        assert context.roads is not None
        runs, steps = context.roads.orientation(here, other), context.roads.lanes_between(here, other)
        if runs is None or steps is None:
            return False
        way = context.roads.driving_direction(here.road, here.lane) * facing(context, entity, here)
        same = steps == 0 or context.roads.driving_direction(other.road, other.lane) * runs == way
        if not same and not self.element.opposite_lanes:
            return False
        left = steps * way
        ranges = self.element.relative_lane_range
        return not ranges or any(
            (bounds.from_ is None or left >= bounds.from_) and (bounds.to is None or left <= bounds.to)
            for bounds in ranges
        )


def covered_lanes(locations: list[LaneLocation]) -> list[LaneLocation]:
    """Return one location in each lane that a box covers between its corners, without lane 0."""
    by_lane = {(location.road, location.lane): location for location in locations}
    for road in {location.road for location in locations}:
        lanes = [lane for name, lane in by_lane if name == road]
        for lane in range(min(lanes) + 1, max(lanes)):
            if lane != 0:
                by_lane.setdefault((road, lane), by_lane[road, lanes[0]]._replace(lane=lane))
    return list(by_lane.values())
