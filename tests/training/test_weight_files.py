"""Cards of trained weights, and descriptions in weight files."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.perception.learned.weights import DESCRIPTION, Description
from training.weight_files import update_card, update_description, write_card, write_weights


def test_update_replaces_entries_and_keeps_arrays(tmp_path: Path) -> None:
    path = tmp_path / "new" / "network.npz"
    write_weights(path, {"kernel": np.arange(3.0)}, {"network": "ssd", "confidence": 0.3})
    write_card(path, {"network": "ssd", "held_out": 1})
    update_description(path, confidence=0.5, outward=[])
    update_card(path, held_out=2)
    with np.load(path) as stored:
        assert sorted(stored.files) == sorted(["kernel", DESCRIPTION])
        assert stored["kernel"].tolist() == [0.0, 1.0, 2.0]
        assert json.loads(str(stored[DESCRIPTION])) == {"network": "ssd", "confidence": 0.5, "outward": []}
    assert json.loads(path.with_suffix(".json").read_text()) == {"network": "ssd", "held_out": 2}


def test_card_of_training_on_a_cpu_beside_a_gpu_states_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")
    from training.train import card_of

    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda device=None: "H100")
    options = argparse.Namespace(data_seed=1, seed=1, batch=8, rate=0.1, device="cpu")
    description = Description("ssd", ("car",), (512, 384))
    card = card_of(options, description, {"mean": 0.5}, 1, 2.0, 3, 4)
    assert card["training"]["device"] == "CPU"
