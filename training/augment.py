"""Data augmentation of whole batches on the training device."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import affine_grid, avg_pool2d, grid_sample

from training.boxes import IGNORED, PADDING, Targets, centered

SMALLEST_SIDE = 3.0
"""Minimum side of a box after augmentation [px]; objects with smaller boxes are ignored."""
LEAST_SHARE = 0.3
"""Minimum share of a box inside the image; other objects are ignored."""
ZOOM = (0.65, 1.6)
STRETCH = 0.15
"""Range of the log ratio of the two zooms: cameras of other aspect ratios are scaled to the same input."""


def transform_images(images: Tensor, boxes: Tensor, classes: Tensor, draws: torch.Generator) -> tuple[Tensor, Targets]:
    """Return images (B, 3, H, W) mirrored, zoomed and shifted at random, with their boxes (B, M, 4) x1 y1 x2 y2."""
    batch, _, height, width = images.shape
    device = images.device

    def uniform(low: float, high: float) -> Tensor:
        return low + (high - low) * torch.rand(batch, generator=draws, device=device)

    zoom = torch.exp(uniform(math.log(ZOOM[0]), math.log(ZOOM[1])))
    unchanged = uniform(0.0, 1.0) < 0.35
    zoom = torch.where(unchanged, 1.0, zoom)
    stretch = torch.where(unchanged, 1.0, torch.exp(uniform(-STRETCH, STRETCH)))
    zoom_x, zoom_y = zoom * stretch, zoom / stretch
    mirror = torch.where(uniform(0.0, 1.0) < 0.5, -1.0, 1.0)
    # A share of 1 / zoom of the image is visible; the shift keeps it inside, or pads for zoom < 1.
    margin_x, margin_y = (1.0 - 1.0 / zoom_x).abs(), (1.0 - 1.0 / zoom_y).abs()
    shift_x, shift_y = uniform(-1.0, 1.0) * margin_x, uniform(-1.0, 1.0) * margin_y
    transform = torch.zeros((batch, 2, 3), device=device)
    transform[:, 0, 0], transform[:, 0, 2] = mirror / zoom_x, shift_x
    transform[:, 1, 1], transform[:, 1, 2] = 1.0 / zoom_y, shift_y
    grid = affine_grid(transform, [batch, 3, height, width], align_corners=False)
    # Pixels outside the image are gray.
    transformed = grid_sample(images - 0.45, grid, mode="bilinear", padding_mode="zeros", align_corners=False) + 0.45
    size = torch.tensor([width, height] * 2, device=device, dtype=boxes.dtype)
    unit = boxes / size * 2.0 - 1.0
    # The grid maps new pixels to old ones; boxes are mapped in the opposite direction.
    x = (unit[..., 0::2] - shift_x[:, None, None]) * (mirror * zoom_x)[:, None, None]
    y = (unit[..., 1::2] - shift_y[:, None, None]) * zoom_y[:, None, None]
    x, y = x.sort(dim=-1).values, y.sort(dim=-1).values
    complete = torch.stack([x[..., 0], y[..., 0], x[..., 1], y[..., 1]], dim=-1)
    inside = complete.clamp(-1.0, 1.0)
    remaining = _area(inside) / _area(complete).clamp(min=1e-9)
    cut = (inside + 1.0) / 2.0 * size
    sides = cut[..., 2:] - cut[..., :2]
    is_outside = (sides <= 0.5).any(dim=-1)
    is_partial = (remaining < LEAST_SHARE) | (sides.amin(dim=-1) < SMALLEST_SIDE)
    present = classes != PADDING
    new_classes = torch.where(present & is_partial & (classes >= 0), torch.full_like(classes, IGNORED), classes)
    new_classes = torch.where(present & is_outside, torch.full_like(classes, PADDING), new_classes)
    return transformed, Targets(centered(cut), new_classes)


def _area(boxes: Tensor) -> Tensor:
    return (boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1])


def change_colors(images: Tensor, draws: torch.Generator) -> Tensor:
    """Return images (B, 3, H, W) with random brightness, contrast, colors, haze, blur and noise, in [0, 1]."""
    batch = len(images)
    device = images.device

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        values = torch.rand((batch, *(shape or (1, 1, 1))), generator=draws, device=device)
        return low + (high - low) * values

    def with_probability(share: float) -> Tensor:
        return uniform(0.0, 1.0) < share

    gamma = torch.exp(uniform(-0.45, 0.45))
    out = images.clamp(1e-4, 1.0) ** torch.where(with_probability(0.6), gamma, 1.0)
    out = out * torch.where(with_probability(0.6), uniform(0.6, 1.4), 1.0)
    mean = out.mean(dim=(1, 2, 3), keepdim=True)
    out = mean + (out - mean) * torch.where(with_probability(0.5), uniform(0.6, 1.3), 1.0)
    gray = out.mean(dim=1, keepdim=True)
    out = gray + (out - gray) * torch.where(with_probability(0.5), uniform(0.3, 1.6), 1.0)
    out = out * torch.where(with_probability(0.4), uniform(0.88, 1.12, 3, 1, 1), 1.0)
    haze = torch.where(with_probability(0.15), uniform(0.1, 0.55), 0.0)
    out = out * (1.0 - haze) + uniform(0.5, 0.85) * haze
    soft = avg_pool2d(out, 3, stride=1, padding=1, count_include_pad=False)
    out = torch.where(with_probability(0.15), soft, out)
    strength = torch.where(with_probability(0.4), uniform(0.0, 0.06), 0.0)
    noise = torch.randn(out.shape, generator=draws, device=device)
    return (out + strength * noise).clamp(0.0, 1.0)
