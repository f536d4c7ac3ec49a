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
        low = self.boxes[..., :2] - self.boxes[..., 2:] / 2.0
        high = low + self.boxes[..., 2:]
        x, y = points[:, 0], points[:, 1]
        found = torch.zeros((self.boxes.shape[0], len(points)), dtype=torch.bool, device=points.device)
        for row in range(self.boxes.shape[1]):
            ignored = self.classes[:, row] == IGNORED
            if ignored.any():
                left, top = low[:, row, 0:1], low[:, row, 1:2]
                right, bottom = high[:, row, 0:1], high[:, row, 1:2]
                inside = (x >= left) & (x <= right) & (y >= top) & (y <= bottom)
                found |= inside & ignored[:, None]
        return found
