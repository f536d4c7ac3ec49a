"""OpenSCENARIO texts for tests: actions, triggers and the elements of storyboards."""

from __future__ import annotations

EVENT_STORY = """<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors>
<Maneuver name="maneuver"><Event name="event" priority="parallel">
<Action name="action"><PrivateAction>{action}</PrivateAction></Action>
<StartTrigger><ConditionGroup>{condition}</ConditionGroup></StartTrigger>
</Event></Maneuver></ManeuverGroup><StartTrigger/></Act></Story>"""

SPEED_ACTION = """<LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget>
</SpeedAction></LongitudinalAction>"""

CONDITION = """<Condition name="{name}" delay="{delay}" conditionEdge="{edge}">{inside}
</Condition>"""


# Actions


def init_xml(entity: str, *actions: str) -> str:
    """Return Init actions of an entity, each a `PrivateAction`."""
    return f'<Private entityRef="{entity}">{"".join(actions)}</Private>'


def private_xml(action: str) -> str:
    """Return an action of an actor."""
    return f"<PrivateAction>{action}</PrivateAction>"


def global_xml(action: str) -> str:
    """Return an action without an actor."""
    return f"<GlobalAction>{action}</GlobalAction>"


def teleport_xml(position: str) -> str:
    """Return an action that places its actor at a position."""
    return private_xml(f"<TeleportAction><Position>{position}</Position></TeleportAction>")


def lane_position_xml(lane: int, s: float, road: str | int = "1", inside: str = "") -> str:
    """Return a position in a lane, at `s` along its road [m]; `inside` may be an orientation."""
    return f'<LanePosition roadId="{road}" laneId="{lane}" s="{s}">{inside}</LanePosition>'


def world_position_xml(x: float, y: float = 0) -> str:
    """Return a position in world coordinates [m]."""
    return f'<WorldPosition x="{x}" y="{y}"/>'


def speed_xml(speed: float | str, value: float = 0.0, *, shape: str = "", dimension: str = "time") -> str:
    """Return an action that sets the speed [m/s], by default at once or, with `value`, linearly in that time [s]."""
    shape = shape or ("linear" if value else "step")
    return private_xml(SPEED_ACTION.format(shape=shape, dimension=dimension, value=value, speed=speed))


# Triggers


def time_xml(value: float | str, rule: str = "greaterThan") -> str:
    """Return a condition of a trigger on the simulation time [s], without name and edge."""
    return f'<ByValueCondition><SimulationTimeCondition rule="{rule}" value="{value}"/></ByValueCondition>'


def element_state_xml(kind: str, name: str, state: str) -> str:
    """Return a condition on the state of a storyboard element, without name and edge."""
    return (
        f'<ByValueCondition><StoryboardElementStateCondition storyboardElementType="{kind}" '
        f'storyboardElementRef="{name}" state="{state}"/></ByValueCondition>'
    )


def by_entity_xml(condition: str, entities: str = "Ego", rule: str = "any") -> str:
    """Return a condition on entities, listed in one text, without name and edge."""
    names = "".join(f'<EntityRef entityRef="{name}"/>' for name in entities.split())
    return (
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{rule}">{names}</TriggeringEntities>'
        f"<EntityCondition>{condition}</EntityCondition></ByEntityCondition>"
    )


def condition_xml(inside: str, edge: str = "none", delay: float = 0, name: str = "c") -> str:
    """Return a named condition with its edge and delay [s]."""
    return CONDITION.format(name=name, delay=delay, edge=edge, inside=inside)


def groups_xml(*groups: str) -> str:
    """Return condition groups, the content of a trigger; each is a text of one or several conditions."""
    return "".join(f"<ConditionGroup>{group}</ConditionGroup>" for group in groups)


def trigger_xml(*groups: str, kind: str = "StartTrigger") -> str:
    """Return a trigger of condition groups; without groups nothing."""
    return f"<{kind}>{groups_xml(*groups)}</{kind}>" if groups else ""


def end_xml(seconds: float) -> str:
    """Return the content of a stop trigger that ends the run at a time [s]."""
    return groups_xml(condition_xml(time_xml(seconds, "greaterOrEqual"), name="end"))


# Storyboard


def event_xml(
    name: str, action: str, trigger: str = "", *, action_name: str = "", priority: str = "parallel", count: int = 1
) -> str:
    """Return an event with one action, by default named "NAME action", and a start trigger."""
    return (
        f'<Event name="{name}" priority="{priority}" maximumExecutionCount="{count}">'
        f'<Action name="{action_name or f"{name} action"}">{action}</Action>{trigger}</Event>'
    )


def group_xml(
    maneuvers: str, actors: str = "Ego", *, name: str = "group", count: int = 1, triggering: bool = False
) -> str:
    """Return a maneuver group of actors, listed in one text; with `triggering` also its triggering entities."""
    references = "".join(f'<EntityRef entityRef="{actor}"/>' for actor in actors.split())
    return (
        f'<ManeuverGroup name="{name}" maximumExecutionCount="{count}">'
        f'<Actors selectTriggeringEntities="{str(triggering).lower()}">{references}</Actors>{maneuvers}</ManeuverGroup>'
    )


def maneuver_xml(events: str, name: str = "maneuver") -> str:
    """Return a maneuver of events."""
    return f'<Maneuver name="{name}">{events}</Maneuver>'


def act_xml(groups: str, triggers: str = "", name: str = "act") -> str:
    """Return an act of maneuver groups, with its start and stop trigger."""
    return f'<Act name="{name}">{groups}{triggers}</Act>'


def acts_xml(*acts: str, name: str = "story") -> str:
    """Return a story of acts."""
    return f'<Story name="{name}">{"".join(acts)}</Story>'


def story_xml(*, action: str = "", speed: str = "10", condition: str = "") -> str:
    """Return a story in which Ego has one event: `event` with `action`, by default a speed action after 1 s."""
    value = condition or '<SimulationTimeCondition rule="greaterThan" value="1"/>'
    return EVENT_STORY.format(
        action=action or SPEED_ACTION.format(shape="linear", dimension="time", value=2, speed=speed),
        condition=condition_xml(f"<ByValueCondition>{value}</ByValueCondition>", name="go"),
    )
