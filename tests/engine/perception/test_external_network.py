"""Networks of third parties, read from ONNX and TorchScript files.

red_boxes.onnx is the network below, exported with torch.onnx.export(network, (images,), path, opset_version=13).
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.errors import SettingError
from eidrive_scenario.perception.learned.external_network import ExternalNetwork
from eidrive_scenario.perception.learned.image_network import MARGIN_GRAY, Candidates, ImageNetwork, letterboxed

ONNX = Path(__file__).parents[2] / "data" / "red_boxes.onnx"
CLASSES = ("truck", "car")
SIZE = (96, 64)


@pytest.fixture
def torchscript(tmp_path: Path) -> Path:
    """Cells of 8 pixels: the objectness is the mean of red minus green; the box is 16 x 16 around the cell."""
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")

    class RedBoxes(torch.nn.Module):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__()
            self.conv = torch.nn.Conv2d(3, 7, 8, 8, bias=False)
            weights = torch.zeros(7, 3, 8, 8)
            weights[4, 0], weights[4, 1] = 1 / 64, -1 / 64
            self.conv.weight = torch.nn.Parameter(weights)
            constant = torch.zeros(1, 7, 8, 12)
            constant[0, 0] = torch.arange(12.0)[None] * 8 + 4
            constant[0, 1] = torch.arange(8.0)[:, None] * 8 + 4
            constant[0, 2:4], constant[0, 6] = 16.0, 1.0
            self.register_buffer("constant", constant)

        def forward(self, images):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
            return (self.conv(images) + self.constant).flatten(2).transpose(1, 2)

    path = tmp_path / "red_boxes.pt"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.jit.trace(RedBoxes().eval(), torch.zeros(1, 3, SIZE[1], SIZE[0])).save(str(path))
    return path


def red_image() -> NDArray[np.uint8]:
    """Return an image twice as large as the network's input: the square covers the cell in row 3, column 5."""
    image = np.full((128, 192, 3), 90, dtype=np.uint8)
    image[48:64, 80:96] = (255, 0, 0)
    return image


def assert_finds_square(network: ExternalNetwork) -> None:
    found = network.find(red_image())
    assert found.classes == ("car",)
    np.testing.assert_allclose(found.boxes, [[72.0, 40.0, 104.0, 72.0]], atol=1e-3)
    np.testing.assert_allclose(found.scores, [1.0], atol=1e-5)
    assert len(network.find(np.zeros((64, 96, 3), dtype=np.uint8))) == 0


def test_find_with_onnx_model_returns_red_square() -> None:
    assert_finds_square(ExternalNetwork(ONNX, CLASSES, SIZE, 0.5))


def test_find_with_torchscript_model_returns_red_square(torchscript: Path) -> None:
    assert_finds_square(ExternalNetwork(torchscript, CLASSES, SIZE, 0.5, allow_torchscript=True))


def test_find_in_letterboxed_image_keeps_aspect_ratio_and_box_positions() -> None:
    """A square image is centered in an input of 96 x 64, with a margin of 16 pixels at either side."""
    image = np.full((128, 128, 3), 90, dtype=np.uint8)
    image[48:64, 48:64] = (255, 0, 0)
    found = ExternalNetwork(ONNX, CLASSES, SIZE, 0.5, letterbox=True).find(image)
    assert found.classes == ("car",)
    np.testing.assert_allclose(found.boxes, [[40.0, 40.0, 72.0, 72.0]], atol=1e-3)
    small, scale, corner = letterboxed(np.full((50, 300, 3), 7, dtype=np.uint8), SIZE)
    assert small.shape == (64, 96, 3)
    np.testing.assert_allclose((scale, corner), [(0.32, 0.32), (0, 24)])
    assert (small[24:40] == 7).all()
    assert (small[:24] == MARGIN_GRAY).all()
    assert (small[40:] == MARGIN_GRAY).all()


def test_external_network_with_unsuitable_weights_raises_error_with_hint(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"return \(1, 96, 7\), which fits no layout for 3 classes; check 'classes'"):
        ExternalNetwork(ONNX, ("car", "truck", "bus"), SIZE, 0.5)
    with pytest.raises(SettingError, match=r"do not accept images of 640 x 640.*set 'input_size' to the input size"):
        ExternalNetwork(ONNX, CLASSES, (640, 640), 0.5)
    with pytest.raises(SettingError, match="is not 'yolov8' for 2 classes"):
        ExternalNetwork(ONNX, CLASSES, SIZE, 0.5, layout="yolov8")
    empty = tmp_path / "empty.onnx"
    empty.write_bytes(b"not a model")
    with pytest.raises(SettingError, match=r"are not an ONNX model.*export the model again"):
        ExternalNetwork(empty, CLASSES, SIZE, 0.5)


def test_external_network_with_invalid_torchscript_file_raises(tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    path = tmp_path / "empty.pt"
    path.write_bytes(b"not a model")
    with pytest.raises(SettingError, match="are not a TorchScript model"):
        ExternalNetwork(path, CLASSES, SIZE, 0.5, allow_torchscript=True)


def test_external_network_torchscript_without_permission_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "any.pt"
    path.write_bytes(b"is not even read")
    with pytest.raises(SettingError, match=r"can execute any code with your rights; export the model to ONNX"):
        ExternalNetwork(path, CLASSES, SIZE, 0.5)


class Fixed(ExternalNetwork):
    """Network with given outputs."""

    def __init__(self, outputs: list[NDArray[np.float32]], classes: tuple[str, ...]) -> None:
        self._path = Path("own.onnx")
        self.classes = classes
        self.confidence = 0.3
        self.outputs = outputs
        self._layout = self._infer_layout(outputs)

    def found(self) -> list[tuple[list[float], float, int]]:
        candidates = self._checked_candidates(self.outputs)
        rows = zip(candidates.boxes, candidates.scores, candidates.classes, strict=True)
        return [
            ([round(v, 4) for v in box.tolist()], round(float(score), 4), int(number)) for box, score, number in rows
        ]


def test_each_layout_returns_same_detection() -> None:
    box, expected = [10.0, 20.0, 4.0, 6.0], [([8.0, 17.0, 12.0, 23.0], 0.8, 1)]
    classes = ("car", "truck", "bus")
    yolov5 = np.array([[[*box, 1.0, 0.1, 0.8, 0.0], [*box, 0.1, 0.9, 0.0, 0.0]]], dtype=np.float32)
    yolov8 = np.zeros((1, 7, 40), dtype=np.float32)
    yolov8[0, :, 3] = [*box, 0.1, 0.8, 0.0]
    corners = np.array([[[8.0, 17.0, 12.0, 23.0]]], dtype=np.float32)
    shares = np.array([[[0.1, 0.8, 0.0]]], dtype=np.float32)
    table = np.array([[8.0, 17.0, 12.0, 23.0, 0.8, 1.0]], dtype=np.float32)
    for outputs in ([yolov5], [yolov8], [corners, shares], [shares, corners], [table]):
        assert Fixed(outputs, classes).found() == expected


def test_layout_detections_ignores_padding_rows_and_rejects_unknown_classes() -> None:
    """Exported suppression pads its list with score 0 and class -1; any other class out of range is an error."""
    row, padding = [8.0, 17.0, 12.0, 23.0, 0.8, 1.0], [0.0, 0.0, 0.0, 0.0, 0.0, -1.0]
    classes = ("car", "truck", "bus")
    network = Fixed([np.array([row, padding], dtype=np.float32)], classes)
    assert network.found() == [([8.0, 17.0, 12.0, 23.0], 0.8, 1)]
    network.outputs = [np.array([[*row[:5], 9.0]], dtype=np.float32)]
    with pytest.raises(SettingError, match=r"own\.onnx' return \(1, 6\), .*: a class number is out of range"):
        network.found()


def test_external_network_ambiguous_shape_requires_layout() -> None:
    with pytest.raises(SettingError, match="fits several layouts: yolov5, detections; set 'layout'"):
        Fixed([np.zeros((1, 10, 6), dtype=np.float32)], ("car",))


def test_external_network_scores_above_one_are_refused() -> None:
    """A model that is exported without its sigmoid returns logits."""
    network = Fixed([np.array([[8.0, 17.0, 12.0, 23.0, 3.5, 1.0]], dtype=np.float32)], ("car", "truck", "bus"))
    with pytest.raises(SettingError, match=r"own\.onnx' return \(1, 6\), .*: a score is 3\.5 \(expected a probability"):
        network.found()


def test_external_network_class_number_nan_is_refused() -> None:
    network = Fixed([np.array([[8.0, 17.0, 12.0, 23.0, 0.8, math.nan]], dtype=np.float32)], ("car", "truck", "bus"))
    with pytest.raises(SettingError, match="a class number is out of range"):
        network.found()


class Constant(ImageNetwork):
    """Network of 100 x 100 pixels that returns the same boxes for every image."""

    def __init__(self, boxes: list[list[float]]) -> None:
        super().__init__(("car",), (100, 100), 0.3)
        self.boxes = np.array(boxes)

    def candidates(self, image: NDArray[np.uint8]) -> Candidates:
        return Candidates(self.boxes, np.full(len(self.boxes), 0.9), np.zeros(len(self.boxes), dtype=np.int64))


@pytest.mark.parametrize(
    "box",
    [
        [math.nan, 10.0, 20.0, 20.0],
        [-math.inf, 10.0, math.inf, 20.0],
        [30.0, 30.0, 20.0, 20.0],
        [110.0, 10.0, 120.0, 20.0],
        [10.0, -9.0, 20.0, -1.0],
        [10.0, 10.0, 10.0, 20.0],
    ],
    ids=["not a number", "infinite", "corners swapped", "right of the image", "above the image", "no width"],
)
def test_find_removes_boxes_without_area_in_image(box: list[float]) -> None:
    """The image is twice as wide as the network's input, so the other box has twice its width."""
    found = Constant([box, [40.0, 40.0, 60.0, 70.0]]).find(np.zeros((100, 200, 3), dtype=np.uint8))
    assert found.boxes.tolist() == [[80.0, 40.0, 120.0, 70.0]]
    assert len(found.scores) == len(found.classes) == 1


@pytest.mark.parametrize(
    ("named", "message"),
    [
        (False, r"return \(1,\), which fits no layout for 2 classes; check 'classes'"),
        (True, r"return dict \(expected tensors of numbers\); export the model with one of the layouts"),
    ],
)
def test_torchscript_output_without_layout_is_refused(named: bool, message: str, tmp_path: Path) -> None:
    """A single number; and a dictionary, as detectors of torchvision return it."""
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")

    class Mean(torch.nn.Module):  # type: ignore[misc, name-defined]
        def forward(self, images):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
            return {"mean": images.mean()} if named else images.mean()

    path = tmp_path / "own.pt"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.jit.trace(Mean(), torch.zeros(1, 3, SIZE[1], SIZE[0]), strict=False).save(str(path))
    with pytest.raises(SettingError, match=message):
        ExternalNetwork(path, CLASSES, SIZE, 0.5, allow_torchscript=True)
