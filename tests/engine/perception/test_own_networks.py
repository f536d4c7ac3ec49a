"""Networks of this project by ONNX Runtime, OpenVINO, OpenCV and torch."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.base.installation import install_command
from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.extensions.settings import parse_settings
from eidrive_scenario.perception.learned import network_loading, runtimes
from eidrive_scenario.perception.learned.detector import YoloDetector
from eidrive_scenario.perception.learned.network_loading import SHIPPED, build_network
from eidrive_scenario.perception.learned.own_network import Infer, OwnNetwork
from eidrive_scenario.perception.learned.runtimes import Runtime, is_installed, select_runtime
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.perception.learned.weights import Precision, read
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed

RED_BOXES = Path(__file__).parents[2] / "data" / "red_boxes.onnx"
NETWORKS = pytest.mark.parametrize("name", ["yolov5", "ssd"])
RUNTIMES = pytest.mark.parametrize("runtime", ["onnxruntime", "openvino", "torch", "opencv"])


def need(runtime: Runtime) -> None:
    if not is_installed(runtime):
        pytest.skip(f"{runtime} is not installed")


def installed(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let these runtimes appear to be the installed ones."""
    for module in (runtimes, network_loading):
        monkeypatch.setattr(module, "is_installed", lambda name: name in names)


def noise(seed: int = 7) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (384, 512, 3), dtype=np.uint8)


@NETWORKS
@pytest.mark.parametrize("precision", get_args(Precision))
def test_onnx_model_passes_the_checker_of_onnx(name: str, precision: Precision) -> None:
    onnx = pytest.importorskip("onnx", reason="needs the extra 'dev'")
    model = onnx.load_from_string(read(SHIPPED / f"{name}.npz").onnx(precision))
    onnx.checker.check_model(model, full_check=True)
    assert (model.ir_version, model.opset_import[0].version) == (8, 13)
    inferred = onnx.shape_inference.infer_shapes(model, strict_mode=True).graph
    shapes = [[side.dim_value for side in output.type.tensor_type.shape.dim] for output in inferred.output]
    channels = {"yolov5": [48] * 3, "ssd": [24] * 5 + [72] * 5}[name]
    assert [shape[:2] for shape in shapes] == [[1, count] for count in channels]
    assert shapes[0][2:] == [48, 64]


@pytest.mark.exhaustive
@NETWORKS
@RUNTIMES
def test_runtime_outputs_equal_trained_network_of_torch(name: str, runtime: Runtime) -> None:
    """The reference has separate batch normalizations, as in training."""
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")
    from eidrive_scenario.perception.learned.torch_network import trainable

    need(runtime)
    path = SHIPPED / f"{name}.npz"
    trained = trainable(read(path))
    with torch.inference_mode():
        pixels = torch.from_numpy(noise().transpose(2, 0, 1)[None] / np.float32(255.0))
        expected = [output.numpy() for output in trained.eval()(pixels)]
    outputs = OwnNetwork(path, runtime)._infer([noise()])[0]
    for found, wanted in zip(outputs, expected, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-3)


@pytest.mark.process
@RUNTIMES
def test_runtime_returns_equal_bits_in_separate_processes(runtime: Runtime) -> None:
    need(runtime)
    program = (
        "import hashlib, sys, numpy as np\n"
        "from pathlib import Path\n"
        "from eidrive_scenario.perception.learned.own_network import OwnNetwork\n"
        "image = np.random.default_rng(7).integers(0, 256, (384, 512, 3), dtype=np.uint8)\n"
        "outputs = OwnNetwork(Path(sys.argv[1]), sys.argv[2])._infer([image])[0]\n"
        "print(hashlib.sha256(b''.join(output.tobytes() for output in outputs)).hexdigest())\n"
        "print('torch' in sys.modules, 'openvino_telemetry' in sys.modules)\n"
    )
    path = SHIPPED / "ssd.npz"
    command = [sys.executable, "-B", "-c", program, str(path), runtime]
    digest, imported = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n", 1)
    network = OwnNetwork(path, runtime)
    for _ in range(2):
        outputs = network._infer([noise()])[0]
        assert hashlib.sha256(b"".join(output.tobytes() for output in outputs)).hexdigest() == digest
    assert imported.split() == [str(runtime == "torch"), "False"]


@pytest.mark.parametrize("runtime", ["opencv", "torch"])
@pytest.mark.parametrize(
    ("change", "diagnostic"),
    [
        ({"fine.0.conv.weight": None}, "fine.0.conv.weight is missing"),
        ({"heads.1.bias": np.zeros(47)}, "heads.1.bias has another shape than the network"),
        ({"anchors": np.zeros((3, 3, 1))}, "anchors has another shape than the network"),
    ],
)
def test_weights_with_wrong_array_raise_in_every_runtime(
    runtime: Runtime, change: dict[str, Any], diagnostic: str, tmp_path: Path
) -> None:
    need(runtime)
    with np.load(SHIPPED / "yolov5.npz") as stored:
        arrays = {**stored, **change}
    path = tmp_path / "own.npz"
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(SettingError, match=f"do not fit: {diagnostic}"):
        OwnNetwork(path, runtime)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("onnxruntime", "openvino", "torch", "opencv"), "onnxruntime"),
        (("openvino", "torch", "opencv"), "openvino"),
        (("torch", "opencv"), "torch"),
        (("opencv",), "opencv"),
    ],
)
def test_auto_selects_fastest_installed_runtime(
    names: tuple[str, ...], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(monkeypatch, *names)
    assert select_runtime(SHIPPED / "ssd.npz") == expected


@pytest.mark.parametrize(
    ("settings", "diagnostic"),
    [
        ({"runtime": "openvino"}, f"runtime 'openvino' is not installed; run: {install_command('openvino')}"),
        ({"runtime": "onnxruntime"}, f"run: {install_command('onnx')}"),
        ({"device": "cuda"}, f"runtime 'torch' is not installed; run: {install_command('learned')}"),
        (
            {"runtime": "opencv", "device": "cuda"},
            "runtime 'opencv' does not execute .npz weights on the device 'cuda'",
        ),
        ({"runtime": "tensorrt"}, "setting 'runtime' is 'tensorrt'"),
        (
            {"runtime": "openvino", "weights": str(RED_BOXES), "classes": ["car", "bus"], "input_size": [96, 64]},
            "on the device 'cpu' with precision 'float32'; set `runtime` to auto, onnxruntime, opencv",
        ),
        (
            {"device": "cuda", "weights": str(RED_BOXES), "classes": ["car", "bus"], "input_size": [96, 64]},
            "device 'cuda' executes no .onnx weights",
        ),
        ({"precision": "int8"}, f"run: {install_command('openvino')}"),
        (
            {"precision": "int8", "runtime": "opencv"},
            "'opencv' does not execute .npz weights on the device 'cpu' with precision 'int8'",
        ),
        ({"precision": "int8", "device": "cuda"}, "precision: int8 applies to weights .npz on the device cpu only"),
        ({"precision": "int8", "weights": "a.onnx"}, "precision: int8 applies to weights .npz"),
        ({"precision": "float16"}, "setting 'precision' is 'float16'"),
    ],
)
def test_unavailable_runtime_or_device_raises_error_with_hint(
    settings: dict[str, Any], diagnostic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(monkeypatch, "opencv")
    with pytest.raises(SettingError) as error:
        build_network("yolov5", parse_settings(LearnedSettings, settings))
    assert diagnostic in str(error.value)


def test_device_cuda_without_gpu_raises_error(monkeypatch: pytest.MonkeyPatch) -> None:
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(SettingError, match=r"device 'cuda' is not available.*set `device: cpu`"):
        build_network("ssd", LearnedSettings(device="cuda"))


def assert_independent_of_the_batch(infer: Infer) -> None:
    """Assert that the outputs for an image are equal bits alone, among others, and in any order."""
    images = [noise(seed) for seed in range(6)]
    alone = [infer([image])[0] for image in images]
    assert infer([]) == []
    for order in ([0, 1], [2, 1, 0], [5, 4, 3, 2, 1, 0], [1, 1, 1]):
        together = infer([images[number] for number in order])
        for number, outputs in zip(order, together, strict=True):
            for found, expected in zip(outputs, alone[number], strict=True):
                np.testing.assert_array_equal(found, expected)


@pytest.mark.exhaustive
@NETWORKS
def test_outputs_do_not_depend_on_other_images_of_the_batch(name: str) -> None:
    pytest.importorskip("torch", reason="needs the extra 'learned'")
    from eidrive_scenario.perception.learned.torch_network import TorchNetwork, trainable

    batched, single = (TorchNetwork(trainable(read(SHIPPED / f"{name}.npz")), 1, batch=batch) for batch in (4, 1))
    assert_independent_of_the_batch(batched)
    for found, expected in zip(batched([noise()])[0], single([noise()])[0], strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-3)


@NETWORKS
def test_outputs_of_a_gpu_do_not_depend_on_other_images(name: str) -> None:
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")
    if not torch.cuda.is_available():
        pytest.skip("torch finds no GPU")
    assert_independent_of_the_batch(OwnNetwork(SHIPPED / f"{name}.npz", "torch", device="cuda")._infer)


def test_device_cuda_detects_the_same_objects() -> None:
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")
    if not torch.cuda.is_available():
        pytest.skip("torch finds no GPU")
    outputs = [
        OwnNetwork(SHIPPED / "yolov5.npz", "torch", device=device)._infer([noise()])[0]
        for device in ("cpu", "cuda", "cuda")
    ]
    for on_cpu, first, second in zip(*outputs, strict=True):
        np.testing.assert_allclose(first, on_cpu, atol=1e-3)
        np.testing.assert_array_equal(first, second)


@RUNTIMES
def test_resolved_settings_of_run_name_runtime_and_version(runtime: Runtime, tmp_path: Path) -> None:
    need(runtime)
    original = resolve_scenario("coop/scenario_1")
    text = original.read_text().replace('"../', f'"{original.parent.parent}/')
    own = f'<Property name="detector" value="ssd"/><Property name="detector_settings" value="{{runtime: {runtime}}}"/>'
    path = tmp_path / "scenario.xosc"
    path.write_text(text.replace('<Property name="detector" value="oracle"/>', own, 1))
    with Simulation(load_for_seed(path, 1, {}), seed=1, settings=RunSettings()) as simulation:
        resolved = simulation.resolved
    expected = cv2.__version__ if runtime == "opencv" else version(runtime)
    names = {"onnxruntime", "openvino", "torch", "opencv"}
    assert {name: one for name, one in resolved.versions.items() if name in names} == {runtime: expected}
    assert json.dumps(runtime) in resolved.canonical


def test_openvino_writes_nothing_into_home_directory(tmp_path: Path) -> None:
    """Its model converter writes an identifier there at import, and sends an event."""
    need("openvino")
    program = (
        "import sys\n"
        "from pathlib import Path\n"
        "from eidrive_scenario.perception.learned.own_network import OwnNetwork\n"
        "OwnNetwork(Path(sys.argv[1]), 'openvino')\n"
    )
    command = [sys.executable, "-B", "-c", program, str(SHIPPED / "ssd.npz")]
    environment = {"PATH": os.defpath, "HOME": str(tmp_path)}
    subprocess.run(command, env=environment, capture_output=True, check=True)
    assert list(tmp_path.rglob("*")) == []


def test_detector_with_runtime_reports_its_version() -> None:
    need("openvino")
    found = YoloDetector(LearnedSettings(runtime="openvino")).library_versions
    assert found == {"openvino": version("openvino")}


def test_calibration_moves_edges_of_vehicles_by_box_height(tmp_path: Path) -> None:
    """Distances of 1 to 4 pixels at a height of 10, twice as far at 20, and constant beyond; other classes keep their
    boxes."""
    with np.load(SHIPPED / "ssd.npz") as stored:
        arrays = {name: stored[name] for name in stored.files}
    description = json.loads(str(arrays["description"]))
    description["outward"] = [[10, 1, 2, 3, 4], [20, 2, 4, 6, 8]]
    path = tmp_path / "calibrated.npz"
    np.savez(path, **{**arrays, "description": np.array(json.dumps(description))})
    network = OwnNetwork(path, "opencv")
    boxes = np.array([[100.0, 100.0, 200.0, 100.0 + height] for height in (8, 15, 40, 15)])
    calibrated = network.calibrated(boxes, ["car", "bus", "truck", "pedestrian"])
    moved = (calibrated - boxes) * (1, 1, -1, -1)
    expected = np.array([[1.0, 2.0, 3.0, 4.0], [1.5, 3.0, 4.5, 6.0], [2.0, 4.0, 6.0, 8.0], [0.0, 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(moved, expected)
    description["outward"] = [[10, 1, 2]]
    np.savez(path, **{**arrays, "description": np.array(json.dumps(description))})
    with pytest.raises(SettingError, match=r"outward: invalid row"):
        OwnNetwork(path, "opencv")
