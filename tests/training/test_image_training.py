"""Training of the networks on images: its card, and training sets that are too small."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra 'learned'")

from eidrive_scenario.perception.learned.weights import Description  # noqa: E402
from training.dataset import encode, write  # noqa: E402
from training.train import card_of, train  # noqa: E402


def options(**given: object) -> argparse.Namespace:
    defaults = {"network": "ssd", "data_seed": 1, "seed": 1, "batch": 8, "rate": 0.1, "device": "cpu", "epochs": 1}
    return argparse.Namespace(**{**defaults, "minutes": 0.0, "check": 1, **given})


def test_card_of_training_on_a_cpu_beside_a_gpu_states_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda device=None: "H100")
    card = card_of(options(), Description("ssd", ("car",), (512, 384)), {"mean": 0.5}, 1, 2.0, 3, 4)
    assert card["training"]["device"] == "CPU"


def test_training_with_a_batch_above_the_number_of_images_is_refused(tmp_path: Path) -> None:
    """Without a complete batch no step would be taken."""
    for split in ("train", "validation"):
        columns = {name: np.empty(0) for name in ("picture", "number", "height", "seen", "whole", "distance")}
        columns |= {"box": np.empty((0, 4)), "readable": np.empty(0, dtype=bool)}
        write(tmp_path / split, [encode(np.zeros((384, 512, 3), dtype=np.uint8), 80)], columns)
    with pytest.raises(SystemExit, match=r"--batch: .*got 8; expected up to 1"):
        train(options(data=tmp_path, out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()
