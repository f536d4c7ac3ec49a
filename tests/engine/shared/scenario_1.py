"""Scenario 1 of the library with changes, its runs, and an observer of their frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Observer, RunResult, RunSettings, run_file

ONE = resolve_scenario("coop/scenario_1")


class FrameCollector:
    """Observer that keeps all frames of a run."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.closed = 0

    def observe(self, frame: Frame) -> None:
        self.frames.append(frame)

    def close(self) -> None:
        self.closed += 1

    @property
    def motion(self) -> list[bytes]:
        """Motion of all actors, by frame."""
        views = [frame.view for frame in self.frames]
        return [np.column_stack([view.position, view.yaw, view.velocity]).tobytes() for view in views]

    @property
    def known(self) -> list[bytes]:
        """Fused objects of the ego, by frame."""
        return [frame.steps["Ego"].fused.boxes.tobytes() for frame in self.frames]


def edited(folder: Path, *changes: tuple[str, str], name: str = "edited.xosc", count: int = -1) -> Path:
    """Write scenario 1 with text replacements, of the first `count` places; references still point to the library."""
    text = ONE.read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, count)
    path = folder / name
    path.write_text(text.replace('"../', f'"{ONE.parent.parent}/'))
    return path


def with_properties(folder: Path, station: str, *properties: tuple[str, str], name: str = "edited.xosc") -> Path:
    """Write scenario 1 with additional properties of the controller of a station, each in its own line."""
    written = "".join(f'\n<Property name="{key}" value="{value}"/>' for key, value in properties)
    head = f'<Controller name="{station}">\n               <Properties>'
    return edited(folder, (head, head + written), name=name)


def simulate(source: Path, channel: str | None, *observers: Observer, seed: int = 1, **more: object) -> RunResult:
    """Run a scenario on a channel with further settings of the run."""
    settings = RunSettings(channel=channel, **more)  # type: ignore[arg-type]
    return run_file(source, seed=seed, settings=settings, observers=observers)
