"""Which messages are lost."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from eidrive_scenario.settings import Settings


class NoLoss(Settings):
    """Every message arrives."""

    kind: Literal["none"] = "none"


class BernoulliLoss(Settings):
    """Each message is lost with the same probability, independently of all others.

    scope  `link`: one draw per message and link. `frame`: one draw per receiver and instant takes all that is sent to
           it then, over links from others and from itself. With `own_perception: true` this is the fault that the
           published EI-Drive code injects: in one tick a station loses the whole list of objects, or nothing.
    """

    kind: Literal["bernoulli"]
    probability: float = Field(ge=0.0, le=1.0)
    scope: Literal["link", "frame"] = "link"


Loss = Annotated[NoLoss | BernoulliLoss, Field(discriminator="kind")]
