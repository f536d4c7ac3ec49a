"""Settings of the detectors `yolov5` and `ssd`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.perception.learned.external_network import Layout
from eidrive_scenario.perception.learned.image_network import misspelt, object_category
from eidrive_scenario.perception.learned.runtimes import Device, Runtime
from eidrive_scenario.perception.learned.weights import (
    MAX_CLASSES,
    MAX_SIDE,
    ONNX_SUFFIX,
    OWN_SUFFIX,
    TORCHSCRIPT_SUFFIX,
    Precision,
)

EXTERNAL_SUFFIXES = (ONNX_SUFFIX, TORCHSCRIPT_SUFFIX)

Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
"""Width or height of a network input [px]."""


class LearnedSettings(Settings):
    """Settings of the property `detector_settings`.

    weights      path relative to the working directory: .npz as training/train.py writes it, an ONNX model (.onnx) or a
                 TorchScript model (.pt), which is loaded only with permission of the user; None: the shipped weights
    classes      of an .onnx or .pt: its classes in order
    input_size   of an .onnx or .pt: width and height of its input [px]
    layout       of an .onnx or .pt: layout of its outputs, if the shape does not determine it
    letterbox    of an .onnx or .pt: whether images keep their aspect ratio, with gray margins; otherwise stretched
    confidence   minimum score of a box; None: the optimum of the shipped weights, and 0.35 for others
    runtime      library that executes the network; `auto`: the fastest one that is installed
    device       `cuda` executes .npz and .pt by torch on a GPU
    precision    `int8` executes .npz by OpenVINO with 8-bit integers, on the CPU
    threads      of the computation of the network on the CPU, in the whole process
    """

    weights: str | None = None
    classes: Annotated[tuple[str, ...], Field(max_length=MAX_CLASSES)] | None = None
    input_size: tuple[Side, Side] | None = None
    layout: Layout | None = None
    letterbox: bool = False
    confidence: float | None = Field(default=None, gt=0.0, lt=1.0)
    runtime: Literal["auto", Runtime] = "auto"
    device: Device = "cpu"
    precision: Precision = "float32"
    threads: Annotated[int, Field(ge=1, le=256)] = 1

    @model_validator(mode="after")
    def _check_consistency(self) -> LearnedSettings:
        suffix = Path(self.weights or OWN_SUFFIX).suffix or OWN_SUFFIX
        if self.precision == "int8" and (suffix != OWN_SUFFIX or self.device != "cpu"):
            raise ValueError("precision: int8 applies to weights .npz on the device cpu only")
        if suffix in EXTERNAL_SUFFIXES:
            if not self.classes or self.input_size is None:
                raise ValueError(f"weights: {suffix} files require `classes: [...]` and `input_size: [width, height]`")
            for name in self.classes:
                suggestion = misspelt(name)
                if suggestion is not None:
                    raise ValueError(f"classes: class {name!r} is unknown (did you mean {suggestion!r}?)")
            if not any(object_category(name) for name in self.classes):
                raise ValueError("classes: none is a road user (expected for example car, truck, bus or pedestrian)")
        elif self.weights is not None and suffix != OWN_SUFFIX:
            raise ValueError(f"weights: unknown file type (got {suffix!r}; expected .npz, .onnx or .pt)")
        elif self.classes is not None or self.input_size is not None or self.layout is not None or self.letterbox:
            raise ValueError("`classes`, `input_size`, `layout` and `letterbox` apply to weights .onnx and .pt only")
        return self
