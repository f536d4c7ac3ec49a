"""Message encoding in unaligned packed encoding rules (UPER), with ASN.1 modules supplied by the user.

The structure follows ETSI EN 302 637-2 V1.4.1 (CAM) and ETSI TR 103 562 V2.1.1 (CPM). A module may define fewer
components; additional mandatory components are an error. The open types of TS 103 324 around the containers of a CPM
are not supported.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.installation import install_command
from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.files.bounded import MIB, is_regular_file, read_regular_file, reason_of
from eidrive_scenario.v2x.messages.message import Message, StationState, station_id

TYPES = {"cam": "CAM", "cpm": "CPM"}
"""ASN.1 type of the message, by kind."""

_STATION_TYPES = {"pedestrian": 1, "bicycle": 2, "motorbike": 4, "car": 5, "bus": 6, "van": 7, "truck": 8, "misc": 15}
_SUBCLASSES = {"car": 3, "motorbike": 2, "bus": 4, "van": 5, "truck": 6}
_METERS_PER_DEGREE = 111_319.49
"""Length of a degree along the equator [m]; the origin of the world is at latitude and longitude 0."""

MAX_BYTES = MIB
"""Maximum size of an ASN.1 module [bytes]."""
ROADSIDE = "misc"
"""Class of stations that are not vehicles: roadside units."""


class Asn1Encoder:
    """Encoder of the messages of one station. `station` is its class (`car`, …; `misc` is a roadside unit).

    Raise SettingError if asn1tools is not installed, a file cannot be read, a type is missing, or a type requires
    components that are not supported. The constructor encodes one message of each kind as a check.
    """

    def __init__(
        self,
        files: Sequence[Path],
        kinds: Sequence[str],
        *,
        station: str = "car",
        source: str = "",
        line: int | None = None,
    ) -> None:
        self._station = station
        try:
            import asn1tools
        except ImportError as error:
            hint = f"install it: {install_command('asn1')}"
            raise SettingError(Diagnostic("asn1_files requires package asn1tools", hint, source, line)) from error
        for file in files:
            if not is_regular_file(file):
                message = f"no ASN.1 module {quoted(str(file))}"
                raise SettingError(Diagnostic(message, "expected the path of a file", source, line))
        try:
            texts = [read_regular_file(file, MAX_BYTES).decode("utf-8-sig", errors="replace") for file in files]
            self._modules = asn1tools.compile_string("\n".join(texts), "uper")
        except OSError as error:
            message = f"ASN.1 module {error.filename} cannot be read: {reason_of(error)}"
            raise SettingError(Diagnostic(message, "check the file", source, line)) from error
        except Exception as error:  # asn1tools raises errors of many types for invalid modules
            names = ", ".join(str(file) for file in files)
            # The message of asn1tools quotes the line, which may be confidential.
            location = re.search(r"line (\d+)", str(error))
            message = f"{names}: not a valid ASN.1 module" + (f" in line {location[1]}" if location else "")
            raise SettingError(Diagnostic(message, "correct the module", source, line)) from error
        for kind in kinds:
            if TYPES[kind] not in self._modules.types:
                message = f"ASN.1 modules do not define type {TYPES[kind]!r}, which messages of kind {kind} require"
                raise SettingError(Diagnostic(message, "add the file that defines it", source, line))
        try:
            for kind in kinds:
                self._try(kind)
        except SettingError as error:
            raise error.at(source, line) from error

    def _try(self, kind: str) -> None:
        """Encode messages of this kind with and without the optional components."""
        unknown = np.full((1, 2), np.nan), np.full((1, 2, 2), np.nan)
        car = Detections(0.0, np.array([[0, 0, 0, 4, 2, 1, 0]], float), np.ones(1), (self._station,), *unknown)
        state = StationState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for seen, more in ((car, True), (car if kind == "cam" else Detections(0.0), False)):
            sensors = (ViewSector(0.0, 0.0, 0.0, 0.0, math.pi, math.inf),) if more else None
            message = Message("station", 0, 0.0, state, seen, 0, "cam" if kind == "cam" else "cpm", sensors=sensors)
            self.encode(message, low_frequency=more)

    def encode(self, message: Message, *, low_frequency: bool = False) -> bytes:
        """Return the encoded message; `low_frequency` applies to a CAM.

        Raise SettingError if the message does not match the type of the module.
        """
        value = cam_value(message, low_frequency) if message.kind == "cam" else cpm_value(message, self._station)
        try:
            encoded: bytes = self._modules.encode(TYPES[message.kind], value)
        except Exception as error:  # errors of many types, such as AttributeError for a recursive type
            reason = re.sub(r"( in)? [{(].*", " …", str(error), flags=re.DOTALL)  # without the message content
            hint = "docs/channels.md lists the standards of the message structure"
            text = f"ASN.1 modules cannot encode a {message.kind}: {reason}"
            raise SettingError(Diagnostic(text, hint)) from error
        return encoded

    def decode(self, kind: str, data: bytes) -> Any:
        """Return the content of an encoded message in the representation of asn1tools."""
        return self._modules.decode(TYPES[kind], data)


def cam_value(message: Message, low_frequency: bool) -> dict[str, Any]:
    """Return a CAM (EN 302 637-2, annex A); that of a roadside unit contains only its position."""
    state = message.state
    station = message.detections.classes[0]
    basic = {"stationType": _STATION_TYPES[station], "referencePosition": _position(state)}
    parameters: dict[str, Any] = {"basicContainer": basic}
    if station == ROADSIDE:
        parameters["highFrequencyContainer"] = ("rsuContainerHighFrequency", {})
    else:
        *_, length, width, _, _ = message.detections.boxes[0].tolist()
        parameters["highFrequencyContainer"] = (
            "basicVehicleContainerHighFrequency",
            {
                **_motion(state),
                "vehicleLength": {
                    "vehicleLengthValue": _clamp(length * 10.0, 1, 1022),
                    "vehicleLengthConfidenceIndication": "unavailable",
                },
                "vehicleWidth": _clamp(width * 10.0, 1, 61),
                "longitudinalAcceleration": {
                    "longitudinalAccelerationValue": 161,
                    "longitudinalAccelerationConfidence": 102,
                },
                "curvature": {"curvatureValue": 1023, "curvatureConfidence": "unavailable"},
                "curvatureCalculationMode": "unavailable",
                "yawRate": {"yawRateValue": 32767, "yawRateConfidence": "unavailable"},
            },
        )
        if low_frequency:
            parameters["lowFrequencyContainer"] = (
                "basicVehicleContainerLowFrequency",
                {"vehicleRole": "default", "exteriorLights": (b"\x00", 8), "pathHistory": []},
            )
    return {
        "header": _header(2, message.sender),
        "cam": {"generationDeltaTime": _milliseconds(state.time), "camParameters": parameters},
    }


def cpm_value(message: Message, station: str) -> dict[str, Any]:
    """Return a CPM (TR 103 562, annex A) of a station of this class.

    Objects are in the frame of the sender, whose axes are east and north if it is a roadside unit, with velocities
    relative to it. A CPM of a roadside unit omits the container of the originating station.
    """
    state, detections = message.state, message.detections
    parameters: dict[str, Any] = {
        "managementContainer": {"stationType": _STATION_TYPES[station], "referencePosition": _position(state)},
        "numberOfPerceivedObjects": min(len(detections), 255),
    }
    if station != ROADSIDE:
        parameters["stationDataContainer"] = ("originatingVehicleContainer", _motion(state))
    if message.sensors:
        parameters["sensorInformationContainer"] = [
            _sensor(number, sector) for number, sector in enumerate(message.sensors)
        ]
    if len(detections):
        delay = _clamp((state.time - detections.time) * 1e3, -1500, 1500)
        parameters["perceivedObjectContainer"] = [
            _object(message, row, delay, 0.0 if station == ROADSIDE else state.yaw)
            for row in range(min(len(detections), 128))
        ]
    return {
        "header": _header(14, message.sender),
        "cpm": {"generationDeltaTime": _milliseconds(state.time), "cpmParameters": parameters},
    }


def _object(message: Message, row: int, delay: int, axis: float) -> dict[str, Any]:
    """Return an object in a frame whose x axis has the direction `axis` [rad]."""
    state, detections = message.state, message.detections
    x, y, z, length, width, height, yaw = detections.boxes[row].tolist()
    cos, sin = math.cos(axis), math.sin(axis)
    east, north = x - state.x, y - state.y
    vx, vy = detections.velocity[row].tolist()
    vx, vy = vx - state.speed * math.cos(state.yaw), vy - state.speed * math.sin(state.yaw)
    speeds = [16383, 16383]
    if not math.isnan(vx + vy):
        speeds = [_clamp(100.0 * v, -16382, 16382) for v in (cos * vx + sin * vy, cos * vy - sin * vx)]
    number = row if message.objects is None else message.objects[row]
    name = detections.classes[row]
    kind: tuple[str, dict[str, int]] = ("other", {"type": 0, "confidence": 0})
    if name in _SUBCLASSES:
        kind = ("vehicle", {"type": _SUBCLASSES[name], "confidence": 0})
    elif name in ("pedestrian", "bicycle"):
        kind = ("person", {"type": 1 if name == "pedestrian" else 3, "confidence": 0})
    return {
        "objectID": number % 256,
        "timeOfMeasurement": delay,
        "objectConfidence": _clamp(100.0 * float(detections.confidence[row]), 0, 100),
        "xDistance": _distance(cos * east + sin * north),
        "yDistance": _distance(cos * north - sin * east),
        "zDistance": _distance(z - state.z),
        "xSpeed": {"value": speeds[0], "confidence": 127},
        "ySpeed": {"value": speeds[1], "confidence": 127},
        "yawAngle": {"value": _tenths_of_degrees(yaw - axis), "confidence": 127},
        # The first dimension is across the direction of the yaw angle.
        "planarObjectDimension1": {"value": _clamp(10.0 * width, 0, 1023), "confidence": 102},
        "planarObjectDimension2": {"value": _clamp(10.0 * length, 0, 1023), "confidence": 102},
        "verticalObjectDimension": {"value": _clamp(10.0 * height, 0, 1023), "confidence": 102},
        "objectRefPoint": 0,
        "classification": [{"confidence": 101, "class": kind}],
    }


def _sensor(number: int, sector: ViewSector) -> dict[str, Any]:
    """Return a sensor with its sector in the frame of the station."""
    first, last = 0, 3600
    if sector.half_angle < math.pi:
        first, last = (_tenths_of_degrees(sector.yaw + side * sector.half_angle) for side in (-1.0, 1.0))
    reach = _clamp(10.0 * sector.range, 0, 10000) if math.isfinite(sector.range) else 10000
    area = {
        "refPointId": 0,
        "xSensorOffset": _clamp(100.0 * sector.x, -5000, 0),
        "ySensorOffset": _clamp(100.0 * sector.y, -1000, 1000),
        "vehicleSensorPropertyList": [
            {"range": reach, "horizontalOpeningAngleStart": first, "horizontalOpeningAngleEnd": last}
        ],
    }
    return {"sensorID": number % 256, "type": 0, "detectionArea": ("vehicleSensor", area)}


def _header(number: int, sender: str) -> dict[str, int]:
    return {"protocolVersion": 2, "messageID": number, "stationID": station_id(sender)}


def _position(state: StationState) -> dict[str, Any]:
    """Return the geographic position, with the origin of the world at latitude and longitude 0."""
    return {
        "latitude": _clamp(state.y / _METERS_PER_DEGREE * 1e7, -900_000_000, 900_000_000),
        "longitude": _clamp(state.x / _METERS_PER_DEGREE * 1e7, -1_800_000_000, 1_800_000_000),
        "positionConfidenceEllipse": {
            "semiMajorConfidence": 4095,
            "semiMinorConfidence": 4095,
            "semiMajorOrientation": 3601,
        },
        "altitude": {"altitudeValue": _clamp(100.0 * state.z, -100_000, 800_000), "altitudeConfidence": "unavailable"},
    }


def _motion(state: StationState) -> dict[str, Any]:
    """Return the heading, clockwise from north (the y axis), and the speed."""
    return {
        "heading": {"headingValue": _tenths_of_degrees(math.pi / 2.0 - state.yaw), "headingConfidence": 127},
        "speed": {"speedValue": _clamp(abs(state.speed) * 100.0, 0, 16382), "speedConfidence": 127},
        "driveDirection": "forward" if state.speed >= 0.0 else "backward",
    }


def _distance(meters: float) -> dict[str, int]:
    return {"value": _clamp(100.0 * meters, -132768, 132767), "confidence": 102}


def _tenths_of_degrees(angle: float) -> int:
    return round(math.degrees(angle) * 10.0) % 3600


def _milliseconds(time: float) -> int:
    return round(time * 1e3) % 65536


def _clamp(value: float, low: int, high: int) -> int:
    return min(max(round(value), low), high)
