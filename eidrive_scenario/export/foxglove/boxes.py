"""Boxes of actors and of perceived objects as scene entities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from eidrive_scenario.detections import Detections
from eidrive_scenario.export.bodies import rotations
from eidrive_scenario.export.foxglove.schemas import (
    WORLD,
    Color,
    Foxglove,
    set_color,
    set_rotation,
    set_stamp,
    set_vector,
)
from eidrive_scenario.recording.frame import Frame

_COLORS: Mapping[str, Color] = {
    "car": (0.25, 0.55, 0.9, 0.9),
    "van": (0.25, 0.7, 0.85, 0.9),
    "truck": (0.35, 0.4, 0.8, 0.9),
    "bus": (0.55, 0.4, 0.85, 0.9),
    "motorbike": (0.95, 0.7, 0.2, 0.9),
    "bicycle": (0.45, 0.8, 0.3, 0.9),
    "pedestrian": (0.95, 0.35, 0.35, 0.9),
}
"""Color of actors by category."""
_OTHER: Color = (0.6, 0.6, 0.6, 0.9)
_TEXT: Color = (1.0, 1.0, 1.0, 1.0)


class ActorScene:
    """Scene with one entity per actor, which is deleted when the actor leaves the world."""

    def __init__(self, foxglove: Foxglove) -> None:
        self._foxglove = foxglove
        self._shown: dict[str, None] = {}

    def build(self, frame: Frame) -> Any:
        """Return the update of the next frame."""
        view = frame.view
        update = self._foxglove.scene()
        for name in self._shown:
            if name not in view:
                deletion = update.deletions.add(type=self._foxglove.deletion.MATCHING_ID, id=name)
                set_stamp(deletion.timestamp, view.time)
        self._shown = dict.fromkeys(view.names)
        arms = np.einsum("nij,nj->ni", rotations(view.yaw, view.pitch, view.roll), view.offset)
        centers = (view.position + arms).tolist()
        for row, (name, category) in enumerate(zip(view.names, view.categories, strict=True)):
            entity = add_entity(update, name, view.time)
            cube = entity.cubes.add()
            set_vector(cube.pose.position, centers[row])
            angles = float(view.yaw[row]), float(view.pitch[row]), float(view.roll[row])
            set_rotation(cube.pose.orientation, *angles)
            set_vector(cube.size, view.size[row].tolist())
            set_color(cube.color, _COLORS.get(category, _OTHER))
            x, y, z = centers[row]
            add_text(entity, name, (x, y, z + 0.5 * float(view.size[row, 2]) + 0.6))
            speed = f"{view.speed[row]:.2f} m/s"
            for key, value in (("category", category), ("speed", speed)):
                entity.metadata.add(key=key, value=value)
        return update


def add_entity(update: Any, name: str, time: float) -> Any:
    """Add an entity in the world frame, which replaces the former one of this name."""
    entity = update.entities.add(id=name, frame_id=WORLD)
    set_stamp(entity.timestamp, time)
    return entity


def add_text(entity: Any, text: str, position: tuple[float, float, float], size: float = 0.8) -> None:
    """Add a text that faces the viewer; size in the world [m]."""
    found = entity.texts.add(billboard=True, font_size=size, scale_invariant=False, text=text)
    set_vector(found.pose.position, position)
    set_rotation(found.pose.orientation, 0.0)
    set_color(found.color, _TEXT)


def box_scene(foxglove: Foxglove, lists: Iterable[tuple[str, Detections]], color: Color, time: float) -> Any:
    """Return a scene of perceived boxes with class and confidence, one entity per name with all its lists."""
    update = foxglove.scene()
    deletion = update.deletions.add(type=foxglove.deletion.ALL)
    set_stamp(deletion.timestamp, time)
    by_name: dict[str, list[Detections]] = {}
    for name, objects in lists:
        by_name.setdefault(name, []).append(objects)
    for name, all_objects in by_name.items():
        entity = add_entity(update, name, time)
        for objects in all_objects:
            _add_boxes(entity, objects, color)
        entity.metadata.add(key="objects", value=str(sum(map(len, all_objects))))
    return update


def _add_boxes(entity: Any, objects: Detections, color: Color) -> None:
    """Add the boxes that are finite."""
    rows = zip(objects.boxes.tolist(), objects.classes, objects.confidence.tolist(), strict=True)
    for (x, y, z, length, width, height, yaw), category, confidence in rows:
        if not np.isfinite([x, y, z, length, width, height, yaw]).all():
            continue
        cube = entity.cubes.add()
        set_vector(cube.pose.position, (x, y, z))
        set_rotation(cube.pose.orientation, yaw)
        set_vector(cube.size, (length, width, height))
        set_color(cube.color, color)
        add_text(entity, f"{category} {confidence:.2f}", (x, y, z + 0.5 * height + 0.3), 0.5)
