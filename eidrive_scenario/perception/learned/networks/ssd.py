"""Network `ssd`: default boxes on five scales with a light backbone.

Liu et al., SSD: Single shot multibox detector, ECCV 2016. The backbone has depthwise separable convolutions (Howard et
al., MobileNets 2017), and so do the heads (Sandler et al., MobileNetV2 2018, section 6.2).
"""

from __future__ import annotations

from torch import Tensor, nn

from eidrive_scenario.perception.learned.networks.blocks import ConvUnit, SeparableUnit
from eidrive_scenario.perception.learned.networks.ssd_sizes import BOXES_PER_CELL, COARSE, FINE, MIDDLE


class Ssd(nn.Module):
    """Network from images (B, 3, H, W) in [0, 1] to the outputs of the ONNX model of the same weights.

    These are (B, 6 · 4, H/s, W/s), the encoded boxes of each stride s, then (B, 6 · (1 + C), H/s, W/s), class logits
    with the background first. H and W are multiples of 128.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.fine = nn.Sequential(ConvUnit(3, 16, 3, 2), *_separable_units(16, FINE))
        self.middle = nn.Sequential(*_separable_units(FINE[-1][0], MIDDLE))
        self.coarse = nn.Sequential(*_separable_units(MIDDLE[-1][0], COARSE))
        self.extra = nn.Sequential(ConvUnit(384, 128), SeparableUnit(128, 256, 2))
        self.last = nn.Sequential(ConvUnit(256, 96), SeparableUnit(96, 192, 2))
        widths = (FINE[-1][0], MIDDLE[-1][0], COARSE[-1][0], 256, 192)
        self.box_heads = nn.ModuleList(_head(width, 4) for width in widths)
        self.class_heads = nn.ModuleList(_head(width, 1 + classes) for width in widths)

    def forward(self, images: Tensor) -> list[Tensor]:
        features = [self.fine(images)]
        for stage in (self.middle, self.coarse, self.extra, self.last):
            features.append(stage(features[-1]))
        heads = (*self.box_heads, *self.class_heads)
        return [head(level) for head, level in zip(heads, (*features, *features), strict=True)]


def _separable_units(inputs: int, units: tuple[tuple[int, int], ...]) -> list[SeparableUnit]:
    """Return units with these output channels and strides."""
    widths = (inputs, *(outputs for outputs, _ in units))
    return [
        SeparableUnit(before, outputs, stride) for before, (outputs, stride) in zip(widths[:-1], units, strict=True)
    ]


def _head(inputs: int, each: int) -> nn.Module:
    return nn.Sequential(ConvUnit(inputs, inputs, 3, groups=inputs), nn.Conv2d(inputs, BOXES_PER_CELL * each, 1))
