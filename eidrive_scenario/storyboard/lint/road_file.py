"""Rules about the road file itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from eidrive_scenario.errors import Problem
from eidrive_scenario.storyboard.lint.survey import RoadSurvey


def doubts_about(rule: str) -> Callable[[RoadSurvey], Iterator[Problem]]:
    """What the road network itself finds doubtful in its file, of one rule."""

    def check(survey: RoadSurvey) -> Iterator[Problem]:
        if survey.roads is not None:
            yield from (problem for problem in survey.roads.doubts if problem.rule == rule)

    return check
