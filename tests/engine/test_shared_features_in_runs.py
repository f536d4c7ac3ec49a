"""Runs whose stations share sensor data: bytes on the radio, closed loop, and what shows the messages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pillar_weights import plain_arrays, save
from scenario_1 import FrameCollector, edited, simulate
from written_recording import write_run

from eidrive_scenario.base.geometry import iou_bev
from eidrive_scenario.errors import InputError
from eidrive_scenario.export.foxglove.writer import write_foxglove
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.perception.detector import SAME_OBJECT
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.reporting.replay.frame_data import describe_content
from eidrive_scenario.simulation import RunResult, Simulation
from eidrive_scenario.v2x.messages.asn1 import Asn1Encoder
from eidrive_scenario.v2x.messages.generation import cpm_size
from eidrive_scenario.v2x.messages.message import Message

TINY = Path(__file__).parents[1] / "data" / "tiny_messages.asn1"
CHANNELS = ("ideal", "latency_300ms", "error_30pct", "80211p_urban", "cv2x_highway", "5g_uu")


def shared_scenario(folder: Path, fusion: str, **properties: str) -> Path:
    """Write scenario 1 with stations that share sensor data by this method.

    The network reports a car in each cell with points, and its first compressed feature is the first one.
    """
    arrays = plain_arrays()
    arrays["compress.weight"][0, 0] = arrays["expand.weight"][0, 0] = 1.0
    weights = save(folder / "pillars.npz", arrays)
    given = {"detector_settings": f"{{weights: {weights}}}", **properties}
    detector = '<Property name="detector" value="pillars"/>'
    more = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in given.items())
    path = edited(
        folder,
        ('<Property name="detector" value="oracle"/>', detector + more),
        ('name="fusion" value="average"/>', f'name="fusion" value="{fusion}"/>'),
    )
    path.write_text(re.sub(r'<Property name="(range|field_of_view|visibility)" value="[^"]*"/>', "", path.read_text()))
    return path


def play(path: Path, channel: str, **more: Any) -> tuple[RunResult, list[Frame]]:
    collector = FrameCollector()
    return simulate(path, channel, collector, **{"time_limit": 0.3, **more}), collector.frames


def sent(frames: list[Frame]) -> dict[tuple[str, int], Message]:
    messages = [message for frame in frames for step in frame.steps.values() for message in step.outbox]
    return {(message.sender, message.number): message for message in messages}


@pytest.fixture
def encoded_lengths(monkeypatch: pytest.MonkeyPatch) -> dict[tuple[str, int], int]:
    """Lengths of the messages that the ASN.1 encoder encodes, by sender and number [bytes]."""
    lengths: dict[tuple[str, int], int] = {}
    encode = Asn1Encoder.encode

    def measured(encoder: Asn1Encoder, message: Message, **more: Any) -> bytes:
        data = encode(encoder, message, **more)
        lengths[message.sender, message.number] = len(data)
        return data

    monkeypatch.setattr(Asn1Encoder, "encode", measured)
    return lengths


@pytest.mark.parametrize(
    ("fusion", "channel"),
    [
        *(("where2comm", channel) for channel in CHANNELS),
        *(
            (fusion, channel)
            for fusion in ("covariance_intersection", "early")
            for channel in ("ideal", "80211p_urban")
        ),
    ],
)
def test_bytes_on_the_channel_are_those_of_the_encoded_messages(
    fusion: str, channel: str, tmp_path: Path, encoded_lengths: dict[tuple[str, int], int]
) -> None:
    pytest.importorskip("asn1tools", reason="asn1tools is not installed (pip install 'eidrive-scenario[asn1]')")
    path = shared_scenario(tmp_path, fusion, asn1_files=str(TINY), security_bytes="96")
    result, frames = play(path, channel, time_limit=0.2)
    messages = sent(frames)
    kinds = set()
    lengths = {}
    for key, message in messages.items():
        kinds.add((message.kind, message.payload is not None))
        payload = b"" if message.payload is None else message.payload.encode()
        lengths[key] = encoded_lengths.get(key, 0) + len(payload) + 96
        assert message.size == lengths[key]
        assert message.kind != "features" or message.size <= 1400
    assert (
        kinds
        == {
            "covariance_intersection": {("cpm", False)},
            "early": {("cpm", True), ("cpm", False)},
            "where2comm": {("cpm", False), ("features", True)},
        }[fusion]
    )
    links = [link for frame in frames for link in frame.links]
    assert links
    for link in links:
        assert link.size == lengths[link.sender, link.number]
    received = [message for frame in frames for message in frame.steps["Ego"].inbox]
    assert {message.message.kind for message in received} <= {kind for kind, _ in kinds}
    assert result.links["RSU", "Ego"].bytes_sent >= sum(link.size for link in links if link.sender == "RSU")


def test_cpm_size_without_encoder_is_that_of_the_model(tmp_path: Path) -> None:
    _, frames = play(shared_scenario(tmp_path, "where2comm"), "ideal", time_limit=0.1)
    cpms = [message for message in sent(frames).values() if message.kind == "cpm"]
    assert {message.size for message in cpms} == {cpm_size(len(message.detections), 1) for message in cpms}


@pytest.mark.parametrize("fusion", ["max", "attention", "where2comm"])
def test_ego_detects_what_the_roadside_unit_sees(fusion: str, tmp_path: Path) -> None:
    settings = "{share: 0.1}"
    result, frames = play(shared_scenario(tmp_path, fusion, fusion_settings=settings), "ideal", time_limit=0.5)
    steps = frames[-1].steps
    seen = steps["RSU"].detections.boxes
    shares = [
        (iou_bev(detections.boxes, seen).max(axis=0) > SAME_OBJECT).mean()
        for detections in (steps["Ego"].detections, steps["Ego"].fused)
    ]
    assert shares[0] < 0.5
    assert shares[1] > 0.8, "all but the ego, and some of several overlapping boxes, of which each keeps another one"
    repeated, _ = play(shared_scenario(tmp_path, fusion, fusion_settings=settings), "ideal", time_limit=0.5)
    assert repeated.trace_hash == result.trace_hash


def test_detector_without_features_is_reported_with_file_and_line(tmp_path: Path) -> None:
    path = edited(tmp_path, ('name="fusion" value="average"/>', 'name="fusion" value="where2comm"/>'))
    expected = "'where2comm' shares features, which detector 'oracle' does not compute"
    with pytest.raises(InputError, match=expected) as caught:
        Simulation(load_scenario(path), seed=1)
    diagnostic = caught.value.diagnostics[0]
    assert diagnostic.source == str(path)
    assert "where2comm" in path.read_text().splitlines()[(diagnostic.line or 0) - 1]


def test_recording_and_exports_contain_feature_messages(tmp_path: Path) -> None:
    _, frames = play(shared_scenario(tmp_path, "where2comm"), "80211p_urban", time_limit=0.2)
    run = write_run(tmp_path / "run", frames)
    again = sent(list(run.frames()))
    messages = sent(frames)
    assert again.keys() == messages.keys()
    for key, message in messages.items():
        assert again[key].size == message.size
        assert describe_content(again[key]) == describe_content(message)
        if message.payload is not None:
            payload = again[key].payload
            assert payload is not None
            assert payload.encode() == message.payload.encode()
    write_foxglove(run, tmp_path / "run.mcap")
    assert (tmp_path / "run.mcap").stat().st_size > 0
