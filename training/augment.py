"""Changes to pictures while training, on whole batches on the device that trains."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import affine_grid, avg_pool2d, grid_sample

from eidrive_scenario.perception.learned.networks.boxes import centered
from eidrive_scenario.perception.learned.networks.targets import IGNORED, PADDING, Targets

SMALLEST_SIDE = 3.0
"""Boxes that come out smaller are ignored [px]."""
LEAST_SHARE = 0.3
"""So are those of which less is left in the picture."""
ZOOM = (0.65, 1.6)
STRETCH = 0.15
"""Ratio of the two zooms about 1: cameras of other shapes are taken to the same input."""


def moved(pictures: Tensor, boxes: Tensor, classes: Tensor, draws: torch.Generator) -> tuple[Tensor, Targets]:
    """Pictures (B, 3, H, W) mirrored, zoomed and shifted at random, and their boxes (B, M, 4) x1 y1 x2 y2 with them."""
    batch, _, height, width = pictures.shape
    device = pictures.device

    def uniform(low: float, high: float) -> Tensor:
        return low + (high - low) * torch.rand(batch, generator=draws, device=device)

    zoom = torch.exp(uniform(math.log(ZOOM[0]), math.log(ZOOM[1])))
    plain = uniform(0.0, 1.0) < 0.35
    zoom = torch.where(plain, 1.0, zoom)
    stretch = torch.where(plain, 1.0, torch.exp(uniform(-STRETCH, STRETCH)))
    zoom_x, zoom_y = zoom * stretch, zoom / stretch
    mirror = torch.where(uniform(0.0, 1.0) < 0.5, -1.0, 1.0)
    # The part of the picture that is shown is 1 / zoom of it; the shift leaves it inside, or pads where zoom < 1.
    room_x, room_y = (1.0 - 1.0 / zoom_x).abs(), (1.0 - 1.0 / zoom_y).abs()
    shift_x, shift_y = uniform(-1.0, 1.0) * room_x, uniform(-1.0, 1.0) * room_y
    transform = torch.zeros((batch, 2, 3), device=device)
    transform[:, 0, 0], transform[:, 0, 2] = mirror / zoom_x, shift_x
    transform[:, 1, 1], transform[:, 1, 2] = 1.0 / zoom_y, shift_y
    grid = affine_grid(transform, [batch, 3, height, width], align_corners=False)
    # Gray where the picture does not reach.
    shown = grid_sample(pictures - 0.45, grid, mode="bilinear", padding_mode="zeros", align_corners=False) + 0.45
    size = torch.tensor([width, height] * 2, device=device, dtype=boxes.dtype)
    unit = boxes / size * 2.0 - 1.0
    # The grid says where a new pixel comes from; boxes go the other way.
    x = (unit[..., 0::2] - shift_x[:, None, None]) * (mirror * zoom_x)[:, None, None]
    y = (unit[..., 1::2] - shift_y[:, None, None]) * zoom_y[:, None, None]
    x, y = x.sort(dim=-1).values, y.sort(dim=-1).values
    whole = torch.stack([x[..., 0], y[..., 0], x[..., 1], y[..., 1]], dim=-1)
    inside = whole.clamp(-1.0, 1.0)
    left = _area(inside) / _area(whole).clamp(min=1e-9)
    cut = (inside + 1.0) / 2.0 * size
    sides = cut[..., 2:] - cut[..., :2]
    gone = (sides <= 0.5).any(dim=-1)
    poor = (left < LEAST_SHARE) | (sides.amin(dim=-1) < SMALLEST_SIDE)
    present = classes != PADDING
    new = torch.where(present & poor & (classes >= 0), torch.full_like(classes, IGNORED), classes)
    new = torch.where(present & gone, torch.full_like(classes, PADDING), new)
    return shown, Targets(centered(cut), new)


def _area(boxes: Tensor) -> Tensor:
    return (boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1])


def recolored(pictures: Tensor, draws: torch.Generator) -> Tensor:
    """Pictures (B, 3, H, W) with other brightness, contrast, colors, haze, blur and noise, in [0, 1]."""
    batch = len(pictures)
    device = pictures.device

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        values = torch.rand((batch, *(shape or (1, 1, 1))), generator=draws, device=device)
        return low + (high - low) * values

    def chosen(share: float) -> Tensor:
        return uniform(0.0, 1.0) < share

    gamma = torch.exp(uniform(-0.45, 0.45))
    out = pictures.clamp(1e-4, 1.0) ** torch.where(chosen(0.6), gamma, 1.0)
    out = out * torch.where(chosen(0.6), uniform(0.6, 1.4), 1.0)
    mean = out.mean(dim=(1, 2, 3), keepdim=True)
    out = mean + (out - mean) * torch.where(chosen(0.5), uniform(0.6, 1.3), 1.0)
    gray = out.mean(dim=1, keepdim=True)
    out = gray + (out - gray) * torch.where(chosen(0.5), uniform(0.3, 1.6), 1.0)
    out = out * torch.where(chosen(0.4), uniform(0.88, 1.12, 3, 1, 1), 1.0)
    haze = torch.where(chosen(0.15), uniform(0.1, 0.55), 0.0)
    out = out * (1.0 - haze) + uniform(0.5, 0.85) * haze
    soft = avg_pool2d(out, 3, stride=1, padding=1, count_include_pad=False)
    out = torch.where(chosen(0.15), soft, out)
    strength = torch.where(chosen(0.4), uniform(0.0, 0.06), 0.0)
    noise = torch.randn(out.shape, generator=draws, device=device)
    return (out + strength * noise).clamp(0.0, 1.0)
