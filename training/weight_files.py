"""Weight files and their cards: a .json file beside each, with the origin of the weights and their results."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.perception.learned.weights import DESCRIPTION


def write_weights(path: Path, arrays: Mapping[str, Any], description: Mapping[str, Any]) -> None:
    """Write the arrays and the description of a network."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, allow_pickle=False, **{**arrays, DESCRIPTION: np.array(json.dumps(description))})


def update_description(path: Path, **entries: object) -> None:
    """Set entries of the description in a weight file."""
    with np.load(path) as stored:
        arrays = dict(stored)
    write_weights(path, arrays, {**json.loads(str(arrays[DESCRIPTION])), **entries})


def write_card(path: Path, card: Mapping[str, Any]) -> None:
    """Write the card of a weight file."""
    path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def update_card(path: Path, **entries: object) -> None:
    """Set entries of the card of a weight file."""
    write_card(path, {**json.loads(path.with_suffix(".json").read_text(encoding="utf-8")), **entries})
