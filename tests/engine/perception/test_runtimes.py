"""Execution of ONNX models by ONNX Runtime and by OpenCV."""

from __future__ import annotations

import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.errors import SettingError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.perception.learned import runtimes
from eidrive_scenario.perception.learned.external_network import ExternalNetwork
from eidrive_scenario.perception.learned.runtimes import (
    Compute,
    Runtime,
    is_installed,
    load_onnx,
    runtime_versions,
    select_runtime,
)
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed

RED_BOXES = Path(__file__).parents[2] / "data" / "red_boxes.onnx"
SIZE = (96, 64)
ROW = [20.0, 30.0, 8.0, 6.0, 1.0, 0.1, 0.9]
"""One box in the layout `yolov5` with two classes: center, size, objectness, probabilities."""


@pytest.fixture
def without_onnxruntime(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let ONNX Runtime appear not to be installed."""
    installed = runtimes.is_installed
    monkeypatch.setattr(runtimes, "is_installed", lambda module: module != "onnxruntime" and installed(module))


def load_network(path: Path, threads: int) -> Compute:
    """Return the function of an ONNX model by the fastest runtime that is installed."""
    return load_onnx(select_runtime(path), path, threads)


def noise() -> NDArray[np.float32]:
    return np.random.default_rng(5).random((1, 3, SIZE[1], SIZE[0])).astype(np.float32)


@pytest.fixture
def uncommon(tmp_path: Path) -> Path:
    """Return a model with the layer IsNaN, which OpenCV does not support; it returns ROW for any finite image."""
    onnx = pytest.importorskip("onnx", reason="needs the extra 'dev'")
    helper = onnx.helper
    nodes = [
        helper.make_node("IsNaN", ["image"], ["nan"]),
        helper.make_node("Cast", ["nan"], ["number"], to=1),
        helper.make_node("ReduceMax", ["number"], ["largest"], keepdims=0),
        helper.make_node("Add", ["largest", "row"], ["boxes"]),
    ]
    row = helper.make_tensor("row", 1, [1, 1, 7], ROW)
    return save_model(tmp_path / "uncommon.onnx", nodes, [row])


def save_model(path: Path, nodes: list[Any], tensors: list[Any], inputs: tuple[str, ...] = ("image",)) -> Path:
    onnx = pytest.importorskip("onnx", reason="needs the extra 'dev'")
    helper = onnx.helper
    shape = [1, 3, SIZE[1], SIZE[0]]
    graph = helper.make_graph(
        nodes,
        "network",
        [helper.make_tensor_value_info(name, 1, shape) for name in inputs],
        [helper.make_tensor_value_info("boxes", 1, [1, 1, 7])],
        tensors,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return path


def test_onnxruntime_and_opencv_return_equal_outputs() -> None:
    pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    (first,) = load_onnx("onnxruntime", RED_BOXES, 1)(noise())
    (second,) = load_onnx("opencv", RED_BOXES, 1)(noise())
    assert first.shape == (1, 96, 7)
    assert first.dtype == np.float32
    np.testing.assert_allclose(first, second, atol=1e-5)


@pytest.mark.parametrize("threads", [1, 2])
def test_onnxruntime_same_image_returns_same_bits(threads: int) -> None:
    pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    outputs = [load_onnx("onnxruntime", RED_BOXES, threads)(noise())[0].tobytes() for _ in range(3)]
    assert len(set(outputs)) == 1


def test_onnxruntime_session_uses_given_threads_on_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    onnxruntime = pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    sessions: list[tuple[Any, list[str]]] = []
    create = onnxruntime.InferenceSession

    def record(model: bytes, options: Any, providers: list[str]) -> Any:
        sessions.append((options, providers))
        return create(model, options, providers=providers)

    monkeypatch.setattr(onnxruntime, "InferenceSession", record)
    load_network(RED_BOXES, 3)(noise())
    ((options, providers),) = sessions
    assert (options.intra_op_num_threads, options.inter_op_num_threads) == (3, 1)
    assert options.use_deterministic_compute
    assert providers == ["CPUExecutionProvider"]


def test_onnxruntime_executes_layer_that_opencv_lacks(uncommon: Path) -> None:
    pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    found = ExternalNetwork(uncommon, ("truck", "car"), SIZE, 0.5).find(np.zeros((64, 96, 3), dtype=np.uint8))
    assert found.classes == ("car",)
    np.testing.assert_allclose(found.boxes, [[16.0, 27.0, 24.0, 33.0]])
    np.testing.assert_allclose(found.scores, [0.9])


@pytest.mark.usefixtures("without_onnxruntime")
def test_opencv_unsupported_layer_is_error_that_names_layer_and_extra(uncommon: Path) -> None:
    expected = r"OpenCV does not support layer IsNaN; .*pip install .*\[onnx\]"
    with pytest.raises(SettingError, match=expected):
        load_network(uncommon, 1)


@pytest.mark.parametrize("location", ["data.bin", "../data.bin", "absolute", "uncommon.onnx"])
@pytest.mark.parametrize("as_constant", [False, True], ids=["initializer", "constant"])
def test_onnxruntime_model_with_external_tensor_file_is_refused(
    location: str, as_constant: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files beside the weights, above them, by absolute path and in the working directory."""
    pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    onnx = pytest.importorskip("onnx", reason="needs the extra 'dev'")
    folder = tmp_path / "weights"
    folder.mkdir()
    for place in (tmp_path, folder):
        np.array(ROW, dtype=np.float32).tofile(place / "data.bin")
    monkeypatch.chdir(folder)
    row = onnx.TensorProto(name="row", data_type=1, dims=[1, 1, 7], data_location=onnx.TensorProto.EXTERNAL)
    location = str(folder / "data.bin") if location == "absolute" else location
    for key, value in (("location", location), ("offset", "0"), ("length", "28")):
        row.external_data.add(key=key, value=value)
    nodes = [
        onnx.helper.make_node("ReduceMax", ["image"], ["largest"], keepdims=0),
        onnx.helper.make_node("Add", ["largest", "row"], ["boxes"]),
    ]
    if as_constant:
        nodes.insert(0, onnx.helper.make_node("Constant", [], ["row"], value=row))
    path = save_model(folder / "uncommon.onnx", nodes, [] if as_constant else [row])
    with pytest.raises(SettingError, match="are not an ONNX model that can be read"):
        load_network(Path(os.path.relpath(path)), 1)


def test_onnxruntime_model_with_two_inputs_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    onnx = pytest.importorskip("onnx", reason="needs the extra 'dev'")
    nodes = [
        onnx.helper.make_node("Sub", ["image", "before"], ["change"]),
        onnx.helper.make_node("ReduceMax", ["change"], ["boxes"], keepdims=0),
    ]
    path = save_model(tmp_path / "two.onnx", nodes, [], ("image", "before"))
    with pytest.raises(SettingError, match=r"have 2 inputs \(expected 1, the image\)"):
        load_network(path, 1)


def test_runtime_versions_of_onnx_weights_name_installed_runtime() -> None:
    pytest.importorskip("onnxruntime", reason="needs the extra 'onnx'")
    assert runtime_versions(select_runtime(RED_BOXES)) == {"onnxruntime": importlib.metadata.version("onnxruntime")}


@pytest.mark.usefixtures("without_onnxruntime")
def test_runtime_versions_without_onnxruntime_name_opencv() -> None:
    assert runtime_versions(select_runtime(RED_BOXES)) == {"opencv": cv2.__version__}


def test_resolved_settings_with_onnx_weights_state_runtime(tmp_path: Path) -> None:
    """The oracle computes nothing with a library, so its runs name no runtime."""
    original = resolve_scenario("coop/scenario_1")
    text = original.read_text().replace('"../', f'"{original.parent.parent}/')
    oracle = '<Property name="detector" value="oracle"/>'
    settings = f"{{weights: {RED_BOXES}, classes: [truck, car], input_size: [96, 64]}}"
    external = f'<Property name="detector" value="yolov5"/><Property name="detector_settings" value="{settings}"/>'
    path = tmp_path / "scenario.xosc"
    path.write_text(text.replace(oracle, external, 1))
    assert resolved_versions(path).items() >= runtime_versions(select_runtime(RED_BOXES)).items()
    assert not set(resolved_versions(original)) & {"onnxruntime", "opencv", "torch"}


def resolved_versions(path: Path) -> dict[str, str]:
    with Simulation(load_for_seed(path, 1, {}), seed=1, settings=RunSettings()) as simulation:
        return dict(simulation.resolved.versions)


@pytest.mark.process
@pytest.mark.parametrize("runtime", ["onnxruntime", "openvino", "opencv"])
def test_process_can_be_interrupted_after_another_thread_freed_a_network(runtime: Runtime) -> None:
    """OpenVINO sets a stack for signals of its thread, and frees the memory of this stack with its core."""
    if not is_installed(runtime):
        pytest.skip(f"needs {runtime}")
    program = """
import faulthandler, gc, signal, sys, threading
from pathlib import Path
from eidrive_scenario.perception.learned.runtimes import load_onnx

faulthandler.enable()
signal.signal(signal.SIGINT, signal.default_int_handler)
networks = [load_onnx(sys.argv[1], Path(sys.argv[2]), 1)]
thread = threading.Thread(target=lambda: (networks.clear(), gc.collect()))
thread.start()
thread.join()
try:
    signal.raise_signal(signal.SIGINT)
except KeyboardInterrupt:
    print("interrupted")
"""
    command = [sys.executable, "-c", program, runtime, str(RED_BOXES)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (0, "interrupted\n"), ended.stderr
