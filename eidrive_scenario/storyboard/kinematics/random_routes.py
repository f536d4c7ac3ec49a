"""Random routes: at each junction one branch, uniformly distributed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eidrive_scenario.roads import Branch, BranchSelector, LaneKey, LaneLocation, RoadNetwork, Route


def uniform_branch_selector(generator: np.random.Generator) -> BranchSelector:
    """Return a selector that draws a branch at each junction."""

    def select_branch(branches: Sequence[Branch]) -> Branch:
        return branches[int(generator.integers(len(branches)))]

    return select_branch


def random_route(roads: RoadNetwork, start: LaneLocation, length: float, select_branch: BranchSelector) -> Route:
    """Return a route from a location, at least `length` [m] long unless the road ends before."""
    road = roads.road(start.road)
    direction = roads.driving_direction(start.road, start.lane)
    key = LaneKey(start.road, road.section_at(start.s).index, start.lane)
    section = road.section_at(start.s)
    remaining = length - ((section.end - start.s) if direction > 0 else (start.s - section.s))
    lanes = [key]
    while remaining > 0.0:
        branches = roads.movement.branches(key, direction)
        if not branches:
            break
        branch = branches[0] if len(branches) == 1 else select_branch(branches)
        if branch.lane in lanes[-2:]:
            break
        key, direction = branch.lane, branch.direction
        lanes.append(key)
        remaining -= roads.road(key.road).sections[key.section].length
    road = roads.road(key.road)
    section = road.sections[key.section]
    end = section.end if direction > 0 else section.s
    return Route(roads.tables, tuple(lanes), start, LaneLocation(key.road, key.lane, end, 0.0, 0.0))
