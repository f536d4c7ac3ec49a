"""Actions: spaces, and conversion to the decisions of a station."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Bools
from eidrive_scenario.driving.step import OWN_DECISIONS, StationAction, StationPerception
from eidrive_scenario.errors import Diagnostic, SettingError, counted, quoted
from eidrive_scenario.gym.libraries import spaces
from eidrive_scenario.gym.observations import nearest_rows
from eidrive_scenario.gym.settings import ActionSettings, MetaSpeed, Pedals, SendMessages, TargetSpeed
from eidrive_scenario.world.actor import Control

_TOLERANCE = 1e-6
"""Excess over the bounds of a space that is accepted, for rounding."""


class ActionDecoder:
    """Actions of one station: their space, and their conversion.

    Of several actions the space is a `Dict` by their kinds.
    """

    def __init__(self, actions: Sequence[ActionSettings]) -> None:
        self._actions = {action.kind: action for action in actions}
        self._max_steering = 0.0
        self._level = 0
        self._mask: Bools = np.empty(0, dtype=bool)
        by_kind: dict[str, spaces.Space[Any]] = {action.kind: _space(action) for action in actions}
        self.space: spaces.Space[Any] = spaces.Dict(by_kind) if len(actions) > 1 else by_kind[actions[0].kind]

    def reset(self, speed: float, max_steering: float) -> None:
        """Begin an episode at a speed [m/s], with a maximum steering angle [rad].

        Relative speeds start from the one that is nearest to the speed.
        """
        self._max_steering = max_steering
        for action in self._actions.values():
            if isinstance(action, MetaSpeed):
                self._level = min(range(len(action.speeds)), key=lambda level: abs(action.speeds[level] - speed))

    def decode(self, given: Any, perceived: StationPerception) -> StationAction:
        """Return the decisions of an action for a step that starts with this perception; `begin_step` begins that step.

        Raise SettingError if the space does not contain the action.
        """
        if len(self._actions) == 1:
            (action,) = self._actions.values()
            return self._decode(action, given, perceived, OWN_DECISIONS)
        if not isinstance(given, Mapping) or given.keys() != self._actions.keys():
            raise _outside(given, f"a mapping with the keys {', '.join(self._actions)}")
        decided = OWN_DECISIONS
        for kind, action in self._actions.items():
            decided = self._decode(action, given[kind], perceived, decided)
        return decided

    def begin_step(self, decided: StationAction) -> None:
        """Begin the step of decoded decisions: the next relative speed starts from theirs."""
        for action in self._actions.values():
            if isinstance(action, MetaSpeed) and decided.target_speed is not None:
                self._level = action.speeds.index(decided.target_speed)

    def select_again(self, decided: StationAction, perceived: StationPerception) -> StationAction:
        """Return the last decoded decisions for a later tick: shared objects are the nearest ones at that time."""
        return decided if decided.share is None else replace(decided, share=self._shared_rows(perceived))

    def _shared_rows(self, perceived: StationPerception) -> tuple[int, ...]:
        rows = nearest_rows(perceived.detections, perceived.ego)
        return tuple(row for row, chosen in zip(rows, self._mask, strict=False) if chosen)

    def _decode(
        self, action: ActionSettings, given: Any, perceived: StationPerception, decided: StationAction
    ) -> StationAction:
        if isinstance(action, TargetSpeed):
            (share,) = _numbers(given, 1)
            return replace(decided, target_speed=(share + 1.0) / 2.0 * action.max_speed)
        if isinstance(action, Pedals):
            pedal, wheel = _numbers(given, 2)
            steering = wheel * self._max_steering
            return replace(decided, control=Control(max(pedal, 0.0), max(-pedal, 0.0), steering))
        if isinstance(action, MetaSpeed):
            if action.relative:
                level = min(max(self._level + _index(given, 3) - 1, 0), len(action.speeds) - 1)
            else:
                level = _index(given, len(action.speeds))
            return replace(decided, target_speed=action.speeds[level])
        if isinstance(action, SendMessages):
            return replace(decided, send=bool(_index(given, 2)))
        self._mask = _mask(given, action.count)
        return replace(decided, send=bool(self._mask.any()), share=self._shared_rows(perceived))


def _space(action: ActionSettings) -> spaces.Space[Any]:
    if isinstance(action, TargetSpeed):
        return spaces.Box(-1.0, 1.0, (1,), np.float32)
    if isinstance(action, Pedals):
        return spaces.Box(-1.0, 1.0, (2,), np.float32)
    if isinstance(action, MetaSpeed):
        return spaces.Discrete(3 if action.relative else len(action.speeds))
    if isinstance(action, SendMessages):
        return spaces.Discrete(2)
    return spaces.MultiBinary(action.count)


def _numbers(given: Any, count: int) -> list[float]:
    """Return numbers in [-1, 1]."""
    expected = f"{counted(count, 'number')} from -1 to 1"
    values = _array(given, expected, "iufb").reshape(-1).tolist()
    if len(values) != count or not all(abs(value) <= 1.0 + _TOLERANCE for value in values):
        raise _outside(given, expected)
    return [min(max(value, -1.0), 1.0) for value in values]


def _index(given: Any, count: int) -> int:
    """Return an integer from 0 to `count` - 1."""
    expected = f"an integer from 0 to {count - 1}"
    value = _array(given, expected, "iu")
    if value.size != 1 or not 0 <= int(value.item()) < count:
        raise _outside(given, expected)
    return int(value.item())


def _mask(given: Any, count: int) -> Bools:
    """Return `count` truth values."""
    expected = f"{counted(count, 'number')} out of 0 and 1"
    value = _array(given, expected, "iufb")
    if value.shape != (count,) or not np.isin(value, (0, 1)).all():
        raise _outside(given, expected)
    return value.astype(bool)


def _array(given: Any, expected: str, kinds: str) -> NDArray[Any]:
    """Return an action as an array of one of the kinds of numpy. Raise SettingError if it has no such form."""
    try:
        values = np.asarray(given)
    except (OverflowError, TypeError, ValueError):
        raise _outside(given, expected) from None
    if values.dtype.kind not in kinds:
        raise _outside(given, expected)
    return values


def _outside(given: Any, expected: str) -> SettingError:
    return SettingError(Diagnostic(f"the action is {quoted(given)}", f"give {expected}"))
