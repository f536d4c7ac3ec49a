"""Networks in torch: devices, weights and inference."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.perception.learned.networks.blocks import fold
from eidrive_scenario.perception.learned.networks.ssd import Ssd
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5
from eidrive_scenario.perception.learned.weights import Description, Weights


def prepare(threads: int, device: str) -> None:
    """Set the number of threads, and deterministic kernels in single precision for a GPU.

    Raise SettingError if the device is `cuda` and torch can use no GPU.
    """
    torch.set_num_threads(threads)
    if device != "cuda":
        return
    if not torch.cuda.is_available():
        message = f"device 'cuda' is not available: torch {torch.__version__} finds no GPU that it supports"
        raise SettingError(Diagnostic(message, "set `device: cpu`, or install torch with CUDA and a driver"))
    torch.backends.cudnn.benchmark = False
    torch.backends.cudnn.deterministic = True
    torch.backends.cudnn.allow_tf32 = False
    torch.backends.cuda.matmul.allow_tf32 = False


def untrained(description: Description) -> YoloV5 | Ssd:
    """Return the network of a description with random weights. Raise ValueError if anchors of `yolov5` are missing."""
    if description.network == "ssd":
        return Ssd(len(description.classes))
    if description.anchors is None:
        raise ValueError("its description lacks anchors")
    return YoloV5(len(description.classes), description.anchors)


def trainable(weights: Weights) -> YoloV5 | Ssd:
    """Return the network with these weights. Raise ValueError if an array is missing or has another shape."""
    network, stored = untrained(weights.description), weights.arrays
    expected = network.state_dict()
    missing = [name for name in expected if name not in stored]
    if missing:
        raise ValueError(f"{missing[0]} is missing")
    mismatched = [name for name, value in expected.items() if tuple(value.shape) != stored[name].shape]
    if mismatched:
        raise ValueError(f"{mismatched[0]} has another shape than the network")
    network.load_state_dict(
        {name: torch.from_numpy(stored[name].copy()).to(value.dtype) for name, value in expected.items()}
    )
    return network


class TorchNetwork:
    """Function from images (H, W, 3), red green blue, to the outputs of the ONNX model of the same weights for each.

    network  with its weights, which cannot be trained afterwards
    threads  of the computation on the CPU, in the whole process;  device  `cpu` or `cuda`
    batch    images that are processed at once. Black images complete a batch: kernels of other batch sizes round
             differently, and the outputs for an image must not depend on the number of the others

    Raise SettingError if the device is `cuda` and torch can use no GPU.
    """

    def __init__(self, network: YoloV5 | Ssd, threads: int, device: str = "cpu", batch: int = 1) -> None:
        prepare(threads, device)
        fold(network, fast_convolutions=device == "cpu")
        self._network = network.to(device)
        self._threads, self._device, self._batch = threads, device, batch

    def __call__(self, images: Sequence[NDArray[np.uint8]]) -> list[list[Floats]]:
        if torch.get_num_threads() != self._threads:
            torch.set_num_threads(self._threads)
        outputs: list[list[Floats]] = []
        for start in range(0, len(images), self._batch):
            part = images[start : start + self._batch]
            batch = np.zeros((self._batch, *part[0].shape), dtype=np.uint8)
            batch[: len(part)] = part
            with torch.inference_mode():
                pixels = torch.from_numpy(batch).to(self._device).permute(0, 3, 1, 2)
                raw = self._network(pixels.to(torch.float32).div_(255.0))
                together = [output.cpu().numpy() for output in raw]
            outputs += [[output[row : row + 1] for output in together] for row in range(len(part))]
        return outputs
