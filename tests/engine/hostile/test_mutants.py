"""A few mutants of the library's files through check and run; `campaign.py` takes as many as asked for.

EIDRIVE_MUTANTS sets how many, EIDRIVE_CORPORA adds the corpora's files.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from campaign import GOOD, cases, sources, try_case
from mutants import mutant

COUNT = int(os.environ.get("EIDRIVE_MUTANTS", "24"))
SEED = 1


@pytest.mark.skipif(not hasattr(os, "fork") or not sys.platform.startswith("linux"), reason="limits need Linux")
@pytest.mark.timeout(0)
def test_check_and_run_of_mutants_end_without_internal_error_or_hang(tmp_path: Path) -> None:
    wrong = []
    for case in cases(SEED, COUNT):
        outcome, _ = try_case(case, SEED, tmp_path / f"m{case.number}")
        if outcome.kind not in GOOD:
            wrong.append(f"{case.number} of {case.source}: {outcome}")
    assert wrong == []


def test_mutant_of_one_seed_and_number_is_always_the_same() -> None:
    path, _ = sources()[0]
    content = path.read_bytes()
    first = [mutant(content, 5, number) for number in range(20)]
    assert first == [mutant(content, 5, number) for number in range(20)]
    assert len(set(first)) > 15
    assert content not in first
