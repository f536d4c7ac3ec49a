"""Weights of the shipped networks: one .npz file, with metadata about their origin in a .json file beside it."""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, shortened
from eidrive_scenario.files.bounded import MIB, is_regular_file, read_regular_file, reason_of
from eidrive_scenario.perception.learned.graphs import ssd_onnx, yolov5_onnx
from eidrive_scenario.perception.learned.networks.yolov5_sizes import ANCHORS_PER_SCALE, STRIDES, Anchors
from eidrive_scenario.perception.learned.quantization import Ranges

MAX_BYTES = 512 * MIB
"""Maximum size of a weight file, and of all arrays in a .npz together."""
MAX_SIDE = 8192
"""Maximum width and height of a network's input [px]."""
MAX_CLASSES = 10_000
"""Maximum number of classes of a network."""
DEFAULT_CONFIDENCE = 0.35
"""Minimum score of a detection if neither the settings nor the weights state one."""
ALLOW_TORCHSCRIPT = "EIDRIVE_ALLOW_TORCHSCRIPT"
"""Environment variable: 1 permits TorchScript weights, as the option --allow-torchscript does."""
Precision = Literal["float32", "int8"]
"""Numbers with which a network computes."""
OWN_SUFFIX, ONNX_SUFFIX, TORCHSCRIPT_SUFFIX = ".npz", ".onnx", ".pt"


def torchscript_is_allowed(option: bool) -> bool:
    """Return whether the option or the environment variable permits that weights execute code."""
    return option or os.environ.get(ALLOW_TORCHSCRIPT) == "1"


def refused_torchscript(path: Path) -> SettingError:
    """Return the error for TorchScript weights without permission."""
    message = f"weights {quoted(str(path))} are TorchScript, which can execute any code with your rights"
    permission = f"RunSettings.allow_torchscript or {ALLOW_TORCHSCRIPT}=1"
    hint = f"export the model to ONNX; or, if you trust it, run with {permission}"
    return SettingError(Diagnostic(message, hint))


def check_weights_exist(path: Path) -> None:
    """Raise SettingError if the path is not a regular file. The file is not read."""
    if not is_regular_file(path):
        hint = "check `weights` of the detector's settings"
        raise SettingError(Diagnostic(f"no file {quoted(str(path))} with weights", hint))


def read_weights(path: Path) -> bytes:
    """Return the content of a file of weights. Raise SettingError if it cannot be read, or is too large."""
    try:
        return read_regular_file(path, MAX_BYTES)
    except OSError as error:
        message = f"weights {quoted(str(path))} cannot be read: {reason_of(error)}"
        raise SettingError(Diagnostic(message, "check `weights` of the detector's settings")) from error


def read_arrays(content: bytes) -> Mapping[str, NDArray[Any]]:
    """Return the arrays of a .npz, by name.

    Raise ValueError or zipfile.BadZipFile if the file is damaged, holds Python objects, or unpacks to more than
    MAX_BYTES. Sizes are checked before memory is allocated.
    """
    arrays: dict[str, NDArray[Any]] = {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = archive.infolist()
        if sum(member.file_size for member in members) > MAX_BYTES:
            raise ValueError(f"the arrays are larger than {MAX_BYTES // MIB} MiB")
        for member in members:
            with archive.open(member) as stream:
                data = stream.read(member.file_size)
            arrays[member.filename.removesuffix(".npy")] = _array(data)
    return arrays


def _array(data: bytes) -> NDArray[Any]:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(version)
    if read_header is None:
        raise ValueError("an array has an unknown format version")
    shape, fortran_order, dtype = read_header(stream)
    if dtype.hasobject:
        raise ValueError("an array holds Python objects, which are not supported")
    body = data[stream.tell() :]
    if any(side < 0 for side in shape) or math.prod(shape) * dtype.itemsize != len(body):
        raise ValueError("the length of an array differs from its header")
    array = np.frombuffer(body, dtype=dtype)
    return array.reshape(shape, order="F" if fortran_order else "C")


DESCRIPTION = "description"
"""Name of the array with the description."""


@dataclass(frozen=True)
class Description:
    """Description of a weight file.

    network     `yolov5`, `ssd` or `pillars`;  classes  in the order of its outputs
    input_size  width and height of its input [px or cells];  anchors  of yolov5 [px]
    confidence  default of the minimum score of a box
    outward     rows of a box height and of the distances by which the left, top, right and bottom edges of boxes of
                vehicles are outside those of the vehicles on average, by ascending height [px]
    ranges      of the outputs of layers, for 8-bit integers; none: not calibrated
    """

    network: str
    classes: tuple[str, ...]
    input_size: tuple[int, int]
    anchors: Anchors | None = None
    confidence: float = DEFAULT_CONFIDENCE
    outward: tuple[tuple[float, ...], ...] = ()
    ranges: Ranges = field(default_factory=dict)


@dataclass(frozen=True)
class Weights:
    """Content of a weight file: its description, and all arrays by the names of the layers."""

    description: Description
    arrays: Mapping[str, NDArray[Any]]

    def onnx(self, precision: Precision = "float32") -> bytes:
        """Return the ONNX model of a network for images.

        Raise ValueError if an array is missing or has another shape, and if ranges for 8-bit integers are missing.
        """
        description = self.description
        if description.network not in _IMAGE_GRAPHS:
            raise ValueError(f"its network {description.network!r} processes no images")
        graph = _IMAGE_GRAPHS[description.network]
        return graph(self.arrays, len(description.classes), description.input_size, self.ranges(precision))

    def ranges(self, precision: Precision) -> Ranges | None:
        """Return the ranges of the layers for 8-bit integers; None in single precision.

        Raise ValueError if they are missing.
        """
        if precision == "float32":
            return None
        if not self.description.ranges:
            raise ValueError("its layers have no ranges for int8 (training/quantize.py computes them)")
        return self.description.ranges


_IMAGE_GRAPHS = {"yolov5": yolov5_onnx, "ssd": ssd_onnx}


FOR_IMAGES = "use a file that training/train.py has written, or an ONNX model (.onnx)"
"""Hint for unsuitable weights of a detector of images."""


def read(path: Path, hint: str = FOR_IMAGES) -> Weights:
    """Return the content of a weight file. Raise SettingError with this hint if the file does not contain weights."""
    content = read_weights(path)
    with suitable(path, hint):
        arrays = read_arrays(content)
        return Weights(_parse_description(json.loads(str(arrays[DESCRIPTION]))), arrays)


def another_network(path: Path, network: str, expected: str) -> SettingError:
    """Return the error for weights of another network."""
    message = f"weights {quoted(str(path))} are of another network (got {network!r}; expected {expected!r})"
    return SettingError(Diagnostic(message, f"use the detector {network!r}"))


@contextmanager
def suitable(path: Path, hint: str = FOR_IMAGES) -> Iterator[None]:
    """Raise SettingError with this path and hint if the block finds that weights are damaged or do not fit."""
    try:
        yield
    except _DAMAGED as error:
        reason = shortened(str(error), 200) if type(error) is ValueError else type(error).__name__
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
    anchors = data.get("anchors")
    if anchors is not None:
        anchors = tuple(tuple((float(w), float(h)) for w, h in scale) for scale in anchors)
    width, height = (int(side) for side in data["input_size"])
    classes = tuple(str(name) for name in data["classes"])
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and 1 <= len(classes) <= MAX_CLASSES):
        raise ValueError("its description has no usable input size or classes")
    network, coarsest = str(data["network"]), STRIDES[-1]
    if network == "yolov5" and (width % coarsest or height % coarsest):
        raise ValueError(f"its input size is invalid (got {width} x {height}; expected multiples of {coarsest})")
    if network not in ("yolov5", "ssd", "pillars") or (network == "yolov5" and anchors is None):
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
    ranges = {str(layer): (float(least), float(most)) for layer, (least, most) in data.get("ranges", {}).items()}
    if not all(math.isfinite(least) and math.isfinite(most) and least <= most for least, most in ranges.values()):
        raise ValueError("ranges: invalid range (expected the least and the greatest value of each layer)")
    return Description(
        network=network,
        classes=classes,
        input_size=(width, height),
        confidence=confidence,
        anchors=anchors,
        outward=outward,
        ranges=ranges,
    )
