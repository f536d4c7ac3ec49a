"""Lines of sight between actors, past the bodies of other actors, buildings and road objects.

The geometry is that of the truth sensor, but it needs frames and roads only, so that it applies to recordings, too.
Hills hide nothing here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.geometry import points_of_boxes
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.crossing import crossing
from eidrive_scenario.sensing.sensor import ABOVE_ROOF
from eidrive_scenario.sensing.truth import SAMPLES
from eidrive_scenario.world.road_objects import buildings, road_object_bodies
from eidrive_scenario.world.view import WorldView

ON_FOOT = frozenset({"pedestrian", "misc"})
"""Classes of actors without a roof sensor; a sensor of these is at the top of the body."""
SAME = 0.5
"""Maximum horizontal distance between the centers of an actor and of the road object that it represents [m]."""


class LinesOfSight:
    """Lines of sight from a sensor on the roof of one actor to the others; all directions."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        boxes = [] if roads is None else list(_scenery(roads))
        self._scenery: Array = np.array(boxes).reshape(-1, 7)
        self._radius = np.hypot(self._scenery[:, 3], self._scenery[:, 4]) / 2.0

    def visible(self, view: WorldView, observer: int, reach: float) -> set[int]:
        """Return the rows of the actors with at least one sampled point in sight of the actor in row `observer`.

        reach  maximum horizontal distance of their centers [m]

        Actors that the scenario hides from sensors are invisible and transparent.
        """
        boxes = view.boxes
        x, y, z, _, _, height, _ = boxes[observer].tolist()
        distance = np.hypot(boxes[:, 0] - x, boxes[:, 1] - y)
        solid = [row for row, name in enumerate(view.names) if row != observer and name not in view.unseen]
        targets = [row for row in solid if distance[row] <= reach]
        if not targets:
            return set()
        top = z + height / 2.0 + (0.0 if view.categories[observer] in ON_FOOT else ABOVE_ROOF)
        blockers = [row for row in solid if distance[row] <= reach + boxes[row, 3] + boxes[row, 4]]
        others = np.concatenate([boxes[blockers], self._near(x, y, reach)])
        numbers = [*blockers, *[-1] * (len(others) - len(blockers))]
        hidden = _hidden(np.array([x, y, top]), boxes[targets], others, _exempt(targets, boxes, numbers, others))
        return {row for row, covered in zip(targets, hidden, strict=True) if not covered}

    def hidden_points(self, view: WorldView, observer: int, origin: Array, points: Array) -> Bools:
        """Return whether each point (M, 3) is hidden from a sensor at `origin` (3,) on the actor in row `observer`."""
        x, y, *_ = view.boxes[observer].tolist()
        reach = float(np.hypot(*(points[:, :2] - (x, y)).T).max(initial=0.0))
        solid = [row for row, name in enumerate(view.names) if row != observer and name not in view.unseen]
        hidden: Bools = np.zeros(len(points), dtype=bool)
        for blocker in np.concatenate([view.boxes[solid], self._near(x, y, reach)]):
            enter, leave = crossing(origin[None, None], points[None], blocker[None])
            hidden |= ((enter < leave) & (leave > 0.0) & (enter < 1.0))[0]
        return hidden

    def _near(self, x: float, y: float, reach: float) -> Array:
        """Return the boxes of the scenery within reach that do not contain the observer."""
        away = np.hypot(self._scenery[:, 0] - x, self._scenery[:, 1] - y)
        near: Array = self._scenery[(away <= reach + self._radius) & (away > SAME)]
        return near


def _scenery(roads: RoadNetwork) -> Iterator[tuple[float, ...]]:
    """Yield the boxes (7,) of all buildings and solid road objects."""
    for building in buildings(roads):
        yield (*building.center, *building.size, building.yaw)
    for body in road_object_bodies(roads):
        if body.solid:
            size = (2.0 * body.radius, 2.0 * body.radius) if body.radius else (body.length, body.width)
            yield (body.pose.x, body.pose.y, body.pose.z + body.height / 2.0, *size, body.height, body.pose.h)


def _exempt(targets: Sequence[int], boxes: Array, rows: Sequence[int], others: Array) -> Bools:
    """Return the mask (T, B) of blockers that are the target itself or the road object that it represents."""
    own = np.equal.outer(np.array(targets), np.array(rows))
    offset = boxes[targets][:, None, :2] - others[None, :, :2]
    same = np.hypot(offset[..., 0], offset[..., 1]) <= SAME
    exempt: Bools = own | (same & (np.array(rows) < 0)[None, :])
    return exempt


def _hidden(origin: Array, targets: Array, others: Array, exempt: Bools) -> list[bool]:
    """Return for each target (T, 7) whether `others` (B, 7) hide all its sampled points."""
    count, blockers = len(targets), len(others)
    points = np.repeat(points_of_boxes(targets, SAMPLES), blockers, axis=0)
    enter, leave = crossing(np.broadcast_to(origin, points.shape), points, np.tile(others, (count, 1)))
    blocked = ((enter < leave) & (enter > 0.0) & (enter < 1.0)).reshape(count, blockers, -1)
    blocked &= ~exempt[..., None]
    covered: Bools = np.asarray(blocked.any(axis=1))
    return [all(row) for row in covered.tolist()]
