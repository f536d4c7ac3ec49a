"""Arms and table of the corner cases."""

from __future__ import annotations

from eidrive_reports.corner_cases import ALONE, ARMS, jobs, table
from eidrive_reports.planner_scenes import SceneRun, time_lost

from eidrive_scenario.extensions.library import describe_scenarios, resolve_scenario
from eidrive_scenario.openscenario import load_scenario


def test_every_corner_case_has_arms_of_declared_parameters() -> None:
    names = {entry.name.split("/")[1] for entry in describe_scenarios() if entry.family == "corner_cases"}
    assert set(ARMS) == names
    for name, arms in ARMS.items():
        declared = load_scenario(resolve_scenario(f"corner_cases/{name}")).parameters
        assert all(set(parameters) <= set(declared) for parameters in arms.values())


def test_jobs_contain_the_arm_without_messages_and_all_seeds() -> None:
    found = jobs(["jammer"], [1, 2])
    assert len(found) == 2 * (1 + len(ARMS["jammer"]))
    assert [job.seed for job in found if job.arm == ALONE] == [1, 2]
    assert dict(found[0].settings.parameters or {}) == {"Participants": "none"}


def test_time_lost_is_that_beyond_the_distance_at_target_speed() -> None:
    """At 10 m/s nothing is lost; from 10 to 0 m/s in 2 s, 10 m are 1 s at 10 m/s."""
    assert time_lost([1.0, 2.0, 3.0], [10.0, 10.0, 10.0], 10.0) == 0.0
    assert time_lost([1.0, 2.0, 3.0], [10.0, 5.0, 0.0], 10.0) == 1.0


def test_table_averages_runs_that_arrived_and_brakings_without_collision() -> None:
    runs = [
        SceneRun("corner_cases/a", "none", 1, True, True, False, 9.0, 30.0, 7.0),
        SceneRun("corner_cases/a", "none", 2, False, False, True, 2.0, 6.0, 8.0),
        SceneRun("corner_cases/a", "unit", 1, False, False, True, -0.01, 2.0, None),
        SceneRun("corner_cases/a", "fault", 1, True, True, False, 3.0, 30.0, None),
    ]
    assert table(runs).splitlines()[2:] == [
        "| `a` | none | 1 of 2 | 1 of 2 | 7.5 | 2.0 | 6.0 |",
        "|  | unit | 0 of 1 | 1 of 1 | - | 0.0 | 2.0 |",
        "|  | fault | 1 of 1 | 0 of 1 | - | - | - |",
    ]
