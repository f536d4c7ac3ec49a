"""Time of the shipped networks per image, with torch on the CPU or a GPU, for several images at once.

A measurement contains the transfer of the images to the device and of all outputs back. Kernels are
those of the detectors: deterministic, in single precision without TF32. A GPU computes only this part of a run; images
are drawn, and boxes suppressed and lifted, on the CPU.

    python benchmarks/bench_networks.py [--device cuda] [--batches 1 8 64] [--repeats 50]
"""

from __future__ import annotations

import argparse
import platform
import time
from statistics import median

import numpy as np
import torch

from eidrive_scenario.perception.learned.network_loading import SHIPPED
from eidrive_scenario.perception.learned.networks.blocks import fold
from eidrive_scenario.perception.learned.torch_network import prepare, trainable
from eidrive_scenario.perception.learned.weights import read

WARM_UP = 5


def milliseconds(name: str, device: str, batch: int, repeats: int) -> float:
    """Return the median time per image [ms]."""
    weights = read(SHIPPED / f"{name}.npz")
    prepare(1, device)
    network = trainable(weights)
    fold(network, fast_convolutions=device == "cpu")
    network = network.to(device)
    width, height = weights.description.input_size
    images = np.random.default_rng(0).integers(0, 256, (batch, height, width, 3), dtype=np.uint8)
    times = []
    with torch.inference_mode():
        for _ in range(WARM_UP + repeats):
            started = time.perf_counter()
            pixels = torch.from_numpy(images).to(device).permute(0, 3, 1, 2)
            outputs = network(pixels.to(torch.float32).div_(255.0))
            for output in outputs:
                output.cpu()
            times.append(time.perf_counter() - started)
    return 1e3 * median(times[WARM_UP:]) / batch


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--batches", type=int, nargs="+", default=[1, 8, 64])
    parser.add_argument("--repeats", type=int, default=50)
    options = parser.parse_args()
    where = torch.cuda.get_device_name() if options.device == "cuda" else platform.processor() or platform.machine()
    print(f"torch {torch.__version__}, {where}, one thread of the CPU: milliseconds per image")
    print(f"{'network':10}" + "".join(f"{f'batch of {batch}':>14}" for batch in options.batches))
    for name in ("yolov5", "ssd"):
        cells = (milliseconds(name, options.device, batch, options.repeats) for batch in options.batches)
        print(f"{name:10}" + "".join(f"{cell:14.2f}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
