"""Report on cooperative perception, from records with known detections, and shapes of known curves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from eidrive_reports.cooperative_perception.receivers import ARMS, AXES, POSE_AND_LATENCY, Condition, Study, on_axis
from eidrive_reports.cooperative_perception.scores import PerceptionRecord, Tally
from eidrive_reports.reproduction import learned, perception, pose_errors
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.figures import draw
from eidrive_reports.reproduction.layout import Row
from eidrive_reports.reproduction.perception_shapes import crossing, shapes
from eidrive_reports.reproduction.perception_tables import records
from eidrive_reports.reproduction.provenance import job_digest

from eidrive_scenario.simulation import RunSettings, Simulation

CORRECT = 0b11_001_001_001
"""Code of a detection that is correct at all overlaps and for both truths, in the first range."""


def tally(detected: int, size: float) -> Tally:
    """Return this number of correct detections, and hidden objects of which half are found."""
    scores, codes = np.full(detected, 60_000, dtype="<u2"), np.full(detected, CORRECT, dtype="<u2")
    return Tally(scores.tobytes(), codes.tobytes(), ((2, 0, 0), (2, 0, 0), (1, 0, 0)), size)


def episodes(study: Study) -> list[Episode]:
    """Return two runs with ten objects: eight found with features, seven with other messages, four without."""
    tallies = {
        condition.name: tally(
            8 if ARMS[condition.arm].shares == "features" else 7 if ARMS[condition.arm].cooperates else 4,
            {"early": 0.5, "none": 0.0}.get(condition.arm, 0.01),
        )
        for condition in study.conditions
    }
    measured = PerceptionRecord(5, (10, 0, 20), (9, 0, 0), (4, 0, 0), tallies)
    return [
        Episode(scene, "lidar", seed, "0" * 16, "", 8.0, 40.0, {}, perception=measured)
        for scene in perception.SCENES
        for seed in (1, 2)
    ]


@pytest.mark.statistical
def test_report_states_precision_recall_and_volume(tmp_path: Path) -> None:
    report = perception.report(episodes(perception.STUDY), perception.DETECTORS)
    data = report.data()
    arms = {str(row["arm"]): row for row in data["perception_arms"]}
    assert {name: row["ap_50"] for name, row in arms.items()} == pytest.approx(
        {name: 7 / 30 if ARMS[name].cooperates else 4 / 30 for name in perception.STUDY.arms}
    )
    assert arms["none"]["ap_50_hit"] == pytest.approx(4 / 9)
    assert arms["none"]["ap_50_range_1"] is None, "no object in this range"
    assert {row["recall"] for row in data["perception_hidden"] if row["iou"] == 0.7} == {0.25}
    text = report.markdown()
    assert "Points need 50 times the bytes of boxes (0.500 and 0.010 MB/s over all links)" in text
    assert "4 scenes of the library with 2 seeds each" in text
    assert "40 frames with 240 objects. The lidar of any station hits 72 of them; 32 are hidden" in text
    path = draw("perception", report, tmp_path)
    assert path is not None
    assert path.stat().st_size > 10_000


def test_report_on_learned_fusion_states_gains_within_the_range_of_features(tmp_path: Path) -> None:
    """Objects beyond 50 m do not count: 8 of 10 are found with features, and 7 with boxes."""
    report = learned.report(episodes(learned.STUDY), learned.DETECTORS)
    data = report.data()
    arms = {str(row["arm"]): row["ap_70"] for row in data["learned_arms"]}
    assert arms.keys() == ARMS.keys()
    assert (arms["none"], arms["covariance_intersection"], arms["attention"]) == pytest.approx((0.4, 0.7, 0.8))
    gains = data["learned_gains"]
    assert {(row["over"], round(float(row["gain_70"] or 0.0), 9)) for row in gains} == {
        ("covariance_intersection", 0.1),
        ("covariance_intersection, aligned", 0.1),
        ("average", 0.1),
    }
    assert all(row["low_70"] == pytest.approx(0.1) for row in gains), "equal runs have no spread"
    text = report.markdown()
    assert "The expected gain of +0.03 is reached by attention, attention, aligned, where2comm." in text
    assert "40 frames with 80 objects, of which the lidar of any station hits 72 and 32 are hidden" in text
    path = draw("learned", report, tmp_path)
    assert path is not None
    assert path.stat().st_size > 10_000


def test_learned_fusion_uses_scenes_and_faults_of_the_part_perception() -> None:
    cases = learned.cases(learned.DETECTORS)
    assert [case.scenario for case in cases] == list(perception.SCENES)
    assert {case.settings.detector for case in cases} == {"pillars"}
    assert set(learned.STUDY.axes) < set(perception.STUDY.axes)


def test_table_of_gains_has_line_per_fault_and_column_per_arm() -> None:
    """8 of 10 objects with features and 7 with boxes: a gain of 0.1 at each of the 12 faults."""
    table = learned.gain_table(tuple(learned.gain_rows(records(episodes(learned.STUDY)))), "average")
    assert [column.title for column in table.columns][2:] == [f"{arm} (95 %)" for arm in learned.INTERMEDIATE]
    assert len(table.rows) == 1 + sum(len(AXES[axis][2]) - 1 for axis in learned.STUDY.axes)
    assert {column.text(row) for row in table.rows for column in table.columns[2:]} == {"+0.100 (+0.10 to +0.10)"}


@pytest.mark.parametrize("study", [perception.STUDY, learned.STUDY], ids=lambda study: study.name)
def test_conditions_are_part_of_the_digest(study: Study) -> None:
    conditions = study.conditions
    settings = RunSettings(detector="lidar")
    digests = {job_digest("coop/scenario_4", settings, conditions=conditions[:count]) for count in (0, 1, 2)}
    assert len(digests) == 3
    assert len({condition.name for condition in conditions}) == len(conditions)


def curves(study: Study, arms: dict[str, list[float]], *, steeper: float) -> list[Row]:
    """Return curves that are equal on all axes; at 0.7 they lose `steeper` times as much as at 0.5."""
    rows: list[Row] = []
    for axis in study.axes:
        values = AXES[axis][2]
        for arm in study.compared:
            course = np.interp(values, np.linspace(0.0, max(values), len(arms[arm])), arms[arm])
            for overlap, factor in ((0.3, 1.0), (0.5, 1.0), (0.7, steeper)):
                for value, precision in zip(values, course.tolist(), strict=True):
                    ap = max(0.0, course[0] - factor * (course[0] - precision))
                    rows.append({"arm": arm, "axis": axis, "value": value, "range": "all", "iou": overlap, "ap": ap})
    return rows


def volume(arm: str, size: float, ap: float, share: float | None = None) -> Row:
    encoding = None if share is None else "int8"
    fields = {"cell": None, "share": share, "encoding": encoding, "megabytes_per_second": size, "ap_50": ap}
    return {"arm": arm, **fields}


VOLUMES: list[Row] = [
    volume(arm, size, ap)
    for arm in ("average", "covariance_intersection", "early")
    for size, ap in ((1.0, 0.7), (0.5, 0.68), (0.2, 0.5))
]
MASKS: list[Row] = [
    volume("none", 0.0, 0.4),
    volume("features only", 1.7, 0.72, 1.0),
    volume("features only, 5 %", 0.09, 0.71, 0.05),
    volume("features only, 0.02 %", 0.01, 0.62, 0.0002),
]
PUBLISHED = {
    "none": [0.4, 0.4],
    "average": [0.6, 0.1, 0.05],
    "covariance_intersection": [0.65, 0.3, 0.2],
    "covariance_intersection, aligned": [0.65, 0.5, 0.3],
    "early": [0.7, 0.3, 0.2],
    "attention, aligned": [0.72, 0.72, 0.6],
    "attention": [0.72, 0.71, 0.6],
    "where2comm": [0.71, 0.7, 0.6],
}
"""Curves with the shapes of the literature."""


@pytest.mark.parametrize("study", [perception.STUDY, learned.STUDY], ids=lambda study: study.name)
def test_all_shapes_hold_for_curves_of_the_literature(study: Study) -> None:
    broken = [
        row for row in shapes(study, curves(study, PUBLISHED, steeper=1.5), VOLUMES + MASKS) if row["holds"] == "no"
    ]
    assert not broken


@pytest.mark.parametrize(
    ("changes", "steeper", "broken"),
    [
        ({"none": [0.4, 0.39]}, 1.5, "no fusion is flat over all axes"),
        ({"average": [0.6, 0.55, 0.5]}, 1.0, "is below no fusion at a pose error of 0.2 m and 0.1 s"),
        ({"attention": [0.72, 0.1, 0.05]}, 1.5, "falls by a larger share than intermediate"),
        ({}, 1.0, "AP 0.5 falls later than AP 0.7"),
        ({"covariance_intersection": [0.6, 0.05, 0.0]}, 1.5, "compensated latency is at least as good"),
        ({"covariance_intersection, aligned": [0.65, 0.2, 0.2]}, 1.5, "aligned poses are at least as good"),
        ({"early": [0.5, 0.3, 0.2]}, 1.5, "no fusion < late (average) < early"),
        ({"average": [0.6, 0.6, 0.59]}, 1.5, "of whole messages is not mild"),
        ({"attention": [0.72, 0.3, 0.0]}, 1.5, "of the frames of features is milder"),
        ({"where2comm": [0.59, 0.59, 0.59]}, 1.5, "late (average) < intermediate"),
        ({"attention": [0.64, 0.64, 0.64]}, 1.5, "early and intermediate differ by at most"),
        ({"attention": [0.76, 0.76, 0.76]}, 1.5, "early and intermediate differ by at most"),
    ],
)
def test_shape_does_not_hold_for_other_curves(changes: dict[str, list[float]], steeper: float, broken: str) -> None:
    study = learned.STUDY
    rows = shapes(study, curves(study, {**PUBLISHED, **changes}, steeper=steeper), VOLUMES + MASKS)
    assert any(broken in str(row["shape"]) and row["holds"] == "no" for row in rows)


def test_change_within_the_plateau_is_no_fall() -> None:
    """Curves that lose 0.04 at most do not fall at either overlap, whichever loses more."""
    flat = {arm: [course[0], course[0] - 0.04] for arm, course in PUBLISHED.items() if arm != "none"}
    rows = shapes(learned.STUDY, curves(learned.STUDY, {**PUBLISHED, **flat}, steeper=0.5), VOLUMES + MASKS)
    (row,) = (row for row in rows if "falls later" in str(row["shape"]))
    assert (row["holds"], str(row["measured"]).split(" curves")[0]) == ("yes", "0 of 0")


def test_shapes_over_the_share_of_the_cells() -> None:
    """A loss of 0.06 at 5 % is no plateau; without a loss at 0.02 % the curve does not fall."""
    study = learned.STUDY
    masks = [
        volume("none", 0.0, 0.4),
        volume("features only", 1.7, 0.72, 1.0),
        volume("features only, 5 %", 0.1, 0.66, 0.05),
        volume("features only, 0.02 %", 0.01, 0.66, 0.0002),
    ]
    rows = shapes(study, curves(study, PUBLISHED, steeper=1.5), VOLUMES + masks)
    assert [row["holds"] for row in rows if "of the cells" in str(row["shape"])] == ["no", "no"]


def test_axis_with_two_faults_is_noisy_setting_of_v2xset() -> None:
    """OpenCOOD: 0.2 m on x and y, and 100 ms."""
    condition = on_axis("average", POSE_AND_LATENCY, 0.2)
    assert (condition.deviation, condition.latency) == (0.2, 0.1)
    assert on_axis("average", POSE_AND_LATENCY, 0.0) == Condition("average")


def test_crossing_is_interpolated() -> None:
    assert crossing({0.0: 0.8, 0.2: 0.6, 0.4: 0.2}, 0.5) == pytest.approx(0.25)
    assert crossing({0.0: 0.8, 0.2: 0.6}, 0.5) is None
    assert crossing({0.0: 0.4, 0.2: 0.2}, 0.5) == 0.0


def test_closed_loop_rows_summarize_runs_of_an_arm() -> None:
    """Two runs of one arm: least speeds 9.9 and 6.1 m/s, mean 8.0; one of them brakes twice and collides."""
    arm = next(arm for arm in pose_errors.arms() if arm.deviation == 0.2)
    drives = [
        Episode(
            pose_errors.SCENE,
            arm.name,
            seed,
            "0" * 16,
            "",
            17.0,
            5.0,
            {"min_speed.Ego": speed, "false_braking.Ego.brakings": brakings, "collision.count": brakings / 2},
        )
        for seed, speed, brakings in ((1, 9.9, 0.0), (2, 6.1, 2.0))
    ]
    (row,) = pose_errors.rows(drives)
    assert (row["detector"], row["tracker"], row["deviation"]) == (arm.detector, arm.tracker, 0.2)
    assert (row["runs"], row["least_speed"], row["brakings"], row["collisions"]) == (2, 6.1, 2, 1)
    assert row["mean_least_speed"] == pytest.approx(8.0)


def test_closed_loop_covers_each_tracker_and_fusion_at_all_errors() -> None:
    drives = pose_errors.cases(perception.DETECTORS)
    assert len({case.arm for case in drives}) == len(drives)
    cells = {(arm.tracker, arm.fusion, arm.deviation) for arm in pose_errors.arms() if arm.detector == "oracle"}
    expected = {
        (tracker, fusion, deviation)
        for tracker in ("none", "cv", "ctrv")
        for fusion in ("average", "covariance_intersection")
        for deviation in (0.0, 0.05, 0.2, 0.4, 0.6)
    }
    assert cells == expected
    assert {arm.fusion for arm in pose_errors.arms() if arm.detector == "lidar"} >= {"early"}
    assert pose_errors.cases(()) == [case for case in drives if not case.arm.startswith("lidar")]


def test_closed_loop_receives_messages() -> None:
    arm = next(arm for arm in pose_errors.arms() if arm.deviation == 0.2)
    with Simulation(pose_errors.SCENE, settings=arm.settings) as simulation:
        assert any(simulation.tick()[0].steps["Ego"].inbox for _ in range(30))
