"""Invalid files of tests/data/broken: each is rejected with line, message and hint."""

from pathlib import Path

import pytest
from processor_time import within_readings

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario

BROKEN = Path(__file__).parents[2] / "data" / "broken"

EXPECTED = {
    "bad_expression": [(41, "unknown function 'squareroot'")],
    "constraint": [(5, "'Speed' is '10.0', outside its constraints; expected lessThan 8")],
    "dangling_element": [(53, "storyboardElementRef refers to event 'Brake', which does not exist")],
    "dangling_entity": [
        (28, "entityRef of Private refers to entity 'Egoo', which does not exist; did you mean 'Ego'?")
    ],
    "duplicate_name": [(24, "two entities are named 'Ego'; the other one is in line 10")],
    "external_entity": [(2, "document type declaration")],
    "missing_attribute": [(32, "WorldPosition lacks the attribute 'y'; expected a number")],
    "missing_catalog": [(15, "no catalog 'Vehicels'")],
    "missing_catalog_entry": [(15, "catalog 'Vehicles' has no entry 'van_red'; known: red_van")],
    "missing_element": [(38, "SpeedAction lacks the element SpeedActionDynamics")],
    "missing_road_file": [(9, "road file 'no_such_road.xodr' is neither")],
    "newer_element": [(57, "AngleCondition in EntityCondition; part of OpenSCENARIO since 1.3")],
    "not_well_formed": [(57, "not well-formed XML")],
    "several": [
        (28, "did you mean 'Ego'?"),
        (32, "lacks the attribute 'y'"),
        (39, "did you mean 'sinusoidal'?"),
        (41, "'fast', which is not a number"),
    ],
    "unknown_assignment": [(17, "unknown parameter 'TopSped'; did you mean 'TopSpeed'?")],
    "unknown_attribute": [(32, "WorldPosition has no attribute 'heading'")],
    "unknown_element": [(39, "unknown element SpeedActionDynamic in SpeedAction; did you mean 'SpeedActionDynamics'?")],
    "unknown_parameter": [(41, "unknown parameter $Sped; did you mean 'Speed'?")],
    "wrong_number": [(41, "value of AbsoluteTargetSpeed is 'fast', which is not a number")],
    "wrong_order": [
        (19, "FrontAxle is not allowed here; Axles contains FrontAxle, RearAxle, AdditionalAxle… in this order")
    ],
    "wrong_word": [(39, "'sinusodial', which is not a literal of DynamicsShape; did you mean 'sinusoidal'?")],
    "xml_bomb": [(2, "document type declaration")],
}


def test_broken_files_all_have_expected_messages() -> None:
    assert {path.stem for path in BROKEN.glob("*.xosc")} == set(EXPECTED)


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_broken_file_error_has_line_and_message(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("EIDRIVE_MAPS", raising=False)
    path = BROKEN / f"{name}.xosc"
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    diagnostics = caught.value.diagnostics
    assert [diagnostic.line for diagnostic in diagnostics] == [line for line, _ in EXPECTED[name]]
    for diagnostic, (line, text) in zip(diagnostics, EXPECTED[name], strict=True):
        assert diagnostic.source == str(path)
        assert str(diagnostic).startswith(f"{path}:{line}: ")
        assert text in str(diagnostic)


@pytest.mark.parametrize("name", ["xml_bomb", "external_entity"])
def test_dangerous_files_are_rejected_immediately(name: str) -> None:
    def load() -> None:
        with pytest.raises(ScenarioError):
            load_scenario(BROKEN / f"{name}.xosc")

    within_readings(1, load)
