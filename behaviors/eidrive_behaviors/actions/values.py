"""Actions on parameters and variables: set, add, multiply."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api import ActionBehaviour, model


class ParameterSetAction(ActionBehaviour):
    """Sets a parameter for the conditions that come; what the file took from it when it was read stays."""

    immediate = True
    action: model.ParameterSetAction
    parent_element: model.ParameterAction

    def update(self) -> Status:
        """Set it."""
        self.stage.parameters[self.parent_element.parameter_ref] = self.action.value
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"set parameter {self.parent_element.parameter_ref} to {self.action.value}"


class ParameterModifyAction(ActionBehaviour):
    """Adds to a parameter, or multiplies it."""

    immediate = True
    action: model.ParameterModifyAction
    parent_element: model.ParameterAction

    def update(self) -> Status:
        """Modify it."""
        name = self.parent_element.parameter_ref
        self.stage.parameters[name] = modified(self, self.stage.parameters.get(name, ""), name, self.action.rule)
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, how."""
        return f"{in_words(self.action.rule)} parameter {self.parent_element.parameter_ref}"


class VariableSetAction(ActionBehaviour):
    """Sets a variable."""

    immediate = True
    action: model.VariableSetAction
    parent_element: model.VariableAction

    def update(self) -> Status:
        """Set it."""
        self.stage.variables[self.parent_element.variable_ref] = self.action.value
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, to what."""
        return f"set variable {self.parent_element.variable_ref} to {self.action.value}"


class VariableModifyAction(ActionBehaviour):
    """Adds to a variable, or multiplies it."""

    immediate = True
    action: model.VariableModifyAction
    parent_element: model.VariableAction

    def update(self) -> Status:
        """Modify it."""
        name = self.parent_element.variable_ref
        self.stage.variables[name] = modified(self, self.stage.variables.get(name, ""), name, self.action.rule)
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one, how."""
        return f"{in_words(self.action.rule)} variable {self.parent_element.variable_ref}"


def modified(
    behaviour: ActionBehaviour, text: str, name: str, rule: model.ModifyRule | model.VariableModifyRule
) -> str:
    """The number in `text` after the rule, as text. Raises ScenarioError if it is no number."""
    try:
        value = float(text)
    except ValueError:
        raise behaviour.problem(f"calculates with {name} = {text!r}", "give it a number first") from None
    if rule.add_value is not None:
        value += rule.add_value.value
    elif rule.multiply_by_value is not None:
        value *= rule.multiply_by_value.value
    return f"{value:.15g}"


def in_words(rule: model.ModifyRule | model.VariableModifyRule) -> str:
    """What a rule does."""
    if rule.add_value is not None:
        return f"add {rule.add_value.value:g} to"
    assert rule.multiply_by_value is not None
    return f"multiply by {rule.multiply_by_value.value:g}"
