"""Selection of the library that executes a network, without an import of any of them."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Literal

import cv2

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.perception.learned.weight_files import ONNX_SUFFIX, TORCHSCRIPT_SUFFIX

Runtime = Literal["onnxruntime", "openvino", "torch", "opencv"]
Device = Literal["cpu", "cuda"]
AUTO = "auto"

FASTEST_FIRST: tuple[Runtime, ...] = ("onnxruntime", "openvino", "torch", "opencv")
"""Runtimes of the networks of this project by their time for an image on one core of a CPU; OpenCV is a dependency of
the project, the others are optional."""
_EXTRAS: Mapping[Runtime, str] = {"openvino": "openvino", "onnxruntime": "onnx", "torch": "learned"}
"""Optional dependencies of this project that contain each runtime."""


def runtimes_of(path: Path, device: Device = "cpu") -> tuple[Runtime, ...]:
    """Return the runtimes that can execute weights of this file type on a device, the fastest first."""
    if path.suffix == TORCHSCRIPT_SUFFIX or (device == "cuda" and path.suffix != ONNX_SUFFIX):
        return ("torch",)
    if device == "cuda":
        return ()
    return ("onnxruntime", "opencv") if path.suffix == ONNX_SUFFIX else FASTEST_FIRST


def select_runtime(path: Path, wanted: str = AUTO, device: Device = "cpu") -> Runtime:
    """Return the runtime for weights: the wanted one, or the fastest that is installed; `torch` if none is.

    Raise SettingError if the wanted runtime cannot execute weights of this file type on the device, or is not
    installed.
    """
    suitable = runtimes_of(path, device)
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
    where = f"{path.suffix or '.npz'} weights on the device {device!r}"
    message = f"runtime {wanted!r} does not execute {where}"
    raise SettingError(Diagnostic(message, f"set `runtime` to {AUTO}, {', '.join(suitable)}"))


def missing_runtime(name: Runtime) -> SettingError:
    """Return the error for a runtime that is not installed."""
    hint = f"run: pip install 'eidrive-scenario[{_EXTRAS[name]}]'"
    return SettingError(Diagnostic(f"runtime {name!r} is not installed", hint))


def runtime_versions(name: Runtime) -> Mapping[str, str]:
    """Return name and version of a runtime; nothing if it is not installed. No library is imported."""
    if name == "opencv":
        return {name: cv2.__version__}
    return {name: version(name)} if is_installed(name) else {}


def is_installed(name: Runtime) -> bool:
    """Return whether the library of a runtime is installed."""
    return name == "opencv" or importlib.util.find_spec(name) is not None
