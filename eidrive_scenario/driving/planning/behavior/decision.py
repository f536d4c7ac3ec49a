"""Decision between proposals: lateral maneuvers, and the emergency brake as the last resort."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.planning.behavior.lane_changes import LaneChange
from eidrive_scenario.driving.planning.behavior.maneuvers import (
    KEEP_CLEAR,
    Situation,
    extended,
    may_pass,
    passing_profiles,
    sets_off,
    shortened,
)
from eidrive_scenario.driving.planning.behavior.memory import ON_FOOT
from eidrive_scenario.driving.planning.behavior.merging import (
    MERGING_TIME_GAP,
    TimeGap,
    TrafficBehind,
    costs_of_waiting,
    gap_leader,
    has_gap_now,
    leaves_room,
    with_followers,
)
from eidrive_scenario.driving.planning.behavior.oncoming import Motion, OncomingTraffic, Outlook, Verdict
from eidrive_scenario.driving.planning.behavior.proposals import (
    AT_OFFSET,
    HASTY,
    ONCOMING_SPEED,
    ROUTE,
    SPEED_SHARES,
    TOWARDS_GAP,
    WALKING_PACE,
    Body,
    Conflict,
    LateralProfile,
    Option,
    Precedence,
    Proposal,
    Start,
    Wall,
    change_length,
    conflicts,
    crossing_walls,
    inside_way,
    leading,
    proposals_for,
    to_lane,
    towards,
    with_view,
)
from eidrive_scenario.driving.planning.behavior.rollout import FREE, LIMIT, WALL, Roller, Rollout
from eidrive_scenario.driving.planning.behavior.scoring import AT_REST, URGENT, Options, evaluate
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings, only, surroundings
from eidrive_scenario.driving.planning.behavior.walking_pace import WalkingPace
from eidrive_scenario.world.actor import ActorSpec


def reason_of(situation: Situation, options: Options, best: int) -> tuple[str, tuple[int, ...]]:
    """Return the reason of a proposal, and the rows of its objects."""
    chosen = options.options[best]
    owners = situation.prediction.objects
    if chosen.proposal.is_emergency:
        threat = _threat(options, best)
        if threat is None:
            return "emergency braking", ()
        owner = owners[threat]
        return f"emergency braking: collision course with {situation.kind_of(owner)}", situation.rows_of(owner)
    reason, hypothesis = _motion_reason(situation, options, best)
    maneuver = "" if chosen.profile.name == ROUTE else f"{chosen.profile.name}; "
    return f"{maneuver}{reason}", () if hypothesis is None else situation.rows_of(owners[hypothesis])


def _motion_reason(situation: Situation, options: Options, best: int) -> tuple[str, int | None]:
    """Return what determines the motion of a proposal along its profile, and the hypothesis behind that, if any."""
    chosen, owners = options.options[best], situation.prediction.objects
    causes = options.rolled.cause[best].tolist()
    for cause in causes:
        hypothesis = options.hypothesis_behind(cause, best)
        if cause <= WALL:
            return chosen.walls[WALL - cause].reason, hypothesis
        if hypothesis is not None:
            owner = owners[hypothesis]
            verb = "stop for" if situation.approaches(owner) else "follow"
            return f"{verb} {situation.describe(owner)}", hypothesis
    is_slower = chosen.proposal.share < 1.0
    if is_slower and owners:
        return "slow down for traffic ahead", None
    if is_slower and chosen.walls:
        return chosen.walls[0].reason, None
    if not is_slower and causes[0] == FREE:
        return "keep speed", None
    if not is_slower and situation.is_lowered_at(float(options.rolled.s[best, 1])):
        return f"caution before a hidden {situation.hidden}" if situation.hidden else "lower speed limit ahead", None
    return "curve or end of route ahead", None


def _threat(options: Options, emergency: int) -> int | None:
    """Return the hypothesis for which the vehicle brakes in an emergency: that with which the first other proposal
    collides, else the one for which it brakes."""
    others = (index for index, option in enumerate(options.options) if not option.proposal.is_emergency)
    other = next(others, emergency)
    causes = [int(options.evaluation.cause[other]), *options.rolled.cause[other].tolist()]
    return options.hypothesis_behind(next((cause for cause in causes if cause not in (FREE, LIMIT)), FREE), other)


OFF_PROFILE = 0.8
"""Distance from the current profile above which the vehicle starts a new one from its position [m]."""
RETURN_GAP = 2.0
"""Additional gap behind what stands where the vehicle returns to its lane, from which it can just pass that [m]."""
SATISFIED = 0.85
"""Share of the wanted progress from which on no other maneuver is considered; a choice, as the next two times."""
DWELL = 2.0
"""Time for which a maneuver is kept unless it becomes risky [s]."""
PERSISTENT = 0.5
"""Time for which another maneuver has to be the best one before it starts [s]."""
RELEASE = 0.75
"""Share of the hard deceleration below which a proposal ends emergency braking."""
ALMOST_AT_REST = 1.5
"""Speed below which emergency braking goes on until the vehicle stands [m/s]: walking pace, from which it stops within
a few decimeters, whereas it would creep on into the way of what it brakes for."""
NEAR_PLACE = 1.0
"""Distance from its place of waiting within which a vehicle waits there [m]."""
VIEW_TIME_GAP = 2.0
"""Time gap behind a slower object at the border of the lane, from where the vehicle sees past it [s]: the two-second
rule of the Highway Code (rule 126)."""
HARDER = 0.3
"""Difference to a comfortable deceleration from which on braking is hard [m/s²]."""


class Decision(msgspec.Struct, frozen=True):
    """Chosen proposal: profile, motion along the line s and speed (K,) [m, m/s], and the reason.

    acceleration  of the first step [m/s²];  braking  deceleration of an emergency [m/s²], or None
    objects       rows of the fused objects that are the reason
    """

    profile: LateralProfile
    s: Array
    speed: Array
    acceleration: float
    braking: float | None
    reason: str
    objects: tuple[int, ...]
    is_free: bool = False
    """Whether only the wanted speed determines the next motion."""


class Course(msgspec.Struct, frozen=True):
    """Lateral profile of proposals, with what lies on it.

    holds      walls at which each proposal stops, whatever its precedence
    way        hypotheses in the way (N, K), before these walls
    conflicts  objects that cross the way or enter it later
    """

    profile: LateralProfile
    verdict: Verdict
    holds: list[Wall]
    way: Bools
    conflicts: list[Conflict]


class Decider:
    """Decisions of one vehicle; it keeps the current maneuver.

    view  distances ahead of and behind the reference point up to which a car is in view [m]
    """

    def __init__(
        self, settings: BehaviorSettings, spec: ActorSpec, body: Body, times: Array, view: tuple[float, float]
    ) -> None:
        self._settings = settings
        self._times = times
        self._roller = Roller(settings, times, spec.max_acceleration)
        self._body = body
        self._emergency = min(settings.emergency_deceleration, spec.max_deceleration)
        self._cruise = Proposal(0, 1.0, "all", settings.hard_deceleration)
        """Proposal at the wanted speed, by whose motion the use of an oncoming lane is verified."""
        self._current: LateralProfile | None = None
        self._switched = -math.inf
        self._challenger: tuple[str, float] = (ROUTE, math.inf)
        """Another maneuver than the current one that has been best, and the time since when [s]."""
        self._time_gap = TimeGap(settings)
        self._view = view
        self._oncoming = self._opposite()
        self._behind = self._neighbors()
        """Traffic in the lanes to the left (1) and to the right (-1) of the line."""
        self._walking_pace = WalkingPace(settings, len(times))
        self._held_up = False
        self._passes = False
        """Whether the last decision was to pass in the oncoming lane, instead of waiting for it."""
        self._braking = 0.0
        """Deceleration of emergency braking if that was the last decision [m/s²], else 0."""

    def _opposite(self) -> OncomingTraffic:
        return OncomingTraffic(self._view[0], self._times, self._body, self._settings)

    def _neighbors(self) -> dict[int, TrafficBehind]:
        return {side: TrafficBehind(self._view[1], self._body, self._settings) for side in (1, -1)}

    def line_changed(self, shift: float | None, aside: float) -> None:
        """Move the current maneuver to another line.

        shift  increase of the distances along the line [m]; None if the maneuver ends because the lines differ
        aside  distance of the new line to the left of the one before [m], if the vehicle has changed to its lane
        """
        if shift is None and not aside:
            self._oncoming = self._opposite()
        else:
            self._oncoming.line_changed(None if aside else shift)
        if aside or shift is None:
            self._behind = self._neighbors()
        current = self._current
        if current is None or shift is None:
            self._current = None
            return
        places = tuple(s + shift for s in current.places)
        self._current = msgspec.structs.replace(current, places=places, waits_at=current.waits_at + shift)
        if aside:
            values = tuple(value - aside for value in current.values)
            self._current = LateralProfile(ROUTE, places, values, current.slope)

    def decide(self, situation: Situation) -> Decision:
        """Return the best proposal."""
        settings = self._settings
        scene = self._scene(situation, settings)
        current = extended(situation, scene, self._continued(situation))
        profiles = [current]
        if current.name != ROUTE or abs(current.last) > 0.05:
            profiles.append(self._to_route(situation))
        if current.uses_oncoming and (given_up := self._given_up(situation, scene, current)) is not None:
            profiles.append(given_up)
        if current.uses_oncoming and (early := shortened(situation, scene, current)) is not None:
            profiles.append(early)
        beside = situation.lanes_ahead
        for side, lane in ((1, beside.left), (-1, beside.right)):
            self._behind[side].observe(scene, lane, situation.now)
        change = situation.change
        merges = change is not None and current.name == change.name
        self._time_gap.update(scene, (situation.s, situation.d), self._body, situation.now, merges=merges)
        if change is not None and merges:
            scene = with_followers(scene, change.offset, situation.motion, self._body)
        elif change is not None and (motion := self._required_change(situation, scene, change)) is not None:
            profiles.append(motion)
        expects = self._held_up and settings.lane_changes
        options = self._options(situation, scene, profiles, with_maneuvers=expects)
        best = options.best(len(profiles))
        self._held_up = settings.lane_changes and len(scene) > 0 and self._is_held_up(situation, options, best)
        passes = self._current is not None and self._current.uses_oncoming
        self._oncoming.observe(
            scene,
            situation.center,
            situation.wanted,
            situation.now,
            held_up=self._held_up or passes,
            oncoming=situation.lanes_ahead.oncoming,
            on_foot=np.array([situation.kind_of(owner) in ON_FOOT for owner in scene.owner], dtype=bool),
        )
        if self._held_up:
            if not expects:
                options = self._options(situation, scene, profiles, with_maneuvers=True)
            best = options.best()
        best = self._kept(options, best, situation.now)
        if options.options[best].proposal.is_emergency and not bool(scene.likely.all()):
            # The vehicle brakes hard for a turn that is possible only, but not as in an emergency.
            likely = self._options(situation, only(scene, scene.likely), [options.options[0].profile])
            if not likely.options[likely.best()].proposal.is_emergency:
                best = options.best(name=options.options[best].profile.name, with_brake=False)
        best = self._with_brake(options, best)
        if not bool(scene.certain.all()):
            is_hard = self._acceleration(options, best) < -settings.comfortable_deceleration - HARDER
            threat = options.uncertain_threat(best, scene.certain, is_hard=is_hard)
            if threat is not None:
                return self._without_hard_braking(situation, scene, options, threat)
        chosen = options.options[best]
        keeps_clear = any(wall.reason == KEEP_CLEAR for wall in chosen.walls)
        is_waiting = keeps_clear or chosen.proposal.profile in options.waiting
        if not is_waiting and self._walking_pace.is_due(situation, options, best):
            slow = self._at_walking_pace(situation, profiles)
            if slow is not None:
                return slow
        return self._decision(situation, options, best)

    def _scene(self, situation: Situation, settings: BehaviorSettings) -> Surroundings:
        if abs(situation.steered[1]) > OFF_PROFILE:
            # A vehicle that returns behind an obstacle needs the space.
            settings = settings.model_copy(update={"passing_gap": min(settings.passing_gap, RETURN_GAP)})
        return surroundings(
            situation.objects,
            situation.prediction,
            situation.line,
            situation.window,
            settings,
            situation.extent,
            situation.gives_way,
        )

    def _at_walking_pace(self, situation: Situation, profiles: list[LateralProfile]) -> Decision | None:
        """Return the decision to drive on at walking pace, with less clearance; None if that is not possible."""
        pace = self._walking_pace
        slow = pace.situation(situation)
        seen, exact = (self._scene(slow, settings) for settings in (pace.settings, pace.exact))
        scene = pace.scene(slow.objects, seen, exact, slow.extent)
        options = self._options(slow, scene, profiles, with_maneuvers=self._settings.lane_changes)
        best = options.best()
        if not pace.moves_safely(situation, options, best):
            return None
        decision = self._decision(slow, options, best)
        return msgspec.structs.replace(decision, reason=f"walking pace: {decision.reason}", is_free=False)

    def _with_brake(self, options: Options, best: int) -> int:
        """Return the best proposal, or emergency braking if it was active and the best one still brakes hard, or if the
        vehicle almost stands: it decides again when it does."""
        emergencies = {options.options[index].proposal.deceleration: index for index in options.emergencies}
        if self._braking in emergencies and not options.options[best].proposal.is_emergency:
            speed = options.rolled.speed[best]
            hardest = float((np.diff(speed) / np.diff(self._times))[: round(URGENT / self._times[1])].min())
            if hardest < -RELEASE * self._settings.hard_deceleration or AT_REST < float(speed[0]) < ALMOST_AT_REST:
                best = emergencies[self._braking]
        proposal = options.options[best].proposal
        self._braking = proposal.deceleration if proposal.is_emergency else 0.0
        return best

    def _without_hard_braking(
        self, situation: Situation, scene: Surroundings, options: Options, threat: int
    ) -> Decision:
        """Return the decision if a hypothesis of uncertain existence is no reason for more than a gentle stop."""
        certain = self._options(situation, only(scene, scene.certain), [options.options[0].profile])
        choice, stop = int(np.argmax(certain.evaluation.score)), certain.gentle
        if self._acceleration(certain, choice) < self._acceleration(certain, stop):
            return self._decision(situation, certain, choice)
        owner = situation.prediction.objects[threat]
        reason = f"slow down for a possible {situation.kind_of(owner)}"
        decision = self._decision(situation, certain, stop)
        return msgspec.structs.replace(decision, reason=reason, objects=situation.rows_of(owner))

    def _acceleration(self, options: Options, index: int) -> float:
        """Return the acceleration of a proposal in the first step [m/s²]."""
        speed = options.rolled.speed[index]
        return float(speed[1] - speed[0]) / float(self._times[1] - self._times[0])

    def _continued(self, situation: Situation) -> LateralProfile:
        """Return the current profile, or one that starts at the vehicle if there is none or it left its profile."""
        current = self._current
        s, d, _ = situation.steered
        if current is not None and abs(current.offset_at(s) - d) <= OFF_PROFILE:
            if current.last == 0.0 and s >= current.places[-1]:
                return LateralProfile(ROUTE, (s,), (0.0,))
            return current
        return self._to_route(situation)

    def _to_route(self, situation: Situation) -> LateralProfile:
        """Return the motion to the route, which continues the current one if the vehicle is on that."""
        current = self._current
        s, start, slope = situation.steered
        if current is not None and abs(current.offset_at(s) - start) <= OFF_PROFILE:
            start, slope = current.offset_at(s), current.slope_at(s)
        if abs(start) < 0.02 and abs(slope) < 0.01:
            return LateralProfile(ROUTE, (s,), (0.0,))
        return towards(ROUTE, 0.0, Start(s, start, slope, situation.speed), self._settings.lateral_acceleration)

    def _given_up(self, situation: Situation, scene: Surroundings, current: LateralProfile) -> LateralProfile | None:
        """Return the motion from a lane of the opposite direction to the route, behind what the vehicle is passing."""
        s, settings = situation.steered[0], self._settings
        offset = current.offset_at(s)
        behind = self._oncoming.place_behind(current, situation.motion, scene, self._emergency)
        if behind is None or current.side * offset <= current.border:
            return None
        begin = max(behind + self._body.wheelbase, s + 0.1)
        end = begin + change_length(offset, WALKING_PACE, HASTY * settings.lateral_acceleration)
        return LateralProfile(ROUTE, (s, begin, end), (offset, offset, 0.0), gives_up=True)

    def _options(
        self,
        situation: Situation,
        scene: Surroundings,
        profiles: list[LateralProfile],
        *,
        with_maneuvers: bool = False,
    ) -> Options:
        """Return the proposals along profiles, the first of which is the current one, and along new maneuvers."""
        if with_maneuvers:
            profiles = profiles + passing_profiles(situation, scene, self._behind, has_begun=self._passes)
        waiting, refused = set[int](), set[int]()
        options: list[Option] = []
        change = situation.change
        end = None if change is None else change.wall(self._body.front, self._settings.lateral_acceleration)
        for number, profile in enumerate(profiles):
            merges = change is not None and profile.name == change.name
            course = self._course(situation, scene, profile, None if merges else end)
            if course.verdict in (Verdict.WAIT, Verdict.FOLLOW):
                waiting.add(number)
            if course.verdict is Verdict.GIVE_UP:
                refused.add(number)
            options += self._options_along(situation, scene, number, course, merges=merges)
        rolled = self._roll(situation, scene, options)
        late = None
        if change is not None and end is not None and situation.s >= change.begin:
            desire = change.desire(situation.s, situation.wanted)
            ends = (end.s, situation.end)
            stays = np.array([option.profile.name != change.name for option in options])
            late = stays * costs_of_waiting(change.offset, rolled, scene, self._times, desire, self._body, ends)
        evaluation = evaluate(
            options,
            rolled,
            scene,
            self._times,
            self._body,
            self._settings,
            limits=situation.speed_limits,
            kept=self._kept_names(situation),
            waiting=waiting,
            refused=refused,
            late=late,
        )
        return Options(options, rolled, evaluation, float(self._times[-1]), waiting, refused)

    def _course(self, situation: Situation, scene: Surroundings, profile: LateralProfile, end: Wall | None) -> Course:
        """Return the course along a profile; `end` is the end of the lane unless the profile leaves it."""
        holds: list[Wall] = []
        verdict = Verdict.GO
        if profile.uses_oncoming:
            profile, verdict, waits_at = self._verified(situation, scene, profile)
            if verdict is Verdict.WAIT:
                holds.append(Wall(waits_at, math.inf, "wait for a free oncoming lane"))
        if end is not None:
            holds.append(end)
        way = inside_way(scene, profile, self._body.half_width)
        if verdict is not Verdict.WAIT:
            holds += situation.clear_of_junctions(scene, way)
        if profile.gives_up:
            # It falls behind what it is beside, and does not brake for it before.
            behind = profile.places[1] + self._body.front
            way &= (scene.speed <= ONCOMING_SPEED) | (scene.rear > behind)
        for hold in holds:
            way &= scene.rear < hold.s + self._body.front
        crossing = conflicts(scene, way, situation.s)
        if profile.gives_up:
            crossing = [conflict for conflict in crossing if conflict.crosses]
        return Course(profile, verdict, holds, way, crossing)

    def _options_along(
        self, situation: Situation, scene: Surroundings, number: int, course: Course, *, merges: bool
    ) -> list[Option]:
        """Return the proposals along the course of the profile `number`, of which 0 is the current one."""
        profile, settings = course.profile, self._settings
        change = situation.change
        seeks_gap = change is not None and situation.s >= change.begin and not merges
        is_passing = self._passes and profile.uses_oncoming and not profile.overtakes
        # A gentle motion through another lane would take too long.
        follows = number == 0 and profile.side == 0 and len(scene) > 0
        here = (self._body.front, situation.s, situation.speed)
        crossing = course.conflicts
        reasons = {
            conflict.hypothesis: f"give way to {situation.kind_of(scene.owner[conflict.hypothesis])}"
            for conflict in crossing
        }
        reactions: dict[Precedence, tuple[list[Wall], Bools]] = {}
        options: list[Option] = []
        for proposal in proposals_for(
            number,
            crossing,
            settings,
            emergency=self._emergency,
            gives_up=profile.gives_up,
            is_current=number == 0,
            comfortable=TOWARDS_GAP if seeks_gap else SPEED_SHARES if follows else (),
        ):
            kind = proposal.precedence
            if kind not in reactions:
                walls = [*course.holds, *crossing_walls(crossing, self._times, here, kind, reasons), *situation.stops]
                reactions[kind] = walls, leading(scene, course.way, crossing, situation.center, kind)
            walls, leads = reactions[kind]
            time_gap = MERGING_TIME_GAP if merges else self._time_gap.value
            if is_passing and not (leads & (scene.speed > ONCOMING_SPEED)).any():
                time_gap = 0.0  # It leaves the oncoming lane soon, before what stands there.
            if profile.gives_up:
                time_gap = 0.0  # It falls behind a vehicle that is faster than it is then.
            if course.verdict is Verdict.FOLLOW:
                time_gap = max(settings.time_gap, VIEW_TIME_GAP)
            options.append(Option(proposal, profile, walls, leads, time_gap))
        if change is not None and seeks_gap:
            walls, leads = reactions["all"]
            comfortable = settings.comfortable_deceleration
            leads = leads | gap_leader(scene, change.offset, situation.motion, self._body, comfortable)
            options.append(Option(Proposal(number, 1.0, "all", comfortable), profile, walls, leads, MERGING_TIME_GAP))
        return options

    def _motion(self, situation: Situation, scene: Surroundings, profile: LateralProfile, time_gap: float) -> Motion:
        """Return the motion along a profile at the wanted speed, with a time gap behind leaders [s]."""
        way = inside_way(scene, profile, self._body.half_width)
        crossing = conflicts(scene, way, situation.s)
        leads = leading(scene, way, crossing, situation.center, self._cruise.precedence)
        rolled = self._roll(situation, scene, [Option(self._cruise, profile, situation.stops, leads, time_gap)])
        return Motion(rolled.s[0], rolled.speed[0])

    def _roll(self, situation: Situation, scene: Surroundings, options: list[Option]) -> Rollout:
        return self._roller.roll(options, situation.speed_limits, situation.motion, self._body, scene)

    def _verified(
        self, situation: Situation, scene: Surroundings, profile: LateralProfile
    ) -> tuple[LateralProfile, Verdict, float]:
        """Return a profile that uses the oncoming lane, whether the vehicle may follow it, and where it waits [m].

        A vehicle that has to wait does so at the edge of its lane if there is enough space: it has a better view there.
        """
        motion = self._motion(situation, scene, profile, self._settings.time_gap)
        beside = situation.lanes_along(profile)
        outlook = Outlook(situation.line, scene, beside, situation.now)
        is_current = self._current is not None and self._current.name == profile.name
        has_begun = self._passes and is_current
        verdict = self._oncoming.verify(profile, motion, outlook, is_current=is_current, has_begun=has_begun)
        waits_at = self._oncoming.waiting_place(profile, situation.s)
        if verdict is Verdict.GO and not has_begun and not may_pass(situation, scene):
            verdict = Verdict.WAIT
        elif verdict is Verdict.GO and not profile.overtakes and sets_off(situation, scene):
            verdict = Verdict.GIVE_UP
        s = situation.center
        viewpoint = (s, profile.offset_at(s))
        if verdict is Verdict.WAIT:
            sufficient = self._oncoming.place_with_view(profile, scene, beside.oncoming, situation.s)
            onward_speed = situation.speed_at(profile.places[-3], self._roller.brisk_acceleration)
            better = with_view(profile, situation.start, self._settings, self._body, sufficient, onward_speed)
            if better is not None:
                profile, waits_at = better, self._oncoming.waiting_place(better, situation.s)
            elif math.isinf(profile.waits_at):
                # Nearer to the obstacle it would see less.
                stop = situation.speed**2 / (2.0 * self._settings.comfortable_deceleration)
                waits_at = min(waits_at, situation.s + stop)
            waits_at = situation.outside_junctions(waits_at)
            waits = situation.speed < AT_REST and waits_at - situation.s < NEAR_PLACE
            if waits and may_pass(situation, scene):
                # A new profile has no place with a view if the vehicle is at that of the current one.
                places = (profile.waits_at, math.inf if self._current is None else self._current.waits_at)
                has_view = any(situation.steered[0] - NEAR_PLACE < place < math.inf for place in places)
                until_border = self._oncoming.until_border(profile, motion)
                is_free = self._oncoming.yields(
                    outlook, viewpoint, is_last_place=True, has_view=has_view, until_border=until_border
                )
                verdict = Verdict.GO if is_free else verdict
        elif verdict is Verdict.FOLLOW:
            if self._oncoming.yields(outlook, viewpoint, is_last_place=False, has_view=True):
                return profile, Verdict.GO, waits_at
            lateral = self._settings.lateral_acceleration
            edge = towards(profile.name, profile.edge, situation.start, lateral, profile.side)
            # A motion to the edge that has begun is completed, instead of a new one in each tick.
            current = self._current if is_current else None
            profile = current if current is not None and abs(current.last - edge.last) < AT_OFFSET else edge
        return profile, verdict, waits_at

    def _required_change(self, situation: Situation, scene: Surroundings, change: LaneChange) -> LateralProfile | None:
        """Return the motion into the lane to which the route changes; None without a gap.

        Traffic behind the gap must not come too close later either: the vehicle may have to stop soon.
        """
        offset, body = change.offset, self._body
        if situation.s < change.begin or not has_gap_now(scene, offset, situation.motion, body, MERGING_TIME_GAP):
            return None
        behind = self._behind[1 if offset > 0.0 else -1]
        if not behind.leaves_gap(situation.limit, situation.speed, situation.now):
            return None
        profile = to_lane(offset, situation.start, self._settings.lateral_acceleration)
        s = self._motion(situation, scene, profile, MERGING_TIME_GAP).s
        has_room = leaves_room(scene, offset, s[None], body, len(self._times))[0, 0]
        return profile if has_room else None

    def _kept_names(self, situation: Situation) -> frozenset[str]:
        """Return the current maneuver, and the route if its lateral motion is complete: then the vehicle returns."""
        current = self._current
        if current is None:
            return frozenset({ROUTE})
        is_complete = situation.s >= current.places[-1]
        return frozenset({current.name, ROUTE}) if is_complete else frozenset({current.name})

    def _is_held_up(self, situation: Situation, options: Options, best: int) -> bool:
        """Return whether the best proposal makes too little progress because of objects."""
        if options.collides(best):
            return True
        return options.progress(best) < SATISFIED * situation.free_progress(options.horizon)

    def _kept(self, options: Options, best: int, now: float) -> int:
        """Return the best proposal; that of the current maneuver during its dwell time, unless it is risky.

        Another maneuver has to be the best one for some time, so that noise of velocities does not start it, unless the
        current one has to brake as in an emergency meanwhile.
        """
        if self._current is None:
            return best
        name, wanted = self._current.name, options.options[best].profile.name
        if wanted == name:
            self._challenger = (name, math.inf)
            return best
        if self._challenger[0] != wanted or math.isinf(self._challenger[1]):
            self._challenger = (wanted, now)
        is_due = now - self._switched >= DWELL and now - self._challenger[1] >= PERSISTENT - TIME_TOLERANCE
        if is_due or all(option.profile.name != name for option in options.options):
            return best
        kept = options.best(name=name)
        proposal = options.options[kept].proposal
        is_risky = proposal.profile in options.refused or options.collides(kept)
        # A best option that brakes as hard, or collides as well, is no way out.
        saves = proposal.is_emergency and not options.options[best].proposal.is_emergency and not options.collides(best)
        return best if is_risky or saves else kept

    def _decision(self, situation: Situation, options: Options, best: int) -> Decision:
        proposal, profile = options.options[best].proposal, options.options[best].profile
        if self._current is not None and profile.name != self._current.name:
            self._switched = situation.now
        self._current = profile
        self._passes = profile.uses_oncoming and proposal.profile not in options.waiting
        speed, s = options.rolled.speed[best], options.rolled.s[best]
        acceleration = self._acceleration(options, best)
        reason, objects = reason_of(situation, options, best)
        braking = proposal.deceleration if proposal.is_emergency else None
        causes = options.rolled.cause[best]
        is_free = proposal.share == 1.0 and not proposal.is_emergency and bool((causes == FREE).all())
        return Decision(profile, s, speed, acceleration, braking, reason, objects, is_free)
