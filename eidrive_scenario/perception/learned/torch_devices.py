"""Settings of torch for inference: threads of the CPU, and deterministic kernels of a GPU."""

from __future__ import annotations

import torch

from eidrive_scenario.errors import Diagnostic, SettingError


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
