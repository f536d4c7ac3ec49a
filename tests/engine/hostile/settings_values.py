"""Immense, tiny and negative numbers in every setting of stations, sensors, trackers, fusion methods and channels."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

NUMBERS: tuple[float, ...] = (
    0,
    -1,
    1e-300,
    1e-9,
    1e-4,
    0.5,
    3,
    1000,
    1e5,
    1e7,
    1e9,
    1e12,
    -1e12,
    1e308,
    2**63,
    10**30,
)

STATIONS: Mapping[str, Mapping[str, Any]] = {
    "station": {
        "range": 50.0,
        "field_of_view": 120.0,
        "visibility": 0.1,
        "mount": [1.0, 0.0, 1.5, 0.0, 0.0],
        "detector_latency": 0.05,
        "report_timeout": 1.0,
        "antenna_height": 1.5,
        "clock_offset": 0.01,
        "clock_drift": 10.0,
        "target_speed": 10.0,
        "message_rate": 10.0,
        "conflict_area": [[100.0, 120.0, -10.0, 10.0]],
        "conflict_brake": 5.0,
        "conflict_hold": 1.0,
    },
    "etsi": {"generation": "etsi", "messages": "cpm, cam", "mtu": 400, "security_bytes": 100},
    "sensors": {
        "localization": "ekf",
        "sensors": {
            "truth": {"range": 40.0, "rate": 10.0, "visibility": 0.2},
            "gnss": {"rate": 10.0, "position_noise": 0.3, "height_noise": 0.6, "bias": 0.1, "bias_walk": 0.1},
            "imu": {
                "accelerometer_noise": 0.02,
                "gyroscope_noise": 0.002,
                "accelerometer_bias": 0.1,
                "gyroscope_bias": 0.005,
                "accelerometer_walk": 0.1,
                "gyroscope_walk": 1e-4,
                "rate": 100.0,
            },
        },
    },
    "tracker": {
        "detector": "lidar",
        "tracker": {"kind": "ctrv"},
        "fusion": "covariance_intersection",
        "sensors": {
            "lidar": {
                "channels": 16,
                "range": 60.0,
                "points_per_second": 20000,
                "rotation": 10.0,
                "upper_fov": 5.0,
                "lower_fov": -15.0,
                "field_of_view": 90.0,
                "attenuation": 0.004,
                "range_noise": 0.02,
                "ten_percent_range": 150.0,
                "dropoff": 0.1,
                "dropoff_intensity": 0.5,
                "dropoff_dark": 0.3,
                "rate": 10.0,
            }
        },
    },
    "camera": {
        "sensors": {
            "truth": {},
            "camera": {
                "width": 64,
                "height": 48,
                "fov": 90.0,
                "distortion": [0.01, 0.0, 0.0, 0.0, 0.0],
                "near": 0.1,
                "far": 200.0,
                "noise": {"full_well": 12000.0, "read_noise": 4.0},
                "f_number": 1.6,
                "exposure_time": 0.01,
                "gain": 3.0,
                "longest_exposure": 0.03,
                "highest_gain": 30.0,
                "supersampling": 1,
                "rate": 10.0,
            },
        },
    },
}
"""Properties of stations that are right, and between them hold every setting with a number."""

CHANNELS: Mapping[str, Mapping[str, Any]] = {
    "constant": {"delay": {"kind": "constant", "seconds": 0.1}, "loss": {"kind": "bernoulli", "probability": 0.1}},
    "gamma": {
        "delay": {"kind": "shifted_gamma", "minimum": 0.02, "mean": 0.1},
        "loss": {"kind": "gilbert_elliott", "probability": 0.3, "burst": 10},
    },
    "lognormal": {"delay": {"kind": "lognormal", "minimum": 0.001, "mean": 0.01, "sd": 0.008}},
    "trace": {
        "delay": {"kind": "trace", "seconds": [0.1, 0.2]},
        "loss": {"kind": "by_distance", "distances": [10.0, 50.0], "reception": [0.9, 0.5]},
    },
    "80211p": {
        "model": "radio",
        "technology": "80211p",
        "frequency_ghz": 5.9,
        "tx_power_dbm": 23.0,
        "antenna_gain_dbi": 3.0,
        "noise_dbm": -95.0,
        "sensing_dbm": -85.0,
        "shadowing_db": 3.0,
        "decorrelation": 10.0,
        "data_rate_mbps": 6.0,
        "mtu": 1400,
        "jitter": 0.01,
        "path_loss": {"kind": "tr37885", "environment": "urban"},
        "queue": {"discipline": "lcfs", "length": 4},
        "congestion": {"kind": "limeric"},
        "background": {"kind": "80211p", "density": 0.06, "rate": 10, "size": 300, "power_dbm": 23},
    },
    "cv2x": {
        "model": "radio",
        "technology": "cv2x_mode4",
        "sidelink": {"interval": 0.1, "subchannels": 4},
        "background": {"kind": "cv2x_mode4", "density": 0.1, "rate": 10, "power_dbm": 23, "subchannels": 4},
    },
}
"""Channel profiles that are right."""


def variants(settings: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield settings with one number replaced, and which one."""
    for path in list(_numbers(settings, ())):
        for number in NUMBERS:
            changed = deepcopy(dict(settings))
            place: Any = changed
            for key in path[:-1]:
                place = place[key]
            place[path[-1]] = number
            yield f"{'.'.join(map(str, path))}={number!r}", changed


def as_property(value: Any) -> str:
    """A value of a property as a scenario file has it: names as they are, all else as YAML."""
    return value if isinstance(value, str) else json.dumps(value)


def _numbers(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _numbers(inner, (*path, key))
    elif isinstance(value, list):
        for place, inner in enumerate(value):
            yield from _numbers(inner, (*path, place))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path
