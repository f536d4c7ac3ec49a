"""Runtimes that execute networks: OpenVINO, ONNX Runtime, OpenCV and TorchScript."""

from __future__ import annotations

import importlib.util
import io
import logging
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Any, Literal

import cv2
import numpy as np

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.base.installation import install_command
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, shortened
from eidrive_scenario.perception.learned.weights import ONNX_SUFFIX, TORCHSCRIPT_SUFFIX, Precision, read_weights

Runtime = Literal["onnxruntime", "openvino", "torch", "opencv"]
GraphRuntime = Literal["onnxruntime", "openvino", "opencv"]
"""Runtimes of ONNX models."""
Device = Literal["cpu", "cuda"]
AUTO = "auto"

FASTEST_FIRST: tuple[Runtime, ...] = ("onnxruntime", "openvino", "torch", "opencv")
"""Runtimes of the networks of this project by their time for an image on one core of a CPU; OpenCV is a dependency of
the project, the others are optional."""
_EXTRAS: Mapping[Runtime, str] = {"openvino": "openvino", "onnxruntime": "onnx", "torch": "learned"}
"""Optional dependencies of this project that contain each runtime."""


def runtimes_of(path: Path, device: Device = "cpu", precision: Precision = "float32") -> tuple[Runtime, ...]:
    """Return the runtimes that can execute weights of this file type on a device, the fastest first."""
    if precision == "int8":
        return ("openvino",)
    if path.suffix == TORCHSCRIPT_SUFFIX or (device == "cuda" and path.suffix != ONNX_SUFFIX):
        return ("torch",)
    if device == "cuda":
        return ()
    return ("onnxruntime", "opencv") if path.suffix == ONNX_SUFFIX else FASTEST_FIRST


def select_runtime(
    path: Path,
    wanted: str = AUTO,
    device: Device = "cpu",
    precision: Precision = "float32",
    supported: Sequence[Runtime] = FASTEST_FIRST,
) -> Runtime:
    """Return the runtime for weights: the wanted one, or the fastest that is installed; `torch` if none is.

    supported  runtimes that the detector supports

    Raise SettingError if the wanted runtime cannot execute weights of this file type on the device, or is not
    installed.
    """
    suitable = [name for name in runtimes_of(path, device, precision) if name in supported]
    if not suitable:
        message = f"device {device!r} executes no {path.suffix} weights"
        raise SettingError(Diagnostic(message, "set `device: cpu`, or use weights .npz or .pt"))
    if wanted == AUTO:
        return next((name for name in suitable if is_installed(name)), suitable[0])
    for name in suitable:
        if name == wanted:
            if not is_installed(name):
                raise missing_runtime(name)
            return name
    where = f"{path.suffix or '.npz'} weights on the device {device!r} with precision {precision!r}"
    message = f"runtime {wanted!r} does not execute {where}"
    raise SettingError(Diagnostic(message, f"set `runtime` to {AUTO}, {', '.join(suitable)}"))


def missing_runtime(name: Runtime) -> SettingError:
    """Return the error for a runtime that is not installed."""
    hint = f"run: {install_command(_EXTRAS[name])}"
    return SettingError(Diagnostic(f"runtime {name!r} is not installed", hint))


def runtime_versions(name: Runtime) -> Mapping[str, str]:
    """Return name and version of a runtime; nothing if it is not installed. No library is imported."""
    if name == "opencv":
        return {name: cv2.__version__}
    return {name: version(name)} if is_installed(name) else {}


def is_installed(name: Runtime) -> bool:
    """Return whether the library of a runtime is installed."""
    return name == "opencv" or importlib.util.find_spec(name) is not None


LAYOUTS = (
    "yolov5 (1, N, 5 + C): cx cy w h objectness, probability of each class; "
    "yolov8 (1, 4 + C, N): cx cy w h, probability of each class; "
    "boxes_scores: (1, N, 4) x1 y1 x2 y2 and (1, N, C); detections (N, 6): x1 y1 x2 y2 score class"
)

Compute = Callable[[Floats], list[Floats]]
"""Function from an image (1, 3, H, W) in [0, 1] to all outputs of a network."""

_NO_TELEMETRY = ("ORT_DISABLE_TELEMETRY", "1")
"""Environment variable of ONNX Runtime. Without it, `import onnxruntime` writes an identifier of the device and a
database below the home directory, and sends events to its manufacturer (its Privacy.md, version 1.29 and later).
"""
_OPENVINO_TOOLS = "openvino.tools.ovc"
_LAYER = re.compile(r"Node \[([\w.]{1,60})@")
_LOG = logging.getLogger(__name__)
_FATAL_ONLY = 4
"""Log level of ONNX Runtime: its errors are raised as exceptions as well."""


def load_onnx(runtime: Runtime, path: Path, threads: int, content: bytes | None = None) -> Compute:
    """Return the function of an ONNX model, executed by a runtime other than torch.

    path     of the weights, for messages
    content  ONNX model of these weights; None: the content of the file

    Raise SettingError if the file is not a readable model.
    """
    if content is None:
        content = read_weights(path)
    if runtime == "openvino":
        return openvino_network(path, threads, content)
    if runtime == "onnxruntime":
        return onnxruntime_network(path, threads, content)
    return opencv_network(path, threads, content)


def openvino_network(path: Path, threads: int, content: bytes) -> Compute:
    """Return the function of an ONNX model of this project, executed by OpenVINO without telemetry.

    Networks of third parties are not executed, as their models may name further files with tensors.
    """
    core = _openvino_core()
    settings = {
        "INFERENCE_NUM_THREADS": threads,
        "NUM_STREAMS": 1,
        "ENABLE_CPU_PINNING": False,  # several processes would be pinned to the same core
        "INFERENCE_PRECISION_HINT": "f32",  # the default is bfloat16 on processors that support it
    }
    try:
        compiled = core.compile_model(core.read_model(model=content), "CPU", settings)
    except RuntimeError as error:
        raise _unreadable(path, "an ONNX model", error) from error
    request, lock = compiled.create_infer_request(), Lock()

    def compute(pixels: Floats) -> list[Floats]:
        with lock:
            request.infer([pixels])
            return [np.array(request.get_output_tensor(number).data) for number in range(len(compiled.outputs))]

    return compute


@cache
def _openvino_core() -> Any:
    """Return the core of OpenVINO of this process, which is never freed.

    Its plugin for CPUs sets the stack for signals of the thread that loads it, and frees the memory of this stack with
    the core. If another thread freed the core, the next signal, such as Ctrl-C, would end the process by SIGSEGV.
    """
    return _openvino().Core()


def _openvino() -> Any:
    """Import OpenVINO without its tools.

    `import openvino` imports its model converter, which sends an event to its manufacturer and writes an identifier
    below the home directory. It tolerates that the converter is missing.
    """
    if "openvino" not in sys.modules:
        sys.modules[_OPENVINO_TOOLS] = None  # type: ignore[assignment]
        try:
            import openvino
        finally:
            del sys.modules[_OPENVINO_TOOLS]
    import openvino

    return openvino


def onnxruntime_network(path: Path, threads: int, content: bytes) -> Compute:
    """Return the function of an ONNX model, executed by ONNX Runtime with deterministic kernels, without telemetry."""
    os.environ.setdefault(*_NO_TELEMETRY)
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    options.log_severity_level = _FATAL_ONLY
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.load_model_format", "ONNX")
    # A model may name further files with its tensors. Below a path that is a file there are none.
    options.add_session_config_entry("session.model_external_initializers_file_folder_path", str(path.resolve()))
    try:
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the exceptions of ONNX Runtime have no common base class
        raise _unreadable(path, "an ONNX model", error) from error
    inputs = [entry.name for entry in session.get_inputs()]
    if len(inputs) != 1:
        message = f"weights {quoted(str(path))} have {len(inputs)} inputs (expected 1, the image)"
        raise SettingError(Diagnostic(message, "export the model with the image as its only input"))

    def compute(pixels: Floats) -> list[Floats]:
        try:
            outputs = session.run(None, {inputs[0]: pixels})
        except Exception as error:  # as above
            raise RuntimeError(str(error)) from error
        if not all(isinstance(output, np.ndarray) and output.dtype.kind in "fiu" for output in outputs):
            raise _unexpected_outputs(path, outputs)
        return [np.atleast_1d(np.asarray(output, dtype=np.float32)) for output in outputs]

    return compute


def opencv_network(path: Path, threads: int, content: bytes) -> Compute:
    """Return the function of an ONNX model, executed by OpenCV, which supports common layers only."""
    cv2.setNumThreads(threads)
    # From memory: a model that is read by its path may name further files with its tensors.
    model = np.frombuffer(content, dtype=np.uint8)
    try:
        with _silent_opencv():
            network = cv2.dnn.readNetFromONNX(model)
        names = network.getUnconnectedOutLayersNames()
    except (cv2.error, MemoryError) as error:
        raise _unreadable(path, "an ONNX model", error) from error
    lock = Lock()

    def compute(pixels: Floats) -> list[Floats]:
        try:
            with lock, _silent_opencv():
                network.setInput(pixels)
                outputs = network.forward(names)
        except cv2.error as error:
            raise RuntimeError(str(error)) from error
        return [np.asarray(output, dtype=np.float32) for output in outputs]

    return compute


def torchscript_network(path: Path, threads: int, device: str = "cpu") -> Compute:
    """Return the function of a TorchScript model, executed by torch on a device. Loading can execute any code."""
    import torch

    from eidrive_scenario.perception.learned.torch_network import prepare

    prepare(threads, device)
    content = read_weights(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # torch recommends torch.export
            network: Any = torch.jit.load(io.BytesIO(content), map_location=device).eval()  # type: ignore[no-untyped-call]
    except (RuntimeError, ValueError, OSError) as error:
        raise _unreadable(path, "a TorchScript model", error) from error

    def compute(pixels: Floats) -> list[Floats]:
        with torch.inference_mode():
            returned = network(torch.from_numpy(pixels).to(device))
        outputs = returned if isinstance(returned, (list, tuple)) else [returned]
        if not all(isinstance(output, torch.Tensor) for output in outputs):
            raise _unexpected_outputs(path, outputs)
        return [np.atleast_1d(output.float().cpu().numpy()) for output in outputs]

    return compute


@contextmanager
def _silent_opencv() -> Iterator[None]:
    """Suppress the log of OpenCV, which prints its exceptions as well."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


def _unexpected_outputs(path: Path, outputs: list[Any] | tuple[Any, ...]) -> SettingError:
    """Return the error for outputs that are not tensors of numbers."""
    kinds = ", ".join(dict.fromkeys(type(output).__name__ for output in outputs))
    message = f"weights {quoted(str(path))} return {shortened(kinds, 100)} (expected tensors of numbers)"
    return SettingError(Diagnostic(message, f"export the model with one of the layouts: {LAYOUTS}"))


def _unreadable(path: Path, kind: str, error: Exception) -> SettingError:
    """Return the error for a file that cannot be read as a model.

    Its reason may quote the file, so the message names only an unsupported layer.
    """
    _LOG.debug("%s: %s", path, error)
    message, hint = f"weights {quoted(str(path))} are not {kind} that can be read", "export the model again"
    if isinstance(error, cv2.error):
        layer = _LAYER.search(str(error))
        message += f": OpenCV does not support layer {layer[1]}" if layer else ""
        hint += f", or install ONNX Runtime: {install_command('onnx')}"
    return SettingError(Diagnostic(message, hint))
