"""Network `yolov5`: CSP backbone, pyramid pooling, path aggregation neck, three scales with anchors; nano size.

Implemented from the published architecture: CSPNet (Wang et al. 2020), PANet (Liu et al. 2018), anchors of YOLOv3 on
three scales (Redmon and Farhadi 2018), extended center offsets of YOLOv4 (Bochkovskiy et al. 2020).
"""

from __future__ import annotations

import math

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
        self._initialize_biases()

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
        found = []
        for scale, (raw, stride) in enumerate(zip(outputs, STRIDES, strict=True)):
            share = raw.sigmoid()
            cells = cell_corners(raw.shape[2], raw.shape[3], raw.device)
            center = (2.0 * share[..., :2] - 0.5 + cells) * stride
            size = (2.0 * share[..., 2:4]).square() * self.anchors[scale][None, :, None, None, :]
            found.append(torch.cat([center, size, share[..., 4:]], dim=-1).flatten(1, 3))
        return torch.cat(found, dim=1)

    def _initialize_biases(self) -> None:
        """Initialize biases so that the first outputs state that objects are rare (Lin et al., Focal loss 2017, section
        4.1)."""
        for head, stride in zip(self.heads, STRIDES, strict=True):
            assert isinstance(head, nn.Conv2d)
            assert head.bias is not None
            bias = head.bias.detach().view(ANCHORS_PER_SCALE, -1)
            bias[:, 4] = math.log(8.0 / (512.0 * 384.0 / stride**2))
            bias[:, 5:] = math.log(0.6 / (self.classes - 0.99))


def cell_corners(height: int, width: int, device: torch.device) -> Tensor:
    """Return column and row of each cell as (H, W, 2)."""
    lines, columns = torch.meshgrid(
        torch.arange(height, device=device), torch.arange(width, device=device), indexing="ij"
    )
    return torch.stack([columns, lines], dim=-1).float()
