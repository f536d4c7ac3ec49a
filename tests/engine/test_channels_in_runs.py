"""Channels in whole runs: what bodies do to the radio, what a perfect and a dead channel come to, rules of messages."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.errors import InputError
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.recording import RunLog, read_recording
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.simulation import Observer, RunResult, RunSettings, Simulation, load_for_seed, run_file
from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.radio.airtime import ieee80211p_airtime
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics

ONE = resolve_scenario("coop/scenario_1")
RSU_AT = '<WorldPosition x="42.2" y="-6.0" z="0" h="2.617994"/>'
BEHIND_THE_TRUCK = '<WorldPosition x="42.2" y="14.0" z="0" h="2.617994"/>'
PLAIN = "{model: radio, shadowing_db: 0, path_loss: {kind: tr37885, blockage: mean}, jitter: 0.001}"


class Kept:
    """Bytes of all that moves and all that the ego knows, and the frames."""

    def __init__(self) -> None:
        self.motion: list[bytes] = []
        self.known: list[bytes] = []
        self.frames: list[Frame] = []

    def observe(self, frame: Frame) -> None:
        view = frame.view
        self.motion.append(np.column_stack([view.position, view.yaw, view.velocity]).tobytes())
        self.known.append(frame.steps["Ego"].fused.boxes.tobytes())
        self.frames.append(frame)

    def close(self) -> None:
        """Nothing to finish."""


def edited(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    """Scenario 1 with places of its text changed, its references still leading to the library."""
    text = ONE.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "edited.xosc"
    path.write_text(text.replace('"../', f'"{ONE.parent.parent}/'))
    return path


def play(source: Path, channel: str | None, *observers: Observer, seed: int = 1, **more: object) -> RunResult:
    settings = RunSettings(channel=channel, **more)  # type: ignore[arg-type]
    return run_file(source, seed=seed, settings=settings, observers=observers)


def test_the_firetruck_between_the_antennas_lowers_the_signal_by_the_model_s_loss(tmp_path: Path) -> None:
    """The unit stands behind the truck: its antenna (3.0 m) and the ego's (1.5 m) are below the truck's roof: 9 dB."""
    hidden = edited(tmp_path, (RSU_AT, BEHIND_THE_TRUCK))
    with_truck, without = Kept(), Kept()
    log, recording = tmp_path / "run.log", tmp_path / "recording.mcap"
    play(hidden, PLAIN, with_truck, RunLog(log), Recorder(recording, metadata={}), time_limit=1.5)
    away = edited(
        tmp_path, (RSU_AT, BEHIND_THE_TRUCK), ('<WorldPosition x="25.4" y="8.016"', '<WorldPosition x="25.4" y="80"')
    )
    play(away, PLAIN, without, time_limit=1.5)
    blocked, clear = ([event for frame in kept.frames for event in frame.links] for kept in (with_truck, without))
    assert len(blocked) == len(clear) > 20
    for hit, free in zip(blocked, clear, strict=True):
        assert (free.los, free.blockers) == ("los", ())
        assert (hit.los, hit.blockers) == ("nlosv", ("Firetruck",))
        assert hit.path_loss_db - free.path_loss_db == pytest.approx(9.0, abs=1e-6)  # type: ignore[operator]
        assert free.snr_db - hit.snr_db == pytest.approx(9.0, abs=1e-6)  # type: ignore[operator]
    lines = [line for line in log.read_text().splitlines() if "RSU to Ego" in line]
    assert len(lines) == len(blocked)
    words = r"message \d+: arrives at .* path loss [\d.]+ dB, signal to noise [\d.]+ dB, NLOSv: behind Firetruck"
    assert all(re.search(words, line) for line in lines)
    read = [event for frame in read_recording(recording).frames() for event in frame.links]
    assert read == blocked


def test_the_command_line_prints_every_link() -> None:
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
    on_air = link["sent"] - link["in_flight"] - link["lost_by"].get("queue", 0)
    assert sum(entry["messages"] for entry in link["reception"]) == on_air


class SharedMemory(Channel):
    """What is said in a tick lies there for everybody in the next."""

    def __init__(self) -> None:
        self._lying: list[tuple[Message, Sequence[str], float]] = []

    def send(self, message: Message, receivers: Sequence[str], now: float) -> Sequence[LinkEvent]:
        self._lying.append((message, receivers, now))
        return ()

    def deliver(self, receiver: str, now: float) -> tuple[ReceivedMessage, ...]:
        heard = [entry for entry in self._lying if receiver in entry[1]]
        self._lying = [entry for entry in self._lying if receiver not in entry[1]]
        return tuple(ReceivedMessage(message, sent) for message, _, sent in heard)

    def in_flight(self) -> int:
        return len(self._lying)

    def statistics(self, now: float) -> Mapping[tuple[str, str], LinkStatistics]:
        return {}

    def continue_from(self, previous: Channel) -> None:
        raise AssertionError("this run keeps its channel")


@pytest.mark.parametrize("scenario", ["coop/scenario_1", "coop/scenario_2"])
def test_without_loss_and_delay_a_channel_is_shared_memory(scenario: str) -> None:
    path = resolve_scenario(scenario)
    channel = "{delay: {kind: constant, seconds: 0}, loss: {kind: bernoulli, probability: 0}}"
    kept, shared = Kept(), Kept()
    play(path, channel, kept)
    simulation = Simulation(
        load_for_seed(path, 1, {}), seed=1, settings=RunSettings(channel="ideal"), observers=[shared]
    )
    simulation.stations._channel = SharedMemory()
    simulation.run()
    assert shared.motion == kept.motion
    assert shared.known == kept.known


@pytest.mark.parametrize(
    "loss", ["{kind: bernoulli, probability: 1}", "{kind: by_distance, distances: [0], reception: [0]}"]
)
def test_a_channel_that_loses_everything_is_no_cooperation(loss: str) -> None:
    dead, alone = Kept(), Kept()
    assert not play(ONE, f"{{loss: {loss}}}", dead).passed
    assert not play(ONE, "none", alone).passed
    assert dead.motion == alone.motion
    assert dead.known == alone.known
    jammed = Kept()
    play(ONE, f"{{model: radio, loss: {loss}}}", jammed)
    assert jammed.motion == alone.motion


def test_receptions_nest_as_loss_grows_whatever_the_run_does() -> None:
    received = []
    for probability in (0.1, 0.4, 0.8):
        kept = Kept()
        play(ONE, f"{{loss: {{kind: bernoulli, probability: {probability}}}}}", kept, time_limit=4.0)
        received.append({e.number for frame in kept.frames for e in frame.links if e.outcome == "delivered"})
    assert received[0] > received[1] > received[2]


def test_the_order_of_the_entities_in_the_file_does_not_matter(tmp_path: Path) -> None:
    text = ONE.read_text()
    entities = re.findall(r"      <ScenarioObject .*?</ScenarioObject>\n", text, re.DOTALL)
    assert len(entities) == 4
    turned = edited(tmp_path, ("".join(entities), "".join(reversed(entities))))
    for channel in ("80211p_urban", "cv2x_highway", "bursty"):
        there, back = Kept(), Kept()
        first, second = play(ONE, channel, there), play(turned, channel, back)
        assert [f.view.position[f.view.row("Ego")].tolist() for f in there.frames] == [
            f.view.position[f.view.row("Ego")].tolist() for f in back.frames
        ]
        assert first.links == second.links


def with_properties(tmp_path: Path, station: str, *properties: tuple[str, str]) -> Path:
    """Scenario 1 with more Properties on the controller of a station."""
    written = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in properties)
    head = f'<Controller name="{station}">\n               <Properties>'
    return edited(tmp_path, (head, head + written))


SEES_FAR = '<Property name="mount" value="front"/>\n                  <Property name="range" value="50"/>'
SEES_NEAR = SEES_FAR.replace("50", "5")


def said(kept: Kept) -> list[Message]:
    return [message for frame in kept.frames for message in frame.steps["RSU"].outbox]


def test_messages_by_the_rules_of_etsi_take_a_fraction_of_the_bytes_and_of_the_margin(tmp_path: Path) -> None:
    kept = Kept()
    etsi = play(with_properties(tmp_path, "RsuStack", ("generation", "etsi")), "ideal", kept)
    often, never = play(ONE, "ideal"), play(ONE, "none")
    assert etsi.links["RSU", "Ego"].bytes_sent < 0.3 * often.links["RSU", "Ego"].bytes_sent
    apart = [result.metrics["min_distance.Ego.Incoming.center"] for result in (never, etsi, often)]
    assert apart[0] < apart[1] <= apart[2]
    messages = said(kept)
    assert all(message.objects is not None and len(message.objects) == len(message.detections) for message in messages)
    gaps = np.diff([message.generated for message in messages])
    assert gaps.min() >= 0.1 - 1e-9
    assert gaps.max() <= 1.0 + 1e-9
    known = [len(frame.steps["Ego"].fused) for frame in kept.frames[10:60]]
    assert min(known) >= 2, "an object that a message leaves out is still known"


def test_in_a_full_channel_stations_make_no_more_messages_than_go_on_the_air(tmp_path: Path) -> None:
    """By the rules of ETSI congestion control spaces the messages when they are made; else they end in the queue.

    LIMERIC leaves the least share of 0.06 %: a message of T = 0.3 to 0.4 ms is followed by T / 0.0006.
    """
    kept = Kept()
    by_rules = play(with_properties(tmp_path, "RsuStack", ("generation", "etsi")), "congested", kept)
    often = play(ONE, "congested")
    assert "queue" not in by_rules.links["RSU", "Ego"].lost_by
    assert often.links["RSU", "Ego"].lost_by["queue"] > 0.8 * often.links["RSU", "Ego"].sent
    messages = said(kept)
    gaps = np.diff([message.generated for message in messages])
    least = [ieee80211p_airtime(message.size, 6.0, 1400) / 0.0006 for message in messages[:-1]]
    assert len(gaps) >= 8
    assert np.all(gaps >= np.array(least) - 1e-9)


def test_a_station_that_says_where_it_is_is_known_by_that(tmp_path: Path) -> None:
    """The unit sends only CAMs: the ego learns of one object, the unit itself, and not of the hidden car."""
    kept = Kept()
    path = with_properties(tmp_path, "RsuStack", ("messages", "cam"), ("generation", "etsi"))
    path.write_text(path.read_text().replace(SEES_FAR, SEES_NEAR))
    assert not play(path, "ideal", kept, time_limit=3.0).passed
    messages = said(kept)
    assert {message.kind for message in messages} == {"cam"}
    assert set(np.round(np.diff([message.generated for message in messages]), 9)) == {1.0}
    assert {message.size for message in messages} == {300}
    places = kept.frames[5].steps["Ego"].fused.boxes[:, :2]
    assert np.min(np.linalg.norm(places - np.array([42.2, -6.0]), axis=1)) < 0.5


def test_both_kinds_of_message_stand_beside_each_other(tmp_path: Path) -> None:
    kept, alone = Kept(), Kept()
    path = with_properties(tmp_path, "RsuStack", ("messages", "[cpm, cam]"))
    path.write_text(path.read_text().replace(SEES_FAR, SEES_NEAR))
    assert play(path, "ideal", kept).passed
    play(edited(tmp_path, (SEES_FAR, SEES_NEAR)), "ideal", alone)
    more = [
        len(b.steps["Ego"].fused) - len(a.steps["Ego"].fused) for a, b in zip(alone.frames, kept.frames, strict=False)
    ]
    assert set(more[1:60]) == {1}, "the unit itself, and all that it sees"


def test_a_clock_that_is_wrong_makes_reports_too_old_or_not(tmp_path: Path) -> None:
    """A unit whose clock is 1.2 s behind tells of what its hearers take for forgotten."""
    late = play(with_properties(tmp_path, "RsuStack", ("clock_offset", "-1.2")), "ideal")
    assert not late.passed
    assert play(with_properties(tmp_path, "RsuStack", ("clock_offset", "0.01")), "ideal").passed


def test_asn1_modules_say_how_large_messages_are(tmp_path: Path) -> None:
    pytest.importorskip("asn1tools", reason="asn1tools is not installed (pip install 'eidrive-scenario[asn1]')")
    module = Path(__file__).parents[1] / "data" / "tiny_messages.asn1"
    (tmp_path / "tiny.asn1").write_text(module.read_text())
    path = with_properties(tmp_path, "RsuStack", ("asn1_files", "tiny.asn1"), ("security_bytes", "100"))
    kept = Kept()
    play(path, "ideal", kept, time_limit=1.0)
    by_count = {len(message.detections): message.size for message in said(kept)}
    # 8 + 8 + 32 bits of header, 16 of time, 8 of station type, 31 + 32 of place, 1 + 8 of counts; 94 and 7 per object
    assert by_count
    for count, size in by_count.items():
        assert size == 100 + -(-(48 + 16 + 8 + 31 + 32 + 9 + (7 if count else 0) + 94 * count) // 8)


def switched(tmp_path: Path, *channels: tuple[float, str]) -> Path:
    """Scenario 1 whose storyboard sets channels at times [s]."""
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


def test_without_a_channel_nothing_is_told_of_links(tmp_path: Path) -> None:
    """At 0.5 s the storyboard takes the channel away: no fate of a message is told once more after that."""
    kept = Kept()
    path = switched(tmp_path, (0.5, "none"))
    run_file(path, seed=1, settings=RunSettings(time_limit=1.0), observers=[kept])
    told = [link.sent for frame in kept.frames for link in frame.links]
    assert len(told) == len(set(told)) > 5
    assert max(told) <= 0.5 + 1e-9


@pytest.mark.parametrize("channel", ["ideal", "{model: radio}"])
def test_messages_said_before_the_channel_was_taken_away_still_count(tmp_path: Path, channel: str) -> None:
    """Those of the 11 ticks up to 0.5 s, and of the 4 after 0.75 s; in the last tick nobody says anything."""
    settings = RunSettings(time_limit=1.0)
    away = run_file(switched(tmp_path, (0.0, channel), (0.5, "none")), seed=1, settings=settings)
    assert away.channel == "none"
    back = run_file(switched(tmp_path, (0.0, channel), (0.5, "none"), (0.75, channel)), seed=1, settings=settings)
    sent = [result.metrics["messages.sent"] for result in (away, back)]
    assert 11 * sent[1] == 15 * sent[0] > 0
    for result in (away, back):
        books = result.links.values()
        assert all(book.sent == book.received + book.lost + book.in_flight for book in books)
        assert sum(book.sent for book in books) == result.metrics["messages.sent"]


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        ((("messages", "[cpm, dam]"),), "'messages.1' is 'dam'"),
        ((("generation", "etsii"),), "'generation' is 'etsii'"),
        ((("generation", "rate"),), "generation 'rate' needs a message_rate"),
        ((("generation", "etsi"), ("message_rate", "10")), "generation 'etsi' and a message_rate exclude each other"),
        ((("asn1_files", "gone.asn1"),), "no ASN.1 module"),
        ((("mtu", "20"),), "'mtu' is 20"),
        ((("antenna_height", "-1"),), "'antenna_height' is -1"),
    ],
)
def test_wrong_properties_are_told_with_their_line(
    tmp_path: Path, properties: tuple[tuple[str, str], ...], words: str
) -> None:
    with pytest.raises(InputError) as caught:
        play(with_properties(tmp_path, "RsuStack", *properties), "ideal")
    assert words in str(caught.value)
    assert re.search(r"edited\.xosc:\d+: ", str(caught.value))


WRONG = [
    ("{delay: {kind: constant, seconds: -0.3}}", "'delay.constant.seconds' is -0.3"),
    ("{loss: {kind: bernoulli, probability: 1.3}}", "'loss.bernoulli.probability' is 1.3"),
    ("{model: radio, frequency: 5.9}", "unknown setting 'frequency'; did you mean 'frequency_ghz'?"),
    ("{model: radio, path_loss: {kind: tr37855}}", "did you mean 'tr37885'?"),
    ("{model: radio, path_loss: {kind: tr37885, enviroment: urban}}", "did you mean 'environment'?"),
    ("{model: radio, packet_errors: 80211p_highway}", "no curve of packet errors '80211p_highway'; did you mean"),
    ("{model: radio, data_rate_mbps: 7}", "known: 3, 4.5, 6, 9, 12, 18, 24, 27"),
    (
        "{model: radio, background: {kind: cv2x_mode4, density: 0.1}}",
        "the background is cv2x_mode4, the technology 80211p",
    ),
    ("{model: radio, own_perception: true}", "own_perception has no effect with model radio"),
    ("{model: radio, technology: cv2x_mode4, sidelink: {interval: 0.3}}", "known: 0.02, 0.05, 0.1"),
    ("{model: radio, queue: {discipline: lifo}}", "'queue.discipline' is 'lifo'"),
]


@pytest.mark.parametrize(("channel", "words"), WRONG, ids=range(len(WRONG)))
def test_wrong_channels_are_told_before_the_run(tmp_path: Path, channel: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        Simulation(load_for_seed(ONE, 1, {}), settings=RunSettings(channel=channel))
    assert str(caught.value).startswith("--channel: ")
    assert words in str(caught.value)
    profile = tmp_path / "mine.yaml"
    profile.write_text(channel)
    with pytest.raises(InputError, match=r"mine\.yaml:1: "):
        Simulation(load_for_seed(ONE, 1, {}), settings=RunSettings(channel=profile))
