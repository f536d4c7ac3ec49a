"""A user's own network, as an ONNX or a TorchScript file."""

from __future__ import annotations

import io
import logging
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Floats
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, shortened
from eidrive_scenario.perception.learned.image_network import Candidates, ImageNetwork
from eidrive_scenario.perception.learned.weight_files import TORCHSCRIPT_SUFFIX, read_weights, refused_torchscript

_ROUNDING = 1e-5
"""Excess of a probability over 1 that single precision explains."""
_LAYER = re.compile(r"Node \[([\w.]{1,60})@")
_LOG = logging.getLogger(__name__)

Layout = Literal["yolov5", "yolov8", "boxes_scores", "detections"]

LAYOUTS = (
    "yolov5 (1, N, 5 + C): cx cy w h objectness, probability of each class; "
    "yolov8 (1, 4 + C, N): cx cy w h, probability of each class; "
    "boxes_scores: (1, N, 4) x1 y1 x2 y2 and (1, N, C); detections (N, 6): x1 y1 x2 y2 score class"
)


class ExternalNetwork(ImageNetwork):
    """A network from a file `.onnx` (by OpenCV) or `.pt` (TorchScript, by torch).

    It gets (1, 3, H, W) float32, red green blue in [0, 1], and gives boxes in pixels of that in one of the layouts
    `yolov5`, `yolov8`, `boxes_scores` and `detections`; None tells them by their shape. It is tried on an empty picture
    while it is built. Raises SettingError if it cannot be read, does not take this size or gives what fits no layout;
    and for TorchScript, which can execute any code, unless `allow_torchscript` says that its source is trusted.
    """

    def __init__(
        self,
        path: Path,
        classes: Sequence[str],
        input_size: tuple[int, int],
        confidence: float,
        layout: Layout | None = None,
        threads: int = 1,
        letterbox: bool = False,
        *,
        allow_torchscript: bool = False,
    ) -> None:
        super().__init__(classes, input_size, confidence, letterbox)
        self._path = path
        if path.suffix == TORCHSCRIPT_SUFFIX and not allow_torchscript:
            raise refused_torchscript(path)
        self._compute = (_torchscript if path.suffix == TORCHSCRIPT_SUFFIX else _onnx)(path, threads)
        blank = np.zeros((input_size[1], input_size[0], 3), dtype=np.uint8)
        outputs = self._outputs(blank)
        self._layout: Layout = layout or self._told_by_shape(outputs)
        self._fitting(outputs)

    def candidates(self, picture: NDArray[np.uint8]) -> Candidates:
        """Raises SettingError if the network gives now what does not fit its layout and classes."""
        return self._fitting(self._outputs(picture))

    def _fitting(self, outputs: list[Floats]) -> Candidates:
        try:
            return self._candidates(outputs)
        except (ValueError, IndexError) as error:
            given = ", ".join(str(output.shape) for output in outputs)
            fits = f"{self._layout!r} for {len(self.classes)} classes"
            message = f"weights {quoted(str(self._path))} give {given}, which is not {fits}: {error}"
            raise SettingError(Diagnostic(message, f"layouts: {LAYOUTS}")) from error

    def _outputs(self, picture: NDArray[np.uint8]) -> list[Floats]:
        pixels = np.ascontiguousarray(picture.transpose(2, 0, 1)[None], dtype=np.float32) / np.float32(255.0)
        try:
            with _quiet_opencv():
                return self._compute(pixels)
        except (cv2.error, RuntimeError, MemoryError) as error:
            width, height = self.input_size
            reason = " ".join(str(error).split())[:160]
            message = f"weights {quoted(str(self._path))} do not take pictures of {width} x {height}: {reason}"
            raise SettingError(Diagnostic(message, "say the network's own with 'input_size'")) from error

    def _told_by_shape(self, outputs: list[Floats]) -> Layout:
        count = len(self.classes)
        shapes = [output.shape for output in outputs]
        fits: list[Layout] = []
        if len(shapes) == 2 and sorted(shape[-1] for shape in shapes) == sorted((4, count)):
            fits.append("boxes_scores")
        if len(shapes) == 1:
            if shapes[0][-1] == 5 + count:
                fits.append("yolov5")
            if len(shapes[0]) >= 2 and shapes[0][-2] == 4 + count:
                fits.append("yolov8")
            if shapes[0][-1] == 6:
                fits.append("detections")
        if len(fits) == 1:
            return fits[0]
        given = ", ".join(str(shape) for shape in shapes)
        if not fits:
            message = f"weights {quoted(str(self._path))} give {given}, which fits no layout for {count} classes"
            raise SettingError(Diagnostic(message, f"check 'classes'; layouts: {LAYOUTS}"))
        message = f"weights {quoted(str(self._path))} give {given}, which could be {' or '.join(fits)}"
        raise SettingError(Diagnostic(message, "say which with 'layout'"))

    def _candidates(self, outputs: list[Floats]) -> Candidates:
        count = len(self.classes)
        if self._layout == "boxes_scores":
            boxes, shares = (output.reshape(-1, output.shape[-1]) for output in outputs)
            if boxes.shape[1] != 4:
                boxes, shares = shares, boxes
        elif self._layout == "detections":
            table = outputs[0].reshape(-1, _sides(outputs[0], -1, 6))
            table = table[table[:, 4] >= self.confidence]  # others may be mere padding
            boxes, shares = table[:, :4], np.zeros((len(table), count), dtype=np.float32)
            if not ((table[:, 5] >= 0.0) & (table[:, 5] < count)).all():
                raise ValueError("a class number is beyond the classes")
            numbers = table[:, 5].astype(np.int64)
            shares[np.arange(len(table)), numbers] = table[:, 4]
        elif self._layout == "yolov5":
            table = outputs[0].reshape(-1, _sides(outputs[0], -1, 5 + count))
            boxes, shares = _corners(table[:, :4]), table[:, 5:] * table[:, 4:5]
        else:
            table = outputs[0].reshape(_sides(outputs[0], -2, 4 + count), -1).T
            boxes, shares = _corners(table[:, :4]), table[:, 4:]
        if boxes.shape[1] != 4 or shares.shape != (len(boxes), count):
            raise ValueError("the shapes do not fit")
        numbers = shares.argmax(axis=1)
        scores = shares[np.arange(len(shares)), numbers]
        sure = scores >= self.confidence
        highest = float(scores[sure].max(initial=0.0))
        if highest > 1.0 + _ROUNDING:
            raise ValueError(f"a score is {highest:g} (expected a probability, such as behind a sigmoid)")
        return Candidates(boxes[sure].astype(float), scores[sure].astype(float), numbers[sure].astype(np.int64))


def _sides(output: Floats, axis: int, expected: int) -> int:
    if output.shape[axis] != expected:
        raise ValueError(f"{expected} numbers of each box are expected")
    return expected


def _corners(boxes: Floats) -> Floats:
    center, half = boxes[:, :2], boxes[:, 2:] / 2.0
    with np.errstate(invalid="ignore"):  # boxes that are not finite are left out later
        return np.concatenate([center - half, center + half], axis=1)


def _onnx(path: Path, threads: int) -> Callable[[Floats], list[Floats]]:
    cv2.setNumThreads(threads)
    # From memory: a model that is read by its path may name further files with its tensors.
    content = np.frombuffer(read_weights(path), dtype=np.uint8)
    try:
        with _quiet_opencv():
            network = cv2.dnn.readNetFromONNX(content)
        names = network.getUnconnectedOutLayersNames()
    except (cv2.error, MemoryError) as error:
        raise _unreadable(path, "an ONNX model", error) from error

    def compute(pixels: Floats) -> list[Floats]:
        network.setInput(pixels)
        return [np.asarray(output, dtype=np.float32) for output in network.forward(names)]

    return compute


@contextmanager
def _quiet_opencv() -> Iterator[None]:
    """OpenCV prints what it raises, too."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


def _torchscript(path: Path, threads: int) -> Callable[[Floats], list[Floats]]:
    import torch

    torch.set_num_threads(threads)
    content = read_weights(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # torch would rather have torch.export
            network: Any = torch.jit.load(io.BytesIO(content), map_location="cpu").eval()  # type: ignore[no-untyped-call]
    except (RuntimeError, ValueError, OSError) as error:
        raise _unreadable(path, "a TorchScript model", error) from error

    def compute(pixels: Floats) -> list[Floats]:
        with torch.inference_mode():
            given = network(torch.from_numpy(pixels))
        outputs = given if isinstance(given, (list, tuple)) else [given]
        if not all(isinstance(output, torch.Tensor) for output in outputs):
            kinds = ", ".join(dict.fromkeys(type(output).__name__ for output in outputs))
            message = f"weights {quoted(str(path))} return {shortened(kinds, 100)} (expected tensors)"
            raise SettingError(Diagnostic(message, f"export the model with one of the layouts: {LAYOUTS}"))
        return [np.atleast_1d(output.float().numpy()) for output in outputs]

    return compute


def _unreadable(path: Path, kind: str, error: Exception) -> SettingError:
    """The error for a file that is not read. Of its reason, which may quote the file, only the layer is named."""
    _LOG.debug("%s: %s", path, error)
    layer = _LAYER.search(str(error))
    message = f"weights {quoted(str(path))} are not {kind} that can be read"
    message += f": OpenCV has no such layer as {layer[1]}" if layer else ""
    return SettingError(Diagnostic(message, "export the model again"))
