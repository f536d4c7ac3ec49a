"""Pictures of an episode: the top view that follows a station."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.gym.episode import Episode
from eidrive_scenario.gym.settings import RenderSettings
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.drawing.road_drawing import network_drawing
from eidrive_scenario.reporting.drawing.snapshot_picture import snapshot_picture
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing
from eidrive_scenario.reporting.snapshot import DEFAULT_SETTINGS, SnapshotBuilder, StationSnapshot
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world.view import WorldView


class Renderer:
    """Pictures of the current instant of an episode, with what one station perceives and receives."""

    def __init__(self, station: str, settings: RenderSettings) -> None:
        self._station = station
        self._settings = settings
        self._roads: tuple[RoadNetwork | None, RoadDrawing] = None, RoadDrawing()
        self._builder = SnapshotBuilder(station)
        self._snapshot: StationSnapshot | None = None
        self._center = 0.0, 0.0

    def begin(self, episode: Episode) -> None:
        """Begin an episode at its current instant, and observe its ticks.

        Until the station enters the world, the pictures show the place of the first station that is present.
        """
        simulation = episode.simulation
        settings = simulation.stack.settings.get(self._station, DEFAULT_SETTINGS)
        self._builder = SnapshotBuilder(self._station, settings)
        if simulation.roads is not self._roads[0]:
            self._roads = simulation.roads, network_drawing(simulation.roads)
        episode.observers.append(self._observe)
        view = episode.start.view
        first = next((name for name in episode.perceived if name in view), None)
        if first is not None:
            self._set_center(view, first)
        self._observe(episode)

    def _observe(self, episode: Episode) -> None:
        """Register the current instant."""
        view, perceived, last = episode.start.view, episode.perceived.get(self._station), episode.last_frame
        steps: dict[str, AgentStep] = {}
        if perceived is not None:
            before = None if last is None else last.steps.get(self._station)
            steps[self._station] = AgentStep(
                detections=perceived.detections,
                inbox=perceived.inbox,
                fused=perceived.fused,
                plan=None if before is None else before.plan,
                control=None if before is None else before.control,
                outbox=(),
            )
        self._snapshot = self._builder.observe(Frame(view, steps, links=() if last is None else last.links))
        if self._station in view:
            self._set_center(view, self._station)

    def _set_center(self, view: WorldView, name: str) -> None:
        x, y, _ = view.centers[view.row(name)].tolist()
        self._center = x, y

    def picture(self) -> NDArray[np.uint8]:
        """Return the picture (height, width, 3) in the order red, green, blue."""
        settings = self._settings
        snapshot = self._snapshot
        assert snapshot is not None
        image = snapshot_picture(
            snapshot, self._roads[1], self._center, size=(settings.width, settings.height), extent=settings.extent
        )
        return np.ascontiguousarray(image[..., ::-1])
