"""Criterion: value of a monitor of the scenario."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Frame, Verdict


class MonitorSettings(CriterionSettings):
    """Settings: `{of: CutInHappened, expected: true, throughout: false}`; `of` is the name of a MonitorDeclaration."""

    of: str
    expected: bool = True
    throughout: bool = False
    """Whether the value is required at all times, not only at the end."""


class Monitor(Criterion):
    """Criterion that fails if a monitor has an unexpected value at the end, or with `throughout` at any time."""

    settings_type = MonitorSettings
    name = "monitor"

    def __init__(self, settings: MonitorSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.monitors = (settings.of,)
        self._value: bool | None = None
        self._changed = 0.0
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        value = frame.monitors.get(self._settings.of)
        if value != self._value:
            self._value, self._changed = value, frame.view.time
        if value is not None and value != self._settings.expected and self._violated is None:
            self._violated = frame.view.time

    def verdict(self) -> Verdict:
        of, expected, value = self._settings.of, self._settings.expected, self._value
        final = self._violated is not None and self._settings.throughout
        if value is None:
            reason = f"the scenario has no monitor {of!r}"
        else:
            reason = f"{of} is {str(value).lower()} since {self._changed:.2f} s"
        return self.conclude(
            value == expected and not final,
            reason,
            value=None if value is None else float(value),
            limit=float(expected),
            first_violation=self._violated if final else None if value == expected else self._changed,
            is_final=final,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the time of the last change [s], and the margin: 1 for the expected value, else 0."""
        if self._value is None:
            return {}
        margin = float(self._value == self._settings.expected)
        return {f"monitor.{self._settings.of}.changed": self._changed, f"{self.name}.margin": margin}
