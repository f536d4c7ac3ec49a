"""Network `ssd`: default boxes on five scales with a light backbone.

Liu et al., SSD: Single shot multibox detector, ECCV 2016. The backbone has depthwise separable convolutions (Howard et
al., MobileNets 2017), and so do the heads (Sandler et al., MobileNetV2 2018, section 6.2).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from eidrive_scenario.perception.learned.networks.blocks import ConvUnit, SeparableUnit
from eidrive_scenario.perception.learned.networks.boxes import corners

STRIDES = (8, 16, 32, 64, 128)
SIDES = (14.0, 34.0, 76.0, 150.0, 270.0, 420.0)
"""Side of the square default box at each stride, and of one beyond the last [px of the network input]."""
ASPECTS = (1.0, 2.0, 3.0, 0.5, 1.0 / 3.0)
BOXES_PER_CELL = len(ASPECTS) + 1
"""One box of each aspect ratio, and a square one between the sides of this and the next stride."""
VARIANCES = (0.1, 0.2)
"""Scale of encoded centers and sizes, as in the code of the paper."""


class Ssd(nn.Module):
    """Network from images (B, 3, H, W) in [0, 1] to encoded boxes (B, N, 4) and class logits (B, N, 1 + C), background
    first.

    H and W are multiples of 128. `default_boxes(H, W)` returns the N boxes.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.classes = classes
        self.fine = nn.Sequential(
            ConvUnit(3, 16, 3, 2),
            SeparableUnit(16, 32),
            SeparableUnit(32, 64, 2),
            SeparableUnit(64, 64),
            SeparableUnit(64, 128, 2),
            *(SeparableUnit(128, 128) for _ in range(3)),
        )
        self.middle = nn.Sequential(SeparableUnit(128, 256, 2), *(SeparableUnit(256, 256) for _ in range(3)))
        self.coarse = nn.Sequential(SeparableUnit(256, 384, 2), *(SeparableUnit(384, 384) for _ in range(2)))
        self.extra = nn.Sequential(ConvUnit(384, 128), SeparableUnit(128, 256, 2))
        self.last = nn.Sequential(ConvUnit(256, 96), SeparableUnit(96, 192, 2))
        widths = (128, 256, 384, 256, 192)
        self.box_heads = nn.ModuleList(_head(width, 4) for width in widths)
        self.class_heads = nn.ModuleList(_head(width, 1 + classes) for width in widths)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        features = [self.fine(images)]
        for stage in (self.middle, self.coarse, self.extra, self.last):
            features.append(stage(features[-1]))
        encoded, logits = [], []
        for box_head, class_head, level in zip(self.box_heads, self.class_heads, features, strict=True):
            batch = level.shape[0]
            encoded.append(box_head(level).permute(0, 2, 3, 1).reshape(batch, -1, 4))
            logits.append(class_head(level).permute(0, 2, 3, 1).reshape(batch, -1, 1 + self.classes))
        return torch.cat(encoded, dim=1), torch.cat(logits, dim=1)

    def decode(self, outputs: tuple[Tensor, Tensor], defaults: Tensor) -> tuple[Tensor, Tensor]:
        """Return boxes (B, N, 4) x1 y1 x2 y2 [px] and class probabilities (B, N, C) without background."""
        encoded, logits = outputs
        return corners(decode(encoded, defaults)), logits.softmax(dim=-1)[..., 1:]


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
    size = torch.exp((encoded[..., 2:] * VARIANCES[1]).clamp(max=8.0)) * defaults[..., 2:]
    return torch.cat([center, size], dim=-1)
