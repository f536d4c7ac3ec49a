"""Part of the reproduction: its runs, and its report from their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from eidrive_scenario.experiments.reproduction.digests import job_digest
from eidrive_scenario.experiments.reproduction.episodes import Episode, EpisodeJob
from eidrive_scenario.experiments.reproduction.layout import PartReport
from eidrive_scenario.simulation import RunSettings


@dataclass(frozen=True)
class Case:
    """Scenario with the settings of one arm, which is run with every seed.

    arm      name of the settings, without the scenario
    counted  station whose known objects are counted; "" for none
    """

    scenario: str
    arm: str
    settings: RunSettings
    counted: str = ""


@dataclass(frozen=True)
class Part:
    """Part of the reproduction.

    name       name on the command line and of its files
    title      title in lists
    episodes   number of episodes per cell without an option, with seeds from 1
    detectors  detectors that it can use
    default    detectors without an option
    cases      function that returns its cases for some detectors
    report     function that returns its report from the episodes of these detectors
    """

    name: str
    title: str
    episodes: int
    detectors: tuple[str, ...]
    default: tuple[str, ...]
    cases: Callable[[Sequence[str]], Sequence[Case]]
    report: Callable[[Sequence[Episode], Sequence[str]], PartReport]

    def jobs(self, episodes: int, detectors: Sequence[str]) -> list[EpisodeJob]:
        """Return all runs, ordered by seed, so that an interrupted part has complete pairs."""
        cases = self.cases(detectors)
        digests = [job_digest(case.scenario, case.settings) for case in cases]
        return [
            EpisodeJob(case.scenario, case.arm, seed, case.settings, digest, case.counted)
            for seed in range(1, episodes + 1)
            for case, digest in zip(cases, digests, strict=True)
        ]


def select(episodes: Sequence[Episode], scenario: str, arm: str) -> list[Episode]:
    """Return the episodes of a case, ordered by seed."""
    mine = [episode for episode in episodes if (episode.scenario, episode.arm) == (scenario, arm)]
    return sorted(mine, key=lambda episode: episode.seed)
