"""Weights of the shipped networks: one .npz file, with metadata about their origin in a .json file beside it."""

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
    """Description of a weight file.

    network     `yolov5` or `ssd`;  classes  in the order of its outputs
    input_size  width and height of its input [px];  anchors  of yolov5 [px]
    confidence  default of the minimum score of a box
    """

    network: str
    classes: tuple[str, ...]
    input_size: tuple[int, int]
    anchors: Anchors | None = None
    confidence: float = DEFAULT_CONFIDENCE

    def build(self) -> YoloV5 | Ssd:
        """Return the untrained network. Raise ValueError if the description fits no network."""
        if self.network == "yolov5" and self.anchors is not None:
            return YoloV5(len(self.classes), self.anchors)
        if self.network == "ssd":
            return Ssd(len(self.classes))
        raise ValueError("its description specifies no known network, or lacks anchors")


def save(path: Path, network: nn.Module, description: Description, card: dict[str, Any]) -> None:
    """Write weights and metadata. Convolutions are stored in half precision, other tensors in single precision."""
    arrays: dict[str, Any] = {}
    for name, value in network.state_dict().items():
        array = value.detach().cpu().numpy()
        arrays[name] = array.astype(np.float16) if array.ndim == 4 else array
    arrays[_DESCRIPTION] = np.array(json.dumps(asdict(description)))
    np.savez_compressed(path, **arrays)
    path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> tuple[Description, YoloV5 | Ssd]:
    """Return the network with its weights, trainable. Raise SettingError if the file does not contain weights."""
    content = read_weights(path)
    try:
        stored = read_arrays(content)
        description = _parse_description(json.loads(str(stored[_DESCRIPTION])))
        network = description.build()
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
    except _DAMAGED as error:
        reason = shortened(str(error), 200) if type(error) is ValueError else type(error).__name__
        hint = "use a file that training/train.py has written, or an ONNX model (.onnx)"
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
"""Exceptions that a damaged file causes: in zipfile, in array headers, in its description, in torch."""


def _parse_description(data: dict[str, Any]) -> Description:
    anchors = data["anchors"]
    width, height = (int(side) for side in data["input_size"])
    classes = tuple(str(name) for name in data["classes"])
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and 1 <= len(classes) <= MAX_CLASSES):
        raise ValueError("its description has no usable input size or classes")
    network, coarsest = str(data["network"]), STRIDES[-1]
    if network == "yolov5" and (width % coarsest or height % coarsest):
        raise ValueError(f"its input size is invalid (got {width} x {height}; expected multiples of {coarsest})")
    confidence = float(data.get("confidence", Description.confidence))
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"its confidence is invalid (got {confidence:g}; expected a number between 0 and 1)")
    return Description(
        network=network,
        classes=classes,
        input_size=(width, height),
        confidence=confidence,
        anchors=None if anchors is None else tuple(tuple((w, h) for w, h in scale) for scale in anchors),
    )
