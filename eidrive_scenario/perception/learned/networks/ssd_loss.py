"""Which default box answers for which object, and the loss of `ssd`."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import cross_entropy, smooth_l1_loss

from eidrive_scenario.perception.learned.networks.boxes import corners, pairwise_iou
from eidrive_scenario.perception.learned.networks.ssd import encode
from eidrive_scenario.perception.learned.networks.targets import Targets

LEAST_OVERLAP = 0.5
"""A default box answers for the object that it overlaps by at least this much."""
NEUTRAL_OVERLAP = 0.4
"""From here up to LEAST_OVERLAP it answers for nothing and is not background either."""
NEGATIVES_PER_POSITIVE = 3
BACKGROUND, NOT_ASKED = 0, -1


def match(targets: Targets, defaults: Tensor) -> tuple[Tensor, Tensor]:
    """The object's row (B, N) and label (B, N) of each default box (N, 4): class + 1, BACKGROUND or NOT_ASKED.

    Each object also has the default box that overlaps it most, however little (Liu et al. 2016, section 2.2).
    """
    present = targets.classes >= 0
    overlap = pairwise_iou(corners(targets.boxes), corners(defaults)[None]) * present[..., None]
    best, row = overlap.max(dim=1)
    label = torch.where(best >= LEAST_OVERLAP, targets.classes.gather(1, row) + 1, BACKGROUND)
    label[(best >= NEUTRAL_OVERLAP) & (best < LEAST_OVERLAP)] = NOT_ASKED
    ignored = targets.in_ignored(defaults[:, :2])
    label[ignored & (label == BACKGROUND)] = NOT_ASKED
    picture, number = torch.nonzero(present, as_tuple=True)
    nearest = overlap[picture, number].argmax(dim=1)
    row[picture, nearest] = number
    label[picture, nearest] = targets.classes[picture, number] + 1
    return row, label


class SsdLoss:
    """Smooth L1 of the encoded boxes and cross entropy of the classes, per answering default box.

    Of the background, the cross entropy counts the boxes that are hardest to tell, three for each answering one.
    """

    def __init__(self, defaults: Tensor) -> None:
        self._defaults = defaults

    def __call__(self, outputs: tuple[Tensor, Tensor], targets: Targets) -> tuple[Tensor, dict[str, float]]:
        """The loss of outputs as `Ssd` gives them, and its parts."""
        encoded, logits = outputs[0].float(), outputs[1].float()
        row, label = match(targets, self._defaults)
        positive = label > BACKGROUND
        count = positive.sum().clamp(min=1)
        wanted = encode(targets.boxes.gather(1, row[..., None].expand(-1, -1, 4)), self._defaults)
        box_loss = smooth_l1_loss(encoded[positive], wanted[positive], reduction="sum") / count
        each = cross_entropy(logits.flatten(0, 1), label.clamp(min=0).flatten(), reduction="none").view_as(label)
        hard = hardest(each.detach(), label)
        class_loss = (each * (positive | hard)).sum() / count
        parts = {"box": box_loss, "class": class_loss}
        return box_loss + class_loss, {name: float(value.detach()) for name, value in parts.items()}


def hardest(loss: Tensor, label: Tensor) -> Tensor:
    """(B, N) the background boxes of each picture with the greatest loss, three for each that answers for an object."""
    background = label == BACKGROUND
    wanted = (label > BACKGROUND).sum(dim=1, keepdim=True) * NEGATIVES_PER_POSITIVE
    wanted = wanted.clamp(min=NEGATIVES_PER_POSITIVE)
    order = torch.where(background, loss, -torch.inf).argsort(dim=1, descending=True)
    rank = order.argsort(dim=1)
    return (rank < wanted) & background
