"""Evaluation of proposals: collisions, clearance, progress, comfort and the use of other lanes."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import msgspec
import numpy as np

from eidrive_scenario.arrays import Array, Bools, Integers
from eidrive_scenario.driving.planning.behavior.lateral import Body, LateralProfile
from eidrive_scenario.driving.planning.behavior.oncoming import first_oncoming, meets_oncoming
from eidrive_scenario.driving.planning.behavior.proposals import ONCOMING_SPEED, Proposal
from eidrive_scenario.driving.planning.behavior.rollout import Rollout
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

CONTACT = 0.1
"""Distance below which bodies are taken to touch [m]."""
CLEAR_AHEAD = 1.0
"""Clearance along the line below which a proposal is risky on a collision course [m]."""
ROUNDING = 1e-6
"""More than the error of sums of distances [m]."""
PROGRESS, RISK, COMFORT, ASIDE, ONCOMING, SWITCH = 5.0, 6.0, 1.5, 0.15, 0.4, 0.3
"""Weights of the score: progress as in PDM-Closed; the others are relative to it. ASIDE and ONCOMING per use of another
lane, SWITCH for another maneuver than the current one."""
SLOWER = 0.05
"""Weight of a lower target speed than wanted, which decides between proposals that are otherwise alike."""
GENTLE = 50.0
"""Weight of a stop for an uncertain object, which is only chosen for such an object."""
CRASH = 100.0
"""Weight of a collision, above all other terms."""
FARTHER = 0.8
"""Share by which the weight of a risk decreases toward the horizon."""
LEAST_LACK = 0.3
"""Risk of a clearance that is just too small; it increases to 1 at a contact."""
AT_REST = 0.1
"""Speed below which the vehicle stands [m/s]."""
COMFORTABLE = 2.0
"""Deceleration up to which a proposal is comfortable [m/s²]."""


class Evaluation(msgspec.Struct, frozen=True):
    """Scores (P,); time of the first collision (P,), inf without one [s]; greatest risk (P,) in [0, 1]; speed of the
    collision (P,) [m/s]; hypothesis that causes the first one (P,), -1 without one."""

    score: Array
    collision: Array
    risk: Array
    impact: Array
    cause: Array


def evaluate(
    proposals: list[Proposal],
    profiles: list[LateralProfile],
    ways: list[Bools],
    rolled: Rollout,
    scene: Surroundings,
    times: Array,
    ego: Body,
    settings: BehaviorSettings,
    wanted: float,
    kept: frozenset[str],
    hidden: float,
) -> Evaluation:
    """Return the evaluation of all proposals.

    ways     where the hypotheses are in the way (N, K) of a vehicle that follows each profile
    kept     names of the maneuvers that are no change: the current one, and the route after a complete one
    hidden   place from which oncoming traffic may come unseen [m], inf without one
    """
    count, horizon = len(proposals), float(times[-1])
    offsets = _offsets(proposals, profiles, rolled, ego)
    collision, risk = np.full(count, np.inf), np.zeros(count)
    impact, cause = np.zeros(count), np.full(count, -1)
    near = _near(rolled, offsets, scene, ego)
    if near.size:
        stops = np.array([proposal.share == 0.0 for proposal in proposals])
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
    score = PROGRESS * progress - COMFORT * np.minimum(hardest / settings.hard_deceleration, 2.0)
    score -= RISK * risk
    score -= CRASH * np.where(np.isfinite(collision), 1.0 + (1.0 - collision / horizon) + 0.05 * impact, 0.0)
    oncoming = [
        first_oncoming(way, float(rolled.s[0, 0]), scene)
        if profile.uses_oncoming and profile.name not in kept
        else len(times)
        for profile, way in zip(profiles, ways, strict=True)
    ]
    values: list[float] = score.tolist()
    for row, proposal in enumerate(proposals):
        profile = profiles[proposal.profile]
        switches = profile.name not in kept
        values[row] -= SLOWER * (1.0 - proposal.share) + GENTLE * proposal.is_gentle
        if profile.uses_oncoming and switches:
            first = oncoming[proposal.profile]
            motion = rolled.s[row], float(rolled.speed[row, -1])
            values[row] -= RISK * meets_oncoming(profile, motion, times, first, (hidden, wanted), scene)
        values[row] -= ASIDE * (profile.side != 0) + ONCOMING * profile.uses_oncoming + SWITCH * switches
    return Evaluation(np.array(values), collision, risk, impact, cause)


def _offsets(proposals: list[Proposal], profiles: list[LateralProfile], rolled: Rollout, ego: Body) -> Array:
    """Return the offsets of the front and the rear axle (2, P, K) [m].

    proposals  in the order of their profiles
    """
    found = np.empty((2, *rolled.s.shape))
    places = np.array([rolled.s + ego.wheelbase, rolled.s])
    owners = [proposal.profile for proposal in proposals]
    for number, profile in enumerate(profiles):
        rows = slice(bisect_left(owners, number), bisect_right(owners, number))
        found[:, rows] = profile.offset(places[:, rows])
    return found


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
