"""Immense, tiny, negative and undefined numbers, and values of other types, in every setting.

The settings are those of stations, sensors, detectors, trackers, fusion methods, channels and weather.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from typing import Any

import yaml

VALUES: tuple[Any, ...] = (
    *(0, -0.0, -1, 1, 3, 0.5, 1000, 1e5, 1e7, 1e9, 1e12, -1e12, 2**31, 2**63, -(2**63), 10**30),
    *(1e-320, -1e-320, 1e-300, 1e-9, 1e-4, 1e308, -1e308, math.nan, math.inf, -math.inf),
    *(True, False, None, "", "text", "1e308", "nan", [], [1], [math.nan], {}, {"a": 1}, [1, [2]]),
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
        "message_phase": 0.05,
        "planner": "conflict_area",
        "conflict_area": [[100.0, 120.0, -10.0, 10.0]],
        "conflict_deceleration": 5.0,
        "conflict_hold_time": 1.0,
        "min_existence": 0.4,
        "pose_error": {"x": 0.5, "y": -0.5, "yaw": 1.0},
        "pose_noise": {"position": 0.2, "yaw": 0.2, "correlation_time": 1.0},
        "false_objects": [
            {
                "x": 40.0,
                "y": 2.0,
                "z": 0.0,
                "speed": 3.0,
                "heading": 90.0,
                "kind": "car",
                "size": [4.5, 1.8, 1.5],
                "score": 0.9,
                "deviation": 0.3,
                "since": 0.1,
                "until": 5.0,
            }
        ],
    },
    "planner": {
        "range": 50.0,
        "planner": "behavior",
        "time_gap": 1.2,
        "standstill_gap": 2.0,
        "passing_gap": 6.0,
        "acceleration": 1.5,
        "comfortable_deceleration": 2.0,
        "hard_deceleration": 4.0,
        "emergency_deceleration": 8.0,
        "lateral_acceleration": 2.0,
        "lateral_margin": 0.4,
        "pedestrian_margin": 0.8,
        "crossing_time": 0.75,
        "horizon": 8.0,
        "period": 0.1,
        "uncertainty": 1.645,
        "possible_existence": 0.3,
        "caution": True,
        "memory": 1.0,
    },
    "fusion": {
        "range": 50.0,
        "tracker": {
            "kind": "cv",
            "confirm": [2, 3],
            "confirm_existence": 0.5,
            "delete_existence": 0.05,
            "coast": 0.5,
            "gate": 0.99,
            "detection_probability": 0.8,
            "birth_density": 1e-4,
            "lifetime": 10.0,
        },
        "fusion": "covariance_intersection",
        "fusion_settings": {"gate": 0.99, "gate_distance": 4.0, "max_age": 1.5, "existence": 0.5},
    },
    "features": {
        "detector": "pillars",
        "detector_settings": {"confidence": 0.3, "runtime": "auto", "precision": "float32"},
        "fusion": "where2comm",
        "fusion_settings": {"share": 0.01, "encoding": "int8", "max_lateness": 0.5, "align_poses": True},
    },
    "early": {
        "detector": "lidar",
        "detector_settings": {"off_road": 0.5, "min_points": 3, "min_score": 0.05},
        "fusion": "early",
        "fusion_settings": {"cell": 0.1, "max_lateness": 0.5, "gate_distance": 4.0},
        "sensors": {"lidar": {"elevations": [0.0, -5.0, -10.0], "channels": 3, "points_per_second": 6000}},
    },
    "etsi": {"generation": "etsi", "messages": "cpm, cam", "mtu": 400, "security_bytes": 100},
    "sensors": {
        "localization": "ekf",
        "sensors": {
            "truth": {"range": 40.0, "rate": 10.0, "visibility": 0.2, "field_of_view": 200.0},
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
                "max_exposure_time": 0.03,
                "max_gain": 30.0,
                "supersampling": 1,
                "rate": 10.0,
            },
        },
    },
}
"""Properties of stations that are right, and between them hold every setting with a number."""

POOL: Mapping[str, Any] = {
    "interval": 0.1,
    "resource_keep_probability": 0.4,
    "processing": 0.001,
    "selection_window": 0.1,
    "latency": 0.1,
    "reselect_after": 3,
    "pssch_rsrp_threshold_dbm": -110.0,
    "cbr_threshold_dbm": -94.0,
}
"""Settings of both kinds of resource pools."""

CHANNELS: Mapping[str, Mapping[str, Any]] = {
    "constant": {"delay": {"kind": "constant", "seconds": 0.1}, "loss": {"kind": "bernoulli", "probability": 0.1}},
    "uniform": {"delay": {"kind": "uniform", "minimum": 0.02, "maximum": 0.1}},
    "normal": {"delay": {"kind": "truncated_normal", "mean": 0.1, "sd": 0.02, "minimum": 0.01, "maximum": 0.3}},
    "gamma": {
        "delay": {"kind": "shifted_gamma", "minimum": 0.02, "mean": 0.1},
        "loss": {"kind": "gilbert_elliott", "probability": 0.3, "burst": 10},
    },
    "states": {
        "loss": {"kind": "gilbert_elliott", "to_bad": 0.1, "to_good": 0.5, "good_loss": 0.01, "bad_loss": 0.9},
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
    "80211p fading": {
        "model": "radio",
        "path_loss": {
            "kind": "log_distance",
            "exponent": 3.0,
            "reference_distance": 1.0,
            "reference_loss_db": 47.0,
            "per_vehicle_db": 6.9,
        },
        "fading": {"kind": "nakagami", "m": [3.0, 1.0], "distances": [80.0]},
        "congestion": {"kind": "reactive", "limits": [0.2, 1.0], "intervals": [0.1, 0.5]},
        "jammers": [{"x": 10.0, "y": -20.0, "z": 1.5, "power_dbm": 30.0}],
    },
    "80211p limeric": {
        "model": "radio",
        "path_loss": {"kind": "winner_b1", "environment_height": 1.0, "per_vehicle_db": 6.0},
        "congestion": {
            "kind": "limeric",
            "alpha": 0.016,
            "beta": 0.0012,
            "target": 0.68,
            "gain_down": -0.00025,
            "gain_up": 0.0005,
            "share_min": 0.0006,
            "share_max": 0.03,
            "interval_min": 0.025,
            "interval_max": 1.0,
        },
        "background": {
            "kind": "80211p",
            "density": 0.06,
            "rate": 10,
            "size": 300,
            "power_dbm": 23,
            "data_rate_mbps": 6.0,
            "environment_height": 0.5,
        },
    },
    "cv2x": {
        "model": "radio",
        "technology": "cv2x_mode4",
        "sidelink": {
            **POOL,
            "subchannels": 4,
            "subchannel_bytes": 190,
        },
    },
    "nr_v2x": {
        "model": "radio",
        "technology": "nr_v2x_mode2",
        "nr_sidelink": {
            **POOL,
            "mcs": 7,
            "sensing_window": 1.1,
            "candidate_share": 0.35,
            "transmissions": 2,
        },
    },
    "cv2x background": {
        "model": "radio",
        "technology": "cv2x_mode4",
        "background": {
            "kind": "cv2x_mode4",
            "density": 0.1,
            "rate": 10,
            "power_dbm": 23,
            "subchannels": 4,
            "environment_height": 0.5,
        },
    },
}
"""Channel profiles that are right."""

WEATHER: Mapping[str, Mapping[str, Any]] = {
    "weather": {
        "name": "all",
        "sun_azimuth": 10.0,
        "sun_elevation": 20.0,
        "sun_illuminance": 1e4,
        "sun_share": 0.5,
        "cloud_cover": 0.3,
        "visual_range": 500.0,
        "precipitation": "rain",
        "precipitation_intensity": 5.0,
        "wetness": 0.4,
        "friction": 0.8,
        "wind_direction": 30.0,
        "wind_speed": 4.0,
        "street_lighting": 5.0,
        "headlights": "auto",
    },
}
"""Weather presets that are right."""


def variants(settings: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield settings with one value replaced, and which one."""
    for path in _paths(settings, ()):
        for value in VALUES:
            changed = deepcopy(dict(settings))
            place: Any = changed
            for key in path[:-1]:
                place = place[key]
            place[path[-1]] = value
            yield f"{'.'.join(map(str, path))}={value!r}", changed


def as_text(value: Any) -> str:
    """A value as a scenario file has it: names as they are, all else as YAML in one line."""
    if isinstance(value, str):
        return value
    text: str = yaml.safe_dump(value, default_flow_style=True, width=10**6, sort_keys=False)
    return text.strip().removesuffix("...").strip()


def _paths(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
    entries: Iterable[tuple[Any, Any]] = ()
    if isinstance(value, Mapping):
        entries = value.items()
    elif isinstance(value, list):
        entries = enumerate(value)
    for key, inner in entries:
        yield (*path, key)
        yield from _paths(inner, (*path, key))
