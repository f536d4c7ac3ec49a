"""Networks of third parties, read from an ONNX or a TorchScript file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.errors import Diagnostic, SettingError, counted, quoted
from eidrive_scenario.perception.learned.image_network import Candidates, ImageNetwork
from eidrive_scenario.perception.learned.runtimes import (
    AUTO,
    LAYOUTS,
    Device,
    load_onnx,
    select_runtime,
    torchscript_network,
)
from eidrive_scenario.perception.learned.weights import TORCHSCRIPT_SUFFIX, refused_torchscript

_ROUNDING = 1e-5
"""Excess of a probability over 1 that single precision explains."""

Layout = Literal["yolov5", "yolov8", "boxes_scores", "detections"]


class ExternalNetwork(ImageNetwork):
    """Network from a file `.onnx` (ONNX Runtime or OpenCV) or `.pt` (TorchScript, torch).

    Its input is (1, 3, H, W) float32, red green blue in [0, 1]. Its outputs are boxes in pixels of that input in one of
    the layouts `yolov5`, `yolov8`, `boxes_scores` and `detections`. If `layout` is None, the shapes determine it. The
    constructor computes the outputs of a black image.

    Raise SettingError if the file cannot be read, does not accept this input size, or fits no layout; and for
    TorchScript, which can execute any code, unless `allow_torchscript` is True. Raise it too if the runtime cannot
    execute the file on the device, or is not installed.
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
        runtime: str = AUTO,
        device: Device = "cpu",
        allow_torchscript: bool = False,
    ) -> None:
        super().__init__(classes, input_size, confidence, letterbox)
        self._path = path
        if path.suffix == TORCHSCRIPT_SUFFIX and not allow_torchscript:
            raise refused_torchscript(path)
        name = select_runtime(path, runtime, device)
        if name == "torch":
            self._compute = torchscript_network(path, threads, device)
        else:
            self._compute = load_onnx(name, path, threads)
        black = np.zeros((input_size[1], input_size[0], 3), dtype=np.uint8)
        outputs = self._outputs(black)
        self._layout: Layout = layout or self._infer_layout(outputs)
        self._checked_candidates(outputs)

    def candidates(self, image: NDArray[np.uint8]) -> Candidates:
        """Return the boxes of an image. Raise SettingError if the outputs do not fit the layout and the classes."""
        return self._checked_candidates(self._outputs(image))

    def _checked_candidates(self, outputs: list[Floats]) -> Candidates:
        try:
            return self._candidates(outputs)
        except (ValueError, IndexError) as error:
            shapes = ", ".join(str(output.shape) for output in outputs)
            expected = f"{self._layout!r} for {counted(len(self.classes), 'class', 'classes')}"
            message = f"weights {quoted(str(self._path))} return {shapes}, which is not {expected}: {error}"
            raise SettingError(Diagnostic(message, f"layouts: {LAYOUTS}")) from error

    def _outputs(self, image: NDArray[np.uint8]) -> list[Floats]:
        pixels = np.ascontiguousarray(image.transpose(2, 0, 1)[None], dtype=np.float32) / np.float32(255.0)
        try:
            return self._compute(pixels)
        except (RuntimeError, MemoryError) as error:
            width, height = self.input_size
            reason = " ".join(str(error).split())[:160]
            message = f"weights {quoted(str(self._path))} do not accept images of {width} x {height}: {reason}"
            raise SettingError(Diagnostic(message, "set 'input_size' to the input size of the network")) from error

    def _infer_layout(self, outputs: list[Floats]) -> Layout:
        """Return the only layout that fits the shapes. Raise SettingError if none or several fit."""
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
        shape_list = ", ".join(str(shape) for shape in shapes)
        if not fits:
            message = f"weights {quoted(str(self._path))} return {shape_list}, which fits no layout for {count} classes"
            raise SettingError(Diagnostic(message, f"check 'classes'; layouts: {LAYOUTS}"))
        message = (
            f"weights {quoted(str(self._path))} return {shape_list}, which fits several layouts: {', '.join(fits)}"
        )
        raise SettingError(Diagnostic(message, "set 'layout'"))

    def _candidates(self, outputs: list[Floats]) -> Candidates:
        count = len(self.classes)
        if self._layout == "boxes_scores":
            boxes, probabilities = (output.reshape(-1, output.shape[-1]) for output in outputs)
            if boxes.shape[1] != 4:
                boxes, probabilities = probabilities, boxes
        elif self._layout == "detections":
            table = outputs[0].reshape(-1, _checked_size(outputs[0], -1, 6))
            table = table[table[:, 4] >= self.confidence]  # other rows may be padding
            boxes, probabilities = table[:, :4], np.zeros((len(table), count), dtype=np.float32)
            if not ((table[:, 5] >= 0.0) & (table[:, 5] < count)).all():
                raise ValueError("a class number is out of range")
            numbers = table[:, 5].astype(np.int64)
            probabilities[np.arange(len(table)), numbers] = table[:, 4]
        elif self._layout == "yolov5":
            table = outputs[0].reshape(-1, _checked_size(outputs[0], -1, 5 + count))
            boxes, probabilities = _corners(table[:, :4]), table[:, 5:] * table[:, 4:5]
        else:
            table = outputs[0].reshape(_checked_size(outputs[0], -2, 4 + count), -1).T
            boxes, probabilities = _corners(table[:, :4]), table[:, 4:]
        if boxes.shape[1] != 4 or probabilities.shape != (len(boxes), count):
            raise ValueError("the shapes do not fit")
        numbers = probabilities.argmax(axis=1)
        scores = probabilities[np.arange(len(probabilities)), numbers]
        confident = scores >= self.confidence
        highest = float(scores[confident].max(initial=0.0))
        if highest > 1.0 + _ROUNDING:
            raise ValueError(f"a score is {highest:g} (expected a probability, such as the output of a sigmoid)")
        return Candidates(
            boxes[confident].astype(float), scores[confident].astype(float), numbers[confident].astype(np.int64)
        )


def _checked_size(output: Floats, axis: int, expected: int) -> int:
    """Return the expected size of an axis. Raise ValueError if the output has another size."""
    if output.shape[axis] != expected:
        raise ValueError(f"{expected} numbers per box are expected")
    return expected


def _corners(boxes: Floats) -> Floats:
    center, half = boxes[:, :2], boxes[:, 2:] / 2.0
    with np.errstate(invalid="ignore"):  # boxes that are not finite are removed later
        return np.concatenate([center - half, center + half], axis=1)
