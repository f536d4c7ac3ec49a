"""Assignment of default boxes to objects, and the loss of `ssd`."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import cross_entropy, smooth_l1_loss

from eidrive_scenario.perception.learned.networks.boxes import corners, pairwise_iou
from eidrive_scenario.perception.learned.networks.ssd import encode
from eidrive_scenario.perception.learned.networks.targets import Targets

LEAST_OVERLAP = 0.5
"""Minimum overlap of a default box with its object (Liu et al. 2016, section 2.2)."""
NEUTRAL_OVERLAP = 0.4
"""Overlap from which, up to LEAST_OVERLAP, a default box is neither assigned nor background."""
NEGATIVES_PER_POSITIVE = 3
BACKGROUND, UNLABELED = 0, -1


def match(targets: Targets, defaults: Tensor) -> tuple[Tensor, Tensor]:
    """Return the row (B, N) of the object and the label (B, N) of each default box (N, 4): class + 1, BACKGROUND or
    UNLABELED.

    In addition, each object has the default box with the largest overlap, however small (Liu et al. 2016, section 2.2).
    """
    present = targets.classes >= 0
    overlap = pairwise_iou(corners(targets.boxes), corners(defaults)[None]) * present[..., None]
    best, row = overlap.max(dim=1)
    label = torch.where(best >= LEAST_OVERLAP, targets.classes.gather(1, row) + 1, BACKGROUND)
    label[(best >= NEUTRAL_OVERLAP) & (best < LEAST_OVERLAP)] = UNLABELED
    ignored = targets.in_ignored(defaults[:, :2])
    label[ignored & (label == BACKGROUND)] = UNLABELED
    image, number = torch.nonzero(present, as_tuple=True)
    nearest = overlap[image, number].argmax(dim=1)
    row[image, nearest] = number
    label[image, nearest] = targets.classes[image, number] + 1
    return row, label


class SsdLoss:
    """Smooth L1 loss of the encoded boxes and cross entropy of the classes, per assigned default box.

    Hard negative mining: the cross entropy includes the three background boxes with the largest loss for each assigned
    one.
    """

    def __init__(self, defaults: Tensor) -> None:
        self._defaults = defaults

    def __call__(self, outputs: tuple[Tensor, Tensor], targets: Targets) -> tuple[Tensor, dict[str, float]]:
        """Return the loss of outputs of `Ssd`, and its terms."""
        encoded, logits = outputs[0].float(), outputs[1].float()
        row, label = match(targets, self._defaults)
        positive = label > BACKGROUND
        count = positive.sum().clamp(min=1)
        expected = encode(targets.boxes.gather(1, row[..., None].expand(-1, -1, 4)), self._defaults)
        box_loss = smooth_l1_loss(encoded[positive], expected[positive], reduction="sum") / count
        each = cross_entropy(logits.flatten(0, 1), label.clamp(min=0).flatten(), reduction="none").view_as(label)
        hard = hardest(each.detach(), label)
        class_loss = (each * (positive | hard)).sum() / count
        parts = {"box": box_loss, "class": class_loss}
        return box_loss + class_loss, {name: float(value.detach()) for name, value in parts.items()}


def hardest(loss: Tensor, label: Tensor) -> Tensor:
    """Return the background boxes (B, N) of each image with the largest loss, three for each assigned one."""
    background = label == BACKGROUND
    expected = (label > BACKGROUND).sum(dim=1, keepdim=True) * NEGATIVES_PER_POSITIVE
    expected = expected.clamp(min=NEGATIVES_PER_POSITIVE)
    order = torch.where(background, loss, -torch.inf).argsort(dim=1, descending=True)
    rank = order.argsort(dim=1)
    return (rank < expected) & background
