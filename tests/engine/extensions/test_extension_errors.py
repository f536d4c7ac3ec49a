"""Errors of extensions: each is reported with its name, for whom it was called, the time, and its line of code."""

from __future__ import annotations

import pickle
import re
from pathlib import Path
from types import MappingProxyType

import pytest
from faulty_extensions import line_of, write_scenario

from eidrive_scenario.errors import ExtensionError, InputError, RegistryError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation, run_file


def run(tmp_path: Path, *, detector: str = "oracle", channel: str = "ideal", **extensions: object) -> RunResult:
    scenario = write_scenario(tmp_path / "s.xosc", **extensions)  # type: ignore[arg-type]
    return run_file(scenario, settings=RunSettings(detector=detector, channel=channel))


def error_of(tmp_path: Path, **extensions: str) -> ExtensionError:
    with pytest.raises(ExtensionError) as caught:
        run(tmp_path, **extensions)
    return caught.value


def test_run_of_sound_extensions_passes(package: Path, tmp_path: Path) -> None:
    assert run(tmp_path, channel="{model: faulty, fault: sound}", criterion="faulty: {fault: sound}").passed


# Exceptions


@pytest.mark.parametrize(
    ("extensions", "place", "time", "line", "diagnostic"),
    [
        ({"detector": "raises"}, "detector 'raises' (faulty:Raises) of station 'Ego'", 0.0,
         'raise KeyError("no such camera")', "KeyError: 'no such camera'"),
        ({"detector": "exits"}, "detector 'exits' (faulty:Exits) of station 'Ego'", 0.5, "sys.exit(0)",
         "SystemExit: 0 (an extension cannot end the process)"),
        ({"detector": "raises_in_numpy"}, "detector 'raises_in_numpy' (faulty:RaisesInNumpy) of station 'Ego'", 0.0,
         "np.linalg.inv", "numpy.linalg.LinAlgError: Singular matrix (raised at "),
        ({"detector": "wrong_shape"}, "detector 'wrong_shape' (faulty:WrongShape) of station 'Ego'", 0.0,
         "np.zeros((1, 6))", "ValueError: boxes have shape (1, 6), expected (N, 7) (raised at "),
        ({"sensors": "{truth: {}, own: {kind: faulty_sensor, fault: read}}"},
         "sensor 'faulty_sensor' (faulty:FaultySensor) of station 'Ego'", 0.5, 'raise TimeoutError("no answer',
         "TimeoutError: no answer of the device"),
        ({"fusion": "fusion_hear_raises"}, "fusion method 'fusion_hear_raises' (faulty:FusionHearRaises) of station",
         0.0, 'raise ZeroDivisionError("division', "ZeroDivisionError: division by zero"),
        ({"planner": "planner_static_raises"}, "planner 'planner_static_raises' (faulty:PlannerStaticRaises) of stat",
         0.0, "from a static method", "RuntimeError: from a static method"),
        ({"channel": "{model: faulty, fault: raises}"}, "channel 'faulty' (faulty:FaultyChannel)", 0.0,
         'raise OSError("no radio")', "OSError: no radio"),
        ({"criterion": "faulty: {fault: observe}"}, "criterion 'faulty' (faulty:FaultyCriterion)", 0.5,
         "this criterion fails to observe", "RuntimeError: this criterion fails to observe"),
        ({"criterion": "faulty: {fault: verdict}"}, "criterion 'faulty' (faulty:FaultyCriterion)", 1.05,
         'raise ValueError("no verdict")', "ValueError: no verdict"),
        ({"action": "raises"}, "action 'faulty.action' (faulty:FaultyAction) of ", 0.55,
         'raise LookupError("no such action")', "LookupError: no such action"),
        ({"condition": "raises"}, "condition 'faulty.condition' (faulty:FaultyCondition) of ", 0.0,
         'raise ArithmeticError("undefined")', "ArithmeticError: undefined"),
    ],
)  # fmt: skip
def test_exception_of_extension_names_it_with_time_and_line(
    package: Path, tmp_path: Path, extensions: dict[str, str], place: str, time: float, line: str, diagnostic: str
) -> None:
    error = error_of(tmp_path, **extensions)
    assert str(error.place).split(": ", 1)[1].startswith(place)
    assert (error.place.file, error.place.line) == (str(package / "faulty.py"), line_of(line))
    assert error.place.time == pytest.approx(time)
    assert error.description.startswith(diagnostic)


def test_exception_of_action_or_condition_names_its_place_in_the_scenario(package: Path, tmp_path: Path) -> None:
    text = write_scenario(tmp_path / "t.xosc").read_text().splitlines()
    for kind, element in (("action", 'type="faulty.action"'), ("condition", 'name="faulty.condition"')):
        line = next(number for number, content in enumerate(text, 1) if element in content)
        assert f"{tmp_path / 's.xosc'}:{line}" in str(error_of(tmp_path, **{kind: "raises"}))


@pytest.mark.parametrize(
    ("extensions", "subject", "line"),
    [
        ({"detector": "exits_when_built"}, "station 'Ego'", "sys.exit(0)"),
        ({"sensors": "{truth: {}, own: {kind: faulty_sensor, fault: built}}"}, "station 'Ego'",
         'raise OSError("no such device")'),
        ({"planner": "planner_arguments"}, "station 'Ego'", "def __init__(self, settings):"),
        ({"criterion": "faulty: {fault: built}"}, "", 'raise RuntimeError("not built")'),
    ],
)  # fmt: skip
def test_exception_of_constructor_names_extension_and_station_without_a_time(
    package: Path, tmp_path: Path, extensions: dict[str, str], subject: str, line: str
) -> None:
    error = error_of(tmp_path, **extensions)
    assert error.place.subject == subject
    assert error.place.time is None or error.place.time == 0.0
    assert error.place.line is not None
    assert line in (package / "faulty.py").read_text().splitlines()[error.place.line - 1]


def test_input_error_of_constructor_stays_an_input_error(package: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no weights; give weights"):
        run(tmp_path, detector="wrong_settings")


def test_exception_of_built_in_extension_names_it(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eidrive_scenario.perception.oracle._certain", lambda count: 1 / 0)
    error = error_of(tmp_path)
    assert str(error.place).endswith("detector 'oracle' (eidrive_scenario.perception.oracle:OracleDetector) "
                                     "of station 'Ego' at t = 0.000 s")  # fmt: skip
    assert error.description.startswith("ZeroDivisionError: division by zero")


def test_extension_error_survives_pickling(package: Path, tmp_path: Path) -> None:
    """Runs in other processes send it back."""
    error = error_of(tmp_path, detector="raises")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.place) == (str(error), error.place)


def test_keyboard_interrupt_of_extension_interrupts_the_run(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import faulty

    def interrupt(self: object, readings: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(faulty.Raises, "detect", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, detector="raises")


# Invalid results


@pytest.mark.parametrize(
    ("extensions", "diagnostic"),
    [
        ({"detector": "returns_nan"}, "detect returned boxes with the value nan (expected finite numbers)"),
        ({"detector": "negative_size"}, "detect returned a length, width or height with the value -4.5 (expected 0"),
        ({"detector": "returns_none"}, "detect returned None (expected Detections)"),
        ({"detector": "list_of_boxes"}, "detect returned an object of type list (expected Detections)"),
        ({"detector": "no_signals", "signals": True}, "signals returned None (expected SignalReadings)"),
        ({"tracker": "tracker_none"}, "update returned None (expected Detections)"),
        ({"fusion": "fusion_nan"}, "fuse returned boxes with the value inf (expected finite numbers)"),
        ({"fusion": "fusion_none"}, "fuse returned None (expected Detections)"),
        ({"fusion": "fusion_no_age"}, "max_report_age is None (expected a number of at least 0 s)"),
        ({"fusion": "fusion_short_batch"}, "fuse_batch returned an object of type list (expected a sequence with one"),
        (
            {"fusion": "fusion_merges_none", "detector": "lidar", "sensors": "{lidar: {}}"},
            "merge_readings returned None (expected Readings)",
        ),
        ({"planner": "planner_none"}, "plan returned None (expected Plan)"),
        ({"planner": "planner_nan"}, "plan returned speeds with the value nan (expected finite numbers)"),
        ({"planner": "planner_absurd"}, "plan returned speeds with the value 1e+300 (expected -10000 to 10000)"),
        ({"planner": "planner_one_point"}, "plan returned points of shape (1, 2) and speeds of shape (1,) (expected"),
        ({"planner": "planner_stands"}, "plan returned points 0 and 1 at the same place [0.0, 0.0] (expected a line)"),
        ({"controller": "controller_none"}, "control returned None (expected Control)"),
        ({"controller": "controller_nan"}, "control returned brake with the value nan (expected finite numbers)"),
        ({"controller": "controller_text"}, "control returned throttle as an object of type str (expected numbers)"),
        ({"channel": "{model: faulty, fault: nan}"}, "ValueError: delay of a message to 'Other' is invalid (got nan"),
        ({"channel": "{model: faulty, fault: inf}"}, "ValueError: delay of a message to 'Other' is invalid (got inf"),
        ({"channel": "{model: faulty, fault: none}"}, "ValueError: delay of a message to 'Other' is invalid (got None"),
        (
            {"channel": "{model: faulty, fault: arrives}"},
            "ValueError: delay of a message to 'Other' is invalid (got Tr",
        ),
        ({"channel": "{model: faulty, fault: array}"}, "ValueError: delay of a message to 'Other' is invalid (got [0."),
        ({"channel": "{model: faulty, fault: interval}"}, "min_message_interval returned nan (expected a finite"),
        ({"channel": "{model: faulty, fault: deliver}"}, "deliver returned None (expected a tuple of ReceivedMessage)"),
        ({"criterion": "faulty: {fault: none}"}, "verdict returned None (expected Verdict)"),
        ({"criterion": "faulty: {fault: nan}"}, "verdict returned passed = nan (expected True or False)"),
        ({"criterion": "faulty: {fault: value}"}, "verdict returned value = nan (expected a number or None)"),
        ({"criterion": "faulty: {fault: surrogate}"}, r"OSError: no file 'a\udcff'"),
        ({"criterion": "faulty: {fault: metrics}"}, "metrics returned None (expected numbers by name)"),
        ({"action": "none"}, "update returned no Status (expected RUNNING, SUCCESS or FAILURE)"),
        ({"condition": "none"}, "the condition returned None (expected True or False)"),
        ({"condition": "nan"}, "the condition returned nan (expected True or False)"),
    ],
)
def test_invalid_result_of_extension_names_it_and_what_is_expected(
    package: Path, tmp_path: Path, extensions: dict[str, str], diagnostic: str
) -> None:
    error = error_of(tmp_path, **extensions)
    assert error.description.startswith(diagnostic)
    assert error.place.value.startswith("faulty:")
    assert error.place.file == str(package / "faulty.py")
    assert error.place.line is not None


def test_action_that_leaves_its_actor_with_nan_is_named(package: Path, tmp_path: Path) -> None:
    error = error_of(tmp_path, action="nan")
    assert error.place.name == "faulty.action"
    assert error.description.startswith("update left actor 'Ego' with motion.speed = nan")


# Extensions that cannot be loaded


@pytest.mark.parametrize(
    ("detector", "diagnostic"),
    [
        ("yields", "detect is a generator or coroutine (expected a method that returns its result)"),
        ("few_arguments", "detect(self) cannot be called as Detector.detect(self, readings: 'Readings')"),
        ("lacks", " lacks detect"),
        ("no_detector", "is not a class derived from Detector (got NoDetector)"),
        ("a_function", "is not a class derived from Detector (got an object of type function)"),
        ("faulty_exits", "does not load: SystemExit: 0 (FOLDER/faulty_exits.py:2)"),
        ("faulty_syntax", "does not load: SyntaxError: invalid syntax (faulty_syntax.py, line 1)"),
        ("faulty_raises", "does not load: ZeroDivisionError: division by zero (FOLDER/faulty_raises.py:2)"),
        ("faulty_import", "does not load: No module named 'no_such_module' (FOLDER/faulty_import.py:1)"),
    ],
)
def test_extension_that_cannot_be_loaded_is_named(
    package: Path, tmp_path: Path, detector: str, diagnostic: str
) -> None:
    text = re.escape(diagnostic.replace("FOLDER", str(package)))
    with pytest.raises(RegistryError, match=rf"detector '{detector}' \(faulty\w*:\w+\).*{text}"):
        run(tmp_path, detector=detector)


def test_criterion_with_settings_of_another_type_is_named(package: Path, tmp_path: Path) -> None:
    expected = r"criterion 'plain_settings' .* \(expected a class derived from CriterionSettings\)"
    with pytest.raises(RegistryError, match=expected):
        run(tmp_path, criterion="plain_settings: {}")


def test_planner_with_another_constructor_is_named(package: Path, tmp_path: Path) -> None:
    error = error_of(tmp_path, planner="planner_arguments")
    assert error.place.name == "planner_arguments"
    assert "TypeError" in error.description


# Observers


class Watcher:
    """Observer that raises given exceptions."""

    def __init__(self, error: BaseException | None = None, close_error: BaseException | None = None) -> None:
        self.error, self.close_error = error, close_error

    def observe(self, frame: Frame) -> None:
        if self.error is not None:
            raise self.error

    def close(self) -> None:
        if self.close_error is not None:
            raise self.close_error


@pytest.mark.parametrize(
    "observer", [Watcher(ValueError("no")), Watcher(None, ValueError("no")), Watcher(SystemExit(0))]
)
def test_exception_of_observer_names_its_class(package: Path, tmp_path: Path, observer: Watcher) -> None:
    with pytest.raises(ExtensionError, match=r"observer 'Watcher'.*(ValueError: no|SystemExit: 0)") as caught:
        run_file(write_scenario(tmp_path / "s.xosc"), observers=[observer])
    assert caught.value.place.file == __file__


def test_exception_of_close_does_not_hide_the_one_of_the_run(package: Path, tmp_path: Path) -> None:
    observer = Watcher(ValueError("of the run"), ValueError("of close"))
    with pytest.raises(ExtensionError, match="of the run"):
        run_file(write_scenario(tmp_path / "s.xosc"), observers=[observer])


def test_observer_cannot_change_the_contents_of_frames(package: Path, tmp_path: Path) -> None:
    with Simulation(write_scenario(tmp_path / "s.xosc")) as simulation:
        frame, _ = simulation.tick()
    for content in (frame.steps, frame.signals, frame.appearances, frame.monitors, frame.routes, frame.trailers):
        assert isinstance(content, MappingProxyType)
    assert not frame.view.boxes.flags.writeable


def test_observer_that_is_a_class_is_refused(package: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="observer Watcher is a class"):
        run_file(write_scenario(tmp_path / "s.xosc"), observers=[Watcher])  # type: ignore[list-item]


def test_observer_without_close_is_refused(package: Path, tmp_path: Path) -> None:
    class Half:
        def observe(self, frame: Frame) -> None: ...

    with pytest.raises(InputError, match="observer Half has no method close"):
        run_file(write_scenario(tmp_path / "s.xosc"), observers=[Half()])  # type: ignore[list-item]
