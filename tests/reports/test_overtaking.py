"""Scenes of overtaking, and drives through some of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from eidrive_reports.overtaking import (
    BEHIND,
    GAPS,
    HEADWAY,
    OBSTACLES,
    START,
    OvertakingRun,
    drive_table,
    gap_scene,
    gap_table,
    random_scene,
    run_of,
    write,
    write_road,
)

from eidrive_scenario.experiments.repetitions import Job
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.run_options import RunSettings


@pytest.mark.parametrize("kind", OBSTACLES)
def test_gap_is_the_time_between_cars_at_one_place(kind: str) -> None:
    scene = gap_scene(kind, 9.0, 1)
    first, second, third, *column = scene.oncoming
    assert (second.x - first.x) / first.speed == pytest.approx(HEADWAY)
    assert (third.x - second.x) / first.speed == pytest.approx(9.0)
    assert (column[0].x - third.x) / first.speed == pytest.approx(HEADWAY)
    meeting = (first.x - scene.obstacle_x) / (first.speed + scene.obstacle.speed)
    assert scene.obstacle_x + scene.obstacle.speed * meeting - (START + scene.speed * meeting) == pytest.approx(BEHIND)


def test_random_scenes_are_valid_and_their_gaps_within_bounds(tmp_path: Path) -> None:
    write_road(tmp_path)
    for seed in range(1, 9):
        scene = random_scene(seed)
        headways = [(b.x - a.x) / a.speed for a, b in zip(scene.oncoming, scene.oncoming[1:], strict=False)]
        assert GAPS[0] <= min(headways) <= max(headways) <= GAPS[-1]
        path = tmp_path / f"{seed}.xosc"
        write(scene, path)
        assert len(load_scenario(path).entities) == 1 + scene.obstacle.number + len(scene.oncoming)
    assert random_scene(1) == random_scene(1) != random_scene(2)


def drive(folder: Path, kind: str, gap: float) -> OvertakingRun:
    write_road(folder)
    write(gap_scene(kind, gap, 1), folder / "scene.xosc")
    contact = {"collision": {"of": "Ego", "name": "contact"}}
    return run_of(Job(str(folder / "scene.xosc"), f"{kind}, {gap:g} s", 1, RunSettings(criteria=contact)))


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("kind", "gap", "accepted"), [("bicycle", 4, False), ("bicycle", 20, True), ("bus at a stop", 20, True)]
)
def test_short_gap_is_refused_and_long_gap_accepted(tmp_path: Path, kind: str, gap: float, accepted: bool) -> None:
    run = drive(tmp_path, kind, gap)
    assert run.accepted == accepted
    assert not run.collided
    assert run.stood == 0.0


@pytest.mark.statistical
@pytest.mark.parametrize("seed", range(101, 107))
def test_vehicle_never_stands_in_the_oncoming_lane_beside_free_space(tmp_path: Path, seed: int) -> None:
    """All cars between which it can overtake have passed after 46 s, unless it has overtaken before."""
    write_road(tmp_path)
    write(random_scene(seed), tmp_path / "scene.xosc")
    settings = RunSettings(criteria={"collision": {"of": "Ego", "name": "contact"}}, time_limit=50.0)
    run = run_of(Job(str(tmp_path / "scene.xosc"), "oracle", seed, settings))
    assert min(run.overtook, run.met) < 46.0
    assert run.idle == 0.0
    assert not run.collided


def test_tables_count_accepted_gaps_and_drives() -> None:
    runs = [
        OvertakingRun("bicycle, 4 s", 1, False, False, 9.0, 8.0, 0.0, 0.0, 1.5),
        OvertakingRun("bicycle, 5 s", 1, True, True, 7.0, 8.0, 0.0, 0.0, 4.5),
    ]
    line = gap_table(runs).splitlines()[2]
    assert line.startswith("| bicycle | 0 of 1 | 1 of 1 | 0 of 0 |")
    assert line.endswith("| 1 | 4.5 |")
    drives = [
        OvertakingRun("lidar", 1, False, False, 9.0, 8.0, 2.0, 0.5, 1.5),
        OvertakingRun("lidar", 2, True, False, float("inf"), 8.0, 1.0, 0.0, 4.5),
    ]
    assert drive_table(drives).splitlines()[2] == "| `lidar` | 2 | 1 | 0 | 50.0 % | 2 | 1 | 1 | 4.5 |"
