"""A scenario of two stations on a plane, whose extensions are chosen."""

from __future__ import annotations

from pathlib import Path

from openscenario_xml import agent_xml, object_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    event_xml,
    group_xml,
    groups_xml,
    init_xml,
    maneuver_xml,
    private_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
)

_ACTIVATE = private_xml(
    '<ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/></ControllerAction>'
)


def write_scenario(
    path: Path,
    *,
    detector: str = "oracle",
    fusion: str = "average",
    planner: str = "route",
    tracker: str = "",
    controller: str = "pid",
    criterion: str = "collision: {of: Ego}",
    action: str = "sound",
    condition: str = "sound",
    signals: bool = False,
    sensors: str = "{truth: {}}",
    end: float = 1.0,
    declarations: str = "",
    speed: str = "5",
) -> Path:
    """Write a scenario of `end` seconds with the extensions of the ego, a criterion and an event after 0.5 s."""
    ego = agent_xml(
        detector=detector,
        fusion=fusion,
        planner=planner,
        tracker=tracker,
        vehicle_controller=controller,
        obey_signals=str(signals).lower(),
        sensors=sensors,
    )
    starts = "".join(
        init_xml(name, teleport_xml(f'<WorldPosition x="{x}" y="{x}" h="0"/>'), speed_xml(speed), _ACTIVATE)
        for name, x in (("Ego", 0), ("Other", 20))
    )
    event = event_xml("event", _command("faulty.action", action), trigger_xml(condition_xml(time_xml(0.5))))
    begin = trigger_xml(condition_xml(time_xml(0, "greaterOrEqual")))
    faulty = f'<UserDefinedValueCondition name="faulty.condition" value="{condition}" rule="equalTo"/>'
    path.write_bytes(
        scenario_xml(
            minor=2,
            declarations=declarations,
            entities=object_xml("Ego", controller=ego) + object_xml("Other", controller=agent_xml(detector="oracle")),
            init=_command("eidrive.criterion", criterion) + starts,
            story=acts_xml(act_xml(group_xml(maneuver_xml(event)), begin)),
            stop=groups_xml(
                condition_xml(f"\n<ByValueCondition>{faulty}</ByValueCondition>"), condition_xml(time_xml(end))
            ),
        )
    )
    return path


def _command(kind: str, content: str) -> str:
    return (
        f'<UserDefinedAction>\n<CustomCommandAction type="{kind}">{content}</CustomCommandAction>\n</UserDefinedAction>'
    )
