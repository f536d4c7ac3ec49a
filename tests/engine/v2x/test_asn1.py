"""Encoded messages, with a tiny module of our own."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.errors import SettingError
from eidrive_scenario.v2x.messages.asn1 import Asn1Encoder, cpm_value
from eidrive_scenario.v2x.messages.message import Message, StationState

pytest.importorskip("asn1tools", reason="asn1tools is not installed (pip install 'eidrive-scenario[asn1]')")

TINY = Path(__file__).parents[2] / "data" / "tiny_messages.asn1"


def message(kind: str, count: int, x: float = 10.0) -> Message:
    boxes = np.array([[x + 5.0 * n, 20.0, 0.75, 4.5, 1.8, 1.5, 0.0] for n in range(count)]).reshape(-1, 7)
    velocity = np.tile([0.0, 3.0], (count, 1))
    seen = Detections(1.9, boxes, np.ones(count), ("car",) * count, velocity, np.full((count, 2, 2), np.nan))
    state = StationState(2.0, 10.0, 5.0, 0.0, math.pi / 2, 8.0)
    return Message("Ego", 4, 2.0, state, seen, 0, kind, tuple(range(7, 7 + count)))  # type: ignore[arg-type]


def test_a_cpm_says_what_is_in_it_in_the_frame_of_the_sender() -> None:
    """Heading along y: an object 15 m further along y is 15 m ahead, and moves ahead with 3 m/s."""
    encoder = Asn1Encoder([TINY], ["cpm"])
    decoded = encoder.decode("cpm", encoder.encode(message("cpm", 2)))
    assert decoded["header"]["messageID"] == 14
    parameters = decoded["cpm"]["cpmParameters"]
    assert parameters["numberOfPerceivedObjects"] == 2
    first, second = parameters["perceivedObjectContainer"]
    assert (first["objectID"], second["objectID"]) == (7, 8)
    assert first["timeOfMeasurement"] == 100
    assert (first["xDistance"]["value"], first["yDistance"]["value"]) == (1500, 0)
    assert (second["xDistance"]["value"], second["yDistance"]["value"]) == (1500, -500)
    assert first["xSpeed"]["value"] == 300


def test_a_cam_says_where_its_sender_is() -> None:
    encoder = Asn1Encoder([TINY], ["cam"])
    short, long = (encoder.encode(message("cam", 1), low_frequency=low) for low in (False, True))
    assert len(long) > len(short)
    decoded = encoder.decode("cam", long)["cam"]["camParameters"]
    position = decoded["basicContainer"]["referencePosition"]
    assert position["longitude"] == round(10.0 / 111_319.49 * 1e7)
    kind, fast = decoded["highFrequencyContainer"]
    assert kind == "basicVehicleContainerHighFrequency"
    assert fast["heading"]["headingValue"] == 0, "north"
    assert fast["speed"]["speedValue"] == 800


def test_a_roadside_unit_says_that_it_is_one_and_neither_speed_nor_heading() -> None:
    encoder = Asn1Encoder([TINY], ["cam", "cpm"], station="misc")
    said = message("cam", 1)
    said = replace(said, detections=replace(said.detections, classes=("misc",)))
    cam = encoder.decode("cam", encoder.encode(said, low_frequency=True))["cam"]["camParameters"]
    assert cam["basicContainer"]["stationType"] == 15
    assert cam["highFrequencyContainer"] == ("rsuContainerHighFrequency", {})
    assert "lowFrequencyContainer" not in cam
    cpm = encoder.decode("cpm", encoder.encode(message("cpm", 1)))["cpm"]["cpmParameters"]
    assert cpm["managementContainer"]["stationType"] == 15
    said_by = {name: cpm_value(message("cpm", 1), 0, name)["cpm"]["cpmParameters"] for name in ("misc", "truck")}
    assert ["stationDataContainer" in parameters for parameters in said_by.values()] == [False, True]


def test_each_object_takes_its_bits() -> None:
    """An object of the tiny module has 8 + 12 + 2 (19 + 7) + 15 + 7 bits = 94."""
    encoder = Asn1Encoder([TINY], ["cpm"])
    sizes = [len(encoder.encode(message("cpm", count))) for count in (1, 9, 17)]
    assert sizes[1] - sizes[0] == sizes[2] - sizes[1] == 94


def test_values_beyond_the_range_of_the_field_are_cut() -> None:
    encoder = Asn1Encoder([TINY], ["cpm"])
    decoded = encoder.decode("cpm", encoder.encode(message("cpm", 1, x=1e5)))
    assert decoded["cpm"]["cpmParameters"]["perceivedObjectContainer"][0]["yDistance"]["value"] == -132768


def test_wrong_modules_say_what_is_wrong(tmp_path: Path) -> None:
    place = {"source": "scenario.xosc", "line": 7}
    with pytest.raises(SettingError, match=r"scenario.xosc:7: no ASN.1 module .*gone.asn1"):
        Asn1Encoder([tmp_path / "gone.asn1"], ["cpm"], **place)  # type: ignore[arg-type]
    broken = tmp_path / "broken.asn1"
    broken.write_text("Tiny DEFINITIONS ::= BEGIN A ::= SEQUENCE { END")
    with pytest.raises(SettingError, match=r"scenario.xosc:7: .*broken.asn1: "):
        Asn1Encoder([broken], ["cpm"], **place)  # type: ignore[arg-type]
    other = tmp_path / "other.asn1"
    other.write_text("Other DEFINITIONS ::= BEGIN CAM ::= INTEGER END")
    with pytest.raises(SettingError, match="have no type 'CPM', which a cpm needs"):
        Asn1Encoder([other], ["cam", "cpm"], **place)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match=r"scenario.xosc:7: the ASN.1 modules take no cam: "):
        Asn1Encoder([other], ["cam"], **place)  # type: ignore[arg-type]
    asks_for_more = tmp_path / "more.asn1"
    asks_for_more.write_text(TINY.read_text().replace("exteriorLights BIT", "gear INTEGER (0..7), exteriorLights BIT"))
    with pytest.raises(SettingError, match=r"no cam: .*member 'gear' not found …; docs/channels.md"):
        Asn1Encoder([asks_for_more], ["cam"])


@pytest.mark.parametrize(
    "types",
    [
        "CAM ::= CAM",
        "CAM ::= SEQUENCE { a CAM }",
        f"CAM ::= INTEGER (0..{'9' * 5000})",
        f"CAM ::= BIT STRING (SIZE({'9' * 400}))",
        f"CAM ::= {'SEQUENCE { a ' * 200}NULL{'}' * 200}",
        "CAM ::= SEQUENCE { a CLASS }",
        "CAM{X} ::= NULL",
    ],
    ids=str,
)
def test_encoder_of_a_hostile_module_is_refused(tmp_path: Path, types: str) -> None:
    path = tmp_path / "hostile.asn"
    path.write_text(f"M DEFINITIONS AUTOMATIC TAGS ::= BEGIN\n{types}\nEND\n")
    with pytest.raises(SettingError) as caught:
        Asn1Encoder([path], ["cam"], source="scene.xosc", line=7)
    assert all((diagnostic.source, diagnostic.line) == ("scene.xosc", 7) for diagnostic in caught.value.diagnostics)
