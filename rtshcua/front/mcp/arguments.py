"""Whether a tool is called with what its schema asks, told in words of ours: what stands there, and what to write.

A mission that comes as a text that holds it, as some hosts send every object, is the same mission, and is taken.
"""

import json
import re
from collections.abc import Mapping
from typing import Any, Final

from rtshcua.ground.agent.json_tree import read_json_text

_TYPES: Final = {"object": dict, "string": str, "integer": int, "boolean": bool}
_ASKED: Final = {"object": "an object", "string": "a text", "integer": "a whole number", "boolean": "true or false"}
_FOUND: Final = {
    dict: "an object", list: "a list", str: "a text", bool: "true or false", int: "a number", float: "a number",
    type(None): "null",
}  # fmt: skip
MOST_SHOWN: Final = 60
_WHOLE: Final = re.compile(r"\+?([0-9]{1,18})(?:\.0{1,9})?")


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
        return _unquoted(name, value)
    if kind == "integer" and isinstance(value, float) and value.is_integer():
        value = int(value)  # the same number to JSON Schema
    if isinstance(value, bool) != (kind == "boolean") or not isinstance(value, _TYPES[kind]):
        help = f"pass {_ASKED[kind]} as `{name}`"
        whole = _WHOLE.fullmatch(value.strip()) if isinstance(value, str) and kind == "integer" else None
        if whole is not None:
            help = f"write {int(whole[1])} without quotes as `{name}`"
        elif kind == "string" and isinstance(value, int | float):
            help = f"write {json.dumps(json.dumps(value))} as `{name}`"
        raise Unfit(f"`{name}` must be {_ASKED[kind]}, not {_FOUND.get(type(value), 'another type')}", help)
    least, most = field.get("minimum"), field.get("maximum")
    if (least is not None and value < least) or (most is not None and value > most):
        within = f"from {least}" + (f" to {most}" if most is not None else "")
        raise Unfit(f"`{name}` is {str(value)[:MOST_SHOWN]}", f"accepted: {within}")
    return value


def _unquoted(name: str, text: str) -> dict[str, Any]:
    """The object that a text holds, and nothing else. Raises `Unfit`."""
    found, why = read_json_text(text)
    if not isinstance(found, dict):
        why = why or f"it holds {_FOUND.get(type(found), 'another type')}"
        help = f"pass an object as `{name}`, or a text that is exactly one object in JSON"
        raise Unfit(f"`{name}` must be an object, not a text: {why}", help)
    return found
