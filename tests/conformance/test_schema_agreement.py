"""Agreement of the reader with the ASAM schemas on the validity of all files and of 3,300 mutants.

The schemas and the files are in the folder that EIDRIVE_CORPORA names. Where the two do not agree, a table that the
test prints says on what, how often, and why; a disagreement that it does not explain fails.
"""

from __future__ import annotations

import copy
import itertools
import os
import random
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from corpora import corpora_folder, corpora_name, needs_corpora, scenario_files
from lxml import etree

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.reading.document import read_root
from eidrive_scenario.openscenario.reading.parsing import open_document

pytestmark = needs_corpora

MUTANTS_OF_A_KIND = 300
SEED = 20260131
NOT_EXPLAINED = "not explained"
SCHEMAS = {
    ("1", "0"): "OpenSCENARIOv1.0.xsd",
    ("1", "1"): "OpenSCENARIOv1.1.1.xsd",
    ("1", "2"): "OpenSCENARIOv1.2.xsd",
    ("1", "3"): "OpenSCENARIOv1.3.1.xsd",
    ("1", "4"): "OpenSCENARIOv1.4.xsd",
}
VALUES = ["", "abc", "-1", "0", "1.5", "70000", "5000000000", "INF", "NaN", "+INF", "true", " 2 ", "0x1", ".5", "5."]
VALUES += ["1e5", "--1", "nan", "1_0", "lessThan", "${1+1}", "${a<b}", "$", "$Nobody", "2020-01-01T24:00:00Z"]
VALUES += ["2020-02-30T00:00:00", "2020-02-29T00:00:00+14:00"]


READER_ONLY = {
    "unknown parameter": "the schema sees that a reference is well-formed, not whether its parameter is declared",
    "declared twice": "the schema has no rule for names",
    r"\$\w+ is '.*', which is no": "the schema does not substitute parameters; the value is not of the required type",
    "the expression '.*' (is .*, which is not|has no)": "the schema does not calculate",
    "parameter '.*' is '.*', which is not": "the schema does not check a parameter value against its type",
    "a constraint of parameter '.*' is not": "the schema does not check a constraint against the parameter type",
    "outside its constraints": "the schema does not compare; the standard has such a scenario not evaluated",
    "is empty$": "up to 1.2 the schema lets an element choose none of its alternatives, which then means nothing",
    "FileHeader has the rev": "the schema takes any number for the version, and a parameter too; it decides all else",
    "FileHeader has the version": "the schema takes any number for the version",
}
"""Patterns of reader errors without a schema error, with the reason."""
SCHEMA_ONLY = {
    "Character content is not allowed, because the content type is empty": (
        "the schema wants nothing at all in such an element; files have white space there, which is a warning"
    ),
    "Element 'LightState': This element is not expected. Expected is \\( LightType \\)": (
        "the other way round scenariogeneration writes them; their order means nothing, which is a warning"
    ),
    "Element 'CatalogReference': This element is not expected. Expected is \\( Maneuver \\)": (
        "a maneuver of a catalog may stand behind others, which is a warning: their order means nothing"
    ),
    "Element 'CustomCommandAction': This element is not expected": (
        "so scenariogeneration writes commands in Init, which is a warning: it cannot mean anything else"
    ),
    "Element 'TrafficeSignalGroupState': This element is not expected": (
        "scenariogeneration keeps the spelling of 1.2 in files of 1.3, which is a warning"
    ),
    "Element 'Sun'.*'(illuminance|intensity)'": (
        "scenariogeneration writes the word of 1.2 in files of 1.1, which is a warning; the early schema of 1.2 in the "
        "corpora lacks it"
    ),
    "Element 'AppearanceAction': This element is not expected. Expected is one of \\( LongitudinalAction": (
        "the 1.2 schema of the corpora is an early one; that of ASAM's checker has the action"
    ),
    "Element '(AppearanceAction|LightType|ComponentAnimation)': Missing child": (
        "the final schema of 1.2 requires all alternatives, while its documentation requires one"
    ),
}
"""Patterns of schema errors without a reader error, with the reason."""


@dataclass(frozen=True)
class Verdict:
    """Errors of the schema and of the reader for one file or mutant."""

    what: str
    schema: tuple[str, ...]
    """Errors of the schema."""
    errors: tuple[str, ...]

    @property
    def agreed(self) -> bool:
        """Whether both accept or both reject the file."""
        return bool(self.schema) == bool(self.errors)

    def explanations(self) -> set[tuple[str, str, str]]:
        """Return source, message pattern and reason of each disagreement; an unexplained one has no reason."""
        return {self._explained("we", message, READER_ONLY) for message in self.errors} | {
            self._explained("the schema", message, SCHEMA_ONLY) for message in self.schema
        }

    @staticmethod
    def _explained(who: str, message: str, known: dict[str, str]) -> tuple[str, str, str]:
        found = ((who, pattern, why) for pattern, why in known.items() if re.search(pattern, message))
        return next(found, (who, message, ""))


class Validator:
    """Validation by schema and reader.

    The schema is that of the version in the file; for an unknown version, that of the original file.
    """

    def __init__(self, folder: Path) -> None:
        present = {version: folder / name for version, name in SCHEMAS.items() if (folder / name).exists()}
        self._schemas = {version: etree.XMLSchema(etree.parse(path)) for version, path in present.items()}

    def version_of(self, root: etree._Element) -> tuple[str, str] | None:
        """Return the version in the header of a file, None if it is unknown."""
        header = root.find("FileHeader")
        named = None if header is None else (header.get("revMajor", "").strip(), header.get("revMinor", "").strip())
        return named if named in self._schemas else None

    def judge(self, what: str, xml: bytes, otherwise: tuple[str, str]) -> Verdict:
        """Validate the bytes of a file by schema and reader."""
        root = etree.fromstring(xml)
        schema = self._schemas[self.version_of(root) or otherwise]
        valid = schema.validate(root)
        complaints = () if valid else tuple(str(one.message) for one in schema.error_log)  # type: ignore[attr-defined]
        collector = DiagnosticCollector()
        read_root(open_document(xml), collector)
        return Verdict(what, complaints, tuple(diagnostic.message for diagnostic in collector.errors))


Mutation = Callable[[etree._Element, random.Random, "Pool"], None]


class Pool:
    """Elements and attributes of all files, for insertion at wrong positions."""

    def __init__(self, trees: list[etree._Element]) -> None:
        nodes = [node for tree in trees for node in tree.iter(etree.Element)]
        self.nodes = nodes
        self.tags = sorted({str(node.tag) for node in nodes})
        self.attributes = sorted({str(name) for node in nodes for name in node.attrib})


def drop_element(node: etree._Element, _: random.Random, __: Pool) -> None:
    parent = node.getparent()
    if parent is not None:
        parent.remove(node)


def double_element(node: etree._Element, _: random.Random, __: Pool) -> None:
    if node.getparent() is not None:
        node.addnext(copy.deepcopy(node))


def rename_element(node: etree._Element, dice: random.Random, pool: Pool) -> None:
    node.tag = dice.choice([dice.choice(pool.tags), str(node.tag) + "s", str(node.tag).lower()])


def move_element(node: etree._Element, dice: random.Random, _: Pool) -> None:
    """Move an element among its siblings, or to another parent outside of it."""
    parent = node.getparent()
    if parent is None:
        return
    places = [one for one in node.getroottree().getroot().iter(etree.Element) if node not in one.iterancestors()]
    target = parent if dice.random() < 0.5 else dice.choice([one for one in places if one is not node])
    parent.remove(node)
    target.insert(dice.randrange(len(target) + 1), node)


def change_attribute(node: etree._Element, dice: random.Random, _: Pool) -> None:
    if node.attrib:
        node.set(dice.choice(list(node.attrib)), dice.choice(VALUES))


def drop_attribute(node: etree._Element, dice: random.Random, _: Pool) -> None:
    if node.attrib:
        del node.attrib[dice.choice(list(node.attrib))]


def rename_attribute(node: etree._Element, dice: random.Random, pool: Pool) -> None:
    if node.attrib:
        name = str(dice.choice(list(node.attrib)))
        value = node.attrib.pop(name)
        node.set(dice.choice([dice.choice(pool.attributes), f"{name}s".split("}")[-1]]), value)


def insert_element(node: etree._Element, dice: random.Random, pool: Pool) -> None:
    node.insert(dice.randrange(len(node) + 1), copy.deepcopy(dice.choice(pool.nodes)))


def add_attribute(node: etree._Element, dice: random.Random, pool: Pool) -> None:
    node.set(dice.choice([*pool.attributes, "bogus"]), dice.choice(VALUES))


def add_text(node: etree._Element, dice: random.Random, _: Pool) -> None:
    node.text = (node.text or "") + dice.choice(["x", " ", "\n"])


def change_version(node: etree._Element, dice: random.Random, _: Pool) -> None:
    header = node.getroottree().getroot().find("FileHeader")
    if header is not None:
        header.set("revMinor", dice.choice("0123"))


MUTATIONS: list[Mutation] = [
    drop_element,
    double_element,
    rename_element,
    move_element,
    insert_element,
    add_text,
    change_attribute,
    drop_attribute,
    rename_attribute,
    add_attribute,
    change_version,
]


def mutants(count: int, seed: int, changes: int = 1) -> Iterator[tuple[Path, str, bytes]]:
    """Yield `count` changed files for each kind of mutation, evenly from all files."""
    dice = random.Random(seed)
    trees = {path: etree.parse(path).getroot() for path in scenario_files()}
    pool = Pool(list(trees.values()))
    paths = list(trees)
    for kind in MUTATIONS:
        dice.shuffle(paths)
        made = 0
        while made < count:
            path = paths[made % len(paths)]
            tree = copy.deepcopy(trees[path])
            for mutation in (kind, *dice.choices(MUTATIONS, k=changes - 1)):
                mutation(dice.choice(list(tree.iter(etree.Element))), dice, pool)
            xml = etree.tostring(tree)
            if xml != etree.tostring(trees[path]):
                made += 1
                yield path, kind.__name__, xml


@pytest.fixture(scope="module")
def judge() -> Validator:
    return Validator(corpora_folder() / "schema")


def table(judged: list[Verdict]) -> list[str]:
    """Return the lines of all disagreements, the most frequent first."""
    lines: Counter[tuple[str, str, str]] = Counter()
    examples: dict[tuple[str, str, str], str] = {}
    for one in judged:
        for explanation in () if one.agreed else one.explanations():
            lines[explanation] += 1
            examples.setdefault(explanation, one.what)
    return [
        f"{count:5}  {who} alone: {what}: {why or NOT_EXPLAINED} (as {examples[who, what, why]})"
        for (who, what, why), count in lines.most_common()
    ]


def assert_explained(judged: list[Verdict], capsys: pytest.CaptureFixture[str]) -> None:
    lines = table(judged)
    valid = sum(one.agreed and not one.errors for one in judged)
    invalid = sum(one.agreed and bool(one.errors) for one in judged)
    others = len(judged) - valid - invalid
    lines.insert(0, f"{len(judged)} judged: {valid} valid for both, {invalid} invalid for both, {others} not alike")
    with capsys.disabled():
        sys.stdout.write("\n" + "\n".join(lines) + "\n")
    assert [line for line in lines if NOT_EXPLAINED in line] == []


def test_reader_and_schema_agree_on_every_file(judge: Validator, capsys: pytest.CaptureFixture[str]) -> None:
    """Five catalogs have version 0.9 without a schema; the schema of 1.0 and the reader reject them."""
    judged = [judge.judge(corpora_name(path), path.read_bytes(), ("1", "0")) for path in scenario_files()]
    assert len(judged) > 150
    assert sum(not one.agreed for one in judged) <= 1
    assert_explained(judged, capsys)


@pytest.mark.exhaustive
def test_reader_and_schema_agree_on_mutants(judge: Validator, capsys: pytest.CaptureFixture[str]) -> None:
    judged = []
    for path, kind, xml in mutants(MUTANTS_OF_A_KIND, SEED):
        version = judge.version_of(etree.parse(path).getroot()) or ("1", "0")
        judged.append(judge.judge(f"{corpora_name(path)} {kind}", xml, version))
    assert len(judged) == len(MUTATIONS) * MUTANTS_OF_A_KIND
    assert sum(not one.schema for one in judged) > 500
    assert sum(bool(one.schema) for one in judged) > 1500
    assert_explained(judged, capsys)


@pytest.mark.exhaustive
def test_mutants_raise_only_scenario_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is loaded with its catalogs and the path of its road file, or expanded."""
    folders = sorted({str(path.parent) for path in corpora_folder().rglob("*.xodr")})
    monkeypatch.setenv("EIDRIVE_MAPS", os.pathsep.join(folders))
    taken = refused = 0
    for path, _, xml in itertools.chain(mutants(60, SEED + 1), mutants(30, SEED + 2, changes=3)):
        tree = etree.fromstring(xml)
        tree.getroottree().docinfo.URL = str(path)
        for load in (load_scenario, load_distribution):
            try:
                load(tree)
                taken += 1
            except ScenarioError:
                refused += 1
    assert taken > 100
    assert refused > 500
