"""Whether a tool is called with what its schema asks, told in words of ours: what stands there, and what to write.

A mission that comes as a text that holds it, as some hosts send every object, is the same mission, and is taken.
"""

import json
from collections.abc import Mapping
from typing import Any, Final

_TYPES: Final = {"object": dict, "string": str, "integer": int, "boolean": bool}
_ASKED: Final = {"object": "an object", "string": "a text", "integer": "a whole number", "boolean": "true or false"}
_FOUND: Final = {
    dict: "an object", list: "a list", str: "a text", bool: "true or false", int: "a number", float: "a number",
    type(None): "null",
}  # fmt: skip
MOST_SHOWN: Final = 60
#: characters of a mission as text
MOST_TEXT: Final = 1 << 20


class Unfit(Exception):
    """An argument is not what the tool's schema asks: what is wrong, and what to write."""

    def __init__(self, text: str, repair: str) -> None:
        super().__init__(text)
        self.repair = repair


def fitted(schema: Mapping[str, Any], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments as the tool takes them. Raises `Unfit`."""
    fields: Mapping[str, Any] = schema["properties"]
    for name in arguments:
        if name not in fields:
            known = ", ".join(f"`{each}`" for each in fields) or "none"
            raise Unfit(f"unknown argument `{name[:MOST_SHOWN]}`", f"leave it out; accepted: {known}")
    for name in schema["required"]:
        if name not in arguments:
            raise Unfit(f"the argument `{name}` is missing", f"pass {_ASKED[fields[name]['type']]} as `{name}`")
    return {name: _value(name, fields[name], value) for name, value in arguments.items()}


def _value(name: str, field: Mapping[str, Any], value: Any) -> Any:
    kind = field["type"]
    if kind == "object" and isinstance(value, str):
        value = _unquoted(value)
    if kind == "integer" and isinstance(value, float) and value.is_integer():
        value = int(value)  # the same number to JSON Schema
    if isinstance(value, bool) != (kind == "boolean") or not isinstance(value, _TYPES[kind]):
        help = f"pass {_ASKED[kind]} as `{name}`"
        if isinstance(value, str) and kind == "integer" and value.isascii() and value.isdecimal():
            help = f"write {int(value[:18])} without quotes as `{name}`"
        elif kind == "string" and isinstance(value, int | float):
            help = f"write {json.dumps(str(value))} as `{name}`"
        raise Unfit(f"`{name}` must be {_ASKED[kind]}, not {_FOUND.get(type(value), 'another type')}", help)
    least, most = field.get("minimum"), field.get("maximum")
    if (least is not None and value < least) or (most is not None and value > most):
        within = f"from {least}" + (f" to {most}" if most is not None else "")
        raise Unfit(f"`{name}` is {str(value)[:MOST_SHOWN]}", f"accepted: {within}")
    return value


def _unquoted(text: str) -> Any:
    """The object that a text holds; the text where it holds none, or a key twice."""
    try:
        found = json.loads(text, object_pairs_hook=_once) if len(text) <= MOST_TEXT else text
    except (ValueError, RecursionError):
        return text
    return found if isinstance(found, dict) else text


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        raise ValueError("a key is written twice")
    return made
