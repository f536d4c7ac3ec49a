"""The frame; what a run leaves behind, and reading it again."""

from eidrive_scenario.recording.camera_images import CameraImageWriter
from eidrive_scenario.recording.criterion import (
    Criterion,
    CriterionSettings,
    Verdict,
    actor_never_present,
    evaluate_criteria,
)
from eidrive_scenario.recording.csv_writer import CsvWriter
from eidrive_scenario.recording.explanation import Explanation
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import Recording, read_recording
from eidrive_scenario.recording.run_log import RunLog
from eidrive_scenario.recording.trace_hash import TraceHash

__all__ = [
    "CameraImageWriter",
    "Criterion",
    "CriterionSettings",
    "CsvWriter",
    "Explanation",
    "Frame",
    "Recorder",
    "Recording",
    "RunLog",
    "TraceHash",
    "Verdict",
    "actor_never_present",
    "evaluate_criteria",
    "read_recording",
]
