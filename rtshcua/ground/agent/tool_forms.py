"""The schema as a tool definition for language models, in the forms that their providers document.

- OpenAI, Responses API: a function tool is flat, `{"type": "function", "name", "description", "parameters",
  "strict"}`; Chat Completions nest it under `"function"`. With `strict` each object has `additionalProperties` false
  and requires all its properties; `allOf`, `not`, `if` are refused, and so are lengths by some models.
- Anthropic, Messages API: `{"name", "description", "input_schema", "strict"}`; with `strict` no lengths, no numeric
  ranges, no recursion.
- Model Context Protocol, 2025-11-25: `{"name", "title", "description", "inputSchema", "annotations"}`; the schema is of
  draft 2020-12 where it names no other.

A strict form needs a schema that a policy narrows: the general schema has arguments of any name, which strict mode does
not support. Strict forms omit `overrides`, because all its properties are optional.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

Schema = dict[str, Any]

NAME: Final = "propose_mission"
TITLE: Final = "Propose a mission"
DESCRIPTION: Final = (
    "Propose a mission for the drone. The mission is checked against the policy. The answer accepts it or lists "
    "findings, each with a JSON Pointer to the wrong value and the values that are accepted. "
    "This call alone does not start a flight."
)
#: the keywords that every provider's strict mode supports
_KEPT: Final = frozenset(
    {"type", "properties", "required", "additionalProperties", "items", "enum", "const", "anyOf", "$ref", "$defs"}
    | {"description", "pattern"}
)
#: the property that strict forms omit
_LEFT_OUT: Final = "overrides"


def strict(schema: Schema) -> Schema:
    """Return a narrowed schema with every property required and only the keywords of strict mode.

    Every value that it accepts also fits `schema`, except for lengths.
    """
    kept: Schema = {}
    for key, value in schema.items():
        if key in ("properties", "$defs"):
            kept[key] = {name: strict(each) for name, each in value.items() if name != _LEFT_OUT}
        elif key == "items":
            kept[key] = strict(value)
        elif key == "anyOf":
            kept[key] = [strict(each) for each in value]
        elif key in _KEPT:
            kept[key] = value
    if "properties" in kept:
        kept["required"] = list(kept["properties"])
        kept["additionalProperties"] = False
    return kept


def _openai(schema: Schema, *, narrow: bool) -> Schema:
    parameters = strict(schema) if narrow else _plain(schema)
    return {"type": "function", "name": NAME, "description": DESCRIPTION, "parameters": parameters, "strict": narrow}


def _openai_chat(schema: Schema, *, narrow: bool) -> Schema:
    function = _openai(schema, narrow=narrow)
    return {"type": function.pop("type"), "function": function}


def _anthropic(schema: Schema, *, narrow: bool) -> Schema:
    tool: Schema = {"name": NAME, "description": DESCRIPTION}
    if narrow:
        return tool | {"input_schema": strict(schema), "strict": True}
    return tool | {"input_schema": _plain(schema)}


def _mcp(schema: Schema, *, narrow: bool) -> Schema:
    del narrow
    hints = {"readOnlyHint": False, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}
    return {
        "name": NAME,
        "title": TITLE,
        "description": DESCRIPTION,
        "inputSchema": schema,
        "annotations": hints,
    }


def _plain(schema: Schema) -> Schema:
    """The schema without the keywords that identify the document."""
    return {key: value for key, value in schema.items() if key not in ("$schema", "$id", "title")}


def _itself(schema: Schema, *, narrow: bool) -> Schema:
    del narrow
    return schema


#: the forms, by the name of the command's option
FORMS: Final[Mapping[str, Callable[..., Schema]]] = {
    "schema": _itself,
    "openai": _openai,
    "openai-chat": _openai_chat,
    "anthropic": _anthropic,
    "mcp": _mcp,
}
