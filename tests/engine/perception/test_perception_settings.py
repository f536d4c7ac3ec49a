"""Perception properties of controllers: errors with file and line before the run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from scenario_1 import FrameCollector, with_properties
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.errors import InputError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation, load_for_seed

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write scenario 1 with further properties of the ego (or the roadside unit), each on a separate line."""

    def write(rsu: bool = False, **properties: str) -> Path:
        return with_properties(tmp_path, "RsuStack" if rsu else "EgoStack", *properties.items())

    return write


def diagnostics_of(path: Path, **options: str) -> list[str]:
    with pytest.raises(InputError) as error:
        Simulation(load_for_seed(path, 1, {}), settings=RunSettings(**options))  # type: ignore[arg-type]
    return [str(diagnostic) for diagnostic in error.value.diagnostics]


def line_of(path: Path, word: str) -> int:
    return next(number for number, line in enumerate(path.read_text().splitlines(), 1) if f'"{word}"' in line)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("tracker", "ukf", "setting 'tracker' is 'ukf'; known: ctrv, cv, none"),
        ("tracker", "{kind: cv, confirm: [3, 2]}", "n exceeds m (got [3, 2]"),
        ("tracker", "{kind: cv, coasting: 1}", "did you mean 'coast'?"),
        ("localization", "slam", "'oracle' or 'ekf'"),
        ("detector_latency", "-0.1", "greater than or equal to 0"),
        ("obey_signals", "sometimes", "valid boolean"),
        ("detector_settings", "{min_points: 4}", "has no settings"),
        ("trackr", "cv", "did you mean 'tracker'?"),
    ],
)
def test_invalid_property_is_error_with_line(write: Write, name: str, value: str, words: str) -> None:
    path = write(**{name: value})
    (diagnostic,) = diagnostics_of(path)
    assert diagnostic.startswith(f"{path}:{line_of(path, name)}: ")
    assert words in diagnostic


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{camera: {width: 0}}", "'sensors.camera.width' is 0; input should be greater than or equal to 2"),
        ("{camera: {rate: -1}}", "'sensors.camera.rate' is -1; input should be greater than or equal to 0.01"),
        ("{camera: {rate: .inf}}", "finite number"),
        ("{camera: {fov: 200}}", "less than 180"),
        ("{camera: {mount: [1, 2]}}", "three to five numbers"),
        ("{camera: {distortion: [-2]}}", "folds the image"),
        (
            "{truth: {}, "
            "camera: {width: 64, height: 48, fov: 139.363, distortion: [0, 0.977637, 0, 0.271634, -0.110679]}}",
            "distortion: the coefficients cannot be inverted",
        ),
        ("{truth: {}, a: {kind: imu}, b: {kind: imu}}", "at most one sensor of kind 'imu' (got a, b)"),
        ("{lidar: {channels: -3}}", "greater than or equal to 1"),
        ("{truth: {}, gnss: {position_noise: -2}}", "'sensors.gnss.position_noise' is -2"),
        ("{truth: {}, imu: {gyroscope_walk: -1}}", "'sensors.imu.gyroscope_walk' is -1"),
        ("{camra: {}}", "did you mean 'camera'?"),
        ("[truth, imu: {}]", "write a mapping from names to settings"),
        ("{lidar: {}}", "needs a sensor of kind truth"),
    ],
)
def test_invalid_sensor_is_error_with_line(write: Write, value: str, words: str) -> None:
    path = write(sensors=value)
    (diagnostic,) = diagnostics_of(path)
    assert diagnostic.startswith(f"{path}:{line_of(path, 'sensors')}: ")
    assert words in diagnostic


def test_run_with_unsuitable_weights_is_error_with_line(write: Write, tmp_path: Path) -> None:
    """Command line: exit code 2, one line per diagnostic, no traceback."""
    invalid = tmp_path / "junk.onnx"
    invalid.write_text("no model")
    path = write(detector_settings=f"{{weights: {invalid}, classes: [car], input_size: [320, 192]}}")
    path.write_text(path.read_text().replace('name="detector" value="oracle"', 'name="detector" value="yolov5"', 1))
    done = CliRunner().invoke(app, ["run", str(path), "--no-record"])
    assert done.exit_code == 2
    place = f"{path}:{line_of(path, 'detector_settings')}: "
    assert f"{place}weights {str(invalid)!r} are not an ONNX model" in " ".join(done.stderr.split())
    done = CliRunner().invoke(app, ["run", str(path), "--no-record", "--detector", "yolo5"])
    assert done.exit_code == 2
    assert "--detector: unknown detector 'yolo5'; did you mean 'yolov5'?" in " ".join(done.stderr.split())


def test_detector_latency_above_report_timeout_is_error(write: Write) -> None:
    (diagnostic,) = diagnostics_of(write(detector_latency="2.5"))
    assert "detector_latency is not below report_timeout (got 2.5 s and 2.28 s)" in diagnostic


def test_security_envelope_of_the_maximum_size_is_error(write: Write) -> None:
    (diagnostic,) = diagnostics_of(write(security_bytes="1400"))
    assert "security_bytes is not below mtu (got 1400 and 1400 bytes)" in diagnostic


def test_detector_latency_above_maximum_age_of_fusion_is_error(write: Write) -> None:
    path = write(detector_latency="0.5", fusion_settings="{max_age: 0.3}")
    path.write_text(
        path.read_text().replace('name="fusion" value="average"', 'name="fusion" value="covariance_intersection"')
    )
    (diagnostic,) = diagnostics_of(path)
    assert "maximum age of reports of fusion method 'covariance_intersection' (got 0.5 s and 0.3 s)" in diagnostic


def test_invalid_detector_settings_are_errors_with_line(write: Write) -> None:
    path = write(rsu=True, detector_settings="{min_points: 0, of_road: 3}")
    text = path.read_text().replace(
        '<Property name="detector" value="oracle"/>', '<Property name="detector" value="lidar"/>'
    )
    path.write_text(text)
    diagnostics = diagnostics_of(path)
    line = line_of(path, "detector_settings")
    assert all(
        diagnostic.startswith(f"{path}:{line}: ") for diagnostic in diagnostics if "has no settings" not in diagnostic
    )
    assert any("'detector_settings.min_points' is 0" in diagnostic for diagnostic in diagnostics)
    assert any("did you mean 'off_road'?" in diagnostic for diagnostic in diagnostics)


def test_detector_option_ignores_detector_settings_of_file(write: Write) -> None:
    """The file configures `lidar`; the option selects the oracle, which has no settings."""
    path = write(detector_settings="{min_points: 4}")
    path.write_text(path.read_text().replace('name="detector" value="oracle"', 'name="detector" value="lidar"'))
    Simulation(load_for_seed(path, 1, {}), settings=RunSettings(detector="oracle")).close()


def test_missing_sensor_of_detector_is_error_with_line_of_sensors(write: Write) -> None:
    path = write(sensors="[truth]")
    (diagnostic,) = diagnostics_of(path, detector="lidar")
    assert diagnostic.startswith(f"{path}:{line_of(path, 'sensors')}: ")
    assert "needs a sensor of kind lidar" in diagnostic


def test_unknown_detector_option_is_error_with_suggestion(write: Write) -> None:
    (diagnostic,) = diagnostics_of(write(), detector="ldiar")
    assert diagnostic.startswith("RunSettings.detector: ")
    assert "did you mean 'lidar'?" in diagnostic


def run(path: Path, **options: object) -> tuple[RunResult, list[Frame]]:
    collector = FrameCollector()
    settings = RunSettings(**options)  # type: ignore[arg-type]
    simulation = Simulation(load_for_seed(path, 1, {}), seed=1, settings=settings, observers=[collector])
    return simulation.run(), collector.frames


def test_explicit_defaults_keep_trace_hash(write: Write) -> None:
    default, _ = run(write(), time_limit=4.0)
    explicit, _ = run(
        write(tracker="none", localization="oracle", detector_latency="0", obey_signals="false"), time_limit=4.0
    )
    assert default.trace_hash == explicit.trace_hash


def test_runs_with_filter_tracker_and_latency_are_repeatable(write: Write) -> None:
    path = write(localization="ekf", tracker="ctrv", detector_latency="0.1")
    (one, frames), (other, _) = run(path, time_limit=3.0), run(path, time_limit=3.0)
    assert one.trace_hash == other.trace_hash
    step = frames[-1].steps["Ego"]
    assert step.estimate is not None
    row = frames[-1].view.row("Ego")
    off = step.estimate.position[:2] - frames[-1].view.position[row, :2]
    assert 1e-6 < float((off**2).sum()) ** 0.5 < 1.0
    assert step.detections.tracks
    assert step.detections.time == pytest.approx(frames[-1].view.time - 0.1)
    assert frames[-1].steps["RSU"].estimate is None


@pytest.mark.exhaustive
@pytest.mark.parametrize(("scenario", "helper"), [("coop/scenario_1", "RSU"), ("coop/scenario_2", "Spectator")])
def test_lidar_detector_finds_incoming_car_in_time(scenario: str, helper: str) -> None:
    """Lidar only: no collision, and the helper detects the hidden car no later than the ego can at the crossing."""
    result, frames = run(resolve_scenario(scenario), detector="lidar", time_limit=6.5)
    passed = {verdict.name for verdict in result.criteria if verdict.passed}
    assert passed == {"collision", "min_distance"}, "the time limit ends the run before the goal"
    first: dict[str, float] = {}
    for frame in frames:
        place = frame.view.centers[frame.view.row("Incoming"), :2]
        truck = frame.view.centers[frame.view.row("Firetruck"), :2]
        if ((place - truck) ** 2).sum() > 12.0**2:
            continue
        for name, step in frame.steps.items():
            boxes = step.detections.boxes[:, :2]
            if len(boxes) and ((boxes - place) ** 2).sum(axis=1).min() < 1.0:
                first.setdefault(name, frame.view.time)
    assert first[helper] <= first["Ego"]
