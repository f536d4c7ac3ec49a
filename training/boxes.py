"""Boxes as tensors, in center form (cx cy w h) or as corners (x1 y1 x2 y2): overlap measures, training targets."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor


def corners(boxes: Tensor) -> Tensor:
    """Convert (…, 4) cx cy w h to x1 y1 x2 y2."""
    center, half = boxes[..., :2], boxes[..., 2:] / 2.0
    return torch.cat([center - half, center + half], dim=-1)


def centered(boxes: Tensor) -> Tensor:
    """Convert (…, 4) x1 y1 x2 y2 to cx cy w h."""
    low, high = boxes[..., :2], boxes[..., 2:]
    return torch.cat([(low + high) / 2.0, high - low], dim=-1)


def pairwise_iou(first: Tensor, second: Tensor) -> Tensor:
    """Return the intersection over union (…, N, M) of corners (…, N, 4) and (…, M, 4)."""
    low = torch.maximum(first[..., :, None, :2], second[..., None, :, :2])
    high = torch.minimum(first[..., :, None, 2:], second[..., None, :, 2:])
    shared = (high - low).clamp(min=0.0).prod(dim=-1)
    area_first = (first[..., 2:] - first[..., :2]).prod(dim=-1)
    area_second = (second[..., 2:] - second[..., :2]).prod(dim=-1)
    return shared / (area_first[..., :, None] + area_second[..., None, :] - shared).clamp(min=1e-9)


def complete_iou(first: Tensor, second: Tensor) -> Tensor:
    """Return the CIoU (N,) of boxes (N, 4) in center form, row by row.

    Overlap minus the squared distance of the centers over the diagonal of the hull, minus a term for different aspect
    ratios (Zheng et al., Distance-IoU loss, AAAI 2020, eq. 6, 10 and 11).
    """
    a, b = corners(first), corners(second)
    shared = (torch.minimum(a[:, 2:], b[:, 2:]) - torch.maximum(a[:, :2], b[:, :2])).clamp(min=0.0).prod(dim=1)
    union = first[:, 2:].prod(dim=1) + second[:, 2:].prod(dim=1) - shared + 1e-9
    iou = shared / union
    hull = torch.maximum(a[:, 2:], b[:, 2:]) - torch.minimum(a[:, :2], b[:, :2])
    diagonal = hull.square().sum(dim=1) + 1e-9
    apart = (first[:, :2] - second[:, :2]).square().sum(dim=1)
    angle_first = torch.atan(first[:, 2] / first[:, 3].clamp(min=1e-9))
    angle_second = torch.atan(second[:, 2] / second[:, 3].clamp(min=1e-9))
    unlike = 4.0 / math.pi**2 * (angle_second - angle_first).square()
    with torch.no_grad():
        weight = unlike / (1.0 - iou + unlike + 1e-9)
    return iou - apart / diagonal - weight * unlike


PADDING, IGNORED = -1, -2
"""Classes of padding rows, and of objects whose detection is neither required nor an error."""


@dataclass(frozen=True)
class Targets:
    """Boxes (B, M, 4) cx cy w h [px of the network input]; classes (B, M), PADDING or IGNORED."""

    boxes: Tensor
    classes: Tensor

    def objects(self) -> tuple[Tensor, Tensor, Tensor]:
        """Return image (K,), box (K, 4) and class (K,) of all required objects."""
        image, row = torch.nonzero(self.classes >= 0, as_tuple=True)
        return image, self.boxes[image, row], self.classes[image, row]

    def in_ignored(self, points: Tensor) -> Tensor:
        """Return whether points (N, 2) [px] are in an ignored object of the image, as (B, N)."""
        image, row = torch.nonzero(self.classes == IGNORED, as_tuple=True)
        center, half = self.boxes[image, row].chunk(2, dim=1)
        half = half / 2.0
        away = (points[None] - center[:, None]).abs()
        inside = (away <= half[:, None]).all(dim=2)
        counts = torch.zeros((self.boxes.shape[0], len(points)), dtype=torch.int32, device=points.device)
        return counts.index_add_(0, image, inside.int()) > 0
