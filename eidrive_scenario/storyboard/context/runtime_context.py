"""State of the storyboard at run time, which conditions read and actions request changes of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from msgspec.structs import replace

from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.contexts import ActionContext, ControllerContext, MotionChange, speed_change
from eidrive_scenario.storyboard.state.commands import NONE, Commands, ExternalPose
from eidrive_scenario.storyboard.state.element_states import MOTION, Domain
from eidrive_scenario.world.view import WorldView

if TYPE_CHECKING:
    from eidrive_scenario.traffic.spawning.population import Changes


def _overlaps(view: WorldView, name: str, other: str) -> bool:
    """Return whether the boxes of two actors overlap; False if one of them is absent."""
    return name in view and other in view and overlap(*view.boxes[[view.row(name), view.row(other)]])


class PreemptableAction(Protocol):
    """Element whose behaviours hold domains that a later action can acquire."""

    def linked_behaviours(self, behaviour: ActionBehaviour) -> Sequence[ActionBehaviour]:
        """Return the behaviours that lose their domains together with this one, including it."""

    def preempt(self, behaviour: ActionBehaviour, why: str) -> None:
        """Stop a behaviour whose domain another action has acquired."""


class RuntimeContext(ActionContext, ControllerContext):
    """State of the run for the storyboard and its tree, which hold control domains and update it once per tick.

    moved        entities whose state, and whose speed, differs from that in the last view; all if actors enter or leave
    """

    def __init__(self, scenario: Scenario, roads: RoadNetwork | None, *, dt: float, seed: int) -> None:
        super().__init__(scenario, roads, dt=dt, seed=seed)
        self.moved: set[MotionChange] = set()
        self.completes_this_step = False
        """Whether an action reaches its goal in the current step."""
        self.pending_actions: list[Callable[[], None]] = []
        """Functions that stop actions that have started at this instant if their entity is still absent."""
        self.instant_actions: list[Callable[[], None]] = []
        """Functions that execute actions with behaviours that take no time, in the order of their starts at this
        instant."""
        self._holders: list[tuple[str, Domain, PreemptableAction, ActionBehaviour]] = []
        """Control domains with their actors, and the element and the behaviour that hold them."""

    def begin_tick(
        self,
        view: WorldView,
        dt: float,
        user_values: Mapping[str, str] = NONE,
        external_poses: Mapping[str, ExternalPose] = NONE,
    ) -> None:
        """Start a tick with a new view and empty commands; histories are continued."""
        last_names = self.view.names
        self.view = view
        self.dt = dt
        self.user_values = user_values
        if external_poses:
            self.external_poses.update(external_poses)
        self.commands = Commands()
        self.instant_actions.clear()
        self.progress.begin(view.tick, view.time)
        self.parting = {pair for pair in self.parting if _overlaps(view, *pair)}
        moved: set[MotionChange] = set()
        rows, states = view.rows, view.states
        for name, actor in self.actors.items():
            row = rows.get(name)
            if row is not None:
                last = actor.last_state
                if states[row] is last and actor.motion.rests and not actor.tracks_off_road:
                    continue
                if actor.observe(view, row):
                    moved.add(name)
                    if last is None or last.speed != states[row].speed:
                        moved.add(speed_change(name))
                if actor.tracks_off_road:
                    actor.update_off_road(self.roads, view)
                if actor.tracks_end_of_road and actor.driven:
                    actor.update_end_of_road(self.roads, view)
        self.moved = moved if view.names is last_names else {*self.actors, *map(speed_change, self.actors)}

    def remove_actor(self, name: str) -> None:
        """Remove an actor from the world, disconnected from trailers, and end the actions that control it."""
        super().remove_actor(name)
        self._preempt_all(name, ~Domain.NONE, f"{name} is removed")

    def connect_trailer(self, name: str, trailer: str) -> None:
        """Connect a trailer to an actor, in place of its present one; the actions that move the trailer end."""
        super().connect_trailer(name, trailer)
        self.let_tow(name, trailer)

    def let_tow(self, name: str, trailer: str) -> None:
        """End the actions that move a trailer, and its controller, as the actor that tows it moves it."""
        self._preempt_all(trailer, MOTION, f"{name} tows {trailer}")
        self.actors[trailer].activate_controller(False, False)

    def _preempt_all(self, name: str, domains: Domain, why: str) -> None:
        """Preempt the holders of domains of an actor."""
        for actor, held, occupant, holder in list(self._holders):
            if actor == name and held & domains:
                occupant.preempt(holder, why)
                self.release_domains(holder)

    def step_traffic(self) -> None:
        """Add spawns, removals and placements of background traffic in the current step to the commands."""
        for traffic in (self.traffic, self.sumo):
            if traffic is not None:
                invisible = [name for name, appearance in self.appearances.items() if not appearance.visibility.traffic]
                self._apply(traffic.step(self.view.without(invisible), self.dt))

    def _apply(self, changes: Changes) -> None:
        commands = self.commands
        for name, (spec, placement) in changes.additions.items():
            commands.spawns[name] = placement
            commands.actor_specs[name] = spec
        commands.removals |= changes.removals
        commands.placements.update(changes.placements)
        for name in changes.additions:
            if name not in changes.placements:
                commands.placements[name] = replace(commands.spawns[name], teleport=True)

    def acquire_domain(
        self, actor: str | None, domains: Domain, occupant: PreemptableAction, holder: ActionBehaviour
    ) -> None:
        """Let a behaviour acquire domains of an actor; the previous holders of these domains are preempted.

        A holder that acts on an entity selection is preempted for all members (ASAM OpenSCENARIO XML 1.3.1, 7.5.1).
        """
        if actor is None or not domains:
            return
        for holder_actor, other_domains, other, behaviour in list(self._holders):
            if (
                holder_actor == actor
                and other_domains & domains
                and not set(behaviour.resources).isdisjoint(holder.resources)
            ):
                for preempted in other.linked_behaviours(behaviour):
                    self.release_domains(preempted)
                    if preempted.controls & MOTION:
                        # It may have decided before an action of this step changed a state.
                        preempted.actor.motion.discard_requests(
                            lateral=bool(preempted.controls & Domain.LATERAL),
                            longitudinal=bool(preempted.controls & Domain.LONGITUDINAL),
                        )
                    other.preempt(preempted, f"{holder.name} acquired its domain")
        self._holders.append((actor, domains, occupant, holder))

    def release_domains(self, holder: ActionBehaviour) -> None:
        """Release all domains of a behaviour."""
        self._holders = [entry for entry in self._holders if entry[3] is not holder]
