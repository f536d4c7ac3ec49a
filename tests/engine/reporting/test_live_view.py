"""Live view of a run: its frames equal those of the replay, and the run equals one without it."""

from __future__ import annotations

import http.client
import json
import math
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import urlopen

import pytest
from lxml import html

from eidrive_scenario.api.live import LiveView
from eidrive_scenario.errors import SettingError, SimulationError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.reporting.live import live_view
from eidrive_scenario.reporting.live.live_view import Pace
from eidrive_scenario.reporting.notebook import write_replay
from eidrive_scenario.reporting.replay.frame_data import replay_data
from eidrive_scenario.reporting.replay.models import ActorModels
from eidrive_scenario.simulation import RunSettings, Simulation, run_file
from eidrive_scenario.simulation.recorded_outcome import recorded_bodies

ONE = "coop/scenario_1"
SHORT = RunSettings(channel="latency_300ms", time_limit=6.0)
Event = tuple[str, Any]


class Watched(LiveView):
    """Live view as fast as possible that opens no browser, and records how long it waits for a page."""

    def __init__(self, **settings: Any) -> None:
        self.announced: list[str] = []
        super().__init__(
            **{"speed": math.inf, "browser": False, "wait": 0.0, "announce": self.announced.append, **settings}
        )

    def events(self) -> list[Event]:
        """Return all events up to the end of the run."""
        parts = urlsplit(self.address)
        connection = http.client.HTTPConnection("127.0.0.1", parts.port or 0, timeout=20.0)
        connection.request("GET", f"{parts.path}events")
        found: list[Event] = []
        kind = ""
        for line in connection.getresponse():
            key, _, text = line.decode().rstrip("\n").partition(": ")
            if key == "event":
                kind = text
            elif key == "data":
                found.append((kind, json.loads(text)))
                if kind == "page" and found[-1][1]["ended"]:
                    connection.close()
                    break
        return found

    def observe(self, frame: Frame) -> None:
        """Add a frame; send those of each half second together at the latest, at any speed of the machine."""
        super().observe(frame)
        if frame.view.tick % 10 == 0:
            self._send_frames()

    def page(self) -> str:
        with urlopen(self.address) as response:
            return str(response.read().decode())


def unpacked(column: list[Any]) -> list[Any]:
    found: list[Any] = []
    for entry in column:
        found.append(found[-1] if found and entry == 0 and entry is not False else entry)
    return found


def extended(column: list[Any], before: int, added: list[Any]) -> list[Any]:
    return [*column, *[None] * (before - len(column)), *added]


def join_parts(events: list[Event]) -> dict[str, Any]:
    """Return the frames of all events in the format of `replay_data`, with columns instead of frames."""
    parts = [data for kind, data in events if kind == "part"]
    times = [time for part in parts for time in part["times"]]
    found: dict[str, Any] = {"times": times, "actors": {}, "poses": {}, "stations": {}, "series": {}, "timeline": {}}
    found["models"] = {number: model for part in parts for number, model in part["models"].items()}
    for key in ("ticks", "changes", "contacts", "light"):
        found[key] = [entry for part in parts for entry in part[key]]
    found["messages"] = [message for part in parts for message in messages_of(part)]
    before = 0
    for part in parts:
        found["actors"] = part["actors"] | found["actors"]
        found["timeline"] |= {row[0]: row for row in part["timeline"]}
        for group in ("poses", "stations", "series"):
            for path, column in leaves(part[group]):
                column = column if group == "series" else unpacked(column)
                found[group][path] = extended(found[group].get(path, []), before, column)
        before += len(part["times"])
    for group in ("poses", "stations", "series"):
        found[group] = {path: extended(column, len(times), []) for path, column in found[group].items()}
    found["timeline"] = list(found["timeline"].values())
    return found


def messages_of(part: Mapping[str, Any]) -> list[list[Any]]:
    """Return the messages of a part with their texts."""
    texts = part["texts"]
    return [
        [sent, texts[sender], texts[receiver], arrives, texts[reason], size, texts[content]]
        for sent, sender, receiver, arrives, reason, size, content in part["messages"]
    ]


def leaves(tree: Mapping[str, Any], path: str = "") -> list[tuple[str, list[Any]]]:
    """Return the lists below a mapping with their paths."""
    found: list[tuple[str, list[Any]]] = []
    for name, value in tree.items():
        found += leaves(value, f"{path}/{name}") if isinstance(value, Mapping) else [(f"{path}/{name}", value)]
    return found


def columns(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return `replay_data` in the same format."""
    poses = {f"/{name}": [pose.get(name) for pose in data["poses"]] for name in data["actors"]}
    stations = {
        f"/{name}/{key}": [None if step is None else step[key] for step in steps]
        for name, steps in data["stations"].items()
        for key in next(step for step in steps if step is not None)
    }
    kept = ("times", "ticks", "actors", "changes", "contacts", "messages", "timeline", "models", "light")
    return {**{key: data[key] for key in kept}, "poses": poses, "stations": stations,
            "series": dict(leaves(data["series"]))}  # fmt: skip


def test_live_frames_equal_those_of_the_replay(tmp_path: Path) -> None:
    with Watched() as live:
        run_and_save(ONE, settings=SHORT, out=tmp_path, observers=[live])
        events = live.events()
    assert sum(kind == "part" for kind, _ in events) >= 120 // 10
    recording = read_recording(tmp_path)
    stations = json.loads(recording.metadata["settings"])["stations"]
    data = replay_data(recording.frames(), models=ActorModels(recorded_bodies(recording), stations))
    assert join_parts(events) == json.loads(json.dumps(columns(data)))
    assert len(data["times"]) == 121


def test_live_page_at_the_end_equals_the_replay(tmp_path: Path) -> None:
    with Watched() as live:
        run_and_save(ONE, settings=SHORT, out=tmp_path, observers=[live])
        shown: Any = html.fromstring(live.page())
        (*_, (_, end)) = live.events()
    file = write_replay(tmp_path, tmp_path / "page.html")
    written: Any = html.fromstring(file.read_text(encoding="utf-8"))
    for path in ("//title", "//h1/span[@id='badge']", "//div[@id='verdict']", "//div[@class='panel']"):
        texts = [[found.text_content() for found in page.xpath(path)] for page in (shown, written)]
        assert texts[0] == texts[1] != []
    before, after = (json.loads(page.xpath("//script[@id='data']")[0].text) for page in (shown, written))
    assert before["roads"] == after["roads"]
    assert end["decisive"] == after["decisive"]
    panel: Any = html.fromstring(end["verdict"])
    assert panel.text_content() == written.xpath("//div[@id='verdict']/*")[0].text_content()


def test_run_with_live_view_equals_run_without() -> None:
    with Watched() as live:
        watched = run_file(ONE, settings=SHORT, observers=[live]).as_json()
    alone = run_file(ONE, settings=SHORT).as_json()
    for result in (watched, alone):
        del result["wall_s"]
    assert json.dumps(watched) == json.dumps(alone)


def test_page_during_the_run_has_settings_but_no_verdict() -> None:
    with Watched() as live, Simulation(ONE, settings=SHORT, observers=[live]) as simulation:
        simulation.tick()
        page: Any = html.fromstring(live.page())
        assert live.announced == [live.address]
        assert page.xpath("//h1")[0].text == "coop/scenario_1, seed 1"
        assert "latency_300ms" in page.text_content()
        assert not page.xpath("//div[@id='verdict']")[0].text_content().strip()
        assert not page.xpath("//div[@role='alert']")


def test_aborted_run_ends_the_page_without_verdicts() -> None:
    with Watched() as live:
        with Simulation(ONE, settings=SHORT, observers=[live]) as simulation:
            for _ in range(3):
                simulation.tick()
        events = live.events()
    assert sum(len(data["times"]) for kind, data in events if kind == "part") == 3
    assert events[-1][1]["ended"]
    assert "aborted" in events[-1][1]["notices"]
    assert not events[-1][1]["verdict"].strip()


@pytest.mark.exhaustive
def test_run_waits_for_the_first_page() -> None:
    """The page is opened when the address is announced, and the wait would take an hour without it."""
    opened: list[threading.Thread] = []

    def open_page(address: str) -> None:
        opened.append(threading.Thread(target=live.events))
        opened[0].start()

    with Watched(wait=3600.0, announce=open_page) as live:
        assert run_file(ONE, settings=SHORT, observers=[live]).simulated_s == 6.0
        live.wait_until_closed()
    opened[0].join()


def test_wait_until_closed_without_page_returns() -> None:
    with Watched() as live:
        live.wait_until_closed()


def test_run_beyond_the_limit_of_a_page_continues_with_notice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eidrive_scenario.reporting.replay.frame_data._LARGEST_PAGE", 2**14)
    with Watched() as live:
        assert run_file(ONE, settings=SHORT, observers=[live]).simulated_s == 6.0
        events = live.events()
    parts = [data for kind, data in events if kind == "part"]
    assert 3 < sum(len(part["times"]) for part in parts) < 100
    assert sum(len(json.dumps(part)) for part in parts) < 2**16
    assert "too large for one page" in events[-1][1]["notices"]
    assert "min_distance" in events[-1][1]["verdict"]


def test_live_view_of_second_run_raises() -> None:
    with Watched() as live:
        run_file(ONE, settings=RunSettings(time_limit=0.2), observers=[live])
        with pytest.raises(SimulationError, match="second LiveView"):
            run_file(ONE, settings=RunSettings(time_limit=0.2), observers=[live])


def test_frame_before_begin_raises(tmp_path: Path) -> None:
    run_and_save(ONE, settings=RunSettings(time_limit=0.2), out=tmp_path)
    frame = next(read_recording(tmp_path).frames())
    with Watched() as live, pytest.raises(SimulationError, match="has not begun"):
        live.observe(frame)


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, True, "fast"])
def test_invalid_speed_raises_setting_error(speed: Any) -> None:
    with pytest.raises(SettingError, match="the speed of the live view is"):
        LiveView(speed=speed)


class Clock:
    """Clock that a test moves, and that a sleep moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def test_pace_delays_simulated_time_by_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """At twice real time 3 s take 1.5 s of the clock."""
    clock = Clock()
    monkeypatch.setattr(live_view, "time", clock)
    double = Pace(2.0)
    for tick in range(61):
        double.wait(0.05 * tick)
    assert clock.now == pytest.approx(101.5)


def test_pace_of_slow_run_catches_up_quarter_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pause of 0.2 s is caught up; after one of 5 s the pace restarts."""
    clock = Clock()
    monkeypatch.setattr(live_view, "time", clock)
    real = Pace(1.0)
    real.wait(0.0)
    clock.now = 101.2
    assert real.delay(1.0) == 0.0
    assert real.delay(1.5) == pytest.approx(0.3)
    clock.now = 106.5
    assert real.delay(1.5) == 0.0
    assert real.delay(2.0) == pytest.approx(0.5)


def test_pace_of_infinite_speed_has_no_delay() -> None:
    assert Pace(math.inf).delay(1e9) == 0.0
