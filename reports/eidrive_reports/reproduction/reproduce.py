"""Runs, record and files of the parts of the reproduction."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path

from rich.console import Console

from eidrive_reports.reproduction.episodes import Episode, run_episode
from eidrive_reports.reproduction.layout import PartReport, Section, as_csv
from eidrive_reports.reproduction.part import Part
from eidrive_reports.reproduction.provenance import commit, read_provenance, write_provenance
from eidrive_reports.run_record import RunRecord
from eidrive_scenario.api.common import write_atomically
from eidrive_scenario.api.experiments import cores, run_jobs


class Record(RunRecord[Episode]):
    """Record of the episodes of a part."""

    kind = Episode
    key = attrgetter("scenario", "arm", "seed", "digest")
    hint = "remove the line, or start again with --restart"


@dataclass(frozen=True)
class Reproduced:
    """Part with its episodes in the order of the jobs.

    added      number of episodes that this call has run; the others are those of the record
    unused     number of episodes of the record with other settings, seeds or code
    elapsed_s  duration of the call [s]
    """

    report: PartReport
    episodes: tuple[Episode, ...]
    added: int
    unused: int
    elapsed_s: float

    @property
    def computed_s(self) -> float:
        """Sum of the durations of all episodes [s]."""
        return sum(episode.wall_s for episode in self.episodes)


def reproduce(
    part: Part,
    out: Path,
    *,
    episodes: int,
    detectors: Sequence[str],
    workers: int | None = None,
    restart: bool = False,
    console: Console | None = None,
) -> Reproduced:
    """Run the episodes of a part that its record lacks, and write its report and tables into the folder `out`.

    restart  whether the record is discarded first

    The report depends on the episodes only, so a second call writes the same files. Raise SettingError if a file
    cannot be written or the record is damaged, and the exceptions of `run_jobs`.
    """
    start, checkout = time.perf_counter(), commit()
    read_provenance(out)  # a damaged file is an error before the runs, not after them
    jobs = part.jobs(episodes, detectors)
    with Record.open(out / f"{part.name}.jsonl", restart=restart) as record:
        recorded = len(record.runs)
        left = [job for job in jobs if record.key(job) not in record.runs]
        if left:
            run_jobs(left, run_episode, workers=workers, console=console, title=part.name, finished=record.add)
        used = tuple(record.runs[record.key(job)] for job in jobs)
    report = part.report(used, detectors)
    report = replace(report, sections=(Section("Question", (part.question,)), *report.sections))
    _write_report(part, out, report)
    unused = recorded - (len(jobs) - len(left))
    done = Reproduced(report, used, len(left), unused, time.perf_counter() - start)
    write_provenance(
        out,
        part.name,
        {
            "seeds": f"1 to {episodes}",
            "detectors": list(detectors),
            "runs": len(used),
            "all_runs_s": round(done.computed_s, 1),
        },
        checkout=checkout,
        added=done.added,
        elapsed_s=done.elapsed_s,
        processes=min(workers or cores(), max(1, done.added)),
    )
    return done


def _write_report(part: Part, out: Path, report: PartReport) -> None:
    """Write Markdown, and the tables as CSV files and as JSON."""
    tables = report.data()
    texts = {
        f"{part.name}.md": report.markdown(),
        f"{part.name}.json": json.dumps(report.as_json(), indent=1) + "\n",
    }
    texts |= {f"{name}.csv": as_csv(rows) for name, rows in tables.items()}
    for name, text in texts.items():
        with write_atomically(out / name) as stream:
            stream.write(text.encode())
