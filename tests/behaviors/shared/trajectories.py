"""Parts of scenarios: trajectories, and actions that follow them."""

from __future__ import annotations

from collections.abc import Sequence

from storyboard_xml import private_xml

RELATIVE = '<Timing domainAbsoluteRelative="relative" offset="0" scale="1"/>'
CORNER = [(100.0, -2.0, None), (110.0, -2.0, None), (110.0, 18.0, None)]
"""Points without times of `follow_points`: 10 m ahead from s = 100, then 20 m to the left."""


def world(x: float, y: float, h: float | None = None) -> str:
    heading = "" if h is None else f' h="{h}"'
    return f'<WorldPosition x="{x}" y="{y}"{heading}/>'


def on_road(s: float, t: float) -> str:
    return f'<RoadPosition roadId="1" s="{s}" t="{t}"/>'


def curve(*places: str, closed: bool = False, times: tuple[float, ...] = ()) -> str:
    """Return a polyline through positions, with or without times [s]."""
    clock = [f' time="{time}"' for time in times] or [""] * len(places)
    vertices = "".join(
        f"<Vertex{at}><Position>{place}</Position></Vertex>" for place, at in zip(places, clock, strict=True)
    )
    shape = f"<Shape><Polyline>{vertices}</Polyline></Shape>"
    return f'<Trajectory name="way" closed="{str(closed).lower()}">{shape}</Trajectory>'


def follow(way: str, mode: str = "position", reference: str = "<None/>") -> str:
    """Return an action that follows a trajectory."""
    return private_xml(f"""<RoutingAction><FollowTrajectoryAction><TrajectoryRef>{way}</TrajectoryRef>
      <TimeReference>{reference}</TimeReference><TrajectoryFollowingMode followingMode="{mode}"/>
      </FollowTrajectoryAction></RoutingAction>""")


def follow_points(
    points: Sequence[tuple[float, float, float | None]], mode: str = "position", reference: str = ""
) -> str:
    """Return an action that follows a polyline through points x, y, time; time is None without timing.

    The default time reference is relative to the start of the action, none without timing.
    """
    times = tuple(time for _, _, time in points if time is not None)
    reference = reference or (RELATIVE if times else "<None/>")
    return follow(curve(*(world(x, y) for x, y, _ in points), times=times), mode, reference)
