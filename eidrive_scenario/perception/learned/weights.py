"""The weights of the project's own networks: one .npz file, with a card beside it that says where they come from."""

from __future__ import annotations

import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from eidrive_scenario.errors import Problem, SettingError
from eidrive_scenario.perception.learned.ssd import Ssd
from eidrive_scenario.perception.learned.yolov5 import Anchors, YoloV5

SHIPPED = Path(__file__).parents[1] / "weights"
_DESCRIPTION = "description"


@dataclass(frozen=True)
class Description:
    """What a file of weights is for.

    network     `yolov5` or `ssd`;  classes  in the order of its outputs
    input_size  width and height of its input [px];  anchors  of yolov5 [px]
    confidence  from which on its boxes are believed, where nobody says another
    """

    network: str
    classes: tuple[str, ...]
    input_size: tuple[int, int]
    anchors: Anchors | None = None
    confidence: float = 0.35

    def build(self) -> YoloV5 | Ssd:
        """The network, untrained. Raises ValueError if the description fits none."""
        if self.network == "yolov5" and self.anchors is not None:
            return YoloV5(len(self.classes), self.anchors)
        if self.network == "ssd":
            return Ssd(len(self.classes))
        raise ValueError(f"no network {self.network!r}, or it lacks its anchors")


def save(path: Path, network: nn.Module, description: Description, card: dict[str, Any]) -> None:
    """Write weights and card. Convolutions are kept in half precision, the rest in single."""
    arrays: dict[str, Any] = {}
    for name, value in network.state_dict().items():
        array = value.detach().cpu().numpy()
        arrays[name] = array.astype(np.float16) if array.ndim == 4 else array
    arrays[_DESCRIPTION] = np.array(json.dumps(asdict(description)))
    np.savez_compressed(path, **arrays)
    path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> tuple[Description, YoloV5 | Ssd]:
    """The network with its weights, ready to be trained on. Raises SettingError if the file is not one of weights."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            description = _described(json.loads(str(stored[_DESCRIPTION])))
            network = description.build()
            own = network.state_dict()
            values = {
                name: torch.from_numpy(stored[name]).to(value.dtype) if name in stored else None
                for name, value in own.items()
            }
        missing = [name for name, value in values.items() if value is None]
        if missing:
            raise ValueError(f"{missing[0]} is missing")
        network.load_state_dict({name: value for name, value in values.items() if value is not None})
    except (OSError, KeyError, TypeError, ValueError, RuntimeError, EOFError, zipfile.BadZipFile) as error:
        reason = " ".join(str(error).split())[:200]
        remedy = "give a file that training/train.py has written, an ONNX model (.onnx) or a TorchScript model (.pt)"
        raise SettingError(Problem(f"weights {str(path)!r} do not fit: {reason}", remedy)) from error
    return description, network


def _described(data: dict[str, Any]) -> Description:
    anchors = data["anchors"]
    width, height = data["input_size"]
    return Description(
        network=str(data["network"]),
        classes=tuple(data["classes"]),
        input_size=(int(width), int(height)),
        confidence=float(data.get("confidence", Description.confidence)),
        anchors=None if anchors is None else tuple(tuple((w, h) for w, h in scale) for scale in anchors),
    )
