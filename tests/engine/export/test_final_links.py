"""Outcomes of the messages of the last tick of a run: in its result, its log, its recording, and the files of these."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from foxglove_topics import decoded
from written_recording import Body, view, write_run

from eidrive_scenario.experiments.judgement import judge_recording
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.export.foxglove.writer import write_foxglove
from eidrive_scenario.export.recorded_run import open_run
from eidrive_scenario.export.tables import write_csv
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.reporting.replay.frame_data import replay_data
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.simulation.recorded_outcome import recorded_outcome
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_statistics import LinkStatistics


@pytest.mark.parametrize("channel", ["80211p_urban", "ideal"])
def test_outcomes_of_all_ticks_are_those_that_the_statistics_count(tmp_path: Path, channel: str) -> None:
    """By definition sent = received + lost + in_flight; a radio decides messages after their tick."""
    log = tmp_path / "run.log"
    settings = RunSettings(
        channel=channel, criteria={"packet_reception_ratio": {"sender": "RSU", "receiver": "Ego"}}, time_limit=1.0
    )
    result = run_and_save("coop/scenario_1", settings=settings, out=tmp_path, log=log)
    link: LinkStatistics = result.links["RSU", "Ego"]
    known = link.received + link.lost
    (ratio,) = (one for one in result.criteria if one.name == "packet_reception_ratio")
    assert ratio.value == pytest.approx(link.received / known)

    recording = read_recording(tmp_path)
    frames, outcome = list(recording.frames()), recorded_outcome(recording)
    assert outcome is not None
    assert outcome.final_links == result.final_links
    assert (len(result.final_links) > 0) == (channel == "80211p_urban")
    assert sum(len(frame.links) for frame in frames) + len(outcome.final_links) == known
    assert judge_recording(tmp_path).criteria == result.criteria

    write_csv(open_run(tmp_path), tmp_path / "t.csv", "messages")
    with (tmp_path / "t.csv").open(newline="") as stream:
        assert [row["outcome"] for row in csv.DictReader(stream)].count("lost") == link.lost
    data = replay_data(frames, final_links=outcome.final_links)
    assert len(data["messages"]) == known
    lines = [line for line in log.read_text().splitlines() if "RSU to Ego" in line]
    assert len(lines) == (known if channel == "80211p_urban" else 0)


def test_repeated_results_count_final_links_once() -> None:
    settings = RunSettings(
        channel="80211p_urban", criteria={"packet_reception_ratio": {"receiver": "Ego"}}, time_limit=0.5
    )
    with Simulation("coop/scenario_1", settings=settings) as simulation:
        first = simulation.run()
        assert first.final_links
        assert simulation.result().criteria == first.criteria


def test_messages_to_a_departed_station_are_lost_in_all_files(tmp_path: Path) -> None:
    """B is present up to 0.1 s. Messages arrive at its last instant, after it, and 0 s after they were sent in it."""
    bodies: dict[str, Body] = {"A": {}, "B": {}}
    events = [
        LinkEvent("A", "B", number, sent, "delivered", arrives, "", 100)
        for number, (sent, arrives) in enumerate([(0.0, 0.1), (0.0, 0.3), (0.1, 0.1)])
    ]
    frames = [
        Frame(view(bodies)),
        Frame(view(bodies, 1), links=tuple(events[:2])),
        Frame(view({"A": {}}, 2), links=tuple(events[2:])),
        Frame(view(bodies, 3)),
    ]
    run = write_run(tmp_path, frames)
    write_foxglove(run, tmp_path / "f.mcap")
    topics, _ = decoded(tmp_path / "f.mcap")
    assert [type(entry).Level.Name(entry.level) for entry in topics["/log/messages"]] == ["DEBUG", "WARNING", "WARNING"]
    assert [entry.message for entry in topics["/log/messages"]][1:] == [
        f"A to B, message {number}: lost: absent" for number in (1, 2)
    ]
    lines = [entity.metadata[0].value for scene in topics["/messages"] for entity in scene.entities]
    assert lines == ["delivered", "absent"]

    write_csv(run, tmp_path / "t.csv", "messages")
    with (tmp_path / "t.csv").open(newline="") as stream:
        rows = [(row["outcome"], row["arrives"], row["reason"]) for row in csv.DictReader(stream)]
    assert rows == [("delivered", "0.1", ""), ("lost", "", "absent"), ("lost", "", "absent")]
    data = replay_data(frames)
    assert [row[3:5] for row in data["messages"]] == [[0.1, ""], [None, "absent"], [None, "absent"]]
    assert data["lost"] == [1, 2]
