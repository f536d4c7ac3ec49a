"""Actions on parameters and variables: set, add, multiply."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model


class ValueAction(ActionBehaviour):
    """An action on one parameter or one variable: texts by their names, both."""

    immediate = True
    parent_element: model.ParameterAction | model.VariableAction

    @property
    def kind(self) -> str:
        """What it is called."""
        return "parameter" if isinstance(self.parent_element, model.ParameterAction) else "variable"

    @property
    def which(self) -> str:
        """Its name."""
        around = self.parent_element
        return around.parameter_ref if isinstance(around, model.ParameterAction) else around.variable_ref

    @property
    def values(self) -> dict[str, str]:
        """All of its kind."""
        return self.context.parameters if self.kind == "parameter" else self.context.variables


class SetAction(ValueAction):
    """Gives it a value."""

    action: model.ParameterSetAction | model.VariableSetAction

    def update(self) -> Status:
        """Set it."""
        self.values[self.which] = self.action.value
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"set {self.kind} {self.which} to {self.action.value}"


class ModifyAction(ValueAction):
    """Adds to its value, or multiplies it."""

    action: model.ParameterModifyAction | model.VariableModifyAction

    def update(self) -> Status:
        """Modify it."""
        self.values[self.which] = modified(self, self.values.get(self.which, ""), self.which, self.action.rule)
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, how."""
        return f"{describe_modification(self.action.rule)} {self.kind} {self.which}"


class ParameterSetAction(SetAction):
    """Sets a parameter for the conditions that come; what the file took from it when it was read stays."""


class ParameterModifyAction(ModifyAction):
    """Adds to a parameter, or multiplies it, for the conditions that come."""


class VariableSetAction(SetAction):
    """Sets a variable."""


class VariableModifyAction(ModifyAction):
    """Adds to a variable, or multiplies it."""


def modified(
    behaviour: ActionBehaviour, text: str, name: str, rule: model.ModifyRule | model.VariableModifyRule
) -> str:
    """The number in `text` after the rule, as text. Raises ScenarioError if it is no number."""
    try:
        value = float(text)
    except ValueError:
        raise behaviour.error(f"calculates with {name} = {text!r}", "give it a number first") from None
    if rule.add_value is not None:
        value += rule.add_value.value
    elif rule.multiply_by_value is not None:
        value *= rule.multiply_by_value.value
    return f"{value:.15g}"


def describe_modification(rule: model.ModifyRule | model.VariableModifyRule) -> str:
    """What a rule does."""
    if rule.add_value is not None:
        return f"add {rule.add_value.value:g} to"
    assert rule.multiply_by_value is not None
    return f"multiply by {rule.multiply_by_value.value:g}"
