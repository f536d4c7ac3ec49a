"""Shapes that curves of cooperative perception have in the literature, checked on measured rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from eidrive_reports.cooperative_perception.receivers import ARMS, AXES, Study
from eidrive_reports.reproduction.layout import Row, number, plain

ALONE = "none"
LATE = "covariance_intersection"
TOLERANCE = 1e-9
"""Largest difference of equal average precisions."""
PLATEAU = 0.05
"""Largest decrease of the average precision that counts as a plateau."""
MILD = 0.8
"""Least share of the benefit that remains after a mild loss."""
FEW_CELLS, FEWEST_CELLS = 0.05, 0.001
"""Shares of the cells of a map down to which the average precision is on a plateau, and at which it has fallen."""
_Curve = Mapping[float, float]
_Curves = Mapping[tuple[str, str, float], _Curve]
SHAPE_COLUMNS = (plain("shape", "shape"), plain("holds", "holds"), plain("measured", "measured"))


def shapes(study: Study, curves: Sequence[Row], volumes: Sequence[Row]) -> tuple[Row, ...]:
    """Return for each shape whether it holds, with the numbers.

    curves  rows with arm, axis, value, range, iou and ap; volumes: rows with arm, share, encoding,
            megabytes_per_second and ap_50
    """
    held: dict[tuple[str, str, float], dict[float, float]] = {}
    for row in curves:
        if row["range"] == "all":
            key = str(row["arm"]), str(row["axis"]), float(row["iou"] or 0.0)
            held.setdefault(key, {})[float(row["value"] or 0.0)] = float(row["ap"] or 0.0)
    sending = [arm for arm in study.compared if ARMS[arm].cooperates]
    intermediate = [arm for arm in sending if ARMS[arm].shares == "features"]
    whole = [arm for arm in sending if arm not in intermediate]
    rows = [
        _flat_alone(held),
        *(_late_crosses_alone(held, axis, near) for axis, near in NEAR.items() if axis in study.axes),
        _strict_falls_first(held, sending, study.axes),
        _loss_of_messages(held, whole),
        _compensated(held),
        *(_aligned(held, arm, study.axes) for arm in sending if f"{arm}, aligned" in sending),
        *_plateaus(volumes, whole),
        _order(held),
    ]
    if intermediate:
        rows += [_loss_of_frames(held, intermediate), *_masks(volumes), *_intermediate_order(held, intermediate)]
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


NEAR = {"pose error": 0.4, "pose drift": 0.4, "latency": 0.2}
"""Values of axes up to which AP 0.7 of late fusion falls below that of no fusion: published at 0.2 m and at 100 ms."""


def _late_crosses_alone(curves: _Curves, axis: str, near: float) -> Row:
    places = {
        arm: crossing(curves[arm, axis, 0.7], min(curves[ALONE, axis, 0.7].values())) for arm in ("average", LATE)
    }
    texts = [f"{arm} {'never' if at is None else f'at {at:.2f}'}" for arm, at in places.items()]
    late = places["average"]
    shape = f"AP 0.7 of late fusion (average) is below no fusion up to {near:g} of {axis}"
    return _row(shape, late is not None and late <= near, ", ".join(texts))


def _strict_falls_first(curves: _Curves, sending: Sequence[str], axes: Sequence[str]) -> Row:
    """The first fault of an axis costs a larger share of AP 0.7 than of AP 0.5."""
    kept = {
        (arm, axis): [_kept(curves[arm, axis, overlap], AXES[axis][2][1]) for overlap in (0.5, 0.7)]
        for arm in sending
        for axis in axes
    }
    fits = [wide >= strict for wide, strict in kept.values()]
    texts = [f"{arm} {wide:.0%}, {strict:.0%}" for (arm, axis), (wide, strict) in kept.items() if axis == "pose error"]
    return _row(
        "AP 0.7 falls before AP 0.5 at the first fault of each axis",
        all(fits),
        f"{sum(fits)} of {len(fits)} curves; kept shares of AP 0.5 and 0.7 at a pose error of "
        f"{AXES['pose error'][2][1]:g} m: {'; '.join(texts)}",
    )


def _kept(curve: _Curve, value: float) -> float:
    return curve[value] / curve[0.0] if curve[0.0] > 0.0 else 0.0


def _remaining(curves: _Curves, arms: Sequence[str], value: float) -> dict[str, float]:
    """Return the share of the benefit in AP 0.5 that remains with a loss, by arm; 0 for arms without a benefit."""
    shares = {}
    for arm in arms:
        curve, alone = curves[arm, "loss", 0.5], curves[ALONE, "loss", 0.5][0.0]
        benefit = curve[0.0] - alone
        shares[arm] = (curve[value] - alone) / benefit if benefit > 0.0 else 0.0
    return shares


def _loss_of_messages(curves: _Curves, arms: Sequence[str]) -> Row:
    """The loss of whole messages takes more than the plateau of the benefit at the largest probability."""
    last = max(AXES["loss"][2])
    shares = _remaining(curves, arms, last)
    texts = [f"{arm} {share:.0%}" for arm, share in shares.items()]
    shape = f"loss of {last:.0%} of whole messages is not mild: less than {MILD:.0%} of the benefit in AP 0.5 remain"
    return _row(shape, max(shares.values()) < MILD, f"benefit that remains: {', '.join(texts)}")


def _loss_of_frames(curves: _Curves, arms: Sequence[str]) -> Row:
    """The loss of cells is mild: those of an object are redundant, and frames are lost independently."""
    last = max(AXES["loss"][2])
    values = {value: _remaining(curves, arms, value) for value in AXES["loss"][2][1:]}
    texts = [
        f"{arm} {', '.join(f'{shares[arm]:.0%} at {value:.0%}' for value, shares in values.items())}" for arm in arms
    ]
    shape = f"loss of {last:.0%} of the frames of features is mild: at least {MILD:.0%} of the benefit in AP 0.5 remain"
    return _row(shape, min(values[last].values()) >= MILD, f"benefit that remains: {'; '.join(texts)}")


def _compensated(curves: _Curves) -> Row:
    """Covariance intersection predicts late boxes to the current time, `average` does not."""
    gains = {
        (overlap, value): curves[LATE, "latency", overlap][value] - precision
        for overlap in (0.3, 0.5, 0.7)
        for value, precision in curves["average", "latency", overlap].items()
    }
    least = min(gains.values())
    text = f"difference {least:+.3f} to {max(gains.values()):+.3f}"
    return _row("compensated latency is at least as good as uncompensated", least >= -TOLERANCE, text)


def _aligned(curves: _Curves, arm: str, axes: Sequence[str]) -> Row:
    """Shared objects show the pose error of a sender; without an error its pose stays as it is."""
    gains = [
        curves[f"{arm}, aligned", axis, overlap][value] - precision
        for axis in ("pose error", "pose drift")
        if axis in axes
        for overlap in (0.5, 0.7)
        for value, precision in curves[arm, axis, overlap].items()
    ]
    text = f"difference {min(gains):+.3f} to {max(gains):+.3f}"
    return _row(f"{arm}: aligned poses are at least as good as those with errors", min(gains) >= -TOLERANCE, text)


def _order(curves: _Curves) -> Row:
    values = {
        overlap: [curves[arm, "latency", overlap][0.0] for arm in (ALONE, "average", "early")] for overlap in (0.5, 0.7)
    }
    holds = all(alone < late < early for alone, late, early in values.values())
    texts = [
        f"AP {overlap:g}: {alone:.3f}, {late:.3f}, {early:.3f}" for overlap, (alone, late, early) in values.items()
    ]
    return _row("without faults: no fusion < late (average) < early", holds, "; ".join(texts))


def _intermediate_order(curves: _Curves, arms: Sequence[str]) -> list[Row]:
    """Intermediate fusion is above late fusion, and as good as early fusion."""
    values = {
        overlap: {arm: curves[arm, "latency", overlap][0.0] for arm in (ALONE, LATE, "early", *arms)}
        for overlap in (0.5, 0.7)
    }
    above = all(at[ALONE] < at[LATE] < min(at[arm] for arm in arms) for at in values.values())
    equal = all(at[arm] > at["early"] - PLATEAU for at in values.values() for arm in arms)
    text = "; ".join(
        f"AP {overlap:g}: {', '.join(f'{arm} {precision:.3f}' for arm, precision in at.items())}"
        for overlap, at in values.items()
    )
    return [
        _row(f"without faults: no fusion < late ({LATE}) < intermediate", above, text),
        _row(f"without faults: intermediate is not below early by more than {PLATEAU:g}", equal, text),
    ]


def _plateaus(volumes: Sequence[Row], arms: Sequence[str]) -> list[Row]:
    """Half of the messages cost little, and a fifth costs more."""
    rows = []
    for arm in arms:
        mine = [row for row in volumes if row["arm"] == arm and row["cell"] in (None, 0.1)]
        if len(mine) < 2:
            continue  # the study does not vary the messages of this arm
        values, volume = ([number(row, name) for row in mine] for name in ("ap_50", "megabytes_per_second"))
        text = ", ".join(f"{ap:.3f} at {size:.3g} MB/s" for ap, size in zip(values, volume, strict=True))
        shape = f"{arm}: AP 0.5 is on a plateau at half of the volume (loss up to {PLATEAU:g})"
        rows.append(_row(shape, values[0] - values[1] <= PLATEAU, text))
    return rows


def _masks(volumes: Sequence[Row]) -> list[Row]:
    """A few per cent of the cells suffice, and less does not."""
    mine = [row for row in volumes if row["encoding"] == "int8" and row["arm"] not in ("max", "attention, aligned")]
    by_share = {number(row, "share"): number(row, "ap_50") for row in mine}
    text = ", ".join(f"{number(row, 'ap_50'):.3f} with {number(row, 'share'):.1%} of the cells" for row in mine)
    few, fewest = by_share[FEW_CELLS], by_share[FEWEST_CELLS]
    return [
        _row(
            f"intermediate: AP 0.5 is on a plateau down to {FEW_CELLS:.0%} of the cells (loss up to {PLATEAU:g})",
            by_share[1.0] - few <= PLATEAU,
            text,
        ),
        _row(
            f"intermediate: AP 0.5 falls by more than {PLATEAU:g} with {FEWEST_CELLS:.1%} of the cells",
            few - fewest > PLATEAU,
            text,
        ),
    ]
