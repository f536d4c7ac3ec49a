"""Networks of torch from weight files, and weight files from trained networks."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from eidrive_scenario.perception.learned.networks.ssd import Ssd
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5
from eidrive_scenario.perception.learned.weights import DESCRIPTION, Description, Weights, read, suitable


def save(path: Path, network: nn.Module, description: Description, card: dict[str, Any]) -> None:
    """Write weights and metadata. Convolutions are stored in half precision, other tensors in single precision."""
    arrays: dict[str, Any] = {}
    for name, value in network.state_dict().items():
        array = value.detach().cpu().numpy()
        arrays[name] = array.astype(np.float16) if array.ndim == 4 else array
    arrays[DESCRIPTION] = np.array(json.dumps(asdict(description)))
    np.savez_compressed(path, **arrays)
    path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> tuple[Description, YoloV5 | Ssd]:
    """Return the network with its weights, trainable. Raise SettingError if the file does not contain weights."""
    weights = read(path)
    with suitable(path):
        return weights.description, trainable(weights)


def untrained(description: Description) -> YoloV5 | Ssd:
    """Return the network of a description with random weights. Raise ValueError if anchors of `yolov5` are missing."""
    if description.network == "ssd":
        return Ssd(len(description.classes))
    if description.anchors is None:
        raise ValueError("its description lacks anchors")
    return YoloV5(len(description.classes), description.anchors)


def trainable(weights: Weights) -> YoloV5 | Ssd:
    """Return the network with these weights. Raise ValueError if an array is missing or has another shape."""
    network, stored = untrained(weights.description), weights.arrays
    expected = network.state_dict()
    missing = [name for name in expected if name not in stored]
    if missing:
        raise ValueError(f"{missing[0]} is missing")
    mismatched = [name for name, value in expected.items() if tuple(value.shape) != stored[name].shape]
    if mismatched:
        raise ValueError(f"{mismatched[0]} has another shape than the network")
    network.load_state_dict(
        {name: torch.from_numpy(stored[name].copy()).to(value.dtype) for name, value in expected.items()}
    )
    return network
