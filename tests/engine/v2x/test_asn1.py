"""ASN.1 encoding of messages, with a small test module."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.base.detections import Detections
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


def test_encoder_writes_cpm_objects_in_the_frame_of_the_sender() -> None:
    """With heading along y, an object 15 m further along y is 15 m ahead. Its 3 m/s are 5 m/s less than those of the
    sender."""
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
    assert first["xSpeed"]["value"] == -500


@pytest.mark.parametrize(
    ("station", "distance", "speed", "yaw"),
    [("car", (1500, -500), (-500, 0), 2700), ("misc", (500, 1500), (0, 300), 0)],
)
def test_cpm_objects_have_the_axes_of_their_station(
    station: str, distance: tuple[int, int], speed: tuple[int, int], yaw: int
) -> None:
    """TR 103 562, annex A: the axes are those of the vehicle, or east and north for a roadside unit. Speeds are
    relative to the station, which drives north at 8 m/s or is at rest. The first dimension of an object is across its
    yaw angle. It is 5 m east and 15 m north, directed east, and moves north at 3 m/s."""
    seen = message("cpm", 2)
    if station == "misc":
        seen = replace(seen, state=replace(seen.state, speed=0.0))
    second = cpm_value(seen, station)["cpm"]["cpmParameters"]["perceivedObjectContainer"][1]
    assert tuple(second[axis + "Distance"]["value"] for axis in "xy") == distance
    assert tuple(second[axis + "Speed"]["value"] for axis in "xy") == speed
    assert second["yawAngle"]["value"] == yaw
    assert [second[f"planarObjectDimension{number}"]["value"] for number in (1, 2)] == [18, 45]


def test_modules_with_byte_order_mark_are_those_without(tmp_path: Path) -> None:
    marked = tmp_path / "marked.asn1"
    marked.write_text(TINY.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert Asn1Encoder([marked], ["cpm"]).encode(message("cpm", 2)) == Asn1Encoder([TINY], ["cpm"]).encode(
        message("cpm", 2)
    )


def test_encoder_writes_cam_with_position_and_speed_of_the_sender() -> None:
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


def test_encoder_writes_roadside_unit_without_speed_and_heading() -> None:
    encoder = Asn1Encoder([TINY], ["cam", "cpm"], station="misc")
    own = message("cam", 1)
    own = replace(own, detections=replace(own.detections, classes=("misc",)))
    cam = encoder.decode("cam", encoder.encode(own, low_frequency=True))["cam"]["camParameters"]
    assert cam["basicContainer"]["stationType"] == 15
    assert cam["highFrequencyContainer"] == ("rsuContainerHighFrequency", {})
    assert "lowFrequencyContainer" not in cam
    cpm = encoder.decode("cpm", encoder.encode(message("cpm", 1)))["cpm"]["cpmParameters"]
    assert cpm["managementContainer"]["stationType"] == 15
    by_class = {name: cpm_value(message("cpm", 1), name)["cpm"]["cpmParameters"] for name in ("misc", "truck")}
    assert ["stationDataContainer" in parameters for parameters in by_class.values()] == [False, True]


def test_encoder_uses_the_number_of_bits_of_each_object() -> None:
    """An object of the test module has 8 + 12 + 2 (19 + 7) + 15 + 7 = 94 bits."""
    encoder = Asn1Encoder([TINY], ["cpm"])
    sizes = [len(encoder.encode(message("cpm", count))) for count in (1, 9, 17)]
    assert sizes[1] - sizes[0] == sizes[2] - sizes[1] == 94


def test_encoder_limits_values_to_the_range_of_the_field() -> None:
    encoder = Asn1Encoder([TINY], ["cpm"])
    decoded = encoder.decode("cpm", encoder.encode(message("cpm", 1, x=1e5)))
    assert decoded["cpm"]["cpmParameters"]["perceivedObjectContainer"][0]["yDistance"]["value"] == -132768


def test_encoder_with_invalid_modules_raises_with_source_and_reason(tmp_path: Path) -> None:
    place = {"source": "scenario.xosc", "line": 7}
    with pytest.raises(SettingError, match=r"scenario.xosc:7: no ASN.1 module .*gone.asn1"):
        Asn1Encoder([tmp_path / "gone.asn1"], ["cpm"], **place)  # type: ignore[arg-type]
    broken = tmp_path / "broken.asn1"
    broken.write_text("Tiny DEFINITIONS ::= BEGIN A ::= SEQUENCE { END")
    with pytest.raises(SettingError, match=r"scenario.xosc:7: .*broken.asn1: "):
        Asn1Encoder([broken], ["cpm"], **place)  # type: ignore[arg-type]
    other = tmp_path / "other.asn1"
    other.write_text("Other DEFINITIONS ::= BEGIN CAM ::= INTEGER END")
    with pytest.raises(SettingError, match="do not define type 'CPM', which messages of kind cpm require"):
        Asn1Encoder([other], ["cam", "cpm"], **place)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match=r"scenario.xosc:7: ASN.1 modules cannot encode a cam: "):
        Asn1Encoder([other], ["cam"], **place)  # type: ignore[arg-type]
    more = tmp_path / "more.asn1"
    more.write_text(TINY.read_text().replace("exteriorLights BIT", "gear INTEGER (0..7), exteriorLights BIT"))
    with pytest.raises(SettingError, match=r"cannot encode a cam: .*member 'gear' not found …; docs/channels.md"):
        Asn1Encoder([more], ["cam"])


@pytest.mark.exhaustive
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
def test_encoder_with_hostile_module_raises(tmp_path: Path, types: str) -> None:
    path = tmp_path / "hostile.asn"
    path.write_text(f"M DEFINITIONS AUTOMATIC TAGS ::= BEGIN\n{types}\nEND\n")
    with pytest.raises(SettingError) as caught:
        Asn1Encoder([path], ["cam"], source="scene.xosc", line=7)
    assert all((diagnostic.source, diagnostic.line) == ("scene.xosc", 7) for diagnostic in caught.value.diagnostics)
