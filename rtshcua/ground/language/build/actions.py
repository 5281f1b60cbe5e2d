"""The actions of the grammar by the names of their rules: the forms of the modules here, and their public functions."""

from types import FunctionType, ModuleType

from rtshcua.ground.language.build import conditions, literals, policies, site, skills, tests
from rtshcua.ground.language.build.reader import Action


def _of(module: ModuleType) -> dict[str, Action]:
    """A function of the name of a rule makes that rule's value."""
    own: dict[str, Action] = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, FunctionType) and value.__module__ == module.__name__ and not name.startswith("_")
    }
    forms: dict[str, Action] = module.FORMS
    return own | forms


ACTIONS: dict[str, Action] = {
    name: action
    for module in (literals, conditions, site, skills, policies, tests)
    for name, action in _of(module).items()
}
