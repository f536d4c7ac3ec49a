"""Part of the reproduction: its runs, and its report from their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from eidrive_reports.cooperative_perception.receivers import Condition
from eidrive_reports.reproduction.episodes import Episode, EpisodeJob
from eidrive_reports.reproduction.layout import PartReport
from eidrive_reports.reproduction.provenance import job_digest
from eidrive_scenario.api.run import RunSettings


@dataclass(frozen=True)
class Case:
    """Scenario with the settings of one arm, which is run with every seed.

    arm      name of the settings, without the scenario
    counted  station whose objects after fusion are counted; "" for none
    varied   function that returns the parameters of a seed, if the part draws them instead of the scenario
    load     number of stations that are added to the scenario and send CAM; see `with_load`
    shift    number that is added to the seed, so that an arm can have several runs per episode
    conditions  conditions under which the perception of the ego is measured in the same run
    """

    scenario: str
    arm: str
    settings: RunSettings
    counted: str = ""
    varied: Callable[[int], Mapping[str, str]] | None = None
    load: int = 0
    shift: int = 0
    conditions: tuple[Condition, ...] = ()

    def job(self, seed: int) -> EpisodeJob:
        """Return the run of a seed."""
        seed += self.shift
        settings = self.settings
        if self.varied is not None:
            settings = replace(settings, parameters={**settings.parameters, **self.varied(seed)})
        digest = job_digest(self.scenario, settings, load=self.load, conditions=self.conditions)
        return EpisodeJob(self.scenario, self.arm, seed, settings, digest, self.counted, self.load, self.conditions)


@dataclass(frozen=True)
class Part:
    """Part of the reproduction.

    name       name on the command line and of its files
    title      title in lists
    question   question that it examines
    episodes   number of episodes per cell without an option, with seeds from 1
    detectors  detectors that it can use
    default    detectors without an option
    cases      function that returns its cases for some detectors
    report     function that returns its report from the episodes of these detectors
    has_replays  whether its runs can be recorded for replays: few cases, each a run of a scenario of the library
    """

    name: str
    title: str
    question: str
    episodes: int
    detectors: tuple[str, ...]
    default: tuple[str, ...]
    cases: Callable[[Sequence[str]], Sequence[Case]]
    report: Callable[[Sequence[Episode], Sequence[str]], PartReport]
    has_replays: bool = False

    def jobs(self, episodes: int, detectors: Sequence[str]) -> list[EpisodeJob]:
        """Return all runs, ordered by seed, so that an interrupted part has complete pairs."""
        cases = self.cases(detectors)
        return [case.job(seed) for seed in range(1, episodes + 1) for case in cases]


def by_case(episodes: Sequence[Episode]) -> dict[tuple[str, str], list[Episode]]:
    """Return the episodes of each case by scenario and arm, ordered by seed."""
    cases: dict[tuple[str, str], list[Episode]] = {}
    for episode in sorted(episodes, key=lambda episode: episode.seed):
        cases.setdefault((episode.scenario, episode.arm), []).append(episode)
    return cases


def select(episodes: Sequence[Episode], scenario: str, arm: str) -> list[Episode]:
    """Return the episodes of a case, ordered by seed."""
    mine = [episode for episode in episodes if (episode.scenario, episode.arm) == (scenario, arm)]
    return sorted(mine, key=lambda episode: episode.seed)
