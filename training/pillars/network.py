"""Network of the detector `pillars` for training, with its quantization and fusion of stations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from training.pillars.scenes import CLASSES

CHANNELS = 12
CELLS, SIDE = 256, 0.4
"""Cells along each axis of the input, and their edge [m]; those of the output are twice as large."""
OUT, STRIDE_SIDE = 128, 0.8
REACH = CELLS * SIDE / 2.0
FEATURES, LATENT = 96, 8
LATENT_LIMIT = 8.0
"""Maximum of a transmitted value; 127 steps on each side of zero."""
BOX = 13
"""Channels of the head besides the classes."""


class Unit(nn.Sequential):
    """Convolution, batch normalization and ReLU."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs, eps=1e-3), nn.ReLU()
        )


class Up(nn.Sequential):
    """1x1 or transposed convolution, batch normalization and ReLU."""

    def __init__(self, inputs: int, outputs: int, factor: int) -> None:
        convolution = (
            nn.Conv2d(inputs, outputs, 1, bias=False)
            if factor == 1
            else nn.ConvTranspose2d(inputs, outputs, factor, factor, bias=False)
        )
        super().__init__(convolution, nn.BatchNorm2d(outputs, eps=1e-3), nn.ReLU())


class Pillars(nn.Module):
    """Backbone, compression and head."""

    def __init__(self) -> None:
        super().__init__()
        self.block0 = nn.Sequential(Unit(CHANNELS, 32, 2), Unit(32, 32))
        self.block1 = nn.Sequential(Unit(32, 48, 2), *(Unit(48, 48) for _ in range(2)))
        self.block2 = nn.Sequential(Unit(48, 128, 2), *(Unit(128, 128) for _ in range(4)))
        self.up0, self.up1, self.up2 = Up(32, 32, 1), Up(48, 32, 2), Up(128, 32, 4)
        self.compress = nn.Conv2d(FEATURES, LATENT, 1)
        self.expand = nn.Conv2d(LATENT, FEATURES, 1)
        self.head = nn.Conv2d(FEATURES, len(CLASSES) + BOX, 1)
        bias = self.head.bias
        assert bias is not None
        nn.init.constant_(bias[: len(CLASSES)], -4.0)

    def features(self, grid: Tensor) -> Tensor:
        """Return features (N, 96, 128, 128) of grids (N, 12, 256, 256)."""
        fine = self.block0(grid)
        middle = self.block1(fine)
        return torch.cat([self.up0(fine), self.up1(middle), self.up2(self.block2(middle))], dim=1)

    def sent(self, features: Tensor) -> Tensor:
        """Return the values (N, 8, 128, 128) that a receiver decodes; gradients pass the rounding."""
        latent: Tensor = self.compress(features).clamp(-LATENT_LIMIT, LATENT_LIMIT)
        scale = LATENT_LIMIT / 127.0
        return latent + (torch.round(latent / scale) * scale - latent).detach()

    def received(self, latent: Tensor) -> Tensor:
        """Return the features of received values."""
        return functional.relu(self.expand(latent))

    def folded(self) -> dict[str, np.ndarray[Any, Any]]:
        """Return the weights, with batch normalizations folded into the convolutions."""
        arrays: dict[str, np.ndarray[Any, Any]] = {}

        def fold(name: str, unit: nn.Sequential) -> None:
            convolution, norm = unit[0], unit[1]
            assert isinstance(convolution, nn.Conv2d | nn.ConvTranspose2d)
            assert isinstance(norm, nn.BatchNorm2d)
            assert norm.running_var is not None
            assert norm.running_mean is not None
            weight = convolution.weight.detach().double().cpu()
            gain = (norm.weight.double() / torch.sqrt(norm.running_var.double() + norm.eps)).detach().cpu()
            axis = (1, -1, 1, 1) if isinstance(convolution, nn.ConvTranspose2d) else (-1, 1, 1, 1)
            arrays[f"{name}.weight"] = (weight * gain.reshape(axis)).float().numpy()
            offset = norm.bias.double().detach().cpu() - norm.running_mean.double().cpu() * gain
            arrays[f"{name}.bias"] = offset.float().numpy()

        for block in ("block0", "block1", "block2"):
            for number, unit in enumerate(getattr(self, block)):
                fold(f"{block}.{number}", unit)
        for up in ("up0", "up1", "up2"):
            fold(up, getattr(self, up))
        for name in ("compress", "expand", "head"):
            arrays[f"{name}.weight"] = getattr(self, name).weight.detach().float().cpu().numpy()
            arrays[f"{name}.bias"] = getattr(self, name).bias.detach().float().cpu().numpy()
        arrays["latent_scale"] = np.array(LATENT_LIMIT / 127.0, dtype=np.float32)
        return arrays


def probabilities(maps: Tensor) -> Tensor:
    """Return the maximum class probability (N, 128, 128) of head maps."""
    return torch.sigmoid(maps[:, : len(CLASSES)].float()).amax(dim=1)


_OFFSETS = torch.arange(5, dtype=torch.float32) - 2.0
_KERNEL = torch.exp(-(_OFFSETS**2) / 2.0)


def smoothed(confidence: Tensor) -> Tensor:
    """Return confidences (N, H, W) smoothed by a 5x5 Gaussian with sigma 1."""
    kernel = (_KERNEL / _KERNEL.sum()).to(confidence)
    rows = functional.conv2d(confidence[:, None], kernel.reshape(1, 1, 5, 1), padding=(2, 0))
    return functional.conv2d(rows, kernel.reshape(1, 1, 1, 5), padding=(0, 2))[:, 0]


def most_confident(confidence: Tensor, share: float) -> Tensor:
    """Return a mask (N, H, W) of this share of the cells."""
    if share >= 1.0:
        return torch.ones_like(confidence)
    flat = smoothed(confidence).flatten(1)
    count = max(1, round(share * flat.shape[1]))
    rows = flat.topk(count, dim=1).indices
    return torch.zeros_like(flat).scatter_(1, rows, 1.0).reshape(confidence.shape)


def warp(latent: Tensor, mask: Tensor, shift: Tensor, turn: Tensor) -> tuple[Tensor, Tensor]:
    """Return values (N, 8, H, W) and mask (N, H, W) of senders in the grids of receivers.

    shift, turn  position (N, 2) [m] and heading (N,) [rad] of the grid of the receiver in that of the sender
    """
    cell = (torch.arange(OUT, device=latent.device) + 0.5) * STRIDE_SIDE - REACH
    x, y = torch.meshgrid(cell, cell, indexing="ij")
    cos, sin = torch.cos(turn)[:, None, None], torch.sin(turn)[:, None, None]
    u = cos * x - sin * y + shift[:, 0, None, None]
    v = sin * x + cos * y + shift[:, 1, None, None]
    where = torch.stack([v, u], dim=3) / REACH
    both = torch.cat([latent.float() * mask[:, None], mask[:, None]], dim=1)
    sampled = functional.grid_sample(both, where, align_corners=False)
    weight = sampled[:, -1]
    return sampled[:, :-1] / weight[:, None].clamp(min=1e-6), (weight >= 0.5).float()


def fuse(own: Tensor, others: Tensor, present: Tensor, method: str) -> Tensor:
    """Return fused features (N, 96, H, W) of own ones and those of S senders (S, N, 96, H, W), present (S, N, H, W)."""
    if method == "max":
        return torch.maximum(own, (others * present[:, :, None]).amax(dim=0))
    scores = (own[None] * others).sum(dim=2) / math.sqrt(FEATURES)
    scores = torch.where(present > 0.0, scores, torch.full_like(scores, -torch.inf))
    first = (own * own).sum(dim=1) / math.sqrt(FEATURES)
    weights = torch.softmax(torch.cat([first[None], scores]), dim=0)
    return weights[0][:, None] * own + (weights[1:, :, None] * others * present[:, :, None]).sum(dim=0)
