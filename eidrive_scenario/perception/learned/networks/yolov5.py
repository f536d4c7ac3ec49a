"""Network `yolov5`: CSP backbone, pyramid pooling, path aggregation neck, three scales with anchors; nano size.

Implemented from the published architecture: CSPNet (Wang et al. 2020), PANet (Liu et al. 2018), anchors of YOLOv3 on
three scales (Redmon and Farhadi 2018), extended center offsets of YOLOv4 (Bochkovskiy et al. 2020).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits

from eidrive_scenario.perception.learned.networks.blocks import ConvUnit, CrossStage, PyramidPooling
from eidrive_scenario.perception.learned.networks.boxes import Targets, complete_iou
from eidrive_scenario.perception.learned.networks.yolov5_sizes import (
    ANCHORS_PER_SCALE,
    DEPTHS,
    STRIDES,
    WIDTHS,
    Anchors,
)


class YoloV5(nn.Module):
    """Network from images (B, 3, H, W) in [0, 1] to raw outputs (B, A, H/s, W/s, 5 + C) of each scale.

    H and W are multiples of 32.

    anchors  width and height [px of the network input] of three boxes for each of the strides 8, 16 and 32
    """

    def __init__(self, classes: int, anchors: Anchors) -> None:
        super().__init__()
        self.classes = classes
        self.anchors: Tensor
        self.register_buffer("anchors", torch.tensor(anchors, dtype=torch.float32))
        if self.anchors.shape != (len(STRIDES), ANCHORS_PER_SCALE, 2):
            raise ValueError(f"anchors: invalid shape (got {tuple(self.anchors.shape)}; expected (3, 3, 2))")
        w1, w2, w3, w4, w5 = WIDTHS
        d2, d3, d4, d5 = DEPTHS
        self.fine = nn.Sequential(
            ConvUnit(3, w1, 6, 2, padding=2),
            ConvUnit(w1, w2, 3, 2),
            CrossStage(w2, w2, d2),
            ConvUnit(w2, w3, 3, 2),
            CrossStage(w3, w3, d3),
        )
        self.middle = nn.Sequential(ConvUnit(w3, w4, 3, 2), CrossStage(w4, w4, d4))
        self.coarse = nn.Sequential(ConvUnit(w4, w5, 3, 2), CrossStage(w5, w5, d5), PyramidPooling(w5))
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.lateral_coarse = ConvUnit(w5, w4)
        self.merge_middle = CrossStage(2 * w4, w4, 1, shortcut=False)
        self.lateral_middle = ConvUnit(w4, w3)
        self.merge_fine = CrossStage(2 * w3, w3, 1, shortcut=False)
        self.down_fine = ConvUnit(w3, w3, 3, 2)
        self.out_middle = CrossStage(2 * w3, w4, 1, shortcut=False)
        self.down_middle = ConvUnit(w4, w4, 3, 2)
        self.out_coarse = CrossStage(2 * w4, w5, 1, shortcut=False)
        self.heads = nn.ModuleList(nn.Conv2d(width, ANCHORS_PER_SCALE * (5 + classes), 1) for width in (w3, w4, w5))
        # The first outputs state that objects are rare (Lin et al., Focal loss 2017, section 4.1).
        for head, stride in zip(self.heads, STRIDES, strict=True):
            assert isinstance(head, nn.Conv2d)
            assert head.bias is not None
            bias = head.bias.detach().view(ANCHORS_PER_SCALE, -1)
            bias[:, 4] = math.log(8.0 / (512.0 * 384.0 / stride**2))
            bias[:, 5:] = math.log(0.6 / (classes - 0.99))

    def raw_outputs(self, images: Tensor) -> list[Tensor]:
        """Return the outputs (B, A (5 + C), H/s, W/s) of the heads of each scale, as the ONNX model does."""
        fine = self.fine(images)
        middle = self.middle(fine)
        coarse = self.lateral_coarse(self.coarse(middle))
        middle = self.lateral_middle(self.merge_middle(torch.cat([self.up(coarse), middle], dim=1)))
        fine = self.merge_fine(torch.cat([self.up(middle), fine], dim=1))
        middle = self.out_middle(torch.cat([self.down_fine(fine), middle], dim=1))
        coarse = self.out_coarse(torch.cat([self.down_middle(middle), coarse], dim=1))
        return [head(features) for head, features in zip(self.heads, (fine, middle, coarse), strict=True)]

    def forward(self, images: Tensor) -> list[Tensor]:
        return [
            raw.view(len(raw), ANCHORS_PER_SCALE, 5 + self.classes, *raw.shape[2:]).permute(0, 1, 3, 4, 2).contiguous()
            for raw in self.raw_outputs(images)
        ]

    def decode(self, outputs: list[Tensor]) -> Tensor:
        """Return (B, N, 5 + C): cx cy w h [px], objectness, probability of each class."""
        predictions = []
        for scale, (raw, stride) in enumerate(zip(outputs, STRIDES, strict=True)):
            share = raw.sigmoid()
            cells = cell_corners(raw.shape[2], raw.shape[3], raw.device)
            center = (2.0 * share[..., :2] - 0.5 + cells) * stride
            size = (2.0 * share[..., 2:4]).square() * self.anchors[scale][None, :, None, None, :]
            predictions.append(torch.cat([center, size, share[..., 4:]], dim=-1).flatten(1, 3))
        return torch.cat(predictions, dim=1)


def cell_corners(height: int, width: int, device: torch.device) -> Tensor:
    """Return column and row of each cell as (H, W, 2)."""
    lines, columns = torch.meshgrid(
        torch.arange(height, device=device), torch.arange(width, device=device), indexing="ij"
    )
    return torch.stack([columns, lines], dim=-1).float()


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
            assignment = assign(targets, self._anchors[scale], stride, height, width)
            expected = torch.zeros(raw.shape[:4], device=device)
            count = len(assignment.classes)
            if count:
                assigned += count
                predictions = raw[assignment.image, assignment.anchor, assignment.line, assignment.column]
                share = predictions[:, :4].sigmoid()
                cells = torch.stack([assignment.column, assignment.line], dim=1)
                center = (2.0 * share[:, :2] - 0.5 + cells) * stride
                size = (2.0 * share[:, 2:]).square() * self._anchors[scale][assignment.anchor]
                fit = complete_iou(torch.cat([center, size], dim=1), assignment.boxes)
                box_loss = box_loss + (1.0 - fit).sum()
                expected.index_put_(
                    (assignment.image, assignment.anchor, assignment.line, assignment.column),
                    fit.detach().clamp(min=0.0),
                )
                one_hot = torch.zeros((count, self._classes), device=device)
                one_hot[torch.arange(count, device=device), assignment.classes] = 1.0
                class_loss = class_loss + binary_cross_entropy_with_logits(predictions[:, 5:], one_hot, reduction="sum")
            # Cells in an ignored object do not count.
            centers = (cell_corners(height, width, device).reshape(-1, 2) + 0.5) * stride
            free = ~targets.in_ignored(centers).view(-1, 1, height, width)
            considered = free.expand(-1, ANCHORS_PER_SCALE, -1, -1) | (expected > 0.0)
            each = binary_cross_entropy_with_logits(raw[..., 4], expected, reduction="none")
            object_loss = object_loss + SCALE_WEIGHTS[scale] * (each * considered).mean()
        inverse_count = 1.0 / max(assigned, 1)
        parts = {
            "box": BOX_WEIGHT * inverse_count * box_loss,
            "object": OBJECT_WEIGHT * object_loss,
            "class": CLASS_WEIGHT * inverse_count * class_loss,
        }
        return sum(parts.values(), torch.zeros((), device=device)), {k: float(v.detach()) for k, v in parts.items()}
