"""What the rules ask about a scenario; worked out once, when first asked."""

from __future__ import annotations

from functools import cached_property

from eidrive_scenario.openscenario.lint.outline import Outline
from eidrive_scenario.openscenario.lint.reach import Reach, Watch


class Survey(Outline):
    """The outline of a scenario, and what its triggers can ever see."""

    @cached_property
    def watches(self) -> tuple[Watch, ...]:
        """All triggers that are asked at all."""
        return tuple(Reach(self).watches())
