"""Evaluation of proposals: collisions, clearance, progress, comfort and the use of other lanes."""

from __future__ import annotations

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

    kept     names of the maneuvers that are no change: the current one, and the route after a complete one
    hidden   place from which oncoming traffic may come unseen [m], inf without one
    """
    count = len(proposals)
    front, rear = np.empty_like(rolled.s), np.empty_like(rolled.s)
    own: list[list[int]] = [[] for _ in profiles]
    for row, proposal in enumerate(proposals):
        own[proposal.profile].append(row)
    for rows, profile in zip(own, profiles, strict=True):
        place = rolled.s[rows]
        front[rows], rear[rows] = profile.offset(place + ego.wheelbase), profile.offset(place)
    collision, risk = np.full(count, np.inf), np.zeros(count)
    impact, cause = np.zeros(count), np.full(count, -1)
    near = _near(rolled, (front, rear), scene, ego)
    if near.size:
        stops = np.array([proposal.share == 0.0 for proposal in proposals])
        touching, lack = _overlaps(rolled, (front, rear), stops, scene.rows(near), times, ego, settings)
        collision, step, cause = _first(touching, times)
        cause = np.where(cause >= 0, near[cause], -1)
        impact = np.where(np.isfinite(collision), rolled.speed[np.arange(count), step], 0.0)
        risk = (lack.max(axis=1) * (1.0 - FARTHER * times / float(times[-1]))).max(axis=1)
    horizon = float(times[-1])
    far = max(wanted * horizon, 1.0)
    progress = np.minimum(np.maximum((rolled.s[:, -1] - rolled.s[:, 0]) / far, 0.0), 1.0)
    slowing = (rolled.speed[:, 1:] - rolled.speed[:, :-1]) / (times[1:] - times[:-1])
    hardest = np.maximum(-slowing.min(axis=1) - COMFORTABLE, 0.0)
    score = PROGRESS * progress - COMFORT * np.minimum(hardest / settings.hard_deceleration, 2.0)
    score -= RISK * risk
    score -= CRASH * np.where(np.isfinite(collision), 1.0 + (1.0 - collision / horizon) + 0.05 * impact, 0.0)
    oncoming = [
        first_oncoming(profile, float(rolled.s[0, 0]), scene, ego.half_width) if profile.uses_oncoming else len(times)
        for profile in profiles
    ]
    values: list[float] = score.tolist()
    for row, proposal in enumerate(proposals):
        profile = profiles[proposal.profile]
        switches = profile.name not in kept
        values[row] -= SLOWER * (1.0 - proposal.share) + GENTLE * proposal.is_gentle
        if profile.uses_oncoming and switches:
            first = oncoming[proposal.profile]
            values[row] -= RISK * meets_oncoming(profile, rolled.s[row], times, first, (hidden, wanted))
        values[row] -= ASIDE * (profile.side != 0) + ONCOMING * profile.uses_oncoming + SWITCH * switches
    score = np.array(values)
    return Evaluation(score, collision, risk, impact, cause)


def _first(found: Bools, times: Array) -> tuple[Array, Array, Array]:
    """Return time, its index and hypothesis of the first entry of `found` (P, N, K) for each proposal."""
    anyone: Bools = np.asarray(found.any(axis=1))
    step = np.argmax(anyone, axis=1)
    happens = anyone[np.arange(len(found)), step]
    cause = np.argmax(found[np.arange(len(found)), :, step], axis=1)
    return np.where(happens, times[step], np.inf), step, np.where(happens, cause, -1)


def _near(rolled: Rollout, offsets: tuple[Array, Array], scene: Surroundings, ego: Body) -> Integers:
    """Return the hypotheses (rows) that any proposal may touch or pass too closely."""
    aside = max(float(np.abs(part).max(initial=0.0)) for part in offsets) + ego.half_width
    low, high = float(rolled.s.min(initial=np.inf)) - ego.rear, float(rolled.s.max(initial=-np.inf)) + ego.front
    margin = np.maximum(scene.margin, CONTACT)[:, None] + ROUNDING
    beside = np.abs(scene.d) - scene.half_width < aside + margin
    beside &= scene.s - scene.half_length < high + CLEAR_AHEAD + ROUNDING
    beside &= scene.s + scene.half_length > low - CLEAR_AHEAD - ROUNDING
    return np.flatnonzero(beside.any(axis=1) & ~scene.behind)


def _overlaps(
    rolled: Rollout,
    offsets: tuple[Array, Array],
    stops: Bools,
    scene: Surroundings,
    times: Array,
    ego: Body,
    settings: BehaviorSettings,
) -> tuple[Bools, Array]:
    """Return where the bodies touch (P, N, K), and the lack of clearance (P, N, K) in [0, 1].

    offsets  of the front and the rear axle (P, K) [m]; each determines the position of its half of the vehicle
    stops    whether a proposal stops as soon as possible (P,)
    """
    shape = (len(rolled.s), len(scene), len(times))
    touching, lack = np.zeros(shape, dtype=bool), np.zeros(shape)
    margin = np.maximum(scene.margin, CONTACT)[None, :, None]
    crossing = np.flatnonzero(scene.crosses.any(axis=1))
    shift = round(settings.crossing_time / float(times[1] - times[0]))
    # Traffic with the right of way keeps its speed: no vehicle enters a junction shortly before it.
    favored = np.flatnonzero(scene.crosses.any(axis=1) & scene.yields)
    moved = [
        (rows, [_shifted(part[rows], later) for part in (scene.s, scene.d, scene.half_length, scene.half_width)])
        for rows, later in ((crossing, shift), (crossing, -shift), (favored, 2 * shift), (favored, 3 * shift))
        if rows.size and shift
    ]
    middle = ego.wheelbase / 2.0
    for d, low, high in ((offsets[0], middle, ego.front), (offsets[1], -ego.rear, middle)):
        center, half_length = (rolled.s + (low + high) / 2.0)[:, None, :], (high - low) / 2.0
        beside = d[:, None, :]
        along = np.abs(scene.s - center) - (scene.half_length + half_length)
        aside = np.abs(scene.d - beside) - (scene.half_width + ego.half_width)
        meets = aside < CONTACT
        touching |= (along < CONTACT) & meets
        missing = np.where(along < 0.0, (margin - aside) / margin, 0.0)
        missing = np.maximum(missing, np.where(meets, (CLEAR_AHEAD - along) / CLEAR_AHEAD, 0.0))
        lack = np.maximum(lack, np.where(missing > 0.0, LEAST_LACK + (1.0 - LEAST_LACK) * missing, 0.0))
        for rows, (s, place, length, width) in moved:
            along = np.abs(s - center) - (length + half_length)
            aside = np.abs(place - beside) - (width + ego.half_width)
            lack[:, rows] = np.maximum(lack[:, rows], (along < CONTACT) & (aside < CONTACT))
    head_on = (scene.speed < -ONCOMING_SPEED) & ~scene.crosses
    ignored = scene.behind | (touching[:, :, 0].any(axis=0) & ~head_on[:, 0])
    keep = ~ignored[None, :, None]
    stands = rolled.speed < AT_REST
    at_rest = stands[:, None, :]
    touching &= keep
    # Before a head-on collision the vehicle has to stand for some time, instead of a stop in the last moment.
    before = np.maximum.reduce([_shifted(rolled.speed, -steps) for steps in range(shift + 1)])
    has_just_stopped = stands & (before >= AT_REST) & ~stops[:, None]
    late = touching & head_on & has_just_stopped[:, None, :]
    touching &= ~(at_rest & (np.abs(scene.speed)[None] > 0.0))
    return touching, np.where(late, 1.0, np.where(keep & ~at_rest, np.minimum(lack, 1.0), 0.0))


def _shifted(values: Array, steps: int) -> Array:
    """Return values (N, K) of `steps` later times; the last or first one is repeated."""
    index = np.clip(np.arange(values.shape[1]) + steps, 0, values.shape[1] - 1)
    return np.asarray(values[:, index])
