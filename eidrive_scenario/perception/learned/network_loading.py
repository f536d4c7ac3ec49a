"""Networks of the detectors `yolov5` and `ssd`, from their settings."""

from __future__ import annotations

from pathlib import Path

from eidrive_scenario.perception.learned.external_network import ExternalNetwork
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.learned.own_network import OwnNetwork
from eidrive_scenario.perception.learned.runtimes import Runtime, is_installed, missing_runtime, select_runtime
from eidrive_scenario.perception.learned.settings import EXTERNAL_SUFFIXES, LearnedSettings
from eidrive_scenario.perception.learned.weights import (
    DEFAULT_CONFIDENCE,
    OWN_SUFFIX,
    TORCHSCRIPT_SUFFIX,
    another_network,
    check_weights_exist,
    refused_torchscript,
    torchscript_is_allowed,
)

SHIPPED = Path(__file__).parents[1] / "weights"
"""Folder of the weights of this project."""


def weights_path(name: str, settings: LearnedSettings) -> Path:
    """Return the path of the weights that the settings of this detector select. Raise SettingError if it is no file."""
    path = SHIPPED / f"{name}{OWN_SUFFIX}" if settings.weights is None else Path(settings.weights)
    check_weights_exist(path)
    return path


def runtime_of(path: Path, settings: LearnedSettings) -> Runtime:
    """Return the runtime for weights. Raise SettingError if none can execute them as the settings demand."""
    return select_runtime(path, settings.runtime, settings.device, settings.precision)


def check_network(name: str, settings: LearnedSettings, *, allow_torchscript: bool) -> tuple[Path, Runtime]:
    """Return the path of the weights that the settings select, and their runtime.

    Raise SettingError if the weights that the settings select are missing, or are TorchScript without permission of
    the user, and if the runtime is not installed. Nothing is read or imported.
    """
    path = weights_path(name, settings)
    if path.suffix == TORCHSCRIPT_SUFFIX and not torchscript_is_allowed(allow_torchscript):
        raise refused_torchscript(path)
    runtime = runtime_of(path, settings)
    if not is_installed(runtime):
        raise missing_runtime(runtime)
    return path, runtime


def build_network(name: str, settings: LearnedSettings, *, allow_torchscript: bool = False) -> ImageNetwork:
    """Return the network that the settings select.

    Raise SettingError as `check_network`, if the weights are not suitable, and if the device is not available.
    """
    path, runtime = check_network(name, settings, allow_torchscript=allow_torchscript)
    if path.suffix in EXTERNAL_SUFFIXES and settings.classes is not None and settings.input_size is not None:
        return ExternalNetwork(
            path,
            settings.classes,
            settings.input_size,
            settings.confidence or DEFAULT_CONFIDENCE,
            settings.layout,
            settings.threads,
            settings.letterbox,
            runtime=runtime,
            device=settings.device,
            allow_torchscript=torchscript_is_allowed(allow_torchscript),
        )
    network = OwnNetwork(path, runtime, settings.confidence, settings.threads, settings.device, settings.precision)
    if network.name != name:
        raise another_network(path, network.name, name)
    return network
