"""Detector `ssd_openimages`: SSD MobileNetV2 trained on photographs (Open Images v4), from an npm package.

The network is the file `object_detection_ssd_mobilenetv2_oidv4_fp16.tflite` in `@mediapipe/objectron` (Apache-2.0). It
is executed by LiteRT, which the extra `openimages` contains. The package is not part of this project: `npm pack`
downloads it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import io
import tarfile
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.base.installation import install_command
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.perception.learned.detector import ImageDetector
from eidrive_scenario.perception.learned.image_network import Candidates, ImageNetwork
from eidrive_scenario.perception.learned.weights import read_weights

NPM_PACKAGE = "@mediapipe/objectron@0.4.1675468480"
ARCHIVE = "mediapipe-objectron-0.4.1675468480.tgz"
"""Name of the file that `npm pack` writes."""
_ARCHIVE_SHA256 = "fc3e37b326b05e8f596099c90b3e0931b05a56cd3160b9ac450b621794bac94c"
_ASSETS = "package/objectron_solution_packed_assets.data"
"""Member of the archive: the label map, and behind it the network."""
_ASSETS_SHA256 = "470986ca5df183f41698da6de74b027d838fe289d77b5ab094497d350bee664e"
_LABEL_BYTES = 184
_HINT = f"run: npm pack {NPM_PACKAGE}; or set `weights` to the path of {ARCHIVE}"

SIDE = 300
"""Width and height of the network input [px]."""
GRIDS = (19, 10, 5, 3, 2, 1)
"""Cells in a row of each feature map."""
_SCALES = np.append(np.linspace(0.2, 0.95, len(GRIDS)), 1.0)
"""Sides of square anchors of each feature map, as a share of the image; the last one is beyond the last map."""
_CODE_DIVISORS = (10.0, 10.0, 5.0, 5.0)
"""Divisors of the encoded center y, x and of the logarithms of height and width."""
_BICYCLE, _PERSON, _VEHICLE, _CAR = 1, 4, 18, 23
"""Used rows of the label map, whose row 0 is the background."""
CLASSES = ("car", "truck", "bicycle", "pedestrian")
DEFAULT_CONFIDENCE = 0.3
"""Optimum of the F1 score of vehicles on 320 rendered images (training/render_data.py, split `validation`)."""


class OpenImagesSettings(Settings):
    """Settings of the property `detector_settings`.

    weights     path relative to the working directory: the npm package (.tgz), or its `objectron_solution_packed_assets
                .data`; None: the .tgz in the working directory
    confidence  minimum score of a box
    threads     of the computation of the network, in the whole process
    """

    weights: str | None = None
    confidence: float = Field(default=DEFAULT_CONFIDENCE, gt=0.0, lt=1.0)
    threads: Annotated[int, Field(ge=1, le=256)] = 1


class OpenImagesDetector(ImageDetector):
    """Detector `ssd_openimages`."""

    settings_type: ClassVar[type[Settings] | None] = OpenImagesSettings
    input_size = (SIDE, SIDE)

    def __init__(self, settings: OpenImagesSettings | None = None) -> None:
        super().__init__()
        self.settings = settings or OpenImagesSettings()
        if _is_installed():
            self.library_versions = {"ai_edge_litert": version("ai-edge-litert")}

    def check_weights(self, *, allow_torchscript: bool = False) -> None:
        """Raise SettingError if LiteRT is not installed, or if there is no file of weights."""
        if not _is_installed():
            message = "the detector 'ssd_openimages' needs LiteRT, which is not installed"
            raise SettingError(Diagnostic(message, f"run: {install_command('openimages')}"))
        if not is_regular_file(self._path):
            raise SettingError(Diagnostic(f"no file {quoted(str(self._path))} with weights", _HINT))

    def build_network(self, *, allow_torchscript: bool = False) -> ImageNetwork:
        """Return the network. Raise SettingError as `check_weights`, and if the file is not this package."""
        self.check_weights()
        return OpenImagesNetwork(self._path, self.settings.confidence, self.settings.threads)

    @property
    def _path(self) -> Path:
        return Path(self.settings.weights or ARCHIVE)


class OpenImagesNetwork(ImageNetwork):
    """The SSD network, executed by LiteRT.

    Raise SettingError if the file is neither the npm package nor its file of the network.
    """

    def __init__(self, path: Path, confidence: float = DEFAULT_CONFIDENCE, threads: int = 1) -> None:
        super().__init__(CLASSES, (SIDE, SIDE), confidence)
        self._compute = _loaded(path.resolve(), threads)
        self.identity = f"{_ASSETS_SHA256} {confidence!r} {threads}"

    def candidates(self, image: NDArray[np.uint8]) -> Candidates:
        return decode(*self._compute(image.astype(np.float32)[None] / np.float32(127.5) - 1.0), self.confidence)


def anchors() -> Array:
    """Return center x, y, width and height (1917, 4) of the anchors, as shares of the image.

    Liu et al., SSD (2016), with the smaller set of the first feature map of TensorFlow's object detection interface.
    """
    blocks = []
    for level, count in enumerate(GRIDS):
        scale, following = _SCALES[level : level + 2]
        shapes = [(1.0, scale), (2.0, scale), (0.5, scale), (3.0, scale), (0.3333, scale)]
        shapes = [(1.0, 0.1), *shapes[1:3]] if level == 0 else [*shapes, (1.0, np.sqrt(scale * following))]
        aspect, side = np.array(shapes).T
        sizes = np.stack([side * np.sqrt(aspect), side / np.sqrt(aspect)], axis=1)
        line, column = np.divmod(np.arange(count * count), count)
        centers = (np.stack([column, line], axis=1) + 0.5) / count
        blocks.append(np.concatenate([np.repeat(centers, len(sizes), axis=0), np.tile(sizes, (len(centers), 1))], 1))
    return np.concatenate(blocks)


_ANCHORS = anchors()


def decode(encoded: Floats, logits: Floats, confidence: float) -> Candidates:
    """Return the road users of at least the minimum confidence from the outputs (1, 1917, 4) and (1, 1917, 24).

    Labels are independent, and a car is a vehicle, too: the score of a vehicle is that of the greater of both. It is a
    car if that is at least as probable as not, given a vehicle, and else a truck, whose sizes include those of a bus.
    """
    with np.errstate(over="ignore"):  # infinity gives 0
        probability = 1.0 / (1.0 + np.exp(-logits[0].astype(float)))
    car, vehicle = probability[:, _CAR], probability[:, _VEHICLE]
    is_car = car >= 0.5 * vehicle
    of_vehicle = np.maximum(car, vehicle)
    scores = np.stack(
        [
            np.where(is_car, of_vehicle, 0.0),
            np.where(is_car, 0.0, of_vehicle),
            probability[:, _BICYCLE],
            probability[:, _PERSON],
        ],
        axis=1,
    )
    rows = np.flatnonzero(scores.max(axis=1) >= confidence)
    center_y, center_x, height, width = (encoded[0, rows].astype(float) / _CODE_DIVISORS).T
    anchor = _ANCHORS[rows]
    center = np.stack([center_x, center_y], axis=1) * anchor[:, 2:] + anchor[:, :2]
    with np.errstate(over="ignore", invalid="ignore"):  # boxes that are not finite are removed later
        half = np.exp(np.stack([width, height], axis=1)) * anchor[:, 2:] / 2.0
        boxes = np.concatenate([center - half, center + half], axis=1) * SIDE
    return Candidates(boxes, scores[rows].max(axis=1), scores[rows].argmax(axis=1))


def _is_installed() -> bool:
    return importlib.util.find_spec("ai_edge_litert") is not None


@lru_cache(maxsize=1)
def _loaded(path: Path, threads: int) -> Callable[[Floats], tuple[Floats, Floats]]:
    """Return the function of the network in a file, which stations and runs share: only one content is accepted."""
    from ai_edge_litert.interpreter import Interpreter

    interpreter, lock = Interpreter(model_content=_read_network(path), num_threads=threads), Lock()
    interpreter.allocate_tensors()
    image = interpreter.get_input_details()[0]["index"]
    boxes, classes = (output["index"] for output in interpreter.get_output_details())

    def compute(pixels: Floats) -> tuple[Floats, Floats]:
        with lock:
            interpreter.set_tensor(image, pixels)
            interpreter.invoke()
            return interpreter.get_tensor(boxes), interpreter.get_tensor(classes)

    return compute


def _read_network(path: Path) -> bytes:
    """Return the network in the npm package, or in its file of assets. Raise SettingError if it is neither."""
    content = read_weights(path)
    digest = hashlib.sha256(content).hexdigest()
    if digest == _ARCHIVE_SHA256:
        with tarfile.open(fileobj=io.BytesIO(content)) as archive:
            member = archive.extractfile(_ASSETS)
            assert member is not None
            content = member.read()
    elif digest != _ASSETS_SHA256:
        message = f"weights {quoted(str(path))} are not those of {NPM_PACKAGE} (the SHA-256 sum differs)"
        raise SettingError(Diagnostic(message, _HINT))
    return content[_LABEL_BYTES:]
