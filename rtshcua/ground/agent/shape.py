"""E0902: where a specification does not follow its schema, told in words that say what to write instead."""

import re
from collections.abc import Iterator, Mapping
from itertools import islice

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.agent.json_tree import Path, Tree
from rtshcua.ground.agent.pointers import pointer
from rtshcua.ground.agent.schema import (
    OverridesShape,
    PhaseShape,
    PolicyName,
    Proposer,
    SpecificationShape,
    StepShape,
)

_UNTOLD = re.compile(r"and ([0-9]+) more findings, which are not told")
_ASKED: Mapping[str, str] = {
    "string_type": "a text",
    "int_type": "a whole number",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
}
_FOUND: Mapping[type, str] = {
    str: "a text",
    bool: "true or false",
    int: "a number",
    list: "a list",
    dict: "an object",
    type(None): "null",
}


def shape_errors(error: ValidationError, tree: Tree, most: int) -> tuple[Diagnostic, ...]:
    """One finding for each place where the specification is not what its schema asks; of many, the first `most`, and
    how many more there are.
    """
    found = tuple(islice(_shape_errors(error, tree), most))
    more = error.error_count() - len(found)
    return (*found, uncounted(more, tree.spans[()].file)) if more else found


def uncounted(more: int, file: str) -> Diagnostic:
    """That there is more to find than is told, and how much."""
    message = f"and {more} more findings, which are not told"
    return Diagnostic(codes.SPECIFICATION_SIZE, message, Span(file, 0, 0), "mend those that are told, and try again")


def untold(found: Diagnostic) -> int:
    """How many findings one of `uncounted` stands for; 0 for any other finding."""
    matched = _UNTOLD.fullmatch(found.message) if found.code is codes.SPECIFICATION_SIZE else None
    return 0 if matched is None else int(matched[1])


def _shape_errors(error: ValidationError, tree: Tree) -> Iterator[Diagnostic]:
    for each in error.errors(include_url=False):
        path = tuple(part for part in each["loc"] if part != "[key]")
        if each["type"] == "missing":
            yield _missing(path, tree)
        elif each["type"] == "extra_forbidden":
            yield _surplus(path, tree)
        else:
            yield _wrong(path, tree, each)


def _missing(path: Path, tree: Tree) -> Diagnostic:
    """A key that is not there: the bracket of the object that lacks it is shown."""
    place = tree.spans[path[:-1]]
    return Diagnostic(
        codes.SPECIFICATION_SHAPE,
        f"the key `{path[-1]}` is missing",
        Span(place.file, place.start, place.start + 1),
        f'add `"{path[-1]}": ...` to this object',
        pointer=pointer(path[:-1]),
    )


def _surplus(path: Path, tree: Tree) -> Diagnostic:
    place = tree.keys[path]
    known = list(_shape_at(path[:-1]).model_fields)
    near = nearest(str(path[-1]), known)
    listed = "its keys are " + ", ".join(f"`{key}`" for key in known)
    return Diagnostic(
        codes.SPECIFICATION_SHAPE,
        f"there is no key `{path[-1]}` here",
        place,
        listed if near is None else f"did you mean `{near}`?",
        fixes=() if near is None else (Fix(place, f'"{near}"', f"write `{near}`"),),
        pointer=pointer(path),
    )


def _wrong(path: Path, tree: Tree, error: ErrorDetails) -> Diagnostic:
    kind, value = error["type"], error["input"]
    help: str | None = None
    if kind in _ASKED:
        message = f"{_ASKED[kind]} is asked, and this is {_FOUND.get(type(value), 'something else')}"
        if kind == "string_type" and {"arguments", "overrides"} & set(path):
            help = 'write the value as a text with its unit, such as "20 m"'
    elif kind == "literal_error":
        message, help = "this value is not accepted", f"accepted: {error.get('ctx', {}).get('expected', '')}"
    elif kind == "string_pattern_mismatch" and "imports" in path:
        message = "a specification imports from the shipped library only"
        help = "write `lib:` and a path; name the policy's own files on the command line"
    elif kind == "string_pattern_mismatch":
        message, help = "this is not a name", "a name has letters, digits, `_`, and `.` between its parts"
    else:
        message = error["msg"][0].lower() + error["msg"][1:]
    span = tree.keys[path] if "[key]" in error["loc"] else tree.spans[path]
    return Diagnostic(codes.SPECIFICATION_SHAPE, message, span, help, pointer=pointer(path))


def _shape_at(path: Path) -> type[BaseModel]:
    """The shape of the object at a path."""
    if not path:
        return SpecificationShape
    if path[0] == "phases":
        return PhaseShape if len(path) < 4 else OverridesShape if "overrides" in path else StepShape
    return PolicyName if path[0] == "policy" else Proposer
