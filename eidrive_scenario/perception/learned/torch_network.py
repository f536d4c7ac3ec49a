"""Shipped networks by torch."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from eidrive_scenario.arrays import Floats
from eidrive_scenario.perception.learned.networks.blocks import fold
from eidrive_scenario.perception.learned.networks.ssd import Ssd
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5
from eidrive_scenario.perception.learned.torch_devices import prepare


class TorchNetwork:
    """Function from an image (H, W, 3), red green blue, to the outputs of the ONNX model of the same weights.

    network  with its weights, which cannot be trained afterwards
    threads  of the computation on the CPU, in the whole process;  device  `cpu` or `cuda`

    Raise SettingError if the device is `cuda` and torch can use no GPU.
    """

    def __init__(self, network: YoloV5 | Ssd, threads: int, device: str = "cpu") -> None:
        prepare(threads, device)
        fold(network, fast_convolutions=device == "cpu")
        self._network = network.to(device)
        self._threads, self._device = threads, device

    def __call__(self, image: NDArray[np.uint8]) -> list[Floats]:
        if torch.get_num_threads() != self._threads:
            torch.set_num_threads(self._threads)
        with torch.inference_mode():
            pixels = torch.from_numpy(np.ascontiguousarray(image)).to(self._device).permute(2, 0, 1)[None]
            outputs = self._network.raw_outputs(pixels.to(torch.float32).div_(255.0))
            return [output.cpu().numpy() for output in outputs]
