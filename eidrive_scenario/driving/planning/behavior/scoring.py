"""Evaluation of proposals: collisions, clearance, progress, comfort and the use of other lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from itertools import groupby

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.driving.planning.behavior.oncoming import STOPPING_ERROR
from eidrive_scenario.driving.planning.behavior.proposals import ONCOMING_SPEED, Body, Option
from eidrive_scenario.driving.planning.behavior.rollout import WALL, Rollout, SpeedLimits
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

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
NEARER = 1.0
"""Distance by which it may stop nearer to a standing object than its gap [m], where it can still pass it."""
RESPONSE, SETTLED = 0.5, 1.5
"""Response time of the vehicle, and time within which it has the distance that this requires [s]; choices."""
TOO_FAST = 0.3
"""Excess over a speed limit above which the vehicle has to brake harder [m/s]; that of rounding is smaller."""
MOST_OVERRUN = 3.0
"""Distance from which on a stop behind its place is not worse [m]; a choice."""
OUT_OF_LANE = 0.5
"""Offset from the route from which on the vehicle is in the way of oncoming traffic, not that in its way [m]."""
AT_REST = 0.1
"""Speed below which the vehicle stands [m/s]."""
COMFORTABLE = 2.0
"""Deceleration up to which a proposal is comfortable [m/s²], of the order of the IDM (Treiber et al. 2000: 1.67)."""


class Weights(msgspec.Struct, frozen=True):
    """Weights of the terms of a score: progress as in PDM-Closed, the others relative to it by design.

    aside, oncoming  per use of another lane, and of one of the opposite direction
    switch           for another maneuver than the current one
    slower           of a lower target speed than wanted, which decides between options that are otherwise alike
    gentle           of a comfortable stop where others go on; below that of hard braking (0.75)
    refused          for an oncoming lane that is not free, or beyond the end of a lane; above any progress
    stays            for a lane that the route leaves, where the vehicle may change; above those of the change
    gap              of the time until it may change, at its most urgent; as that of all progress
    overrun          per meter of a stop behind its place
    hit              of standstill where oncoming traffic hits the vehicle, without its fault
    view             in favor of a place with a view into the oncoming lane; above the progress to the obstacle
    crash            of a collision, above all other terms
    """

    progress: float = 5.0
    risk: float = 6.0
    comfort: float = 1.5
    aside: float = 0.15
    oncoming: float = 0.4
    switch: float = 0.3
    slower: float = 0.05
    gentle: float = 0.5
    refused: float = 20.0
    overrun: float = 1.0
    hit: float = 1.0
    view: float = 2.0
    stays: float = 1.0
    gap: float = 5.0
    crash: float = 100.0


WEIGHTS = Weights()


class Evaluation(msgspec.Struct, frozen=True):
    """Scores (P,), and their part for progress (P,); time of the first collision (P,), inf without one [s]; greatest
    risk (P,) in [0, 1]; hypothesis that causes the first collision (P,), -1 without one."""

    score: Array
    progress: Array
    collision: Array
    risk: Array
    cause: Array


def evaluate(
    options: Sequence[Option],
    rolled: Rollout,
    scene: Surroundings,
    times: Array,
    ego: Body,
    settings: BehaviorSettings,
    *,
    limits: SpeedLimits,
    kept: frozenset[str],
    waiting: Set[int] = frozenset(),
    refused: Set[int] = frozenset(),
    late: Array | None = None,
) -> Evaluation:
    """Return the evaluation of all options, which are in the order of their profiles.

    limits   speed limits along the line and the wanted speed
    kept     names of the maneuvers that are no change: the current one, and the route after a complete one
    waiting  profiles that end before an oncoming lane, for a view into it
    refused  profiles that use an oncoming lane that is not free
    late     cost of the time until a lane change that the route requires (P,); None without one
    """
    count, horizon = len(options), float(times[-1])
    offsets = _offsets(options, rolled, ego)
    collision, risk = np.full(count, np.inf), np.zeros(count)
    impact, cause = np.zeros(count), np.full(count, -1)
    is_hit = np.zeros(count, dtype=bool)
    near = _near(rolled, offsets, scene, ego)
    if near.size:
        stops = np.array([option.proposal.share == 0.0 for option in options])
        touching, is_hit, lack = _overlaps(rolled, offsets, stops, scene.rows(near), times, ego, settings)
        risk = (lack.max(axis=1) * (1.0 - FARTHER * times / horizon)).max(axis=1)
        if touching.any():
            collision, step, cause = _first_event(touching, times)
            cause = np.where(cause >= 0, near[cause], -1)
            impact = np.where(np.isfinite(collision), rolled.speed[np.arange(count), step], 0.0)
    far = max(limits.wanted * horizon, 1.0)
    progress = WEIGHTS.progress * np.minimum(np.maximum((rolled.s[:, -1] - rolled.s[:, 0]) / far, 0.0), 1.0)
    slowing = (rolled.speed[:, 1:] - rolled.speed[:, :-1]) / (times[1:] - times[:-1])
    hardest = np.maximum(-slowing.min(axis=1) - COMFORTABLE, 0.0)
    score = progress - WEIGHTS.comfort * np.minimum(hardest / settings.hard_deceleration, 2.0)
    score -= WEIGHTS.risk * risk
    crash = 1.0 + (1.0 - collision / horizon) + 0.05 * impact
    score -= WEIGHTS.crash * np.where(np.isfinite(collision), crash, 0.0)
    if late is not None:
        score -= late
    score -= WEIGHTS.overrun * _overrun(options, rolled, scene, limits, times, ego, settings) + WEIGHTS.hit * is_hit
    held = waiting | refused
    may_go = any(option.profile.uses_oncoming and option.proposal.profile not in held for option in options)
    values: list[float] = score.tolist()
    for index, option in enumerate(options):
        proposal, profile = option.proposal, option.profile
        switches = profile.name not in kept
        values[index] -= WEIGHTS.slower * (1.0 - proposal.share) + WEIGHTS.gentle * proposal.is_gentle
        if proposal.profile in waiting:
            values[index] += 0.0 if may_go else WEIGHTS.view
            continue
        lanes = WEIGHTS.aside * (profile.side != 0) + WEIGHTS.oncoming * profile.uses_oncoming
        values[index] -= lanes + WEIGHTS.switch * switches + WEIGHTS.refused * (proposal.profile in refused)
    return Evaluation(np.array(values), progress, collision, risk, cause)


def _overrun(
    options: Sequence[Option],
    rolled: Rollout,
    scene: Surroundings,
    limits: SpeedLimits,
    times: Array,
    ego: Body,
    settings: BehaviorSettings,
) -> Array:
    """Return the distances (P,) by which options pass a place of waiting, or end too near to a standing leader [m].

    A place so near that not even hard braking suffices is that of such a stop. Comfortable braking counts most where it
    leaves the vehicle too close to a leader or too fast.
    """
    later = times >= SETTLED
    nearest = rolled.s[0, 0] + rolled.speed[0, 0] ** 2 / (2.0 * settings.hard_deceleration)
    stop = scene.rear[:, -1] - scene.passing_gap - settings.standstill_gap - ego.front + NEARER
    ahead = (scene.passing_gap > 0.0) & (stop > rolled.s[0, 0])
    overrun = np.zeros(len(options))
    if ahead.any():
        leads = np.array([option.leads[:, -1] for option in options]) & ahead
        overrun = np.where(leads, rolled.s[:, -1:] - stop, 0.0).max(axis=1, initial=0.0)
    for index, option in enumerate(options):
        proposal, s, speed = option.proposal, rolled.s[index], rolled.speed[index]
        if proposal.is_emergency:
            overrun[index] = 0.0
            continue
        for wall in option.walls:
            waits = s[times < wall.until]
            if waits.size:
                overrun[index] = max(overrun[index], waits[-1] - max(wall.s, nearest) - STOPPING_ERROR)
        if proposal.deceleration < settings.hard_deceleration:
            is_fast = (speed > limits.at(s) + TOO_FAST)[later].any()
            if is_fast or _is_close(option, s, speed, scene, later, ego, settings):
                overrun[index] = MOST_OVERRUN
    return np.asarray(np.minimum(overrun, MOST_OVERRUN))


def _is_close(
    option: Option, s: Array, speed: Array, scene: Surroundings, later: Bools, ego: Body, settings: BehaviorSettings
) -> bool:
    """Return whether the vehicle comes closer to a leader than its way in the response time, or stays `later` so close
    that hard braking might not suffice if that brakes as hard (lemma 2 of RSS, without acceleration in this time)."""
    other = np.clip(scene.speed, 0.0, speed)
    needed = RESPONSE * speed + later * (speed**2 - other**2) / (2.0 * settings.hard_deceleration)
    return bool((option.leads & (scene.rear - ego.front - s < needed)).any())


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


def _first_event(events: Bools, times: Array) -> tuple[Array, Array, Array]:
    """Return time, its index and hypothesis of the first entry of `events` (P, N, K) for each proposal."""
    anyone: Bools = np.asarray(events.any(axis=1))
    step, rows = anyone.argmax(axis=1), np.arange(len(events))
    happens = anyone[rows, step]
    cause = events[rows, :, step].argmax(axis=1)
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
    rows: Integers = (np.logical_or.reduce(beside, axis=1) & ~scene.behind).nonzero()[0]
    return rows


def _overlaps(
    rolled: Rollout,
    offsets: Array,
    stops: Bools,
    scene: Surroundings,
    times: Array,
    ego: Body,
    settings: BehaviorSettings,
) -> tuple[Bools, Bools, Array]:
    """Return where the bodies touch (P, N, K), which options end at standstill in the way of oncoming objects (P,), and
    the lack of clearance (P, N, K) in [0, 1].

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
            s, d, length, width = (_shifted(part[rows], later) for part in columns)
            along = np.abs(s - center) - (length + half_length)
            aside = np.abs(d - beside) - (width + ego.half_width)
            touches = np.logical_or.reduce((along < CONTACT) & (aside < CONTACT), axis=0)
            lack[:, rows] = np.maximum(lack[:, rows], touches)
    stands = rolled.speed < AT_REST
    at_rest = stands[:, None, :]
    counts = ~at_rest
    late: Bools | None = None
    is_hit = np.zeros(len(touching), dtype=bool)
    if touching.any():
        head_on = (scene.speed < -ONCOMING_SPEED) & ~scene.crosses
        ignored = np.logical_or.reduce(touching[:, :, 0], axis=0) & ~head_on[:, 0]
        keep = ~ignored[:, None]
        counts = counts & keep
        touching &= keep
        # Before a head-on collision the vehicle has to stand for some time, instead of a stop in the last moment.
        has_just_stopped = stands & (_recent_maximum(rolled.speed, shift) >= AT_REST) & ~stops[:, None]
        late = touching & head_on & has_just_stopped[:, None, :]
        # A vehicle that stands still is not hit by its own fault, except in the way of traffic with the right of way or
        # of oncoming traffic that is in its own lane.
        is_aside = (np.abs(offsets).max(axis=0) > OUT_OF_LANE)[:, None, :]
        blameless = at_rest & (scene.speed != 0.0) & ~(crosses & scene.yields)[:, None] & ~(head_on & is_aside)
        is_hit = (touching & blameless & head_on).any(axis=(1, 2))
        touching &= ~blameless
    lack = np.where(counts, np.minimum(lack, 1.0), 0.0)
    return touching, is_hit, lack if late is None else np.where(late, 1.0, lack)


def _shifted(values: Array, steps: int) -> Array:
    """Return values (N, K) of `steps` later times; the last or first one is repeated."""
    return np.asarray(np.take(values, np.arange(steps, steps + values.shape[1]), axis=1, mode="clip"))


def _recent_maximum(values: Array, steps: int) -> Array:
    """Return the maximum of values (P, K) at each time and the `steps` times before it."""
    maximum = values.copy()
    for step in range(1, min(steps, values.shape[1] - 1) + 1):
        np.maximum(maximum[:, step:], values[:, :-step], out=maximum[:, step:])
    return maximum


URGENT = 4.0
"""Time before a collision at which the emergency brake may act [s]."""


class Options(msgspec.Struct, frozen=True):
    """Options of a decision with their rollout and evaluation."""

    options: Sequence[Option]
    rolled: Rollout
    evaluation: Evaluation
    horizon: float
    """Time for which the options are rolled out [s]."""
    waiting: Set[int] = frozenset()
    """Profiles that end before an oncoming lane, for a view into it."""
    refused: Set[int] = frozenset()
    """Profiles that use an oncoming lane that is not free."""

    @property
    def gentle(self) -> int:
        """Index of the gentle stop."""
        return next(index for index, option in enumerate(self.options) if option.proposal.is_gentle)

    @property
    def emergencies(self) -> list[int]:
        """Indices of emergency braking on the current course, by deceleration."""
        return [index for index, option in enumerate(self.options) if option.proposal.is_emergency]

    def collides(self, index: int) -> bool:
        """Return whether an option collides within the horizon."""
        return math.isfinite(self.evaluation.collision[index])

    def progress(self, index: int) -> float:
        """Return the distance that an option covers within the horizon [m]."""
        return float(self.rolled.s[index, -1] - self.rolled.s[index, 0])

    def hypothesis_behind(self, cause: int, index: int) -> int | None:
        """Return the hypothesis that is a cause of the motion of an option, itself or by a wall; None without one."""
        if cause <= WALL:
            return self.options[index].walls[WALL - cause].owner
        return cause if cause >= 0 else None

    def best(self, profiles: int | None = None, name: str | None = None, *, with_brake: bool = True) -> int:
        """Return the index of the option with the highest score, among those along the first `profiles` or of one
        maneuver.

        With the emergency brake, that is one of them if the best other one collides soon, or has a risk as of a near
        contact, and is worse apart from its progress.
        """
        count = len(self.options) if profiles is None else profiles
        counts = [option.proposal.profile < count and name in (None, option.profile.name) for option in self.options]
        score = np.where(counts, self.evaluation.score, -math.inf)
        brake = max(self.emergencies, key=score.__getitem__)
        braking = float(score[brake])
        score[self.emergencies] = -math.inf
        best = int(np.argmax(score))
        collision, risk = float(self.evaluation.collision[best]), float(self.evaluation.risk[best])
        is_urgent = collision < URGENT or risk > 1.0 - FARTHER * URGENT / self.horizon
        progress = self.evaluation.progress
        is_better = braking - progress[brake] > score[best] - progress[best]
        return brake if with_brake and is_urgent and is_better else best

    def uncertain_threat(self, best: int, certain: Bools, *, is_hard: bool) -> int | None:
        """Return the hypothesis of an object of uncertain existence for which a proposal brakes hard, if there is one.

        certain  (N,) whether the existence of each hypothesis is certain
        is_hard  whether the proposal brakes hard; a collision soon counts as well
        """
        if not (is_hard or float(self.evaluation.collision[best]) < URGENT):
            return None
        causes = [self.evaluation.cause[best], self.evaluation.cause[self.gentle], *self.rolled.cause[best]]
        hypotheses = (self.hypothesis_behind(int(cause), best) for cause in causes)
        existing = (hypothesis for hypothesis in hypotheses if hypothesis is not None)
        return next((hypothesis for hypothesis in existing if not certain[hypothesis]), None)
