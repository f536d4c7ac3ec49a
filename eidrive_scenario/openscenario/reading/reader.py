"""Reader from XML elements to model objects, by the schema rules of the model classes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, cast

import msgspec
from lxml import etree

from eidrive_scenario.errors import quoted, suggestion
from eidrive_scenario.files.untrusted_xml import line_of
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector, Location
from eidrive_scenario.openscenario.model.element import incomplete_element
from eidrive_scenario.openscenario.reading.schema import AttributeRule, Rules, check_children, rules
from eidrive_scenario.openscenario.values.expressions import REFERENCE, ExpressionError
from eidrive_scenario.openscenario.values.parameters import Assignment, Parameter, Scope, declare
from eidrive_scenario.openscenario.values.scalars import DOUBLE, STRING, Version, availability

_SCHEMA_INSTANCE = "{http://www.w3.org/2001/XMLSchema-instance}"
_IGNORED = {_SCHEMA_INSTANCE + "noNamespaceSchemaLocation", _SCHEMA_INSTANCE + "schemaLocation"}
_MAY_BE_EMPTY = (model.Action, model.ObjectController)
"""Classes that may be empty up to 1.2: an action without effect, an object without a controller."""
_INFINITE = ("inf", "-inf")
_WITH_TEXT = etree.XPath("descendant-or-self::*[text()[normalize-space()]]")
_WITH_SPACE = etree.XPath("descendant-or-self::*[text() and not(*)]")


class ReferenceUse(msgspec.Struct, frozen=True):
    """Catalog reference and the kinds of entries that are allowed for it."""

    reference: model.CatalogReference
    kinds: tuple[type[model.Element], ...]


ReadElement = tuple[model.Element, tuple[ReferenceUse, ...]]
"""Element and the catalog references in it."""


class Reader:
    """Reader of the elements of one file.

    Invalid elements are built incompletely, so that all errors of a file are reported together. The result is valid
    only if `collector` has no errors.

    read   elements of an earlier reading, by their nodes: those without parameters and diagnostics. They are used
           again, and those of this reading are added; None to read all
    """

    def __init__(
        self,
        source: str,
        version: Version,
        collector: DiagnosticCollector,
        read: dict[etree._Element, ReadElement] | None = None,
    ) -> None:
        self.source = source
        self.version = version
        self.collector = collector
        self.references: list[ReferenceUse] = []
        self.declared: Scope | None = None
        """Parameters that the root element declares."""
        self._error_count = 0
        self._read = read
        self._scope_uses = 0
        """Number of values so far that depend on the visible parameters."""
        self._with_text: set[etree._Element] = set()
        self._with_space: set[etree._Element] = set()

    def read(
        self,
        node: etree._Element,
        cls: type[model.Element],
        assignments: Mapping[str, Assignment] | None = None,
        lent: Scope | None = None,
    ) -> model.Element:
        """Read an element with its descendants.

        assignments  values of the parameters that it declares
        lent         parameters of another file, for those that it does not declare
        """
        self._with_text = set(cast(list[etree._Element], _WITH_TEXT(node)))
        self._with_space = set(cast(list[etree._Element], _WITH_SPACE(node)))
        open_assignments = dict(assignments or {})
        element = self._any_element(node, cls, lent or Scope(budget=self.collector.budget), open_assignments)
        self._unknown_parameters(open_assignments, ())
        return element

    def _any_element(
        self, node: etree._Element, cls: type[model.Element], scope: Scope, assignments: dict[str, Assignment]
    ) -> model.Element:
        """Return the element of an earlier reading, or read it."""
        if self._read is None:
            return self._element(node, cls, scope, assignments)
        earlier = self._read.get(node)
        if earlier is not None and type(earlier[0]) is cls:
            self.references += earlier[1]
            return earlier[0]
        before = self._scope_uses, self.collector.count
        first_reference = len(self.references)
        element = self._element(node, cls, scope, assignments)
        if before == (self._scope_uses, self.collector.count):
            self._read[node] = element, tuple(self.references[first_reference:])
        return element

    def _element(
        self, node: etree._Element, cls: type[model.Element], scope: Scope, assignments: dict[str, Assignment]
    ) -> model.Element:
        content = rules(cls, self.version)
        values: dict[str, Any] = {"line": line_of(node), "source": self.source}
        if "sibling_index" in cls.field_defaults:
            values["sibling_index"] = cast(etree._Element, node.getparent()).index(node)
        children = list(node.iterchildren(etree.Element))
        if "ParameterDeclarations" in content.children:
            declarations = next((child for child in children if child.tag == "ParameterDeclarations"), None)
            if declarations is not None:
                self._scope_uses += 1
                scope = scope.inner()
                self.declared = self.declared or scope
                values["parameter_declarations"] = self._declarations(declarations, scope, assignments)
        self._attributes(node, content, scope, values)
        self._text(node, content, values)
        if cls is model.Property or cls is model.CustomCommandAction:
            self._keep_scope(node, scope, values)
        elif cls is model.ParameterCondition or cls is model.ParameterAction:
            self._scope_uses += 1
            values["scope"] = scope
        repeated: dict[str, list[model.Element]] = {}
        for child in children:
            self._child(node, child, content, scope, values, repeated)
        values.update((name, tuple(elements)) for name, elements in repeated.items())
        if children or content.children:
            check_children(node, children, content, self.version, self._error)
        if content.choice and not any(
            child.tag in content.choice or child.tag not in content.children for child in children
        ):
            # The schemas up to 1.2 allow an empty choice
            report = self._warn if cls in _MAY_BE_EMPTY else self._error
            report(f"{node.tag} is empty", "it contains one of " + ", ".join(content.choice), node)
        for name in ("catalog_reference", "catalog_references"):
            if name in values:
                self._note_references(content, values[name])
        if cls is model.Orientation and self.version >= (1, 3):
            # A missing type is relative since 1.3 and was absolute before (Orientation.type).
            values.setdefault("type", model.ReferenceContext.RELATIVE)
        return incomplete_element(cls, values)

    def _attributes(self, node: etree._Element, content: Rules, scope: Scope, values: dict[str, Any]) -> None:
        present = set()
        for name, text in cast(list[tuple[str, str]], node.items()):
            rule = content.attributes.get(name)
            if rule is not None:
                present.add(name)
                values[rule.field] = self._value(node, name, text, rule, scope)
            elif name not in _IGNORED:
                usage = content.other_attributes.get(name)
                hint = availability(usage, self.version) if usage else suggestion(name, content.attributes)
                self._error(f"{node.tag} has no attribute {name!r}", hint, node)
        for name, rule in content.attributes.items():
            if rule.required and name not in present:
                self._error(f"{node.tag} lacks the attribute {name!r}", f"expected {rule.scalar.name}", node)

    def _value(self, node: etree._Element, name: str, text: str, rule: AttributeRule, scope: Scope) -> Any:
        value: Any = None
        try:
            value = self._convert(text, rule, scope)
        except ExpressionError as error:
            self._error_count += 1
            if error.message:
                self._error(f"{name} of {node.tag}: {error.message}", error.hint, node)
        except ValueError as error:
            # Python literals that XML does not have; scenariogeneration 0.16 writes some
            message = f"{name} of {node.tag} is {quoted(text)}, which is"
            if text == "None" and not rule.required:
                self._warn(f"{message} read as a missing attribute", "omit it", node)
            elif text in _INFINITE and rule.scalar is DOUBLE:
                value = float(text)
                self._warn(f"{message} read as infinity", f"write {text.upper()}", node)
            else:
                self._error(f"{message} not {rule.scalar.name}", str(error), node)
        if rule.deprecated:
            self._deprecated(f"the attribute {name!r} of {node.tag}", rule.deprecated, node)
        if isinstance(value, model.Enumeration) and value in rule.scalar.deprecated:
            self._deprecated(f"{value.value!r} of {type(value).__name__}", value.usage.deprecated, node)
        return value

    def _convert(self, text: str, rule: AttributeRule, scope: Scope) -> Any:
        if not text.startswith("$"):
            return rule.scalar.convert(text)
        self._scope_uses += 1
        if rule.points_to == "parameter" and REFERENCE.fullmatch(text):
            return text[1:]
        if text.startswith("${") and self.version < (1, 1):
            if rule.scalar is STRING:
                return text
            raise ExpressionError(f"{quoted(text)} is an expression", "expressions require OpenSCENARIO 1.1")
        return scope.resolve(text, rule.scalar)

    def _keep_scope(self, node: etree._Element, scope: Scope, values: dict[str, Any]) -> None:
        """Keep the visible parameters for references inside a text, or inside the file of a command.

        A property whose value begins with a reference is already resolved.
        """
        text = node.get("value") or ""
        if "content" in values or ("$" in text and not text.startswith("$")):
            self._scope_uses += 1
            values["scope"] = scope

    def _text(self, node: etree._Element, content: Rules, values: dict[str, Any]) -> None:
        if content.text_field:
            values[content.text_field] = "".join(cast(list[str], node.xpath("text()")))
        elif node in self._with_text:
            self._error(f"{node.tag} contains text; only elements are allowed", "remove the text", node)
        elif not content.children and node in self._with_space:
            self._warn(f"{node.tag} contains white space; the schema allows no content", f"write <{node.tag} …/>", node)

    def _child(
        self,
        node: etree._Element,
        child: etree._Element,
        content: Rules,
        scope: Scope,
        values: dict[str, Any],
        repeated: dict[str, list[model.Element]],
    ) -> None:
        rule = content.children.get(child.tag)
        if rule is None:
            return
        if rule.deprecated:
            self._deprecated(f"{child.tag} in {node.tag}", rule.deprecated, child)
        if rule.cls is model.ParameterDeclarations:
            return
        element = self._any_element(child, rule.cls, scope, {})
        if rule.many:
            repeated.setdefault(rule.field, []).append(element)
        else:
            values.setdefault(rule.field, element)

    def _declarations(self, node: etree._Element, scope: Scope, assignments: dict[str, Assignment]) -> model.Element:
        """Read declarations in their order, so that each may use those before it."""
        content = rules(model.ParameterDeclarations, self.version)
        values: dict[str, Any] = {"line": line_of(node), "source": self.source}
        children = list(node.iterchildren(etree.Element))
        self._attributes(node, content, scope, values)
        self._text(node, content, values)
        check_children(node, children, content, self.version, self._error)
        declared = []
        scope.awaited = {child.get("name", "") for child in children}
        for child in children:
            if child.tag in content.children:
                errors_before = self._error_count
                declaration = cast(
                    model.ParameterDeclaration, self._element(child, model.ParameterDeclaration, scope, {})
                )
                is_valid = self._error_count == errors_before
                declared.append(self._declare(declaration, scope, assignments, is_valid))
                scope.awaited.discard(str(declaration.name))
        values["parameter_declaration"] = tuple(declared)
        self._unknown_parameters(assignments, scope.parameters)
        assignments.clear()
        return incomplete_element(model.ParameterDeclarations, values)

    def _declare(
        self, declaration: model.ParameterDeclaration, scope: Scope, assignments: dict[str, Assignment], is_valid: bool
    ) -> model.ParameterDeclaration:
        """Add a parameter to its scope, and return the declaration with its final value."""
        name = str(declaration.name)
        assignment = assignments.pop(name, None)
        other = scope.parameters.get(name)
        if other is not None:
            message = f"parameter {declaration.name!r} is declared twice"
            report = self.collector.warning if declaration.value == other.declared else self.collector.error
            report(message, "rename or remove one", at=Location(self.source, declaration.line))
            return replace(declaration, value=other.text)
        if not is_valid:
            scope.parameters[name] = Parameter(name, "", "", "", is_valid=False)
            return declaration
        declare(scope, declaration, assignment, self.collector)
        return replace(declaration, value=assignment.text) if assignment else declaration

    def _unknown_parameters(self, assignments: Mapping[str, Assignment], declared: Iterable[str]) -> None:
        for name, assignment in assignments.items():
            origin = assignment.origin or Location(self.source)
            self.collector.error(f"unknown parameter {name!r}", suggestion(name, declared), at=origin)

    def _note_references(self, content: Rules, value: Any) -> None:
        entries = {child.cls for child in rules(model.Catalog, self.version).children.values()}
        kinds = tuple(child.cls for child in content.children.values() if child.cls in entries)
        references = value if isinstance(value, tuple) else (value,)
        self.references.extend(ReferenceUse(reference, kinds) for reference in references)

    def _deprecated(self, subject: str, since: str, node: etree._Element) -> None:
        self._warn(f"{subject} is deprecated since OpenSCENARIO {since}", "", node)

    def _warn(self, message: str, hint: str, node: etree._Element) -> None:
        self.collector.warning(message, hint, at=Location(self.source, line_of(node)))

    def _error(self, message: str, hint: str, node: etree._Element) -> None:
        self._error_count += 1
        self.collector.error(message, hint, at=Location(self.source, line_of(node)))
