"""Traffic signals in simulation runs and in their recordings."""

from __future__ import annotations

from pathlib import Path

import pytest
from storyboard_xml import global_xml
from street_scene import NOTHING, after
from whole_run import Run

from eidrive_scenario.errors import InputError
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.recording.trace_hash import TraceHash

LIGHTS = """<TrafficSignals><TrafficSignalController name="crossing">
  <Phase name="go" duration="0.4"><TrafficSignalState trafficSignalId="7" state="off;off;on"/></Phase>
  <Phase name="stop" duration="0.6"><TrafficSignalState trafficSignalId="7" state="on;off;off"/></Phase>
  </TrafficSignalController></TrafficSignals>"""


@pytest.mark.element("TrafficSignalControllerAction", "TrafficSignalControllerCondition", "TrafficSignalController")
def test_signal_phases_are_executed_and_recorded(run: Run, tmp_path: Path) -> None:
    go = '<ByValueCondition><TrafficSignalControllerCondition trafficSignalControllerRef="crossing" phase="stop"/>'
    red = '<ByValueCondition><TrafficSignalCondition name="7" state="ON;OFF;OFF"/></ByValueCondition>'
    restart = global_xml(
        "<InfrastructureAction><TrafficSignalAction><TrafficSignalControllerAction "
        'trafficSignalControllerRef="crossing" phase="go"/></TrafficSignalAction></InfrastructureAction>'
    )
    played = run(
        1.5,
        ("Ego", NOTHING, f"{go}</ByValueCondition>"),
        ("Ego", restart, after(0.62)),
        ("Ego", NOTHING, red),
        signals=LIGHTS,
    )
    states = [frame.signals["7"] for frame in played.frames]
    green, stop = "off;off;on", "on;off;off"
    assert states == [green] * 8 + [stop] * 5 + [green] * 8 + [stop] * 10
    assert played.begun("event 0") == pytest.approx([0.4])
    assert played.begun("event 2") == pytest.approx([0.4])
    assert any("no signal '7'" in warning for warning in played.result.warnings)
    recorder = Recorder(tmp_path / "run.mcap", metadata={})
    live, read = TraceHash(), TraceHash()
    for frame in played.frames:
        recorder.observe(frame)
        live.observe(frame)
    recorder.close()
    for frame in read_recording(tmp_path / "run.mcap").frames():
        read.observe(frame)
    assert [f.signals["7"] for f in read_recording(tmp_path / "run.mcap").frames()] == states
    assert read.hexdigest() == live.hexdigest() == played.result.trace_hash


@pytest.mark.parametrize(
    ("phase", "expected"), [("gone", "did you mean 'go'"), ("stop", "")], ids=["unknown phase", "known phase"]
)
def test_unknown_signal_phase_is_rejected_before_the_run(run: Run, phase: str, expected: str) -> None:
    reference = f'trafficSignalControllerRef="crossing" phase="{phase}"'
    action = global_xml(
        f"<InfrastructureAction><TrafficSignalAction><TrafficSignalControllerAction {reference}/></TrafficSignalAction>"
        "</InfrastructureAction>"
    )
    condition = f"<ByValueCondition><TrafficSignalControllerCondition {reference}/></ByValueCondition>"
    for steps in ((("Ego", action),), (("Ego", NOTHING, condition),)):
        if expected:
            with pytest.raises(InputError, match=expected):
                run(0.2, *steps, signals=LIGHTS)
        else:
            assert run(0.2, *steps, signals=LIGHTS).result.end_reason == "stop trigger"
