"""Shapes that curves of cooperative perception have in the literature, checked on measured rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from eidrive_reports.cooperative_perception.receivers import ARMS, AXES, POSE_AND_LATENCY, Study
from eidrive_reports.reproduction.layout import DataTable, Row, Section, groups, number, plain, where
from eidrive_reports.reproduction.perception_tables import StudyResult

ALONE = "none"
LATE, FILTERED = "average", "covariance_intersection"
"""Late fusion of the boxes of one scan, as in the literature, and of those of all scans, predicted to the current
time."""
FEATURES_ONLY = "features only"
"""Prefix of the arms without boxes of others. With them, boxes replace the features that are not sent."""
TOLERANCE = 1e-9
"""Largest difference of equal average precisions."""
PLATEAU = 0.05
"""Largest decrease of the average precision that counts as a plateau; a curve falls where it is lower."""
MILD = 0.8
"""Least share of the benefit that remains after a mild loss."""
FEW_CELLS = 0.05
"""Share of the cells of a map down to which the average precision is on a plateau: a few per cent."""
_Curve = Mapping[float, float]
_Curves = Mapping[tuple[str, str, float], _Curve]
SHAPE_NOTES = (
    f"The shapes are those of the literature. Late fusion there has no memory, as `{LATE}` here; `{FILTERED}` also "
    f"uses earlier scans. A curve falls where it is more than {PLATEAU:g} below its value without faults: smaller "
    "changes are within the 95 % intervals.",
)
FEATURE_NOTES = (
    "The literature calls the loss of cells mild and that of whole messages not, without a probability: the two are "
    "compared at the largest one. It sends features without boxes: so the curve over the share of the cells is that of "
    f"`{FEATURES_ONLY}`, as boxes replace features that are not sent.",
)
"""Paragraphs about the shapes of all studies, and about those of features."""
SHAPE_COLUMNS = (plain("shape"), plain("holds"), plain("measured"))


def shape_section(result: StudyResult) -> Section:
    """Return the section of the report about the shapes."""
    study = result.study
    notes = (*SHAPE_NOTES, *(FEATURE_NOTES if "attention" in study.compared else ()))
    table = DataTable(f"{study.name}_shapes", SHAPE_COLUMNS, shapes(study, result.curves, result.volumes))
    return Section("Shapes of the curves", notes, table)


def shapes(study: Study, curves: Sequence[Row], volumes: Sequence[Row]) -> tuple[Row, ...]:
    """Return for each shape whether it holds, with the numbers.

    curves  rows with arm, axis, value, range, iou and ap; volumes: rows with arm, share, megabytes_per_second and ap_50
    """
    by_curve = {
        key: {row["value"]: number(row, "ap") for row in mine}
        for key, mine in groups(where(curves, range="all"), "arm", "axis", "iou").items()
    }
    sending = [arm for arm in study.compared if ARMS[arm].cooperates]
    intermediate = [arm for arm in sending if ARMS[arm].shares == "features"]
    others = [arm for arm in sending if arm not in intermediate]
    rows = [
        _flat_alone(by_curve),
        _late_below_alone(by_curve, intermediate),
        _strict_falls_first(by_curve, sending, [axis for axis in study.axes if axis != POSE_AND_LATENCY]),
        _loss_of_messages(by_curve, others),
        _compensated(by_curve),
        *(_aligned(by_curve, arm, study.axes) for arm in sending if f"{arm}, aligned" in sending),
        *_plateaus(volumes, others),
        _order(by_curve, "early", [LATE, "early"]),
    ]
    if intermediate:
        rows += [
            _loss_of_frames(by_curve, intermediate, others),
            *_masks(volumes),
            _order(by_curve, "intermediate", [LATE, *intermediate]),
            _early_and_intermediate(by_curve, intermediate),
        ]
    return tuple(rows)


def _row(shape: str, holds: bool, measured: str) -> Row:
    return {"shape": shape, "holds": "yes" if holds else "no", "measured": measured}


def _flat_alone(curves: _Curves) -> Row:
    worst = max(max(curve.values()) - min(curve.values()) for (arm, _, _), curve in curves.items() if arm == ALONE)
    return _row("no fusion is flat over all axes", worst <= TOLERANCE, f"largest change {worst:.3f}")


def crossing(curve: _Curve, limit: float) -> float | None:
    """Return the first value, linear in between, at which a curve is below a limit; None if it never is."""
    before: tuple[float, float] | None = None
    for value, precision in sorted(curve.items()):
        if precision < limit:
            if before is None:
                return value
            share = (before[1] - limit) / (before[1] - precision)
            return before[0] + share * (value - before[0])
        before = value, precision
    return None


def _late_below_alone(curves: _Curves, intermediate: Sequence[str]) -> Row:
    """Published for the noisy setting of V2XSet; intermediate fusion is less brittle there."""
    fault = max(AXES[POSE_AND_LATENCY][2])
    arms = [LATE, *intermediate]
    strict = {arm: curves[arm, POSE_AND_LATENCY, 0.7] for arm in (*arms, FILTERED)}
    kept = {arm: curve[fault] / max(curve[0.0], TOLERANCE) for arm, curve in strict.items()}
    alone = curves[ALONE, POSE_AND_LATENCY, 0.7][fault]
    holds = strict[LATE][fault] < alone and all(kept[LATE] < kept[arm] for arm in intermediate)
    shape = f"AP 0.7 of late fusion ({LATE}) is below no fusion at a pose error of {fault:g} m and 0.1 s"
    if intermediate:
        shape += ", and falls by a larger share than intermediate"
    texts = [f"{arm} {curve[fault]:.3f} ({kept[arm]:.0%} kept)" for arm, curve in strict.items()]
    return _row(shape, holds, f"no fusion {alone:.3f}, {', '.join(texts)}")


def _strict_falls_first(curves: _Curves, sending: Sequence[str], axes: Sequence[str]) -> Row:
    """Values at which the curves of both overlaps leave their plateaus; a curve that never does has none."""
    falls = {
        (arm, axis): [_fall(curves[arm, axis, overlap]) for overlap in (0.5, 0.7)] for arm in sending for axis in axes
    }
    falling = {key: ends for key, ends in falls.items() if min(ends) < math.inf}
    later = [wide > strict for wide, strict in falling.values()]
    texts = [
        f"{arm} {' and '.join('never' if end == math.inf else f'{end:.2f}' for end in ends)}"
        for (arm, axis), ends in falling.items()
        if axis == "pose error"
    ]
    return _row(
        "AP 0.5 falls later than AP 0.7 on all axes",
        all(later),
        f"{sum(later)} of {len(later)} curves that fall; AP 0.5 and 0.7 over the pose error [m]: {'; '.join(texts)}",
    )


def _fall(curve: _Curve) -> float:
    """Return the value at which a curve leaves its plateau; infinity if it never does."""
    value = crossing(curve, curve[0.0] - PLATEAU)
    return math.inf if value is None else value


def _remaining(curves: _Curves, arms: Sequence[str], value: float) -> dict[str, float]:
    """Return the share of the benefit in AP 0.5 that remains with a loss, by arm; 0 for arms without a benefit."""
    shares = {}
    for arm in arms:
        curve, alone = curves[arm, "loss", 0.5], curves[ALONE, "loss", 0.5][0.0]
        benefit = curve[0.0] - alone
        shares[arm] = (curve[value] - alone) / benefit if benefit > 0.0 else 0.0
    return shares


def _loss_of_messages(curves: _Curves, arms: Sequence[str]) -> Row:
    last = max(AXES["loss"][2])
    shares = _remaining(curves, arms, last)
    texts = [f"{arm} {share:.0%}" for arm, share in shares.items()]
    shape = f"loss of {last:.0%} of whole messages is not mild: less than {MILD:.0%} of the benefit in AP 0.5 remain"
    return _row(shape, max(shares.values()) < MILD, f"benefit that remains: {', '.join(texts)}")


def _loss_of_frames(curves: _Curves, intermediate: Sequence[str], others: Sequence[str]) -> Row:
    """Cells of an object are redundant, and frames are lost independently."""
    values = {value: _remaining(curves, intermediate, value) for value in AXES["loss"][2][1:]}
    last = max(values)
    messages = max(_remaining(curves, others, last).values())
    texts = [
        f"{arm} {', '.join(f'{shares[arm]:.0%} at {value:.0%}' for value, shares in values.items())}"
        for arm in intermediate
    ]
    return _row(
        f"loss of {last:.0%} of the frames of features is milder than that of whole messages (benefit in AP 0.5)",
        min(values[last].values()) > messages,
        f"benefit that remains: {'; '.join(texts)}; whole messages up to {messages:.0%} at {last:.0%}",
    )


def _compensated(curves: _Curves) -> Row:
    """Covariance intersection predicts late boxes to the current time, `average` does not."""
    gains = [
        curves[FILTERED, "latency", overlap][value] - precision
        for overlap in (0.3, 0.5, 0.7)
        for value, precision in curves[LATE, "latency", overlap].items()
        if value > 0.0
    ]
    text = f"difference {min(gains):+.3f} to {max(gains):+.3f}"
    return _row("compensated latency is at least as good as uncompensated", min(gains) >= -TOLERANCE, text)


def _aligned(curves: _Curves, arm: str, axes: Sequence[str]) -> Row:
    """Shared objects show the pose error of a sender; without an error its pose stays as it is."""
    gains = [
        curves[f"{arm}, aligned", axis, overlap][value] - precision
        for axis in axes
        if AXES[axis][0] == "deviation"
        for overlap in (0.5, 0.7)
        for value, precision in curves[arm, axis, overlap].items()
    ]
    text = f"difference {min(gains):+.3f} to {max(gains):+.3f}"
    return _row(f"{arm}: aligned poses are at least as good as those with errors", min(gains) >= -TOLERANCE, text)


def _order(curves: _Curves, highest: str, arms: Sequence[str]) -> Row:
    """No fusion is below the first arm, and this one below all others, at both overlaps without faults."""
    values = {overlap: {arm: curves[arm, "latency", overlap][0.0] for arm in (ALONE, *arms)} for overlap in (0.5, 0.7)}
    late, *others = arms
    holds = all(at[ALONE] < at[late] < min(at[arm] for arm in others) for at in values.values())
    return _row(f"without faults: no fusion < late ({late}) < {highest}", holds, _precisions(values))


def _early_and_intermediate(curves: _Curves, intermediate: Sequence[str]) -> Row:
    values = {
        overlap: {arm: curves[arm, "latency", overlap][0.0] for arm in ("early", *intermediate)}
        for overlap in (0.5, 0.7)
    }
    holds = all(abs(at[arm] - at["early"]) <= PLATEAU for at in values.values() for arm in intermediate)
    return _row(f"without faults: early and intermediate differ by at most {PLATEAU:g}", holds, _precisions(values))


def _precisions(values: Mapping[float, Mapping[str, float]]) -> str:
    return "; ".join(
        f"AP {overlap:g}: {', '.join(f'{arm} {precision:.3f}' for arm, precision in at.items())}"
        for overlap, at in values.items()
    )


def _plateaus(volumes: Sequence[Row], arms: Sequence[str]) -> list[Row]:
    """Half of the messages cost little, and a fifth costs more."""
    rows = []
    for arm in arms:
        mine = [row for row in where(volumes, arm=arm) if row["cell"] in (None, 0.1)]
        if len(mine) < 2:
            continue  # the study does not vary the messages of this arm
        text = ", ".join(f"{row['ap_50']:.3f} at {row['megabytes_per_second']:.3g} MB/s" for row in mine)
        shape = f"{arm}: AP 0.5 is on a plateau at half of the volume (loss up to {PLATEAU:g})"
        rows.append(_row(shape, mine[0]["ap_50"] - mine[1]["ap_50"] <= PLATEAU, text))
    return rows


def _masks(volumes: Sequence[Row]) -> list[Row]:
    """A few per cent of the cells suffice, and less does not."""
    by_share = {row["share"]: row["ap_50"] for row in volumes if row["arm"].startswith(FEATURES_ONLY)}
    (alone,) = (row["ap_50"] for row in where(volumes, arm=ALONE))
    text = ", ".join(f"{precision:.3f} with {share:.2%} of the cells" for share, precision in by_share.items())
    fewest = min(by_share)
    return [
        _row(
            f"{FEATURES_ONLY}: AP 0.5 is on a plateau down to {FEW_CELLS:.0%} of the cells (loss up to {PLATEAU:g})",
            by_share[1.0] - by_share[FEW_CELLS] <= PLATEAU,
            text,
        ),
        _row(
            f"{FEATURES_ONLY}: AP 0.5 falls by more than {PLATEAU:g} towards no fusion with {fewest:.2%} of the cells",
            by_share[FEW_CELLS] - by_share[fewest] > PLATEAU,
            f"{text}, no fusion {alone:.3f}",
        ),
    ]
