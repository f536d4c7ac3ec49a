"""Channels in complete runs: blockage, ideal and lossy channels, changes of the channel, invalid settings."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from scenario_1 import ONE, FrameCollector, edited, simulate, with_properties
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.text.run_log import RunLog
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed, run_file
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

RSU_AT = '<WorldPosition x="42.2" y="-6.0" z="0" h="2.617994"/>'
BEHIND_THE_TRUCK = '<WorldPosition x="42.2" y="14.0" z="0" h="2.617994"/>'
PLAIN = "{model: radio, shadowing_db: 0, path_loss: {kind: tr37885, blockage: mean}, jitter: 0.001}"


def test_run_with_truck_between_antennas_has_the_model_blockage_loss(tmp_path: Path) -> None:
    """The antennas of the unit (3.0 m) and of the ego (1.5 m) are below the roof of the truck: 9 dB."""
    hidden = edited(tmp_path, (RSU_AT, BEHIND_THE_TRUCK))
    with_truck, without = FrameCollector(), FrameCollector()
    log, recording = tmp_path / "run.log", tmp_path / "recording.mcap"
    result = simulate(hidden, PLAIN, with_truck, RunLog(log), Recorder(recording, metadata={}), time_limit=1.5)
    away = edited(
        tmp_path, (RSU_AT, BEHIND_THE_TRUCK), ('<WorldPosition x="25.4" y="8.016"', '<WorldPosition x="25.4" y="80"')
    )
    simulate(away, PLAIN, without, time_limit=1.5)
    blocked, clear = (
        [event for frame in collector.frames for event in frame.links] for collector in (with_truck, without)
    )
    assert len(blocked) == len(clear) > 20
    for hit, free in zip(blocked, clear, strict=True):
        assert (free.los, free.blockers) == ("los", ())
        assert (hit.los, hit.blockers) == ("nlosv", ("Firetruck",))
        assert hit.path_loss_db - free.path_loss_db == pytest.approx(9.0, abs=1e-6)  # type: ignore[operator]
        assert free.snr_db - hit.snr_db == pytest.approx(9.0, abs=1e-6)  # type: ignore[operator]
    lines = [line for line in log.read_text().splitlines() if "RSU to Ego" in line]
    assert len(lines) == len(blocked) + len(result.final_links)
    words = r"message \d+: arrives at .* path loss [\d.]+ dB, signal to noise [\d.]+ dB, NLOSv: behind Firetruck"
    assert all(re.search(words, line) for line in lines)
    read = [event for frame in read_recording(recording).frames() for event in frame.links]
    assert read == blocked


@pytest.mark.statistical
def test_run_command_prints_statistics_of_every_link() -> None:
    done = CliRunner().invoke(app, ["run", str(ONE), "--channel", "cv2x_highway", "--no-record", "--json"])
    assert done.exit_code == 0, done.output
    (link,) = json.loads(done.stdout)["links"]
    assert (link["sender"], link["receiver"]) == ("RSU", "Ego")
    assert link["sent"] == link["received"] + link["lost"] + link["in_flight"]
    assert sum(link["lost_by"].values()) == link["lost"]
    assert 0.0 < link["mean_delay"] <= link["max_delay"] < 0.2
    assert 0.0 < link["mean_age"] < link["p95_age"]
    assert link["peak_age"] > link["mean_age"]
    assert 0.2 < link["channel_busy_ratio"] < 0.5
    assert link["bytes_sent"] >= 121 * link["sent"]
    assert [entry["from_m"] for entry in link["reception"]] == [0.0, 25.0]
    transmitted = link["sent"] - link["in_flight"] - link["lost_by"].get("queue", 0)
    assert sum(entry["messages"] for entry in link["reception"]) == transmitted


class SharedMemory(Channel):
    """Channel that delivers all messages in the next tick."""

    def __init__(self) -> None:
        self._messages: list[tuple[Message, Sequence[str], float]] = []

    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        self._messages.append((message, receivers, now))
        return ()

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        due = [entry for entry in self._messages if receiver in entry[1]]
        self._messages = [entry for entry in self._messages if receiver not in entry[1]]
        return tuple(ReceivedMessage(message, sent) for message, _, sent in due)

    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        return {}

    def continue_from(self, previous: Channel) -> None:
        raise AssertionError("the channel is not replaced")


@pytest.mark.statistical
@pytest.mark.parametrize("scenario", ["coop/scenario_1", "coop/scenario_2"])
def test_run_without_loss_and_delay_equals_shared_memory(scenario: str) -> None:
    path = resolve_scenario(scenario)
    channel = "{delay: {kind: constant, seconds: 0}, loss: {kind: bernoulli, probability: 0}}"
    collector, shared = FrameCollector(), FrameCollector()
    simulate(path, channel, collector)
    simulation = Simulation(
        load_for_seed(path, 1, {}), seed=1, settings=RunSettings(channel="ideal"), observers=[shared]
    )
    assert isinstance(simulation.stack, Stations)
    simulation.stack._channel.active = simulation.stack._channel._last = SharedMemory()
    simulation.run()
    assert shared.motion == collector.motion
    assert shared.known == collector.known


def test_channel_that_cannot_continue_another_is_error_with_line() -> None:
    with Simulation(load_for_seed(ONE, 1, {}), seed=1) as simulation:
        assert isinstance(simulation.stack, Stations)
        simulation.stack._channel.active = simulation.stack._channel._last = SharedMemory()
        with pytest.raises(SettingError, match=r"a\.xosc:7: ComposedChannel cannot continue .* of SharedMemory"):
            simulation.stack.request_channel("ideal", source="a.xosc", line=7)


@pytest.mark.statistical
@pytest.mark.parametrize(
    "loss", ["{kind: bernoulli, probability: 1}", "{kind: by_distance, distances: [0], reception: [0]}"]
)
def test_run_with_total_loss_equals_no_cooperation(loss: str) -> None:
    lossy, alone = FrameCollector(), FrameCollector()
    assert not simulate(ONE, f"{{loss: {loss}}}", lossy).passed
    assert not simulate(ONE, "none", alone).passed
    assert lossy.motion == alone.motion
    assert lossy.known == alone.known
    jammed = FrameCollector()
    simulate(ONE, f"{{model: radio, loss: {loss}}}", jammed)
    assert jammed.motion == alone.motion


def test_run_deliveries_with_more_loss_are_a_subset() -> None:
    received = []
    for probability in (0.1, 0.4, 0.8):
        collector = FrameCollector()
        simulate(ONE, f"{{loss: {{kind: bernoulli, probability: {probability}}}}}", collector, time_limit=4.0)
        received.append({e.number for frame in collector.frames for e in frame.links if e.outcome == "delivered"})
    assert received[0] > received[1] > received[2]


@pytest.mark.exhaustive
def test_run_with_reversed_entities_has_equal_links(tmp_path: Path) -> None:
    text = ONE.read_text()
    entities = re.findall(r"      <ScenarioObject .*?</ScenarioObject>\n", text, re.DOTALL)
    assert len(entities) == 4
    reordered = edited(tmp_path, ("".join(entities), "".join(reversed(entities))))
    for channel in ("80211p_urban", "cv2x_highway", "bursty"):
        forward, backward = FrameCollector(), FrameCollector()
        first, second = simulate(ONE, channel, forward), simulate(reordered, channel, backward)
        assert [f.view.position[f.view.row("Ego")].tolist() for f in forward.frames] == [
            f.view.position[f.view.row("Ego")].tolist() for f in backward.frames
        ]
        assert first.links == second.links


def switched(tmp_path: Path, *channels: tuple[float, str]) -> Path:
    """Write scenario 1 with a storyboard that sets channels at times [s]."""
    start = '<Event name="EgoSetsOff"'
    events = "".join(
        f"""<Event name="Switch at {time}" priority="parallel"><Action name="Switch"><UserDefinedAction>
        <CustomCommandAction type="eidrive.channel">{channel}</CustomCommandAction></UserDefinedAction></Action>
        <StartTrigger><ConditionGroup><Condition name="Later" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="{time}" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
        </StartTrigger></Event>"""
        for time, channel in channels
    )
    return edited(tmp_path, (start, events + start))


def test_run_after_removal_of_the_channel_returns_no_outcomes(tmp_path: Path) -> None:
    """The storyboard removes the channel at 0.5 s; each outcome is returned once, and none later."""
    collector = FrameCollector()
    path = switched(tmp_path, (0.5, "none"))
    run_file(path, seed=1, settings=RunSettings(time_limit=1.0), observers=[collector])
    sent = [link.sent for frame in collector.frames for link in frame.links]
    assert len(sent) == len(set(sent)) > 5
    assert max(sent) <= 0.5 + 1e-9


@pytest.mark.parametrize("channel", ["ideal", "{model: radio}"])
def test_run_counts_messages_sent_before_removal_of_the_channel(tmp_path: Path, channel: str) -> None:
    """Messages of 11 ticks up to 0.5 s, and of 4 ticks after 0.75 s; no message is sent in the last tick."""
    settings = RunSettings(time_limit=1.0)
    away = run_file(switched(tmp_path, (0.0, channel), (0.5, "none")), seed=1, settings=settings)
    assert away.channel == "none"
    back = run_file(switched(tmp_path, (0.0, channel), (0.5, "none"), (0.75, channel)), seed=1, settings=settings)
    sent = [result.metrics["messages.sent"] for result in (away, back)]
    assert 11 * sent[1] == 15 * sent[0] > 0
    for result in (away, back):
        links = result.links.values()
        assert all(link.sent == link.received + link.lost + link.in_flight for link in links)
        assert sum(link.sent for link in links) == result.metrics["messages.sent"]


@pytest.mark.parametrize("channel", ["{delay: {seconds: 0.3}}", "{model: radio, delay: {seconds: 0.32}}"])
@pytest.mark.parametrize("later", [(), ((0.7, "ideal"),)])
def test_messages_in_flight_arrive_after_removal_of_the_channel(
    tmp_path: Path, channel: str, later: tuple[tuple[float, str], ...]
) -> None:
    """Each message of the table of outcomes is received in the first time step from its arrival on, and no other."""
    collector = FrameCollector()
    path = switched(tmp_path, (0.0, channel), (0.5, "none"), *later)
    run_file(path, seed=1, settings=RunSettings(time_limit=1.2), observers=[collector])
    received = [
        (message.message.sender, message.message.number, round(frame.view.time / 0.05))
        for frame in collector.frames
        for message in frame.steps["Ego"].inbox
    ]
    arrivals = [
        (link.sender, link.number, math.ceil(max(link.arrives, link.sent + 1e-3) / 0.05 - 1e-6))
        for frame in collector.frames
        for link in frame.links
        if link.receiver == "Ego" and link.arrives is not None and link.arrives <= 1.2
    ]
    assert sorted(arrivals) == sorted(received)
    assert sum(10 < tick < 18 for _, _, tick in arrivals) >= 5


INVALID = [
    ("{delay: {kind: constant, seconds: -0.3}}", "'delay.constant.seconds' is -0.3"),
    ("{loss: {kind: bernoulli, probability: 1.3}}", "'loss.bernoulli.probability' is 1.3"),
    ("{model: radio, frequency: 5.9}", "unknown setting 'frequency'; did you mean 'frequency_ghz'?"),
    ("{model: radio, path_loss: {kind: tr37855}}", "did you mean 'tr37885'?"),
    ("{model: radio, path_loss: {kind: tr37885, enviroment: urban}}", "did you mean 'environment'?"),
    ("{model: radio, packet_errors: 80211p_highway}", "unknown packet error curve '80211p_highway'; did you mean"),
    ("{model: radio, data_rate_mbps: 7}", "(got 7; expected one of 3, 4.5, 6, 9, 12, 18, 24, 27)"),
    (
        "{model: radio, background: {kind: cv2x_mode4, density: 0.1}}",
        "background.kind must be 80211p, as technology (got cv2x_mode4)",
    ),
    ("{model: radio, own_perception: true}", "own_perception has no effect with model radio"),
    (
        "{model: radio, technology: cv2x_mode4, sidelink: {interval: 0.3}}",
        "(got 0.3 s; expected one of 0.02, 0.05, 0.1",
    ),
    ("{model: radio, queue: {discipline: lifo}}", "'queue.discipline' is 'lifo'"),
]


@pytest.mark.parametrize(("channel", "message"), INVALID, ids=range(len(INVALID)))
def test_run_with_invalid_channel_raises_before_the_start(tmp_path: Path, channel: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        Simulation(load_for_seed(ONE, 1, {}), settings=RunSettings(channel=channel))
    assert str(caught.value).startswith("RunSettings.channel: ")
    assert message in str(caught.value)
    profile = tmp_path / "mine.yaml"
    profile.write_text(channel)
    with pytest.raises(InputError, match=r"mine\.yaml:1: "):
        Simulation(load_for_seed(ONE, 1, {}), settings=RunSettings(channel=profile))


def test_message_numbers_continue_after_the_sender_enters_again() -> None:
    """Loss and delay are keyed by the number of a message: numbers from 0 would repeat those of the first presence."""
    numbers: list[int] = []
    with Simulation(load_for_seed(ONE, 1, {}), seed=1, settings=RunSettings(channel="ideal")) as simulation:
        assert isinstance(simulation.stack, Stations)
        rsu = simulation.world.spec("RSU")
        for tick in range(30):
            if tick == 10:
                simulation.stack.remove("RSU")
            if tick == 20:
                simulation.stack.add(rsu)
            frame, _ = simulation.tick()
            numbers += [link.number for link in frame.links if link.sender == "RSU"]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) in (19, 20, 21)


@pytest.mark.parametrize("setting", [("generation", "etsi"), ("tracker", "cv")])
def test_object_ids_are_new_after_the_sender_enters_again(tmp_path: Path, setting: tuple[str, str]) -> None:
    """Receivers keep objects by their ids for seconds: ids from 0 would rename those of the first presence."""
    stays: list[set[int]] = [set(), set()]
    path = with_properties(tmp_path, "RsuStack", setting)
    with Simulation(load_for_seed(path, 1, {}), seed=1, settings=RunSettings(channel="ideal")) as simulation:
        assert isinstance(simulation.stack, Stations)
        rsu = simulation.world.spec("RSU")
        for stay in stays:
            for _ in range(30):
                frame, _ = simulation.tick()
                stay.update(*(message.identified.tracks for message in frame.steps["RSU"].outbox))
            simulation.stack.remove("RSU")
            simulation.stack.add(rsu)
    assert all(stays)
    assert max(stays[0]) < min(stays[1])


@pytest.mark.parametrize("switched_off", [False, True])
def test_messages_in_flight_are_lost_when_all_stations_leave(switched_off: bool) -> None:
    """With a delay of 0.3 s and a message in each tick of 0.05 s, six messages of each link are in flight."""
    with Simulation(load_for_seed(ONE, 1, {}), seed=1) as simulation:
        stack = simulation.stack
        assert isinstance(stack, Stations)
        list(stack.request_channel("{delay: {kind: constant, seconds: 0.3}}", source="test", line=1))
        for _ in range(10):
            frame, _ = simulation.tick()
        if switched_off:
            list(stack.request_channel("none", source="test", line=2))
        names = set(frame.steps)
        for name in names:
            stack.remove(name)
        frame, _ = simulation.tick()
    links = stack.link_statistics(frame.view.time).values()
    assert len(links) >= 1
    assert {(link.in_flight, *link.lost_by.items()) for link in links} == {(0, ("absent", 6))}
