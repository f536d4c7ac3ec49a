"""Evaluation of proposals: collisions, clearance, progress, comfort and the use of other lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.driving.planning.behavior.proposals import ONCOMING_SPEED, Body, LateralProfile, Option
from eidrive_scenario.driving.planning.behavior.reference import LanesBeside
from eidrive_scenario.driving.planning.behavior.rollout import WALL, Rollout
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

LANES = 6.0
"""Offset from the line within which oncoming traffic counts [m]: two lanes."""
PAUSE = 6.0
"""Time of waiting without oncoming traffic after which none is expected beyond the view [s], of the order of the
critical gaps of the Highway Capacity Manual (4.1 to 7.5 s)."""
FREE_TIME = 1.0
"""Time without an obstruction after which the vehicle does not wait any more [s]."""
SAMPLE = 2.0
"""Spacing of the places on the oncoming lane that are checked for a view [m]."""


class OncomingTraffic:
    """Oncoming traffic that one vehicle observes over time, and what may come from where it has no view.

    view  range of the perception of the vehicle [m]
    """

    def __init__(self, view: float) -> None:
        self._ahead: Array = np.arange(SAMPLE, view + SAMPLE, SAMPLE)
        """Distances of the places that are checked for a view [m]."""
        self._last = -math.inf
        self._held_up_since: float | None = None
        self._held_up_until = -math.inf

    def observe(self, scene: Surroundings, center: float, now: float, *, held_up: bool) -> None:
        """Update by the objects at `now` [s].

        center   distance of the center of the vehicle along the line [m]
        held_up  whether the vehicle would pass something
        """
        if bool(_is_oncoming(scene, 0, center).any()):
            self._last = now
        if held_up:
            self._held_up_until = now
            self._held_up_since = now if self._held_up_since is None else self._held_up_since
        elif now - self._held_up_until > FREE_TIME:
            self._held_up_since = None

    def first_hidden(self, scene: Surroundings, beside: LanesBeside, ego: tuple[float, float], now: float) -> float:
        """Return the place nearest to the vehicle from which traffic may come unseen [m]; inf if none is expected.

        None is expected if the vehicle has waited and no oncoming traffic appeared for a time of PAUSE.

        ego  distance of the center of the vehicle along the line, and its offset [m]
        """
        since = max(self._last, now if self._held_up_since is None else self._held_up_since)
        if now - since >= PAUSE or math.isnan(beside.oncoming):
            return math.inf
        s, d = ego
        places = s + self._ahead
        center, half = scene.d[:, 0, None], scene.half_width[:, 0, None]
        edges = np.concatenate([scene.rear[:, 0], scene.front[:, 0]])
        # A line to a place on the oncoming lane passes an edge of an object at this share of its length; it is hidden
        # where it crosses the body between both edges.
        share = ((edges - s)[:, None] / (places - s)).reshape(2, len(scene), len(places))
        at_edge = d + share * (beside.oncoming - d)
        crosses = (share > 0.0) & (share < 1.0) & (at_edge > center - half) & (at_edge < center + half)
        hidden: Bools = np.logical_or.reduce(crosses, axis=(0, 1))
        first = int(hidden.argmax()) if hidden.any() else len(places)
        return float(s + first * SAMPLE)


def first_oncoming(way: Bools, s: float, scene: Surroundings) -> int:
    """Return the index of the first time at which oncoming traffic is in the way of a vehicle at s; K if never.

    way  where hypotheses are in the way of the vehicle (N, K)
    """
    meets: Bools = np.logical_or.reduce(way & (scene.speed < -ONCOMING_SPEED) & (scene.front > s), axis=0)
    return int(meets.argmax()) if meets.any() else len(meets)


def meets_oncoming(
    profile: LateralProfile,
    motion: tuple[Array, float],
    times: Array,
    oncoming: int,
    hidden: tuple[float, float],
    scene: Surroundings,
) -> bool:
    """Return whether the vehicle meets oncoming traffic before it is back on its side, or does not return.

    Past objects that stand it also returns after the horizon, until which all keep their last speeds.

    motion    distances along the line (K,) of the vehicle at `times` [m], and its last speed [m/s]
    oncoming  index of the time from which on oncoming traffic is in its way
    hidden    place from which traffic may come unseen [m], inf without one, and its speed [m/s]
    """
    s, own_speed = motion
    back = int(s.searchsorted(profile.places[-2]))
    if oncoming < len(s) and oncoming <= back:
        return True
    if back < len(s):
        end, duration = float(s[back]), float(times[back])
    elif profile.passes_standing and own_speed > ONCOMING_SPEED:
        end = profile.places[-2]
        after = (end - float(s[-1])) / own_speed
        duration = float(times[-1]) + after
        if bool((_is_oncoming(scene, -1, float(s[-1])) & (scene.rear[:, -1] + scene.speed[:, -1] * after < end)).any()):
            return True
    else:
        return True
    place, speed = hidden
    return bool(place - speed * duration < end)


def _is_oncoming(scene: Surroundings, step: int, place: float) -> Bools:
    """Return which hypotheses (N,) are oncoming traffic ahead of a place [m] at a time step."""
    is_oncoming = (scene.speed[:, step] < -ONCOMING_SPEED) & (np.abs(scene.d[:, step]) < LANES)
    return np.asarray(is_oncoming & (scene.front[:, step] > place))


CONTACT = 0.1
"""Distance below which bodies are taken to touch [m]; a choice of the order of the errors of tracked positions."""
CLEAR_AHEAD = 1.0
"""Clearance along the line below which a proposal is risky on a collision course [m]; half of `standstill_gap`."""
ROUNDING = 1e-6
"""More than the error of sums of distances [m]."""
FARTHER = 0.8
"""Share by which the weight of a risk decreases toward the horizon, as predictions become uncertain; a choice."""
LEAST_LACK = 0.3
"""Risk of a clearance that is just too small; it increases to 1 at a contact. A choice: a step, so that no option gains
by a clearance that lacks a millimeter."""
AT_REST = 0.1
"""Speed below which the vehicle stands [m/s]."""
COMFORTABLE = 2.0
"""Deceleration up to which a proposal is comfortable [m/s²], of the order of the IDM (Treiber et al. 2000: 1.67)."""


class Weights(msgspec.Struct, frozen=True):
    """Weights of the terms of a score: progress as in PDM-Closed, the others relative to it by design.

    aside, oncoming  per use of another lane, and of one of the opposite direction
    switch           for another maneuver than the current one
    slower           of a lower target speed than wanted, which decides between options that are otherwise alike
    gentle           of a stop for an uncertain object, which is only chosen for such an object
    crash            of a collision, above all other terms
    """

    progress: float = 5.0
    risk: float = 6.0
    comfort: float = 1.5
    aside: float = 0.15
    oncoming: float = 0.4
    switch: float = 0.3
    slower: float = 0.05
    gentle: float = 50.0
    crash: float = 100.0


WEIGHTS = Weights()


class Evaluation(msgspec.Struct, frozen=True):
    """Scores (P,); time of the first collision (P,), inf without one [s]; greatest risk (P,) in [0, 1]; speed of the
    collision (P,) [m/s]; hypothesis that causes the first one (P,), -1 without one."""

    score: Array
    collision: Array
    risk: Array
    impact: Array
    cause: Array


def evaluate(
    options: Sequence[Option],
    rolled: Rollout,
    scene: Surroundings,
    times: Array,
    ego: Body,
    settings: BehaviorSettings,
    *,
    wanted: float,
    kept: frozenset[str],
    hidden: float,
) -> Evaluation:
    """Return the evaluation of all options, which are in the order of their profiles.

    wanted   wanted speed [m/s]
    kept     names of the maneuvers that are no change: the current one, and the route after a complete one
    hidden   place from which oncoming traffic may come unseen [m], inf without one
    """
    count, horizon = len(options), float(times[-1])
    offsets = _offsets(options, rolled, ego)
    collision, risk = np.full(count, np.inf), np.zeros(count)
    impact, cause = np.zeros(count), np.full(count, -1)
    near = _near(rolled, offsets, scene, ego)
    if near.size:
        stops = np.array([option.proposal.share == 0.0 for option in options])
        touching, lack = _overlaps(rolled, offsets, stops, scene.rows(near), times, ego, settings)
        risk = (lack.max(axis=1) * (1.0 - FARTHER * times / horizon)).max(axis=1)
        if touching.any():
            collision, step, cause = _first(touching, times)
            cause = np.where(cause >= 0, near[cause], -1)
            impact = np.where(np.isfinite(collision), rolled.speed[np.arange(count), step], 0.0)
    far = max(wanted * horizon, 1.0)
    progress = np.minimum(np.maximum((rolled.s[:, -1] - rolled.s[:, 0]) / far, 0.0), 1.0)
    slowing = (rolled.speed[:, 1:] - rolled.speed[:, :-1]) / (times[1:] - times[:-1])
    hardest = np.maximum(-slowing.min(axis=1) - COMFORTABLE, 0.0)
    score = WEIGHTS.progress * progress - WEIGHTS.comfort * np.minimum(hardest / settings.hard_deceleration, 2.0)
    score -= WEIGHTS.risk * risk
    crash = 1.0 + (1.0 - collision / horizon) + 0.05 * impact
    score -= WEIGHTS.crash * np.where(np.isfinite(collision), crash, 0.0)
    meeting: dict[int, int] = {}
    """Index of the time from which on oncoming traffic is in the way, by profile."""
    values: list[float] = score.tolist()
    for row, option in enumerate(options):
        proposal, profile = option.proposal, option.profile
        switches = profile.name not in kept
        values[row] -= WEIGHTS.slower * (1.0 - proposal.share) + WEIGHTS.gentle * proposal.is_gentle
        if profile.uses_oncoming and switches:
            if proposal.profile not in meeting:
                meeting[proposal.profile] = first_oncoming(option.way, float(rolled.s[0, 0]), scene)
            motion = rolled.s[row], float(rolled.speed[row, -1])
            first = meeting[proposal.profile]
            values[row] -= WEIGHTS.risk * meets_oncoming(profile, motion, times, first, (hidden, wanted), scene)
        lanes = WEIGHTS.aside * (profile.side != 0) + WEIGHTS.oncoming * profile.uses_oncoming
        values[row] -= lanes + WEIGHTS.switch * switches
    return Evaluation(np.array(values), collision, risk, impact, cause)


def _offsets(options: Sequence[Option], rolled: Rollout, ego: Body) -> Array:
    """Return the offsets of the front and the rear axle (2, P, K) [m] of options in the order of their profiles."""
    offsets = np.empty((2, *rolled.s.shape))
    places = np.array([rolled.s + ego.wheelbase, rolled.s])
    begin = 0
    for _, group in groupby(options, key=lambda option: option.proposal.profile):
        same = list(group)
        rows = slice(begin, begin + len(same))
        offsets[:, rows] = same[0].profile.offset(places[:, rows])
        begin += len(same)
    return offsets


def _first(found: Bools, times: Array) -> tuple[Array, Array, Array]:
    """Return time, its index and hypothesis of the first entry of `found` (P, N, K) for each proposal."""
    anyone: Bools = np.asarray(found.any(axis=1))
    step, rows = anyone.argmax(axis=1), np.arange(len(found))
    happens = anyone[rows, step]
    cause = found[rows, :, step].argmax(axis=1)
    return np.where(happens, times[step], np.inf), step, np.where(happens, cause, -1)


def _near(rolled: Rollout, offsets: Array, scene: Surroundings, ego: Body) -> Integers:
    """Return the hypotheses (rows) that any proposal may touch or pass too closely.

    offsets  of the front and the rear axle (2, P, K) [m]
    """
    aside = float(np.abs(offsets).max(initial=0.0)) + ego.half_width
    low, high = float(rolled.s.min(initial=np.inf)) - ego.rear, float(rolled.s.max(initial=-np.inf)) + ego.front
    margin = np.maximum(scene.margin, CONTACT)[:, None] + ROUNDING
    beside = np.abs(scene.d) - scene.half_width < aside + margin
    beside &= scene.rear < high + CLEAR_AHEAD + ROUNDING
    beside &= scene.front > low - CLEAR_AHEAD - ROUNDING
    found: Integers = (np.logical_or.reduce(beside, axis=1) & ~scene.behind).nonzero()[0]
    return found


def _overlaps(
    rolled: Rollout,
    offsets: Array,
    stops: Bools,
    scene: Surroundings,
    times: Array,
    ego: Body,
    settings: BehaviorSettings,
) -> tuple[Bools, Array]:
    """Return where the bodies touch (P, N, K), and the lack of clearance (P, N, K) in [0, 1].

    offsets  of the front and the rear axle (2, P, K) [m]; each determines the position of its half of the vehicle
    stops    whether a proposal stops as soon as possible (P,)
    scene    hypotheses of which none follows the ego
    """
    margin = np.maximum(scene.margin, CONTACT)[:, None]
    shift = round(settings.crossing_time / float(times[1] - times[0]))
    middle = ego.wheelbase / 2.0
    low, high = np.array([middle, -ego.rear]), np.array([ego.front, middle])
    # (2, P, N, K): front and rear half of the vehicle, options, hypotheses, times; each half follows its own axle, so
    # that the vehicle is bent along a curved profile.
    half_length = ((high - low) / 2.0)[:, None, None, None]
    center = (rolled.s + ((low + high) / 2.0)[:, None, None])[:, :, None, :]
    beside = offsets[:, :, None, :]
    along = np.abs(scene.s - center) - (scene.half_length + half_length)
    aside = np.abs(scene.d - beside) - (scene.half_width + ego.half_width)
    meets = aside < CONTACT
    touching: Bools = np.logical_or.reduce((along < CONTACT) & meets, axis=0)
    missing = np.maximum(
        np.where(along < 0.0, (margin - aside) / margin, 0.0),
        np.where(meets, (CLEAR_AHEAD - along) / CLEAR_AHEAD, 0.0),
    ).max(axis=0)
    lack = np.where(missing > 0.0, LEAST_LACK + (1.0 - LEAST_LACK) * missing, 0.0)
    crosses = np.logical_or.reduce(scene.crosses, axis=1)
    if shift and crosses.any():
        crossing = crosses.nonzero()[0]
        # Traffic with the right of way keeps its speed: no vehicle enters a junction shortly before it.
        favored = (crosses & scene.yields).nonzero()[0]
        for rows, later in ((crossing, shift), (crossing, -shift), (favored, 2 * shift), (favored, 3 * shift)):
            if not rows.size:
                continue
            columns = (scene.s, scene.d, scene.half_length, scene.half_width)
            s, place, length, width = (_shifted(part[rows], later) for part in columns)
            along = np.abs(s - center) - (length + half_length)
            aside = np.abs(place - beside) - (width + ego.half_width)
            found = np.logical_or.reduce((along < CONTACT) & (aside < CONTACT), axis=0)
            lack[:, rows] = np.maximum(lack[:, rows], found)
    stands = rolled.speed < AT_REST
    at_rest = stands[:, None, :]
    counts = ~at_rest
    late: Bools | None = None
    if touching.any():
        head_on = (scene.speed < -ONCOMING_SPEED) & ~scene.crosses
        ignored = np.logical_or.reduce(touching[:, :, 0], axis=0) & ~head_on[:, 0]
        keep = ~ignored[:, None]
        counts = counts & keep
        touching &= keep
        # Before a head-on collision the vehicle has to stand for some time, instead of a stop in the last moment.
        has_just_stopped = stands & (_recent_maximum(rolled.speed, shift) >= AT_REST) & ~stops[:, None]
        late = touching & head_on & has_just_stopped[:, None, :]
        # A vehicle that stands still is not hit by its own fault, except on the way of traffic with the right of way.
        touching &= ~(at_rest & (scene.speed != 0.0) & ~(crosses & scene.yields)[:, None])
    lack = np.where(counts, np.minimum(lack, 1.0), 0.0)
    return touching, lack if late is None else np.where(late, 1.0, lack)


def _shifted(values: Array, steps: int) -> Array:
    """Return values (N, K) of `steps` later times; the last or first one is repeated."""
    last = values.shape[1] - 1
    index = np.minimum(np.maximum(np.arange(steps, steps + last + 1), 0), last)
    return np.asarray(values[:, index])


def _recent_maximum(values: Array, steps: int) -> Array:
    """Return the maximum of values (P, K) at each time and the `steps` times before it."""
    found = values.copy()
    for step in range(1, min(steps, values.shape[1] - 1) + 1):
        np.maximum(found[:, step:], values[:, :-step], out=found[:, step:])
    return found


URGENT = 4.0
"""Time before a collision at which the emergency brake may act [s]."""


class Options(msgspec.Struct, frozen=True):
    """Options of a decision with their rollout and evaluation."""

    options: Sequence[Option]
    rolled: Rollout
    evaluation: Evaluation

    @property
    def gentle(self) -> int:
        """Index of the gentle stop."""
        return next(row for row, option in enumerate(self.options) if option.proposal.is_gentle)

    @property
    def emergency(self) -> int:
        """Index of emergency braking on the current course."""
        return next(row for row, option in enumerate(self.options) if option.proposal.is_emergency)

    def name_of(self, row: int) -> str:
        """Return the maneuver of an option."""
        return self.options[row].profile.name

    def best(self, profiles: int | None = None) -> int:
        """Return the index of the option with the highest score, among those along the first `profiles`."""
        count = len(self.options)
        if profiles is not None:
            count = sum(option.proposal.profile < profiles for option in self.options)
        return int(np.argmax(self.evaluation.score[:count]))

    def uncertain_threat(self, best: int, certain: Bools, *, is_hard: bool) -> int:
        """Return the hypothesis of an object of uncertain existence for which a proposal brakes hard; -1 without one.

        certain  (N,) whether the existence of each hypothesis is certain
        is_hard  whether the proposal brakes hard; a collision soon counts as well
        """
        if not (is_hard or float(self.evaluation.collision[best]) < URGENT):
            return -1
        causes = [self.evaluation.cause[best], self.evaluation.cause[self.gentle], *self.rolled.cause[best]]
        for cause in causes:
            row = int(cause)
            if row <= WALL:
                owner = self.options[best].walls[WALL - row].owner
                row = -1 if owner is None else owner
            if row >= 0 and not certain[row]:
                return row
        return -1
