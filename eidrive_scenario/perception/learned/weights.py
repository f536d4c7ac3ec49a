"""The weights of the project's own networks: one .npz file, with a card beside it that says where they come from."""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, shortened
from eidrive_scenario.perception.learned.networks.ssd import Ssd
from eidrive_scenario.perception.learned.networks.yolov5 import STRIDES, Anchors, YoloV5
from eidrive_scenario.perception.learned.weight_files import (
    DEFAULT_CONFIDENCE,
    MAX_CLASSES,
    MAX_SIDE,
    read_arrays,
    read_weights,
)

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
    confidence: float = DEFAULT_CONFIDENCE

    def build(self) -> YoloV5 | Ssd:
        """The network, untrained. Raises ValueError if the description fits none."""
        if self.network == "yolov5" and self.anchors is not None:
            return YoloV5(len(self.classes), self.anchors)
        if self.network == "ssd":
            return Ssd(len(self.classes))
        raise ValueError("its description names no network, or lacks anchors")


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
    content = read_weights(path)
    try:
        stored = read_arrays(content)
        description = _described(json.loads(str(stored[_DESCRIPTION])))
        network = description.build()
        own = network.state_dict()
        missing = [name for name in own if name not in stored]
        if missing:
            raise ValueError(f"{missing[0]} is missing")
        wrong = [name for name, value in own.items() if tuple(value.shape) != stored[name].shape]
        if wrong:
            raise ValueError(f"{wrong[0]} has another shape than the network")
        network.load_state_dict(
            {name: torch.from_numpy(stored[name].copy()).to(value.dtype) for name, value in own.items()}
        )
    except _DAMAGED as error:
        reason = shortened(str(error), 200) if type(error) is ValueError else type(error).__name__
        hint = "give a file that training/train.py has written, or an ONNX model (.onnx)"
        raise SettingError(Diagnostic(f"weights {quoted(str(path))} do not fit: {reason}", hint)) from error
    return description, network


_DAMAGED = (
    OSError,
    LookupError,
    TypeError,
    ValueError,
    ArithmeticError,
    RuntimeError,
    EOFError,
    MemoryError,
    SyntaxError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What a damaged file may raise: in zipfile, in the headers of its arrays, in its description, in torch."""


def _described(data: dict[str, Any]) -> Description:
    anchors = data["anchors"]
    width, height = (int(side) for side in data["input_size"])
    classes = tuple(str(name) for name in data["classes"])
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and 1 <= len(classes) <= MAX_CLASSES):
        raise ValueError("its description has no usable input size or classes")
    network, coarsest = str(data["network"]), STRIDES[-1]
    if network == "yolov5" and (width % coarsest or height % coarsest):
        raise ValueError(f"its input size is {width} x {height}, which are not multiples of {coarsest}")
    confidence = float(data.get("confidence", Description.confidence))
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"its confidence is {confidence:g} (expected a number between 0 and 1)")
    return Description(
        network=network,
        classes=classes,
        input_size=(width, height),
        confidence=confidence,
        anchors=None if anchors is None else tuple(tuple((w, h) for w, h in scale) for scale in anchors),
    )
