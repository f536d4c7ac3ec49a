"""Trace hashes of many runs and diagnostics of many files, to show that a change of the code changes no behavior.

    python tests/conformance/trace_baseline.py write baseline.json      # in the old checkout
    python tests/conformance/trace_baseline.py compare baseline.json    # in the new one; exit status 1 if any differs

The runs cover all scenarios of the library with three seeds, all channel profiles and detectors with two of them, and
the corpora under EIDRIVE_CORPORA, if that is set.
Only the command line is used, so that both checkouts may differ in any internal name. A hash depends on the versions
of numpy and pybullet and on the processor; a baseline holds for the machine that wrote it.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

SCENARIOS = Path(__file__).parents[2] / "xosc"
LIBRARY = ("coop/scenario_1", "coop/scenario_2")
"""Scenarios that are run with all channels and detectors."""
CHANNELS = (
    "none", "ideal", "paper", "congested", "cv2x_highway", "80211p_urban", "5g_uu", "bursty", "error_30pct",
    "latency_300ms", "stochastic_latency", "paper_error_30pct", "paper_latency_300ms",
)  # fmt: skip
ALL_SEEDS = ("none", "ideal", "paper", "congested", "cv2x_highway")
DETECTORS = ("lidar", "yolov5", "ssd")
SEEDS = (1, 2, 3)
TIME_LIMIT = "30"


def runs() -> Iterator[tuple[str, ...]]:
    """Yield the arguments of `eidrive run`, one tuple a run."""
    for scenario in LIBRARY:
        for channel in CHANNELS:
            for seed in SEEDS if channel in ALL_SEEDS else SEEDS[:1]:
                yield scenario, "--channel", channel, "--seed", str(seed)
        for detector in DETECTORS:
            for channel in ("none", "paper"):
                yield scenario, "--detector", detector, "--channel", channel
    for path in sorted(SCENARIOS.rglob("*.xosc")):
        name = path.relative_to(SCENARIOS).with_suffix("").as_posix()
        if b"<ParameterValueDistribution" in path.read_bytes():
            yield name, "--max-runs", "2"
        elif b"<Storyboard" in path.read_bytes():
            for seed in SEEDS:
                yield name, "--seed", str(seed)
    for weather in ("foggy_morning", "storm"):
        yield LIBRARY[0], "--weather", weather, "--detector", "lidar"
    for path in corpus("*.xosc"):
        several = b"<ParameterValueDistribution" in path.read_bytes()
        yield str(path), "--no-criteria", "--time-limit", TIME_LIMIT, *(("--max-runs", "2") if several else ())


def corpus(pattern: str) -> list[Path]:
    """Return the files of the corpora, none if EIDRIVE_CORPORA is not set."""
    folder = os.environ.get("EIDRIVE_CORPORA")
    return sorted(Path(folder).rglob(pattern)) if folder else []


def eidrive(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line of this checkout."""
    command = [sys.executable, "-m", "eidrive_scenario", *arguments]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "COLUMNS": "200"}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def outcome(arguments: Sequence[str]) -> dict[str, Any]:
    """Return what one run gave, without names that a change may rename; only the exit status if it gave no result."""
    done = eidrive("run", *arguments, "--json", "--no-record")
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    return {
        "exit": done.returncode,
        "runs": [
            {
                "trace_hash": run["trace_hash"],
                "verdicts": [criterion["passed"] for criterion in run["criteria"]],
                "metrics": sorted(map(repr, run["metrics"].values())),
            }
            for run in lines
        ],
    }


def diagnostics() -> dict[str, int]:
    """Return the number of lines that `eidrive check` prints for each file of the corpora and the library."""
    folder = os.environ.get("EIDRIVE_CORPORA")
    done = eidrive("check", *LIBRARY, *([folder] if folder else []))
    if done.returncode not in (0, 2):
        raise SystemExit(done.stderr)
    files = (line.split(": ", 1)[0].rsplit(":", 1)[0] for line in done.stdout.splitlines()[:-1] if ": " in line)
    return dict(sorted(Counter(files).items()))


def measure(workers: int) -> dict[str, Any]:
    """Return the outcomes of all runs by their arguments, and the number of diagnostics by file."""
    wanted = list(runs())
    with ThreadPoolExecutor(workers) as pool:
        outcomes = list(pool.map(outcome, wanted))
    return {
        "runs": {" ".join(arguments): given for arguments, given in zip(wanted, outcomes, strict=True)},
        "diagnostics": diagnostics(),
    }


def differences(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Return a line for each entry that is not the same."""
    found = []
    for kind in ("runs", "diagnostics"):
        for name in sorted({*before[kind], *after[kind]}):
            old, new = before[kind].get(name), after[kind].get(name)
            if old != new:
                found.append(f"{name}: {old} -> {new}")
    return found


def main() -> int:
    """Write or compare a baseline."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("action", choices=("write", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    measured = measure(options.workers)
    count = f"{len(measured['runs'])} runs, {len(measured['diagnostics'])} files with diagnostics"
    if options.action == "write":
        options.file.write_text(json.dumps(measured, indent=1), encoding="utf-8")
        print(f"{options.file}: {count}")
        return 0
    found = differences(json.loads(options.file.read_text(encoding="utf-8")), measured)
    for line in found:
        print(line)
    print(f"{count}, {len(found)} different")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
