"""Descriptions in weight files, and their cards."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from eidrive_scenario.perception.learned.weights import DESCRIPTION
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
