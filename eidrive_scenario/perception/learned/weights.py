"""Weights of the shipped networks: one .npz file, with metadata about their origin in a .json file beside it."""

from __future__ import annotations

import json
import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, shortened
from eidrive_scenario.perception.learned.graphs.ssd_graph import ssd_onnx
from eidrive_scenario.perception.learned.graphs.yolov5_graph import yolov5_onnx
from eidrive_scenario.perception.learned.networks.yolov5_sizes import ANCHORS_PER_SCALE, STRIDES, Anchors
from eidrive_scenario.perception.learned.weight_files import (
    DEFAULT_CONFIDENCE,
    MAX_CLASSES,
    MAX_SIDE,
    read_arrays,
    read_weights,
)

DESCRIPTION = "description"
"""Name of the array with the description."""


@dataclass(frozen=True)
class Description:
    """Description of a weight file.

    network     `yolov5` or `ssd`;  classes  in the order of its outputs
    input_size  width and height of its input [px];  anchors  of yolov5 [px]
    confidence  default of the minimum score of a box
    outward     rows of a box height and of the distances by which the left, top, right and bottom edges of boxes of
                vehicles are outside those of the vehicles on average, by ascending height [px]
    """

    network: str
    classes: tuple[str, ...]
    input_size: tuple[int, int]
    anchors: Anchors | None = None
    confidence: float = DEFAULT_CONFIDENCE
    outward: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class Weights:
    """Content of a weight file: its description, and all arrays by the names of the layers."""

    description: Description
    arrays: Mapping[str, NDArray[Any]]

    def onnx(self) -> bytes:
        """Return the ONNX model of the network. Raise ValueError if an array is missing or has another shape."""
        graph = yolov5_onnx if self.description.network == "yolov5" else ssd_onnx
        return graph(self.arrays, len(self.description.classes), self.description.input_size)


def read(path: Path) -> Weights:
    """Return the content of a weight file. Raise SettingError if the file does not contain weights."""
    content = read_weights(path)
    with suitable(path):
        arrays = read_arrays(content)
        return Weights(_parse_description(json.loads(str(arrays[DESCRIPTION]))), arrays)


@contextmanager
def suitable(path: Path) -> Iterator[None]:
    """Raise SettingError with this path if the block finds that weights are damaged or do not fit."""
    try:
        yield
    except _DAMAGED as error:
        reason = shortened(str(error), 200) if type(error) is ValueError else type(error).__name__
        hint = "use a file that training/train.py has written, or an ONNX model (.onnx)"
        raise SettingError(Diagnostic(f"weights {quoted(str(path))} do not fit: {reason}", hint)) from error


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
    if anchors is not None:
        anchors = tuple(tuple((float(w), float(h)) for w, h in scale) for scale in anchors)
    width, height = (int(side) for side in data["input_size"])
    classes = tuple(str(name) for name in data["classes"])
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and 1 <= len(classes) <= MAX_CLASSES):
        raise ValueError("its description has no usable input size or classes")
    network, coarsest = str(data["network"]), STRIDES[-1]
    if network == "yolov5" and (width % coarsest or height % coarsest):
        raise ValueError(f"its input size is invalid (got {width} x {height}; expected multiples of {coarsest})")
    if network not in ("yolov5", "ssd") or (network == "yolov5" and anchors is None):
        raise ValueError("its description specifies no known network, or lacks anchors")
    if anchors is not None and [len(scale) for scale in anchors] != [ANCHORS_PER_SCALE] * len(STRIDES):
        raise ValueError(f"anchors: invalid number (expected {ANCHORS_PER_SCALE} on each of {len(STRIDES)} scales)")
    confidence = float(data.get("confidence", Description.confidence))
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"its confidence is invalid (got {confidence:g}; expected a number between 0 and 1)")
    outward = tuple(tuple(float(value) for value in row) for row in data.get("outward", ()))
    if any(len(row) != 5 or not all(map(math.isfinite, row)) for row in outward):
        raise ValueError("outward: invalid row (expected a height and four distances)")
    if any(before[0] >= after[0] for before, after in pairwise(outward)):
        raise ValueError("outward: rows are not in ascending order of their heights")
    return Description(
        network=network,
        classes=classes,
        input_size=(width, height),
        confidence=confidence,
        anchors=anchors,
        outward=outward,
    )
