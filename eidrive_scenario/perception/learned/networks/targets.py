"""Training targets: the objects of a batch of images, padded to a common number."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

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
        found = torch.zeros((self.boxes.shape[0], len(points)), dtype=torch.int32, device=points.device)
        return found.index_add_(0, image, inside.int()) > 0
