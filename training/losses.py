"""Losses of the networks `yolov5` and `ssd`, by the assignment of their outputs to objects."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy, smooth_l1_loss

from eidrive_scenario.perception.learned.networks import ssd_sizes, yolov5_sizes
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5
from training.boxes import Targets, complete_iou, corners, pairwise_iou


def ssd_rows(outputs: list[Tensor]) -> tuple[Tensor, Tensor]:
    """Return outputs of `Ssd` as encoded boxes (B, N, 4) and class logits (B, N, 1 + C), background first.

    `default_boxes` returns the N boxes.
    """
    levels = len(ssd_sizes.STRIDES)
    encoded, logits = (
        torch.cat([_cells(raw, ssd_sizes.BOXES_PER_CELL) for raw in kind], dim=1)
        for kind in (outputs[:levels], outputs[levels:])
    )
    return encoded, logits


def _cells(raw: Tensor, boxes: int) -> Tensor:
    """Return an output (B, A K, H, W) with A boxes in each cell as a table (B, H W A, K)."""
    return raw.permute(0, 2, 3, 1).reshape(len(raw), -1, raw.shape[1] // boxes)


def default_boxes(height: int, width: int) -> Tensor:
    """Return cx cy w h (N, 4) [px] of the default boxes of an image, in the order of the network outputs."""
    boxes = []
    for level, stride in enumerate(ssd_sizes.STRIDES):
        side = ssd_sizes.SIDES[level]
        sizes = [(side * math.sqrt(aspect), side / math.sqrt(aspect)) for aspect in ssd_sizes.ASPECTS]
        between = math.sqrt(side * ssd_sizes.SIDES[level + 1])
        sizes.append((between, between))
        centers = (cell_corners(math.ceil(height / stride), math.ceil(width / stride)) + 0.5) * stride
        each = torch.tensor(sizes).expand(*centers.shape[:2], -1, -1)
        boxes.append(torch.cat([centers[:, :, None, :].expand_as(each), each], dim=-1).reshape(-1, 4))
    return torch.cat(boxes)


def encode(boxes: Tensor, defaults: Tensor) -> Tensor:
    """Return boxes (…, N, 4) in center form as offsets from the default boxes (N, 4)."""
    center = (boxes[..., :2] - defaults[..., :2]) / (defaults[..., 2:] * ssd_sizes.VARIANCES[0])
    size = torch.log(boxes[..., 2:].clamp(min=1e-3) / defaults[..., 2:]) / ssd_sizes.VARIANCES[1]
    return torch.cat([center, size], dim=-1)


LEAST_OVERLAP = 0.5
"""Minimum overlap of a default box with its object (Liu et al. 2016, section 2.2)."""
NEUTRAL_OVERLAP = 0.4
"""Overlap from which, up to LEAST_OVERLAP, a default box is neither assigned nor background."""
NEGATIVES_PER_POSITIVE = 3
BACKGROUND, UNLABELED = 0, -1


def match(targets: Targets, defaults: Tensor) -> tuple[Tensor, Tensor]:
    """Return the row (B, N) of the object and the label (B, N) of each default box (N, 4): class + 1, BACKGROUND or
    UNLABELED.

    In addition, each object has the default box with the largest overlap, however small (Liu et al. 2016, section 2.2).
    """
    present = targets.classes >= 0
    overlap = pairwise_iou(corners(targets.boxes), corners(defaults)[None]) * present[..., None]
    best, row = overlap.max(dim=1)
    label = torch.where(best >= LEAST_OVERLAP, targets.classes.gather(1, row) + 1, BACKGROUND)
    label[(best >= NEUTRAL_OVERLAP) & (best < LEAST_OVERLAP)] = UNLABELED
    ignored = targets.in_ignored(defaults[:, :2])
    label[ignored & (label == BACKGROUND)] = UNLABELED
    image, number = torch.nonzero(present, as_tuple=True)
    nearest = overlap[image, number].argmax(dim=1)
    row[image, nearest] = number
    label[image, nearest] = targets.classes[image, number] + 1
    return row, label


def ssd_loss(outputs: list[Tensor], targets: Targets, defaults: Tensor) -> dict[str, Tensor]:
    """Return the terms of the loss of outputs of `Ssd` per assigned default box (N, 4): smooth L1 loss of the encoded
    boxes, and cross entropy of the classes.

    Hard negative mining: the cross entropy includes the three background boxes with the largest loss for each assigned
    one.
    """
    encoded, logits = (output.float() for output in ssd_rows(outputs))
    row, label = match(targets, defaults)
    positive = label > BACKGROUND
    count = positive.sum().clamp(min=1)
    expected = encode(targets.boxes.gather(1, row[..., None].expand(-1, -1, 4)), defaults)
    box_loss = smooth_l1_loss(encoded[positive], expected[positive], reduction="sum") / count
    each = cross_entropy(logits.flatten(0, 1), label.clamp(min=0).flatten(), reduction="none").view_as(label)
    hard = hardest(each.detach(), label)
    return {"box": box_loss, "class": (each * (positive | hard)).sum() / count}


def hardest(loss: Tensor, label: Tensor) -> Tensor:
    """Return the background boxes (B, N) of each image with the largest loss, three for each assigned one."""
    background = label == BACKGROUND
    expected = (label > BACKGROUND).sum(dim=1, keepdim=True) * NEGATIVES_PER_POSITIVE
    expected = expected.clamp(min=NEGATIVES_PER_POSITIVE)
    order = torch.where(background, loss, -torch.inf).argsort(dim=1, descending=True)
    rank = order.argsort(dim=1)
    return (rank < expected) & background


def yolo_cells(outputs: list[Tensor]) -> list[Tensor]:
    """Return outputs of `YoloV5` as (B, A, H/s, W/s, 5 + C) of each scale."""
    count = yolov5_sizes.ANCHORS_PER_SCALE
    return [raw.view(len(raw), count, -1, *raw.shape[2:]).permute(0, 1, 3, 4, 2).contiguous() for raw in outputs]


def state_rare_objects(network: YoloV5) -> None:
    """Set the biases of the heads so that the first outputs state that objects are rare (Lin et al., Focal loss 2017,
    section 4.1)."""
    for head, stride in zip(network.heads, yolov5_sizes.STRIDES, strict=True):
        assert isinstance(head, nn.Conv2d)
        assert head.bias is not None
        bias = head.bias.detach().view(yolov5_sizes.ANCHORS_PER_SCALE, -1)
        classes = bias.shape[1] - 5
        bias[:, 4] = math.log(8.0 / (512.0 * 384.0 / stride**2))
        bias[:, 5:] = math.log(0.6 / (classes - 0.99))


def cell_corners(height: int, width: int, device: torch.device | None = None) -> Tensor:
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
    neighbors = beside.new_tensor([[[0.0, 0.0]], [[1.0, 0.0]], [[0.0, 1.0]]])
    cells = (cell + neighbors * beside).long().reshape(-1, 2)
    row, anchor = row.repeat(3), anchor.repeat(3)
    column, line = cells.unbind(dim=1)
    inside = (column >= 0) & (column < width) & (line >= 0) & (line < height)
    row, anchor, column, line = row[inside], anchor[inside], column[inside], line[inside]
    return Assignment(image[row], anchor, line, column, boxes[row], classes[row])


def yolo_loss(outputs: list[Tensor], targets: Targets, anchors: Tensor) -> dict[str, Tensor]:
    """Return the terms of the loss of outputs of `YoloV5` with anchors (3, A, 2) [px]: CIoU of boxes, and binary cross
    entropy of objectness and classes, each averaged.

    The target objectness of an assigned cell is the CIoU of its box. Cells in ignored objects are excluded.
    """
    device = outputs[0].device
    box_loss, object_loss, class_loss = (torch.zeros((), device=device) for _ in range(3))
    assigned = 0
    for scale, (raw, stride) in enumerate(zip(yolo_cells(outputs), yolov5_sizes.STRIDES, strict=True)):
        raw = raw.float()
        height, width = raw.shape[2:4]
        assignment = assign(targets, anchors[scale], stride, height, width)
        assigned += len(assignment.classes)
        at = (assignment.image, assignment.anchor, assignment.line, assignment.column)
        predictions = raw[at]
        share = predictions[:, :4].sigmoid()
        cells = torch.stack([assignment.column, assignment.line], dim=1)
        center = (2.0 * share[:, :2] - 0.5 + cells) * stride
        size = (2.0 * share[:, 2:]).square() * anchors[scale][assignment.anchor]
        fit = complete_iou(torch.cat([center, size], dim=1), assignment.boxes)
        box_loss = box_loss + (1.0 - fit).sum()
        expected = torch.zeros(raw.shape[:4], device=device).index_put_(at, fit.detach().clamp(min=0.0))
        logits = predictions[:, 5:]
        one_hot = functional.one_hot(assignment.classes, logits.shape[1]).to(logits)
        class_loss = class_loss + binary_cross_entropy_with_logits(logits, one_hot, reduction="sum")
        # Cells in an ignored object do not count.
        centers = (cell_corners(height, width, device).reshape(-1, 2) + 0.5) * stride
        free = ~targets.in_ignored(centers).view(-1, 1, height, width)
        considered = free.expand(-1, yolov5_sizes.ANCHORS_PER_SCALE, -1, -1) | (expected > 0.0)
        each = binary_cross_entropy_with_logits(raw[..., 4], expected, reduction="none")
        object_loss = object_loss + SCALE_WEIGHTS[scale] * (each * considered).mean()
    inverse_count = 1.0 / max(assigned, 1)
    return {
        "box": BOX_WEIGHT * inverse_count * box_loss,
        "object": OBJECT_WEIGHT * object_loss,
        "class": CLASS_WEIGHT * inverse_count * class_loss,
    }
