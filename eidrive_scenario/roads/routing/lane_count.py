"""Number of lanes between two places on connected roads."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.roads.model.location import LaneKey, LaneLocation
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.roads.routing.links import LaneLinks


def lanes_between(roads: Mapping[str, Road], links: LaneLinks, a: LaneLocation, b: LaneLocation, runs: int) -> int:
    """Return the number of lanes from the lane of a to that of b, positive in the direction of t at a.

    The lane of a is followed along its links. If it does not reach b, the nearest lane beside it that does is followed,
    first of those on its side of the road; without any, the lanes keep their numbers.

    runs  1 if s at b increases in the direction of s at a, else -1
    """
    here, there = (roads[place.road].section_at(place.s) for place in (a, b))
    own = _rank(a.lane)
    beside = sorted((lane for lane in here.lanes if lane), key=lambda lane: (lane * a.lane < 0, abs(_rank(lane) - own)))
    for lane in beside:
        reached = links.continued(LaneKey(a.road, here.index, lane), b.road, there.index)
        if reached:
            return (_rank(b.lane) - _rank(reached)) * runs + _rank(lane) - own
    return _rank(b.lane * runs) - own


def _rank(lane: int) -> int:
    """Return the place of a lane among those of a section in the direction of t, without lane 0."""
    return lane if lane > 0 else lane + 1
