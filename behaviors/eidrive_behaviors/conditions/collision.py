"""CollisionCondition: contact of an entity with another one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.api.actions import ConditionContext, EntityCondition, entity_box, model
from eidrive_scenario.api.common import overlap


class CollisionCondition(EntityCondition):
    """Contact of the bounding box with that of a named entity, or of any entity of a type, but the own trailer."""

    element: model.CollisionCondition

    def holds_for(self, context: ConditionContext, entity: str) -> bool:
        """Return True if another entity is touched."""
        return bool(self._touched_entities(context, entity))

    def explain_for(self, context: ConditionContext, entity: str) -> str:
        """Describe the touched entities."""
        touched = self._touched_entities(context, entity)
        return f"{entity}: collides with {', '.join(touched)}" if touched else f"{entity}: touches no entity"

    def describe_for(self) -> str:
        """Describe the other entity or type."""
        if self.element.entity_ref is not None:
            return f"collides with {self.element.entity_ref.entity_ref}"
        assert self.element.by_type is not None
        return f"collides with a {self.element.by_type.type.value}"

    def _touched_entities(self, context: ConditionContext, entity: str) -> list[str]:
        box = entity_box(context, entity)
        # Bodies that rebound within a step do not overlap at its end: the contact event counts too.
        begun: set[str] = set()
        for contact in context.view.contacts:
            if entity in (contact.first, contact.second):
                begun |= {contact.first, contact.second}
        named = [
            name
            for name in self._candidates(context)
            if name != entity
            and not context.are_coupled(entity, name)
            and (name in begun or overlap(box, entity_box(context, name)))
        ]
        return named if self.element.by_type is None else [*named, *self._touched_traffic(context, box, begun)]

    def _touched_traffic(self, context: ConditionContext, box: Sequence[float], begun: set[str]) -> list[str]:
        """Return the background traffic of the type that touches a box. It counts although it has no entities."""
        assert self.element.by_type is not None
        kind, view = self.element.by_type.type.value, context.view
        rows = [view.rows[name] for name in context.traffic_names if name in view]
        if not rows or kind not in ("vehicle", "pedestrian"):
            return []
        boxes = view.boxes[rows]
        reach = np.hypot(boxes[:, 3], boxes[:, 4]) + math.hypot(box[3], box[4])
        near = np.hypot(boxes[:, 0] - box[0], boxes[:, 1] - box[1]) < 0.5 * reach
        return [
            view.names[row]
            for row, close in zip(rows, near.tolist(), strict=True)
            if (view.categories[row] == "pedestrian") == (kind == "pedestrian")
            and (view.names[row] in begun or (close and overlap(box, view.boxes[row])))
        ]

    def _candidates(self, context: ConditionContext) -> list[str]:
        names: tuple[str, ...]
        if self.element.entity_ref is not None:
            names = (self.element.entity_ref.entity_ref,)
        else:
            assert self.element.by_type is not None
            names = context.scenario.entities_by_type.get(self.element.by_type.type, ())
        return [name for name in names if name in context.view]
