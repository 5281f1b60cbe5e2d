"""The actions of the grammar by the names of their rules: the `FORMS` and the public functions of these modules."""

from types import FunctionType, ModuleType

from rtshcua.ground.language.build import conditions, literals, policies, site, skills, tests
from rtshcua.ground.language.build.reader import Action


def _of(module: ModuleType) -> dict[str, Action]:
    """The actions of a module: each public function is the action of the rule with its name."""
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
