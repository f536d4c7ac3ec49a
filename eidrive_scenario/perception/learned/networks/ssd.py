"""Network `ssd`: default boxes on five scales with a light backbone.

Liu et al., SSD: Single shot multibox detector, ECCV 2016. The backbone has depthwise separable convolutions (Howard et
al., MobileNets 2017), and so do the heads (Sandler et al., MobileNetV2 2018, section 6.2).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy, smooth_l1_loss

from eidrive_scenario.perception.learned.networks.blocks import ConvUnit, SeparableUnit
from eidrive_scenario.perception.learned.networks.boxes import Targets, corners, pairwise_iou
from eidrive_scenario.perception.learned.networks.ssd_sizes import (
    ASPECTS,
    BOXES_PER_CELL,
    COARSE,
    FINE,
    MAX_LOG_SIZE,
    MIDDLE,
    SIDES,
    STRIDES,
    VARIANCES,
)


class Ssd(nn.Module):
    """Network from images (B, 3, H, W) in [0, 1] to encoded boxes (B, N, 4) and class logits (B, N, 1 + C), background
    first.

    H and W are multiples of 128. `default_boxes(H, W)` returns the N boxes.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.classes = classes
        self.fine = nn.Sequential(ConvUnit(3, 16, 3, 2), *_separable_units(16, FINE))
        self.middle = nn.Sequential(*_separable_units(FINE[-1][0], MIDDLE))
        self.coarse = nn.Sequential(*_separable_units(MIDDLE[-1][0], COARSE))
        self.extra = nn.Sequential(ConvUnit(384, 128), SeparableUnit(128, 256, 2))
        self.last = nn.Sequential(ConvUnit(256, 96), SeparableUnit(96, 192, 2))
        widths = (FINE[-1][0], MIDDLE[-1][0], COARSE[-1][0], 256, 192)
        self.box_heads = nn.ModuleList(_head(width, 4) for width in widths)
        self.class_heads = nn.ModuleList(_head(width, 1 + classes) for width in widths)

    def raw_outputs(self, images: Tensor) -> list[Tensor]:
        """Return the outputs (B, 6 K, H/s, W/s) of the heads of each scale as the ONNX model does, first of boxes."""
        features = [self.fine(images)]
        for stage in (self.middle, self.coarse, self.extra, self.last):
            features.append(stage(features[-1]))
        heads = (*self.box_heads, *self.class_heads)
        return [head(level) for head, level in zip(heads, (*features, *features), strict=True)]

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        outputs = self.raw_outputs(images)
        encoded, logits = outputs[: len(STRIDES)], outputs[len(STRIDES) :]
        return _rows(encoded, 4), _rows(logits, 1 + self.classes)

    def decode(self, outputs: tuple[Tensor, Tensor], defaults: Tensor) -> tuple[Tensor, Tensor]:
        """Return boxes (B, N, 4) x1 y1 x2 y2 [px] and class probabilities (B, N, C) without background."""
        encoded, logits = outputs
        return corners(decode(encoded, defaults)), logits.softmax(dim=-1)[..., 1:]


def _separable_units(inputs: int, units: tuple[tuple[int, int], ...]) -> list[SeparableUnit]:
    """Return units with these output channels and strides."""
    widths = (inputs, *(outputs for outputs, _ in units))
    return [
        SeparableUnit(before, outputs, stride) for before, (outputs, stride) in zip(widths[:-1], units, strict=True)
    ]


def _rows(outputs: list[Tensor], each: int) -> Tensor:
    """Return outputs (B, 6 K, H/s, W/s) of all scales as one table (B, N, K)."""
    return torch.cat([raw.permute(0, 2, 3, 1).reshape(len(raw), -1, each) for raw in outputs], dim=1)


def _head(inputs: int, each: int) -> nn.Module:
    return nn.Sequential(ConvUnit(inputs, inputs, 3, groups=inputs), nn.Conv2d(inputs, BOXES_PER_CELL * each, 1))


def default_boxes(height: int, width: int) -> Tensor:
    """Return cx cy w h (N, 4) [px] of the default boxes of an image, in the order of the network outputs."""
    boxes = []
    for level, stride in enumerate(STRIDES):
        side = SIDES[level]
        sizes = [(side * math.sqrt(aspect), side / math.sqrt(aspect)) for aspect in ASPECTS]
        between = math.sqrt(side * SIDES[level + 1])
        sizes.append((between, between))
        lines, columns = torch.meshgrid(
            torch.arange(math.ceil(height / stride)), torch.arange(math.ceil(width / stride)), indexing="ij"
        )
        centers = (torch.stack([columns, lines], dim=-1).float() + 0.5) * stride
        each = torch.tensor(sizes).expand(*centers.shape[:2], -1, -1)
        boxes.append(torch.cat([centers[:, :, None, :].expand_as(each), each], dim=-1).reshape(-1, 4))
    return torch.cat(boxes)


def encode(boxes: Tensor, defaults: Tensor) -> Tensor:
    """Return boxes (…, N, 4) in center form as offsets from the default boxes (N, 4)."""
    center = (boxes[..., :2] - defaults[..., :2]) / (defaults[..., 2:] * VARIANCES[0])
    size = torch.log(boxes[..., 2:].clamp(min=1e-3) / defaults[..., 2:]) / VARIANCES[1]
    return torch.cat([center, size], dim=-1)


def decode(encoded: Tensor, defaults: Tensor) -> Tensor:
    """Return boxes (…, N, 4) in center form: the inverse of `encode`."""
    center = encoded[..., :2] * VARIANCES[0] * defaults[..., 2:] + defaults[..., :2]
    size = torch.exp((encoded[..., 2:] * VARIANCES[1]).clamp(max=MAX_LOG_SIZE)) * defaults[..., 2:]
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


class SsdLoss:
    """Smooth L1 loss of the encoded boxes and cross entropy of the classes, per assigned default box.

    Hard negative mining: the cross entropy includes the three background boxes with the largest loss for each assigned
    one.
    """

    def __init__(self, defaults: Tensor) -> None:
        self._defaults = defaults

    def __call__(self, outputs: tuple[Tensor, Tensor], targets: Targets) -> tuple[Tensor, dict[str, float]]:
        """Return the loss of outputs of `Ssd`, and its terms."""
        encoded, logits = outputs[0].float(), outputs[1].float()
        row, label = match(targets, self._defaults)
        positive = label > BACKGROUND
        count = positive.sum().clamp(min=1)
        expected = encode(targets.boxes.gather(1, row[..., None].expand(-1, -1, 4)), self._defaults)
        box_loss = smooth_l1_loss(encoded[positive], expected[positive], reduction="sum") / count
        each = cross_entropy(logits.flatten(0, 1), label.clamp(min=0).flatten(), reduction="none").view_as(label)
        hard = hardest(each.detach(), label)
        class_loss = (each * (positive | hard)).sum() / count
        parts = {"box": box_loss, "class": class_loss}
        return box_loss + class_loss, {name: float(value.detach()) for name, value in parts.items()}


def hardest(loss: Tensor, label: Tensor) -> Tensor:
    """Return the background boxes (B, N) of each image with the largest loss, three for each assigned one."""
    background = label == BACKGROUND
    expected = (label > BACKGROUND).sum(dim=1, keepdim=True) * NEGATIVES_PER_POSITIVE
    expected = expected.clamp(min=NEGATIVES_PER_POSITIVE)
    order = torch.where(background, loss, -torch.inf).argsort(dim=1, descending=True)
    rank = order.argsort(dim=1)
    return (rank < expected) & background
