import dataclasses
import pickle

import pytest

from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.reading.document import VERSIONS
from eidrive_scenario.openscenario.reading.schema import rules

CLASSES = sorted(model.Element.__subclasses__(), key=lambda cls: cls.__name__)


def test_element_comparison_ignores_lines() -> None:
    one = model.WorldPosition(x=1.0, y=2.0, line=3, source="a.xosc")
    other = model.WorldPosition(x=1.0, y=2.0, line=4, source="b.xosc")
    assert one == other
    assert hash(one) == hash(other)


def test_elements_are_frozen_and_picklable() -> None:
    position = model.Position(world_position=model.WorldPosition(x=1.0, y=2.0, line=7))
    with pytest.raises(dataclasses.FrozenInstanceError):
        position.world_position = None  # type: ignore[misc]
    again = pickle.loads(pickle.dumps(position))
    assert again == position
    assert again.world_position.line == 7


def test_element_requires_its_fields_and_no_other() -> None:
    with pytest.raises(TypeError, match="WorldPosition requires y"):
        model.WorldPosition(x=1.0)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="WorldPosition has no field w"):
        model.WorldPosition(x=1.0, y=2.0, w=3.0)  # type: ignore[call-arg]
    with pytest.raises(dataclasses.FrozenInstanceError):
        del model.WorldPosition(x=1.0, y=2.0).x


def test_elements_of_different_content_or_class_are_unequal() -> None:
    position = model.WorldPosition(x=1.0, y=2.0)
    assert position != dataclasses.replace(position, y=3.0)
    assert dataclasses.replace(position, y=3.0) == model.WorldPosition(x=1.0, y=3.0)
    assert model.AbsoluteSpeed(value=1.0) != model.AbsoluteTargetSpeed(value=1.0)


def test_text_of_element_omits_its_location() -> None:
    distance = model.TargetDistanceSteadyState(distance=2.0, line=7, source="a.xosc")
    assert repr(distance) == "TargetDistanceSteadyState(distance=2.0)"


def test_chosen_returns_the_set_alternative() -> None:
    world = model.WorldPosition(x=0.0, y=0.0)
    assert model.Position(world_position=world).chosen() is world
    with pytest.raises(ValueError, match=r"got 0; expected 1"):
        model.Position().chosen()


def test_chosen_considers_only_the_choice() -> None:
    reference = model.CatalogReference(catalog_name="Vehicles", entry_name="car")
    controller = model.ObjectController(catalog_reference=reference)
    entity = model.ScenarioObject(name="Ego", catalog_reference=reference, object_controller=(controller,))
    assert entity.chosen() is reference


def test_walk_yields_every_element_once() -> None:
    corners = tuple(
        model.Vertex(position=model.Position(world_position=model.WorldPosition(x=x, y=0.0))) for x in (0.0, 1.0)
    )
    tree = model.Trajectory(name="t", closed=False, shape=model.Shape(polyline=model.Polyline(vertex=corners)))
    kinds = [type(element).__name__ for element in tree.walk()]
    assert kinds == ["Trajectory", "Shape", "Polyline", *["Vertex", "Position", "WorldPosition"] * 2]


@pytest.mark.parametrize("version", VERSIONS)
def test_every_class_has_rules_in_every_version(version: tuple[int, int]) -> None:
    for cls in CLASSES:
        known = rules(cls, version)
        assert (
            set(known.attributes)
            | set(known.children)
            | {known.text_field}
            | set(known.other_attributes)
            | set(known.other_children)
        ), cls


def test_model_has_every_schema_type() -> None:
    """The expectation is the union of the types of 1.0, 1.1.1, 1.2, 1.3.1 and 1.4; None is None_ in Python,
    and the ten types of catalog locations are one class."""
    assert len(CLASSES) == 287
    assert "None_" in {cls.__name__ for cls in CLASSES}


def test_every_class_has_a_docstring() -> None:
    """A dataclass without a docstring gets its signature as one."""
    assert [cls.__name__ for cls in CLASSES if not cls.__doc__ or cls.__doc__.startswith(f"{cls.__name__}(")] == []
