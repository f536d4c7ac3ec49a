"""Messages in complete runs: generation rules, contents, sizes and clocks."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scenario_1 import ONE, FrameCollector, edited, simulate, with_properties

from eidrive_scenario.errors import InputError
from eidrive_scenario.v2x.messages.message import Message
from eidrive_scenario.v2x.standards import ieee80211p_airtime

LONG_RANGE = '<Property name="mount" value="front"/>\n                  <Property name="range" value="50"/>'
SHORT_RANGE = LONG_RANGE.replace("50", "5")


def sent_messages(collector: FrameCollector) -> list[Message]:
    return [message for frame in collector.frames for message in frame.steps["RSU"].outbox]


def test_run_with_etsi_generation_sends_fewer_bytes_at_smaller_distance(tmp_path: Path) -> None:
    collector = FrameCollector()
    etsi = simulate(with_properties(tmp_path, "RsuStack", ("generation", "etsi")), "ideal", collector)
    often, never = simulate(ONE, "ideal"), simulate(ONE, "none")
    assert etsi.links["RSU", "Ego"].bytes_sent < 0.3 * often.links["RSU", "Ego"].bytes_sent
    apart = [result.metrics["min_distance.Ego.Incoming.center"] for result in (never, etsi, often)]
    assert apart[0] < apart[1] <= apart[2]
    messages = sent_messages(collector)
    assert all(message.objects is not None and len(message.objects) == len(message.detections) for message in messages)
    gaps = np.diff([message.generated for message in messages])
    assert gaps.min() >= 0.1 - 1e-9
    assert gaps.max() <= 1.0 + 1e-9
    known = [len(frame.steps["Ego"].fused) for frame in collector.frames[10:60]]
    assert min(known) >= 2, "objects that a message omits are collector"


def test_run_in_congested_channel_with_etsi_generation_drops_no_messages(tmp_path: Path) -> None:
    """With ETSI rules, congestion control limits message generation; without them, messages are dropped in the queue.

    LIMERIC applies the minimum share of 0.06 %: the interval after a message of T = 0.3 to 0.4 ms is T / 0.0006.
    """
    collector = FrameCollector()
    by_rules = simulate(with_properties(tmp_path, "RsuStack", ("generation", "etsi")), "congested", collector)
    often = simulate(ONE, "congested")
    assert "queue" not in by_rules.links["RSU", "Ego"].lost_by
    assert often.links["RSU", "Ego"].lost_by["queue"] > 0.8 * often.links["RSU", "Ego"].sent
    messages = sent_messages(collector)
    gaps = np.diff([message.generated for message in messages])
    least = [ieee80211p_airtime(message.size, 6.0, 1400) / 0.0006 for message in messages[:-1]]
    assert len(gaps) >= 8
    assert np.all(gaps >= np.array(least) - 1e-9)


def test_run_with_cam_only_reports_the_sender(tmp_path: Path) -> None:
    """The unit sends only CAMs: the ego receives one object, the unit, and not the hidden car."""
    collector = FrameCollector()
    path = with_properties(tmp_path, "RsuStack", ("messages", "cam"), ("generation", "etsi"))
    path.write_text(path.read_text().replace(LONG_RANGE, SHORT_RANGE))
    assert not simulate(path, "ideal", collector, time_limit=3.0).passed
    messages = sent_messages(collector)
    assert {message.kind for message in messages} == {"cam"}
    assert set(np.round(np.diff([message.generated for message in messages]), 9)) == {1.0}
    assert {message.size for message in messages} == {300}
    places = collector.frames[22].steps["Ego"].fused.boxes[:, :2]
    assert np.min(np.linalg.norm(places - np.array([42.2, -6.0]), axis=1)) < 0.5


def test_run_with_cam_and_cpm_reports_sender_and_objects(tmp_path: Path) -> None:
    collector, alone = FrameCollector(), FrameCollector()
    path = with_properties(tmp_path, "RsuStack", ("messages", "[cpm, cam]"))
    path.write_text(path.read_text().replace(LONG_RANGE, SHORT_RANGE))
    assert simulate(path, "ideal", collector).passed
    simulate(edited(tmp_path, (LONG_RANGE, SHORT_RANGE)), "ideal", alone)
    more = [
        len(b.steps["Ego"].fused) - len(a.steps["Ego"].fused)
        for a, b in zip(alone.frames, collector.frames, strict=False)
    ]
    assert set(more[1:60]) == {1}, "one object more: the unit"


def test_run_with_clock_offset_beyond_the_lifetime_ignores_reports(tmp_path: Path) -> None:
    """Reports of a unit whose clock is 2.4 s behind are older than the lifetime of reports, 2.28 s."""
    late = simulate(with_properties(tmp_path, "RsuStack", ("clock_offset", "-2.4")), "ideal")
    assert not late.passed
    assert late.links["RSU", "Ego"].expired == late.links["RSU", "Ego"].received > 0
    assert simulate(with_properties(tmp_path, "RsuStack", ("clock_offset", "0.01")), "ideal").passed


def test_run_with_asn1_modules_has_encoded_message_sizes(tmp_path: Path) -> None:
    pytest.importorskip("asn1tools", reason="asn1tools is not installed (pip install 'eidrive-scenario[asn1]')")
    module = Path(__file__).parents[1] / "data" / "tiny_messages.asn1"
    (tmp_path / "tiny.asn1").write_text(module.read_text())
    path = with_properties(tmp_path, "RsuStack", ("asn1_files", "tiny.asn1"), ("security_bytes", "100"))
    collector = FrameCollector()
    simulate(path, "ideal", collector, time_limit=1.0)
    by_count = {len(message.detections): message.size for message in sent_messages(collector)}
    # bits: header 8 + 8 + 32, time 16, station type 8, position 31 + 32, counts 1 + 8; 94 and 7 per object
    assert by_count
    for count, size in by_count.items():
        assert size == 100 + -(-(48 + 16 + 8 + 31 + 32 + 9 + (7 if count else 0) + 94 * count) // 8)


@pytest.mark.parametrize(
    ("properties", "message"),
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
def test_run_with_invalid_station_properties_raises_with_line(
    tmp_path: Path, properties: tuple[tuple[str, str], ...], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        simulate(with_properties(tmp_path, "RsuStack", *properties), "ideal")
    assert message in str(caught.value)
    assert re.search(r"edited\.xosc:\d+: ", str(caught.value))
