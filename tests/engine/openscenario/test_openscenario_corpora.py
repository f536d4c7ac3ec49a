"""Files written for other engines, and the judgement of ASAM's schemas; both from the folder EIDRIVE_CORPORA."""

import copy
import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from lxml import etree

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, read_document
from eidrive_scenario.openscenario.document import read_root
from eidrive_scenario.openscenario.findings import Findings
from eidrive_scenario.openscenario.parsing import open_document

CORPORA = Path(os.environ["EIDRIVE_CORPORA"]) if "EIDRIVE_CORPORA" in os.environ else None
pytestmark = pytest.mark.skipif(CORPORA is None, reason="EIDRIVE_CORPORA is not set")

EXCEPTIONS = {
    "esmini/xosc/Catalogs/Maneuvers/HWManeuvers.xosc": "an entry uses a parameter that it does not declare",
    "esmini/xosc/auto_light.xosc": "its catalog's folder is not there",
    "esmini/xosc/car_walk.xosc": "its catalogs lie outside the corpus",
    "scenario_runner/catalogs/EnvironmentCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/ManeuverCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/MiscObjectCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/PedestrianCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/VehicleCatalog.xosc": "written for 0.9",
}
SCHEMAS = {
    "0": "OpenSCENARIOv1.0.xsd",
    "1": "OpenSCENARIOv1.1.1.xsd",
    "2": "OpenSCENARIOv1.2.xsd",
    "3": "OpenSCENARIOv1.3.1.xsd",
}
BEYOND_THE_SCHEMA = ("unknown parameter", "declared twice", "outside its constraints", "has no value", " is empty")


def files() -> list[Path]:
    return sorted(CORPORA.rglob("*.xosc")) if CORPORA else []


def excused(path: Path) -> bool:
    return CORPORA is not None and path.relative_to(CORPORA).as_posix() in EXCEPTIONS


@pytest.fixture
def maps(monkeypatch: pytest.MonkeyPatch) -> None:
    assert CORPORA is not None
    folders = sorted({str(path.parent) for path in CORPORA.rglob("*.xodr")})
    monkeypatch.setenv("EIDRIVE_MAPS", os.pathsep.join(folders))


@pytest.mark.usefixtures("maps")
def test_every_file_is_read() -> None:
    refused = {}
    for path in files():
        try:
            document = read_document(path)
            if document.storyboard is not None:
                load_scenario(path)
        except ScenarioError as error:
            refused[path] = str(error)
    assert {path: text for path, text in refused.items() if not excused(path)} == {}
    assert len(refused) <= len(EXCEPTIONS)
    assert len(files()) > 150


@pytest.fixture(scope="module")
def schemas() -> dict[str, etree.XMLSchema]:
    assert CORPORA is not None
    return {minor: etree.XMLSchema(etree.parse(CORPORA / "schema" / name)) for minor, name in SCHEMAS.items()}


Mutation = Callable[[etree._Element, random.Random, list[etree._Element]], None]


def drop_attribute(node: etree._Element, _: random.Random, __: list[etree._Element]) -> None:
    for name in list(node.attrib)[:1]:
        del node.attrib[name]


def change_attribute(node: etree._Element, dice: random.Random, _: list[etree._Element]) -> None:
    values = ["", "abc", "-1", "1.5", "70000", "5000000000", "INF", "NaN", "+INF", "true", " 2 ", "0x1", ".5", "5."]
    values += ["1e5", "--1", "nan", "1_0", "lessThan", "${1+1}", "${a<b}", "$", "2020-01-01T24:00:00Z", "2020-02-30"]
    if node.attrib and node.tag not in ("FileHeader", "ParameterDeclaration", "ValueConstraint"):
        node.set(dice.choice(list(node.attrib)), dice.choice(values))


def add_attribute(node: etree._Element, dice: random.Random, _: list[etree._Element]) -> None:
    node.set(dice.choice(["x", "name", "value", "bogus", "s", "rule", "maxRate"]), "1")


def drop_element(node: etree._Element, _: random.Random, __: list[etree._Element]) -> None:
    parent = node.getparent()
    if parent is not None:
        parent.remove(node)


def double_element(node: etree._Element, _: random.Random, __: list[etree._Element]) -> None:
    if node.getparent() is not None:
        node.addnext(copy.deepcopy(node))


def move_element(node: etree._Element, dice: random.Random, _: list[etree._Element]) -> None:
    parent = node.getparent()
    if parent is not None:
        parent.remove(node)
        parent.insert(dice.randrange(len(parent) + 1), node)


def insert_element(node: etree._Element, dice: random.Random, pool: list[etree._Element]) -> None:
    node.insert(dice.randrange(len(node) + 1), copy.deepcopy(dice.choice(pool)))


def add_text(node: etree._Element, dice: random.Random, _: list[etree._Element]) -> None:
    node.text = (node.text or "") + dice.choice(["x", " ", "\n"])


def change_version(node: etree._Element, dice: random.Random, _: list[etree._Element]) -> None:
    header = node.getroottree().getroot().find("FileHeader")
    if header is not None:
        header.set("revMinor", dice.choice("0123"))


MUTATIONS: list[Mutation] = [
    drop_attribute,
    change_attribute,
    add_attribute,
    drop_element,
    double_element,
    move_element,
    insert_element,
    add_text,
    change_version,
]


def judged_by_us(xml: bytes) -> list[str]:
    """What is wrong with the file as such; white space in an empty element is a warning only."""
    findings = Findings()
    read_root(open_document(xml), findings)
    problems = [problem.message for problem in findings.problems]
    wrong = [text for text in problems if not any(beyond in text for beyond in BEYOND_THE_SCHEMA)]
    return wrong + [warning.message for warning in findings.warnings if "white space" in warning.message]


def test_the_judgement_on_the_files_is_the_schemas(schemas: dict[str, etree.XMLSchema]) -> None:
    for path in files():
        root = etree.parse(path).getroot()
        header = root.find("FileHeader")
        assert header is not None
        if header.get("revMajor") == "1":
            assert schemas[header.get("revMinor", "")].validate(root) == (not judged_by_us(etree.tostring(root))), path


@pytest.mark.parametrize("seed", range(8))
def test_the_judgement_on_mutants_is_the_schemas(schemas: dict[str, etree.XMLSchema], seed: int) -> None:
    dice = random.Random(seed)
    trees = [etree.parse(path).getroot() for path in dice.sample([path for path in files() if not excused(path)], 25)]
    pool = [node for tree in trees for node in tree.iter(etree.Element)]
    verdicts = []
    for _ in range(150):
        tree = copy.deepcopy(dice.choice(trees))
        for _ in range(dice.choice([1, 1, 2])):
            dice.choice(MUTATIONS)(dice.choice(list(tree.iter(etree.Element))), dice, pool)
        header = tree.find("FileHeader")
        if header is None or header.get("revMinor") is None or header.get("revMajor") != "1":
            continue
        xml = etree.tostring(tree)
        valid = schemas[header.get("revMinor", "")].validate(etree.fromstring(xml))
        assert valid == (not judged_by_us(xml)), (judged_by_us(xml), xml.decode())
        verdicts.append(valid)
    assert 20 < sum(verdicts) < len(verdicts) - 20


@pytest.mark.usefixtures("maps")
@pytest.mark.parametrize("seed", range(4))
def test_mutants_bring_out_nothing_but_our_errors(seed: int) -> None:
    dice = random.Random(seed)
    paths = dice.sample([path for path in files() if not excused(path)], 25)
    trees = {path: etree.parse(path).getroot() for path in paths}
    pool = [node for tree in trees.values() for node in tree.iter(etree.Element)]
    refused = 0
    for _ in range(100):
        path = dice.choice(paths)
        tree = copy.deepcopy(trees[path])
        for _ in range(3):
            dice.choice(MUTATIONS)(dice.choice(list(tree.iter(etree.Element))), dice, pool)
        again = etree.fromstring(etree.tostring(tree))
        again.getroottree().docinfo.URL = str(path)
        try:
            load_scenario(again)
        except ScenarioError:
            refused += 1
    assert refused > 0
