"""One run of a parameter value distribution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from eidrive_scenario.openscenario.values.parameters import Assignment


@dataclass(frozen=True)
class ConcreteRun:
    """Scenario with a value for each parameter that its distribution varies.

    number       number of the run in the distribution, from 0
    assignments  values by parameter, each with its line in the file; an argument of `load_scenario`
    """

    scenario: Path
    number: int
    assignments: Mapping[str, Assignment]

    @property
    def parameters(self) -> dict[str, str]:
        """Return the values by parameter."""
        return {name: assignment.text for name, assignment in self.assignments.items()}

    def __str__(self) -> str:
        """Format the values as `Speed=10,Model=car`; of a path only the last part is shown."""
        return ",".join(f"{name}={PurePosixPath(text).name or text}" for name, text in self.parameters.items())
