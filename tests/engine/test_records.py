"""Records made often: as frozen dataclasses, only quicker."""

from __future__ import annotations

import inspect
import pickle
from dataclasses import FrozenInstanceError, asdict, dataclass, field, replace

import pytest

from eidrive_scenario.records import fast_frozen


@fast_frozen
@dataclass(frozen=True)
class Record:
    number: int
    name: str = "none"
    parts: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.number < 0:
            raise ValueError("a number below 0")


def test_fields_are_set_by_position_and_name_with_defaults() -> None:
    assert asdict(Record(1)) == {"number": 1, "name": "none", "parts": []}
    assert asdict(Record(2, "two", [3])) == {"number": 2, "name": "two", "parts": [3]}
    assert Record(number=2, parts=[3], name="two") == Record(2, "two", [3])
    assert repr(Record(1)).endswith("Record(number=1, name='none', parts=[])")


def test_default_factory_is_called_per_record() -> None:
    first, second = Record(1), Record(1)
    first.parts.append(5)
    assert second.parts == []


def test_field_assignment_raises() -> None:
    record = Record(1)
    with pytest.raises(FrozenInstanceError):
        record.number = 2  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError):
        del record.name
    assert record.number == 1


def test_post_init_check_is_executed() -> None:
    with pytest.raises(ValueError, match="below 0"):
        Record(-1)
    with pytest.raises(ValueError, match="below 0"):
        replace(Record(1), number=-1)


def test_wrong_arguments_raise_with_class_name() -> None:
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'number'"):
        Record()  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="unexpected keyword argument 'size'"):
        Record(1, size=2)  # type: ignore[call-arg]
    assert list(inspect.signature(Record).parameters) == ["number", "name", "parts"]


def test_record_survives_pickling() -> None:
    record = Record(4, "four", [1, 2])
    assert pickle.loads(pickle.dumps(record)) == record
    assert replace(record, name="vier") == Record(4, "vier", [1, 2])


def test_class_with_non_init_fields_raises() -> None:
    @dataclass(frozen=True)
    class Derived:
        number: int
        twice: int = field(init=False, default=0)

    with pytest.raises(TypeError, match="are not parameters"):
        fast_frozen(Derived)
