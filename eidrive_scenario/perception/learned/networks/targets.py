"""What a network is trained towards: the objects of a batch of pictures, padded to one number."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

PADDING, IGNORED = -1, -2
"""Classes of rows that hold nothing, and of objects that are neither to be found nor wrong to be found."""


@dataclass(frozen=True)
class Targets:
    """boxes (B, M, 4) cx cy w h [px of the network's input]; classes (B, M), PADDING or IGNORED."""

    boxes: Tensor
    classes: Tensor

    def objects(self) -> tuple[Tensor, Tensor, Tensor]:
        """Picture (K,), box (K, 4) and class (K,) of all objects to be found."""
        picture, row = torch.nonzero(self.classes >= 0, as_tuple=True)
        return picture, self.boxes[picture, row], self.classes[picture, row]

    def in_ignored(self, points: Tensor) -> Tensor:
        """(B, N) whether points (N, 2) [px] lie in an object of the picture that is ignored."""
        picture, row = torch.nonzero(self.classes == IGNORED, as_tuple=True)
        center, half = self.boxes[picture, row].chunk(2, dim=1)
        half = half / 2.0
        away = (points[None] - center[:, None]).abs()
        inside = (away <= half[:, None]).all(dim=2)
        found = torch.zeros((self.boxes.shape[0], len(points)), dtype=torch.int32, device=points.device)
        return found.index_add_(0, picture, inside.int()) > 0
