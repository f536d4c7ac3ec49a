"""Actions on parameters and variables: set, add, multiply."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_behaviors.conditions.values import NUMBER
from eidrive_scenario.api.actions import ActionBehaviour, model


class ValueAction(ActionBehaviour):
    """Base class of actions on one parameter or one variable, both of which hold text."""

    immediate = True
    parent_element: model.ParameterAction | model.VariableAction

    @property
    def kind(self) -> str:
        """Kind of the value: `parameter` or `variable`."""
        return "parameter" if isinstance(self.parent_element, model.ParameterAction) else "variable"

    @property
    def ref(self) -> str:
        """Name of the parameter or variable."""
        parent = self.parent_element
        return parent.parameter_ref if isinstance(parent, model.ParameterAction) else parent.variable_ref

    @property
    def value(self) -> str:
        """Current value; empty without one."""
        parent = self.parent_element
        if isinstance(parent, model.ParameterAction):
            return self.context.parameter(parent) or ""
        return self.context.variables.get(parent.variable_ref, "")

    def set_value(self, value: str) -> None:
        """Set the value."""
        parent = self.parent_element
        if isinstance(parent, model.ParameterAction):
            self.context.set_parameter(parent, value)
        else:
            self.context.set_variable(parent.variable_ref, value)


class SetAction(ValueAction):
    """Assignment of a value."""

    action: model.ParameterSetAction | model.VariableSetAction

    def update(self) -> Status:
        """Set the value."""
        self.set_value(self.action.value)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe name and value."""
        return f"set {self.kind} {self.ref} to {self.action.value}"


class ModifyAction(ValueAction):
    """Addition to a value, or its multiplication."""

    action: model.ParameterModifyAction | model.VariableModifyAction

    def update(self) -> Status:
        """Modify the value, in the notation of XML. Raise ScenarioError if it is not a number."""
        rule = self.action.rule
        if not NUMBER.fullmatch(self.value.strip()):
            raise self.error(f"{self.ref} is not a number (got {self.value!r}; expected a number)")
        value = float(self.value)
        if rule.add_value is not None:
            value += rule.add_value.value
        elif rule.multiply_by_value is not None:
            value *= rule.multiply_by_value.value
        # 15 digits are free of rounding errors, as in 0.1 + 0.2, but too few for large integers
        digits = 15 if abs(value) < 1e15 else 17
        self.set_value(f"{value:.{digits}g}".replace("inf", "INF").replace("nan", "NaN"))
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe name and rule."""
        rule = self.action.rule
        if rule.add_value is not None:
            return f"add {rule.add_value.value:g} to {self.kind} {self.ref}"
        assert rule.multiply_by_value is not None
        return f"multiply by {rule.multiply_by_value.value:g} {self.kind} {self.ref}"


class ParameterSetAction(SetAction):
    """Assignment of a parameter for later conditions. Values that the reader substituted are not changed."""


class ParameterModifyAction(ModifyAction):
    """Addition to a parameter, or its multiplication, for later conditions."""


class VariableSetAction(SetAction):
    """Assignment of a variable."""


class VariableModifyAction(ModifyAction):
    """Addition to a variable, or its multiplication."""
