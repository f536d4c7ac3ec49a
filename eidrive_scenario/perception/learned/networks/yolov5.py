"""Network `yolov5`: CSP backbone, pyramid pooling, path aggregation neck, three scales with anchors; nano size.

Implemented from the published architecture: CSPNet (Wang et al. 2020), PANet (Liu et al. 2018), anchors of YOLOv3 on
three scales (Redmon and Farhadi 2018), extended center offsets of YOLOv4 (Bochkovskiy et al. 2020).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from eidrive_scenario.perception.learned.networks.blocks import ConvUnit, CrossStage, PyramidPooling
from eidrive_scenario.perception.learned.networks.yolov5_sizes import (
    ANCHORS_PER_SCALE,
    DEPTHS,
    STRIDES,
    WIDTHS,
    Anchors,
)


class YoloV5(nn.Module):
    """Network from images (B, 3, H, W) in [0, 1] to the outputs (B, A (5 + C), H/s, W/s) of each stride s.

    They are those of the ONNX model of the same weights. H and W are multiples of 32.

    anchors  width and height [px of the network input] of three boxes for each of the strides 8, 16 and 32
    """

    def __init__(self, classes: int, anchors: Anchors) -> None:
        super().__init__()
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

    def forward(self, images: Tensor) -> list[Tensor]:
        fine = self.fine(images)
        middle = self.middle(fine)
        coarse = self.lateral_coarse(self.coarse(middle))
        middle = self.lateral_middle(self.merge_middle(torch.cat([self.up(coarse), middle], dim=1)))
        fine = self.merge_fine(torch.cat([self.up(middle), fine], dim=1))
        middle = self.out_middle(torch.cat([self.down_fine(fine), middle], dim=1))
        coarse = self.out_coarse(torch.cat([self.down_middle(middle), coarse], dim=1))
        return [head(features) for head, features in zip(self.heads, (fine, middle, coarse), strict=True)]
