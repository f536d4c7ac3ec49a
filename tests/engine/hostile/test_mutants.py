"""A few mutants of the library's files through check and run; `campaign.py` takes as many as asked for.

EIDRIVE_MUTANTS sets how many, EIDRIVE_CORPORA adds the corpora's files.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from campaign import sources
from mutants import mutant

COUNT = os.environ.get("EIDRIVE_MUTANTS", "24")


@pytest.mark.process
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the limits of a trial need Linux")
@pytest.mark.timeout(0)
def test_check_and_run_of_mutants_end_without_internal_error_or_hang(tmp_path: Path) -> None:
    """In a process with one thread: each trial is a fork, and locks of other threads would stay locked in it."""
    single = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    program = Path(__file__).parent / "shared" / "campaign.py"
    path = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, str(program), "--count", COUNT, "--out", str(tmp_path)],
        env=dict(os.environ) | single | path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "end: {" in done.stdout


def test_mutant_of_one_seed_and_number_is_always_the_same() -> None:
    path, _ = sources()[0]
    content = path.read_bytes()
    first = [mutant(content, 5, number) for number in range(20)]
    assert first == [mutant(content, 5, number) for number in range(20)]
    assert len(set(first)) > 15
    assert content not in first
