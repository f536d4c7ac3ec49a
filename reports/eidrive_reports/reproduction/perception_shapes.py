"""Shapes that curves of cooperative perception have in the literature, checked on measured rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from eidrive_reports.cooperative_perception.receivers import AXES
from eidrive_reports.reproduction.layout import Row, plain

SENDING = ("average", "covariance_intersection", "early")
ALONE = "none"
TOLERANCE = 1e-9
"""Largest difference of equal average precisions."""
PLATEAU = 0.05
"""Largest decrease of the average precision that counts as a plateau."""
_Curve = Mapping[float, float]
_Curves = Mapping[tuple[str, str, float], _Curve]
SHAPE_COLUMNS = (plain("shape", "shape"), plain("holds", "holds"), plain("measured", "measured"))


def shapes(curves: Sequence[Row], volumes: Sequence[Row]) -> tuple[Row, ...]:
    """Return for each shape whether it holds, with the numbers.

    curves  rows with arm, axis, value, range, iou and ap; volumes: rows with arm, megabytes_per_second and ap_50
    """
    held: dict[tuple[str, str, float], dict[float, float]] = {}
    for row in curves:
        if row["range"] == "all":
            key = str(row["arm"]), str(row["axis"]), float(row["iou"] or 0.0)
            held.setdefault(key, {})[float(row["value"] or 0.0)] = float(row["ap"] or 0.0)
    checks: list[Callable[[_Curves], list[Row]]] = [
        _flat_alone,
        _late_crosses_alone,
        _strict_falls_first,
        _loss_of_messages,
        _compensated,
        _aligned,
        _order,
    ]
    found = [row for check in checks for row in check(held)]
    return (*found[:-1], *_plateaus(volumes), found[-1])


def _row(shape: str, holds: bool, measured: str) -> Row:
    return {"shape": shape, "holds": "yes" if holds else "no", "measured": measured}


def _flat_alone(curves: _Curves) -> list[Row]:
    worst = max(max(curve.values()) - min(curve.values()) for (arm, _, _), curve in curves.items() if arm == ALONE)
    return [_row("no fusion is flat over all axes", worst <= TOLERANCE, f"largest change {worst:.3f}")]


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


def _late_crosses_alone(curves: _Curves) -> list[Row]:
    """At 0.2 m and at 100 ms the published late fusion is at or below no fusion at an overlap of 0.7."""
    found = []
    for axis, near in (("pose error", 0.4), ("pose drift", 0.4), ("latency", 0.2)):
        places = {
            arm: crossing(curves[arm, axis, 0.7], min(curves[ALONE, axis, 0.7].values()))
            for arm in ("average", "covariance_intersection")
        }
        texts = [f"{arm} {'never' if at is None else f'at {at:.2f}'}" for arm, at in places.items()]
        late = places["average"]
        shape = f"AP 0.7 of late fusion (average) is below no fusion up to {near:g} of {axis}"
        found.append(_row(shape, late is not None and late <= near, ", ".join(texts)))
    return found


def _strict_falls_first(curves: _Curves) -> list[Row]:
    """The first fault of an axis costs a larger share of AP 0.7 than of AP 0.5."""
    kept = {
        (arm, axis): [_kept(curves[arm, axis, overlap], AXES[axis][2][1]) for overlap in (0.5, 0.7)]
        for arm in SENDING
        for axis in AXES
    }
    fits = [wide >= strict for wide, strict in kept.values()]
    texts = [f"{arm} {wide:.0%}, {strict:.0%}" for (arm, axis), (wide, strict) in kept.items() if axis == "pose error"]
    return [
        _row(
            "AP 0.7 falls before AP 0.5 at the first fault of each axis",
            all(fits),
            f"{sum(fits)} of {len(fits)} curves; kept shares of AP 0.5 and 0.7 at a pose error of "
            f"{AXES['pose error'][2][1]:g} m: {'; '.join(texts)}",
        )
    ]


def _kept(curve: _Curve, value: float) -> float:
    return curve[value] / curve[0.0] if curve[0.0] > 0.0 else 0.0


def _loss_of_messages(curves: _Curves) -> list[Row]:
    """The loss of whole messages takes more than the plateau of the benefit at the largest probability."""
    shares = {}
    for arm in SENDING:
        curve, alone = curves[arm, "loss", 0.5], curves[ALONE, "loss", 0.5][0.0]
        benefit = curve[0.0] - alone
        shares[arm] = (curve[max(curve)] - alone) / benefit if benefit > 0.0 else 0.0
    last = max(AXES["loss"][2])
    texts = [f"{arm} {share:.0%}" for arm, share in shares.items()]
    shape = f"loss of {last:.0%} of whole messages is not mild: less than 80 % of the benefit in AP 0.5 remain"
    return [_row(shape, max(shares.values()) < 0.8, f"benefit that remains: {', '.join(texts)}")]


def _compensated(curves: _Curves) -> list[Row]:
    """Covariance intersection predicts late boxes to the current time, `average` does not."""
    gains = {
        (overlap, value): curves["covariance_intersection", "latency", overlap][value] - precision
        for overlap in (0.3, 0.5, 0.7)
        for value, precision in curves["average", "latency", overlap].items()
    }
    least = min(gains.values())
    text = f"difference {least:+.3f} to {max(gains.values()):+.3f}"
    return [_row("compensated latency is at least as good as uncompensated", least >= -TOLERANCE, text)]


def _aligned(curves: _Curves) -> list[Row]:
    """Shared objects show the pose error of a sender; without an error its pose stays as it is."""
    late = "covariance_intersection"
    gains = [
        curves[f"{late}, aligned", axis, overlap][value] - precision
        for axis in ("pose error", "pose drift")
        for overlap in (0.5, 0.7)
        for value, precision in curves[late, axis, overlap].items()
    ]
    least = min(gains)
    text = f"difference {least:+.3f} to {max(gains):+.3f}"
    return [_row("aligned poses are at least as good as those with errors", least >= -TOLERANCE, text)]


def _order(curves: _Curves) -> list[Row]:
    values = {
        overlap: [curves[arm, "latency", overlap][0.0] for arm in (ALONE, "average", "early")] for overlap in (0.5, 0.7)
    }
    holds = all(alone < late < early for alone, late, early in values.values())
    texts = [
        f"AP {overlap:g}: {alone:.3f}, {late:.3f}, {early:.3f}" for overlap, (alone, late, early) in values.items()
    ]
    return [_row("without faults: no fusion < late (average) < early", holds, "; ".join(texts))]


def _plateaus(volumes: Sequence[Row]) -> list[Row]:
    """Half of the messages cost little, and a fifth costs more."""
    found = []
    for arm in SENDING:
        mine = [row for row in volumes if row["arm"] == arm and row["cell"] in (None, 0.1)]
        values = [float(row["ap_50"] or 0.0) for row in mine]
        volume = [float(row["megabytes_per_second"] or 0.0) for row in mine]
        text = ", ".join(f"{ap:.3f} at {size:.3g} MB/s" for ap, size in zip(values, volume, strict=True))
        shape = f"{arm}: AP 0.5 is on a plateau at half of the volume (loss up to {PLATEAU:g})"
        found.append(_row(shape, values[0] - values[1] <= PLATEAU, text))
    return found
