"""Third-party scenarios, maps and schemas, which are not part of the project: the folder EIDRIVE_CORPORA."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

CORPORA = Path(os.environ["EIDRIVE_CORPORA"]) if os.environ.get("EIDRIVE_CORPORA") else None
needs_corpora = pytest.mark.skipif(CORPORA is None, reason="EIDRIVE_CORPORA is not set")


def corpora_folder() -> Path:
    """Return the folder. Skip the test if there is none."""
    if CORPORA is None:
        pytest.skip("EIDRIVE_CORPORA is not set")
    return CORPORA


def scenario_files() -> list[Path]:
    """Return all OpenSCENARIO files of the folder, none without a folder."""
    return sorted(CORPORA.rglob("*.xosc")) if CORPORA is not None else []


def corpora_name(path: Path) -> str:
    """Return the path of a file below the folder."""
    return path.relative_to(corpora_folder()).as_posix()
