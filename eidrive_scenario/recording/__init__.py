"""The frame; what a run leaves behind, and reading it again."""

from eidrive_scenario.recording.camera_pictures import CameraPictures
from eidrive_scenario.recording.criterion import Criterion, CriterionSettings, Verdict, judge, never_appeared
from eidrive_scenario.recording.csv_writer import CsvWriter
from eidrive_scenario.recording.explanation import Explanation
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import Recording, read_recording
from eidrive_scenario.recording.run_log import RunLog
from eidrive_scenario.recording.trace_hash import TraceHash

__all__ = [
    "CameraPictures",
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
    "judge",
    "never_appeared",
    "read_recording",
]
