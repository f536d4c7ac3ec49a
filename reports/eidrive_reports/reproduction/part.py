"""Part of the reproduction: its runs, and its report from their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter

from eidrive_reports.cooperative_perception.receivers import Condition
from eidrive_reports.reproduction.episodes import Episode, EpisodeJob
from eidrive_reports.reproduction.layout import PartReport
from eidrive_reports.reproduction.provenance import job_digest
from eidrive_reports.studies import group_by
from eidrive_scenario.api.run import RunSettings

_BLOCK = 1000
"""Number of consecutive seeds of a block."""


def seed_of_block(seed: int, block: int, blocks: int) -> int:
    """Return the seed of an episode, from 1, in one of several blocks, which have no seed in common."""
    cycle, position = divmod(seed - 1, _BLOCK)
    return (cycle * blocks + block) * _BLOCK + position + 1


@dataclass(frozen=True)
class Case:
    """Scenario with the settings of one arm, which is run with every seed.

    arm      name of the settings, without the scenario
    counted  station whose objects after fusion are counted; "" for none
    varied   function that returns the parameters of a seed, if the part draws them instead of the scenario
    load     number of stations that are added to the scenario and send CAM; see `with_load`
    block    number of the arm among the `blocks` arms of equal settings, so that these have several runs per episode
    conditions  conditions under which the perception of the ego is measured in the same run
    """

    scenario: str
    arm: str
    settings: RunSettings
    counted: str = ""
    varied: Callable[[int], Mapping[str, str]] | None = None
    load: int = 0
    block: int = 0
    blocks: int = 1
    conditions: tuple[Condition, ...] = ()

    def job(self, seed: int) -> EpisodeJob:
        """Return the run of a seed."""
        seed = seed_of_block(seed, self.block, self.blocks)
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
    cases      function that returns its cases for some detectors
    report     function that returns its report from the episodes of these detectors
    default    detectors without an option; by default all that it can use
    has_replays  whether its runs can be recorded for replays: few cases, each a run of a scenario of the library
    """

    name: str
    title: str
    question: str
    episodes: int
    detectors: tuple[str, ...]
    cases: Callable[[Sequence[str]], Sequence[Case]]
    report: Callable[[Sequence[Episode], Sequence[str]], PartReport]
    default: tuple[str, ...] = ()
    has_replays: bool = False

    def jobs(self, episodes: int, detectors: Sequence[str]) -> list[EpisodeJob]:
        """Return all runs, ordered by seed, so that an interrupted part has complete pairs."""
        cases = self.cases(detectors)
        return [case.job(seed) for seed in range(1, episodes + 1) for case in cases]


Runs = Mapping[tuple[str, str], Sequence[Episode]]
"""Episodes of each case by scenario and arm, ordered by seed."""


def by_case(episodes: Sequence[Episode]) -> Runs:
    """Return the episodes of each case."""
    return group_by(sorted(episodes, key=attrgetter("seed")), attrgetter("scenario", "arm"))
