"""Warnings about delays shorter than the time step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.v2x.profile import ChannelProfile


def short_channel_delay(
    profile: ChannelProfile | None, dt: float, source: str = "", line: int | None = None
) -> Iterator[Diagnostic]:
    """Yield a warning if most messages of a channel are delayed by less than one step `dt` [s], but by more than 0.

    A message without delay arrives in the next tick by definition of the channel, which is no warning.
    """
    delay: Any = getattr(profile, "delay", None)
    if profile is None or not hasattr(delay, "quantile"):
        return
    median = float(delay.quantile(0.5))
    if 0.0 < median < dt - TIME_TOLERANCE:
        what = "the median delay" if delay.random else "the delay"
        yield Diagnostic(
            f"most messages take one step of {dt:g} s: {what} of the channel {profile.name!r} is only {median:.3g} s",
            "use a smaller step (--dt) to resolve it",
            source,
            line,
        )


def short_detector_latencies(settings: Mapping[str, AgentSettings], dt: float) -> Iterator[Diagnostic]:
    """Yield a warning for each station whose detector takes less than one step `dt` [s], but more than 0."""
    for name, station in settings.items():
        if 0.0 < station.detector_latency < dt - TIME_TOLERANCE:
            yield Diagnostic(
                f"detections of {name!r} are known one step of {dt:g} s later: "
                f"its detector_latency is only {station.detector_latency:g} s",
                "use a smaller step (--dt) to resolve it",
            )
