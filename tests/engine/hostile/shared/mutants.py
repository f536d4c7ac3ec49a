"""Mutants of scenario and road files: deterministic damage to structure, values and bytes."""

from __future__ import annotations

import random
from collections.abc import Callable
from copy import deepcopy

from lxml import etree

VALUES = (
    "",
    " ",
    "0",
    "-0.0",
    "-1",
    "1e-300",
    "-1e-9",
    "4.9e-324",
    "1e9",
    "-1e9",
    "1e12",
    "1e308",
    "-1e308",
    "1e309",
    "NaN",
    "nan",
    "INF",
    "-INF",
    "inf",
    "2147483648",
    "-2147483649",
    "18446744073709551616",
    "9" * 400,
    "1" * 5000,
    "x" * 5000,
    "../" * 1600,
    "Zoë-名前-\u202e-\U0001f697",
    "$x",
    "$",
    "${",
    "${1/0}",
    "${pow(10, 400)}",
    "${9 * 9 * 9}",
    "${$x + $x}",
    "${" + "(" * 300 + "1" + ")" * 300 + "}",
    "{a: [1, 2], b: &x [*x]}",
    "{" * 50,
    "true",
    "None",
    "/dev/zero",
    "/",
    "..",
    "a\tb",
    "]]>",
)
"""Texts that take the place of a value."""

Tree = etree._Element


def mutant(content: bytes, seed: int, number: int) -> bytes:
    """Return the mutant of this number of a file: one to four mutations, all of them drawn from seed and number."""
    draw = random.Random(f"{seed}/{number}")
    if draw.random() < 0.15:
        return _damaged(content, draw)
    root = etree.fromstring(content, etree.XMLParser(remove_comments=True, huge_tree=False))
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        draw.choice(_MUTATIONS)(root, draw)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8")


def _damaged(content: bytes, draw: random.Random) -> bytes:
    """Bytes that are changed, cut out, repeated or cut off."""
    data = bytearray(content)
    kind = draw.randrange(5)
    at = draw.randrange(len(data))
    if kind == 0:
        for _ in range(draw.choice((1, 3, 30))):
            data[draw.randrange(len(data))] = draw.randrange(256)
    elif kind == 1:
        del data[at:]
    elif kind == 2:
        del data[at : at + draw.choice((1, 5, 500))]
    elif kind == 3:
        data[at:at] = data[at : at + draw.choice((1, 40, 4000))]
    else:
        data[at:at] = draw.choice((b"\0", b"\xff\xfe", b"&#0;", b"&a;", b"<!--", b"<![CDATA[", b"<?x?>", b"\r\r\n"))
    return bytes(data)


def _elements(root: Tree) -> list[Tree]:
    return [node for node in root.iter(etree.Element) if node.getparent() is not None]


def _element(root: Tree, draw: random.Random) -> Tree | None:
    found = _elements(root)
    return draw.choice(found) if found else None


def _parent(node: Tree) -> Tree:
    """The parent of an element; only a root has none, and `_elements` omits it."""
    parent = node.getparent()
    assert parent is not None
    return parent


def _delete(root: Tree, draw: random.Random) -> None:
    node = _element(root, draw)
    if node is not None:
        _parent(node).remove(node)


def _duplicate(root: Tree, draw: random.Random) -> None:
    node = _element(root, draw)
    if node is not None:
        for _ in range(draw.choice((1, 1, 2, 20))):
            node.addnext(deepcopy(node))


def _swap(root: Tree, draw: random.Random) -> None:
    one, other = _element(root, draw), _element(root, draw)
    if one is None or other is None or one is other or one in other.iterancestors() or other in one.iterancestors():
        return
    first, second = deepcopy(one), deepcopy(other)
    _parent(one).replace(one, second)
    _parent(other).replace(other, first)


def _move(root: Tree, draw: random.Random) -> None:
    """An element below another one, where it most likely does not belong."""
    one, other = _element(root, draw), _element(root, draw)
    if one is not None and other is not None and one is not other and one not in other.iterancestors():
        other.append(one)


def _nest(root: Tree, draw: random.Random) -> None:
    """An element inside copies of itself."""
    node = _element(root, draw)
    if node is None or len(list(node.iter())) > 50:
        return
    attributes = {str(name): str(value) for name, value in node.attrib.items()}
    inner = node
    for _ in range(draw.choice((1, 3, 40))):
        inner = etree.SubElement(inner, node.tag, attributes)


def _rename(root: Tree, draw: random.Random) -> None:
    node = _element(root, draw)
    if node is not None:
        node.tag = draw.choice([str(other.tag) for other in _elements(root)[:200]] + ["x", node.tag + "s", "é"])


def _reverse(root: Tree, draw: random.Random) -> None:
    node = _element(root, draw)
    if node is not None:
        node[:] = list(node)[::-1]


def _set(root: Tree, draw: random.Random) -> None:
    """A value in the place of an attribute."""
    nodes = [node for node in _elements(root) if node.attrib]
    if nodes:
        node = draw.choice(nodes)
        node.set(draw.choice(sorted(node.attrib)), draw.choice(VALUES))


def _set_number(root: Tree, draw: random.Random) -> None:
    """A number in the place of a number, as a wrong unit, sign or order of magnitude makes it."""
    numbers = [(node, name) for node in _elements(root) for name, text in node.attrib.items() if _is_number(str(text))]
    if numbers:
        node, name = draw.choice(numbers)
        factor = draw.choice((-1.0, 0.0, 1e-6, 1e-3, 0.1, 10.0, 1e3, 1e6))
        value = float(node.attrib[name]) * factor
        if draw.random() < 0.5:
            value = float(
                draw.choice(("1e9", "-1e9", "1e-9", "1e6", "-1e6", "1e5", "0.001", "100000", "-0.5", "1e-300"))
            )
        node.set(name, repr(value) if draw.random() < 0.5 else str(int(value)))


def _copy_value(root: Tree, draw: random.Random) -> None:
    """The value of one attribute in the place of another: names, words and numbers of the file itself."""
    nodes = [node for node in _elements(root) if node.attrib]
    if len(nodes) > 1:
        one, other = draw.choice(nodes), draw.choice(nodes)
        value = one.attrib[draw.choice(sorted(one.attrib))]
        other.set(draw.choice(sorted(other.attrib)), value)


def _unset(root: Tree, draw: random.Random) -> None:
    nodes = [node for node in _elements(root) if node.attrib]
    if nodes:
        node = draw.choice(nodes)
        del node.attrib[draw.choice(sorted(node.attrib))]


def _text(root: Tree, draw: random.Random) -> None:
    """A value in the place of a text; commands hold texts."""
    nodes = [node for node in _elements(root) if node.text and node.text.strip()] or _elements(root)
    if nodes:
        draw.choice(nodes).text = draw.choice([value for value in VALUES if value != "a\tb"])


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


_MUTATIONS: tuple[Callable[[Tree, random.Random], None], ...] = (
    _delete,
    _duplicate,
    _swap,
    _move,
    _nest,
    _rename,
    _reverse,
    _set,
    _set,
    _set,
    _set_number,
    _set_number,
    _set_number,
    _set_number,
    _copy_value,
    _unset,
    _text,
)
