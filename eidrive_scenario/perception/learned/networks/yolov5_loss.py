"""Assignment of cells and anchors to objects, and the loss of `yolov5`."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from eidrive_scenario.perception.learned.networks.boxes import complete_iou
from eidrive_scenario.perception.learned.networks.targets import Targets
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5, cell_corners
from eidrive_scenario.perception.learned.networks.yolov5_sizes import ANCHORS_PER_SCALE, STRIDES

LARGEST_RATIO = 4.0
"""Maximum ratio between the sides of an anchor and of its object: decoded sizes are at most (2·1)² = 4 times the
anchor."""
SCALE_WEIGHTS = (4.0, 1.0, 0.4)
"""Weights of the objectness at strides 8, 16, 32: small objects are frequent and hard."""
BOX_WEIGHT, OBJECT_WEIGHT, CLASS_WEIGHT = 2.5, 25.0, 0.6


class Assignment(NamedTuple):
    """K assignments of one scale: image, anchor, row and column (K,), box (K, 4) [px], class (K,)."""

    image: Tensor
    anchor: Tensor
    line: Tensor
    column: Tensor
    boxes: Tensor
    classes: Tensor


def assign(targets: Targets, anchors: Tensor, stride: int, height: int, width: int) -> Assignment:
    """Return the assignments of one scale of height x width cells; anchors (A, 2) [px].

    An object is assigned to all anchors of similar size, in the cell of its center and in the two neighboring cells
    whose extended offsets, -0.5 to 1.5, reach it.
    """
    image, boxes, classes = targets.objects()
    ratio = boxes[:, None, 2:] / anchors[None]
    fits = torch.maximum(ratio, 1.0 / ratio.clamp(min=1e-9)).amax(dim=2) < LARGEST_RATIO
    row, anchor = torch.nonzero(fits, as_tuple=True)
    center = boxes[row, :2] / stride
    cell = center.floor()
    beside = torch.where(center - cell < 0.5, -1.0, 1.0)
    none = torch.zeros_like(cell[:, 0])
    shifts = torch.stack(
        [
            torch.stack([none, none], dim=1),
            torch.stack([beside[:, 0], none], dim=1),
            torch.stack([none, beside[:, 1]], dim=1),
        ]
    )
    cells = (cell[None] + shifts).long().reshape(-1, 2)
    row, anchor = row.repeat(3), anchor.repeat(3)
    column, line = cells.unbind(dim=1)
    inside = (column >= 0) & (column < width) & (line >= 0) & (line < height)
    row, anchor, column, line = row[inside], anchor[inside], column[inside], line[inside]
    return Assignment(image[row], anchor, line, column, boxes[row], classes[row])


class YoloLoss:
    """CIoU of boxes, binary cross entropy of objectness and classes, each averaged.

    The target objectness of an assigned cell is the CIoU of its box. Cells in ignored objects are excluded.
    """

    def __init__(self, network: YoloV5) -> None:
        self._anchors = network.anchors
        self._classes = network.classes

    def __call__(self, outputs: list[Tensor], targets: Targets) -> tuple[Tensor, dict[str, float]]:
        """Return the loss of outputs of `YoloV5`, and its terms."""
        device = outputs[0].device
        box_loss, object_loss, class_loss = (torch.zeros((), device=device) for _ in range(3))
        assigned = 0
        for scale, (raw, stride) in enumerate(zip(outputs, STRIDES, strict=True)):
            raw = raw.float()
            height, width = raw.shape[2:4]
            found = assign(targets, self._anchors[scale], stride, height, width)
            expected = torch.zeros(raw.shape[:4], device=device)
            count = len(found.classes)
            if count:
                assigned += count
                predictions = raw[found.image, found.anchor, found.line, found.column]
                share = predictions[:, :4].sigmoid()
                cells = torch.stack([found.column, found.line], dim=1)
                center = (2.0 * share[:, :2] - 0.5 + cells) * stride
                size = (2.0 * share[:, 2:]).square() * self._anchors[scale][found.anchor]
                fit = complete_iou(torch.cat([center, size], dim=1), found.boxes)
                box_loss = box_loss + (1.0 - fit).sum()
                expected.index_put_((found.image, found.anchor, found.line, found.column), fit.detach().clamp(min=0.0))
                one_hot = torch.zeros((count, self._classes), device=device)
                one_hot[torch.arange(count, device=device), found.classes] = 1.0
                class_loss = class_loss + binary_cross_entropy_with_logits(predictions[:, 5:], one_hot, reduction="sum")
            considered = self._considered(targets, height, width, stride, device) | (expected > 0.0)
            each = binary_cross_entropy_with_logits(raw[..., 4], expected, reduction="none")
            object_loss = object_loss + SCALE_WEIGHTS[scale] * (each * considered).mean()
        inverse_count = 1.0 / max(assigned, 1)
        parts = {
            "box": BOX_WEIGHT * inverse_count * box_loss,
            "object": OBJECT_WEIGHT * object_loss,
            "class": CLASS_WEIGHT * inverse_count * class_loss,
        }
        return sum(parts.values(), torch.zeros((), device=device)), {k: float(v.detach()) for k, v in parts.items()}

    def _considered(self, targets: Targets, height: int, width: int, stride: int, device: torch.device) -> Tensor:
        """Return the cells (B, A, H, W) that are not in an ignored object."""
        centers = (cell_corners(height, width, device).reshape(-1, 2) + 0.5) * stride
        free = ~targets.in_ignored(centers).view(-1, 1, height, width)
        return free.expand(-1, ANCHORS_PER_SCALE, -1, -1)
