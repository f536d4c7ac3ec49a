"""Shipped networks by torch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from eidrive_scenario.arrays import Floats
from eidrive_scenario.perception.learned.networks.blocks import fold
from eidrive_scenario.perception.learned.networks.ssd import Ssd
from eidrive_scenario.perception.learned.networks.yolov5 import YoloV5
from eidrive_scenario.perception.learned.torch_devices import prepare


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
            together = self._outputs(part)
            outputs += [[output[row : row + 1] for output in together] for row in range(len(part))]
        return outputs

    def _outputs(self, images: Sequence[NDArray[np.uint8]]) -> list[Floats]:
        """Return the outputs of a batch that these images begin."""
        together = np.zeros((self._batch, *images[0].shape), dtype=np.uint8)
        for row, image in enumerate(images):
            together[row] = image
        with torch.inference_mode():
            pixels = torch.from_numpy(together).to(self._device).permute(0, 3, 1, 2)
            outputs = self._network.raw_outputs(pixels.to(torch.float32).div_(255.0))
            return [output.cpu().numpy() for output in outputs]
