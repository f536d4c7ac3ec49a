"""Entity selections as senders of messages: property `cooperates_with` and option `--cooperate`."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenario_1 import ONE, FrameCollector, edited, simulate

from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.errors import InputError

SELECTION = '<EntitySelection name="{}"><Members>{}</Members></EntitySelection>'
MASTS = SELECTION.format("masts", '<EntityRef entityRef="RSU"/>')
NESTED = SELECTION.format("all_masts", '<EntityRef entityRef="masts"/><EntityRef entityRef="Firetruck"/>')
BY_TYPE = SELECTION.format("objects", '<ByType objectType="miscellaneous"/>')
TRUCKS = SELECTION.format("trucks", '<EntityRef entityRef="Firetruck"/>')
BOTH = SELECTION.format("both", '<EntityRef entityRef="Ego"/><EntityRef entityRef="RSU"/>')
RING = SELECTION.format("ring", '<EntityRef entityRef="ring"/>')


def listening_to(folder: Path, senders: str, *selections: str) -> Path:
    return edited(folder, ("$Participants", senders), ("</Entities>", "".join(selections) + "</Entities>"))


@pytest.mark.parametrize(
    ("senders", "receives"),
    [("masts", True), ("all_masts", True), ("[objects]", True), ("none", False), ("masts, RSU", True), ("both", True)],
)
def test_selection_stands_for_its_stations(tmp_path: Path, senders: str, receives: bool) -> None:
    """A station in its own selection is no error, and receives nothing from itself."""
    file = listening_to(tmp_path, senders, MASTS, NESTED, BY_TYPE, BOTH)
    collector = FrameCollector()
    result = simulate(file, "ideal", collector, time_limit=1.0)
    links = {(event.sender, event.receiver) for frame in collector.frames for event in frame.links}
    assert links == ({("RSU", "Ego")} if receives else set())
    named = {*result.settings.stations["Ego"]["cooperates_with"]} - {"Ego"}
    assert named == ({"RSU"} if receives else set())


def test_same_run_by_selection_and_by_name(tmp_path: Path) -> None:
    by_name = simulate(ONE, "error_30pct", time_limit=5.0)
    by_selection = simulate(listening_to(tmp_path, "masts", MASTS), "error_30pct", time_limit=5.0)
    assert by_selection.trace_hash == by_name.trace_hash


def test_option_accepts_a_selection(tmp_path: Path) -> None:
    file = listening_to(tmp_path, "none", MASTS)
    collector = FrameCollector()
    simulate(file, "ideal", collector, time_limit=1.0, cooperate=("masts",))
    assert {event.sender for frame in collector.frames for event in frame.links} == {"RSU"}


@pytest.mark.parametrize(
    ("senders", "message"),
    [
        ("mast", "'mast', which is no station; did you mean 'masts'"),
        ("trucks", "'trucks', which is a selection without stations; give one of its members a driving stack"),
        ("ring", "selection 'ring' is a member of itself"),
    ],
)
def test_selection_without_stations_is_an_error(tmp_path: Path, senders: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(listening_to(tmp_path, senders, MASTS, TRUCKS, RING), "ideal", time_limit=0.1)
    if senders == "trucks":
        with pytest.raises(InputError, match=r"RunSettings\.cooperate: selection without stations 'trucks'; give one"):
            simulate(listening_to(tmp_path, "none", TRUCKS), "ideal", time_limit=0.1, cooperate=("trucks",))


def test_check_reports_only_selections_that_select_nothing(tmp_path: Path) -> None:
    file = listening_to(tmp_path, "none", MASTS, TRUCKS)
    found = [one.message for one in check_scenario(file).warnings if "selection" in one.message]
    assert found == ["selection 'trucks' is never used"]
