"""Machine-readable rejections of a proposal: the place, the limit, the value found, and the nearest accepted value.

The errors come from the compiler. The limit and the nearest value come from the schema that the policy narrows, or else
from a fix or the help of the error.
"""

import json
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, Final, NamedTuple

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import likeness, nearest
from rtshcua.ground.agent.json_tree import pointer as pointer_to
from rtshcua.ground.agent.json_tree import read_json_text
from rtshcua.ground.agent.narrowed_schema import PermittedSkill
from rtshcua.ground.agent.quantity_reading import PLACE_FORM, decimal, quantity_text, read_place, read_quantity
from rtshcua.ground.agent.specification_schema import uncounted_findings
from rtshcua.ground.agent.value_patterns import COORDINATES, DURATION, SHARE, unit_of, written
from rtshcua.model.flat.contract import QUANTITY
from rtshcua.model.quantity import UNITS, Dimension

#: the limit of a value that must be removed
ABSENT: Final[Mapping[str, Any]] = {"absent": True}
_NO_NAME = re.compile(r"[^A-Za-z0-9_]+")
_NO_LETTER = re.compile(r"[\W_]+")
#: quantities without a range in the schema, by their pattern
_UNRANGED: Final = {DURATION: Dimension.DURATION, SHARE: Dimension.RATIO}
_MOST = 40
#: the most misfits of each kind that are matched with errors, which bounds the work
_MOST_MISFITS = 1_000
_NAMES = {dict: "object", list: "array", str: "string", bool: "boolean", int: "integer"}
_ARTICLED = {
    "object": "an object", "array": "a list", "string": "a text", "boolean": "true or false",
    "integer": "a whole number",
}  # fmt: skip
_NOTHING: Final = object()
#: how a text with JSON, or with marks for code around it, begins
_JSON: Final = ("[", "{", "`")
#: the longest name that is compared with the known ones, in characters
_MOST_NAME = 200
#: the longest text, in characters, that is tried as JSON, and whose error is looked for: a proposal may have many
_MOST_JSON, _MOST_EXPLAINED = 65_536, 4_096


class PermittedRange(NamedTuple):
    """The range of an argument that some permit allows, in the canonical unit of its dimension."""

    low: int
    high: int
    dimension: Dimension


class ProposalFrame(NamedTuple):
    """What a policy permits an agent: the narrowed schema, the ranges of quantities by skill and argument, and the
    phases to which a skill is limited.
    """

    schema: Mapping[str, Any]
    ranges: Mapping[tuple[str, str], PermittedRange]
    phases: Mapping[str, tuple[str, ...]]


class SchemaMisfit(NamedTuple):
    """A value that does not fit the schema.

    `near` is the same value in the accepted form, or the nearest accepted value; None if there is none. `reported_at`
    is the pointer of the compiler's error, if that is another place. `why` is the reason.
    """

    pointer: str
    limit: Mapping[str, Any]
    near: Any
    reported_at: str = ""
    why: str = ""


def frame_of(schema: Mapping[str, Any], skills: Iterable[PermittedSkill]) -> ProposalFrame:
    """Return what a policy permits an agent, from its narrowed `schema` and the `skills` that it permits."""
    known = tuple(skills)
    ranges = {
        (skill.contract.name, each.parameter.name): PermittedRange(
            each.low, each.high, Dimension(each.parameter.dimension)
        )
        for skill in known
        for each in skill.allowed
        if each.parameter.kind == QUANTITY
    }
    phases = {each.contract.name: tuple(each.contract.phases) for each in known if each.contract.phases}
    return ProposalFrame(schema, ranges, phases)


class Rejections(NamedTuple):
    """The first rejections of a proposal, and the number of further ones."""

    first: list[dict[str, Any]]
    more: int


def rejections(value: Any, found: Iterable[Diagnostic], source: Source, frame: ProposalFrame) -> Rejections:
    """Return a rejection for each compiler error on the specification `value`, whose text is `source`.

    Only the first 40 are returned, with the number of further ones. That number includes the findings that the compiler
    counted but did not list.
    """
    fit = islice(_SchemaFit(frame).misfits(frame.schema, value, "", ("", "")), _MOST_MISFITS)
    misfits = [*fit, *islice(_StepOrder(frame, value).misfits(), _MOST_MISFITS)]
    rejected: dict[str, dict[str, Any]] = {}
    more = 0
    for each in found:
        if uncounted_findings(each):
            more += uncounted_findings(each)
        elif each.severity is Severity.ERROR:
            for one in _rejections(each, value, source, misfits):
                rejected.setdefault(json.dumps([one["field"], one["limit"] or one["code"]]), one)
    return Rejections(list(rejected.values())[:_MOST], max(len(rejected) - _MOST, 0) + more)


def _rejections(found: Diagnostic, value: Any, source: Source, misfits: list[SchemaMisfit]) -> Iterator[dict[str, Any]]:
    pointer = found.pointer or ""
    about = _about(pointer, misfits)
    for misfit in about:
        yield _rejection(found, misfit.pointer, value, misfit.limit, misfit.near, misfit.why)
    if not about:
        near = _fixed(found, source, _raw(value, pointer))
        yield _rejection(found, pointer, value, None if near is None else {"one_of": [near]}, near)


def _about(pointer: str, misfits: list[SchemaMisfit]) -> list[SchemaMisfit]:
    """Return the misfits at a place; if there are none, those below it; if there are none either, those above it."""
    own = [each for each in misfits if pointer == (each.reported_at or each.pointer)]
    others = [each for each in misfits if not each.reported_at]
    below = [each for each in others if each.pointer.startswith(f"{pointer}/")]
    return own or below or [each for each in others if pointer.startswith(f"{each.pointer}/")]


def _rejection(
    found: Diagnostic, pointer: str, value: Any, limit: Mapping[str, Any] | None, near: Any, why: str = ""
) -> dict[str, Any]:
    there, observed = _at(value, pointer)
    message = found.message
    if there and limit is not None and set(limit) == {"type"} and pointer != (found.pointer or ""):
        # the error is about another value below the same place
        message = f"expected {_ARTICLED[limit['type']]}; found `{observed}`"
    return {
        "code": found.code.id,
        "field": pointer,
        "message": message,
        "limit": None if limit is None else dict(limit),
        "observed": observed if there else None,
        "age_us": None,
        "nearest": near,
        "repair": _repair(pointer, limit or {}, near, why) or found.help or message,
    }


def _repair(pointer: str, limit: Mapping[str, Any], near: Any, why: str) -> str:
    """The advice how to correct the value; empty if neither the limit, the nearest value nor a reason is known."""
    accepted = limit.get("one_of", limit.get("places"))
    if limit == ABSENT:
        return f"remove `{pointer}`"
    if isinstance(near, dict | list) and why:
        return f"{why} at `{pointer}`"
    if near is not None:
        return f"write {json.dumps(near, ensure_ascii=False)} at `{pointer}`" + (f": {why}" if why else "")
    if "least" in limit:
        return (f"{why}; " if why else "") + f"permitted at `{pointer}`: from {limit['least']} to {limit['most']}"
    if accepted:
        listed = ", ".join(json.dumps(each, ensure_ascii=False) for each in accepted)
        return (
            (f"{why}; " if why else "")
            + f"accepted at `{pointer}`: {listed}"
            + ("" if "one_of" in limit else f", or {PLACE_FORM}")
        )
    return why


def _raw(value: Any, pointer: str) -> Any:
    """Return the value at a pointer, or `_NOTHING`."""
    for part in pointer.split("/")[1:]:
        key = part.replace("~1", "/").replace("~0", "~")
        try:
            value = value[int(key)] if isinstance(value, list) else value[key]
        except (KeyError, IndexError, ValueError, TypeError):
            return _NOTHING
    return value


def _at(value: Any, pointer: str) -> tuple[bool, Any]:
    """Return whether there is a value at a pointer, and the value; of an object or array only its size."""
    value = _raw(value, pointer)
    if isinstance(value, dict | list):
        return True, f"{_NAMES[type(value)]} of {len(value)}"
    return value is not _NOTHING, value[:200] if isinstance(value, str) else value


def _fixed(found: Diagnostic, source: Source, value: Any) -> Any:
    """What the first fix makes of `value`, a string or number; None if the fix changes anything else."""
    if not isinstance(value, str | int):
        return None
    text = json.dumps(value, ensure_ascii=False)
    for fix in found.fixes:
        start, end = fix.span.start, fix.span.end
        at = source.text.find(text, max(0, start - len(text)), end + len(text))
        if fix.span.file == source.file and 0 <= at <= start and end <= at + len(text):
            try:
                return json.loads(text[: start - at] + fix.replacement + text[end - at :])
            except ValueError:
                return None
    return None


class _StepOrder:
    """Checks the steps of a specification against each other: whether each may be in its phase, and whether each begins
    where the previous step ended.
    """

    def __init__(self, frame: ProposalFrame, value: Any) -> None:
        self._frame = frame
        self._phases = value.get("phases") if isinstance(value, dict) else None

    def misfits(self) -> Iterator[SchemaMisfit]:
        """Yield the phase names and arguments that do not fit the other steps."""
        before: tuple[str, Any] | None = None
        names: list[Any] = []
        for number, phase in enumerate(self._phases if isinstance(self._phases, list) else ()):
            if not isinstance(phase, dict) or not isinstance(phase.get("steps"), list):
                continue
            name, at = phase.get("name"), f"/phases/{number}"
            if name in names:
                yield SchemaMisfit(f"{at}/name", {"none_of": list(names)}, f"phase_{number + 1}")
            names.append(name)
            for index, step in enumerate(phase["steps"]):
                here = f"{at}/steps/{index}"
                bound = self._frame.phases.get(_skill(step), ())
                if bound and name not in bound:
                    yield SchemaMisfit(f"{at}/name", {"one_of": list(bound)}, bound[0], f"{here}/skill")
                if before is not None and isinstance(step, dict):
                    yield from self._discontinuities(before, step, here)
                before = (here, step)

    def _discontinuities(self, before: tuple[str, Any], step: Mapping[str, Any], here: str) -> Iterator[SchemaMisfit]:
        """Yield the arguments that the previous step needs so that `step` begins where it ends."""
        at, previous = before
        old, new = _arguments(previous), _arguments(step)
        schema = self._frame.schema["$defs"].get(_skill(previous))
        if old is None or new is None or schema is None:
            return
        for name, wanted in new.items():
            if old.get(name, wanted) != wanted and (_skill(step), name) in self._frame.ranges:
                yield SchemaMisfit(f"{at}/arguments/{name}", {"one_of": [wanted]}, wanted, here)
        entries = [f"{each}.entry" for each in new.values() if isinstance(each, str)]
        for name, each in schema["properties"]["arguments"]["properties"].items():
            fits = [entry for entry in entries if "pattern" in each and _fits(each, entry)]
            if fits and old.get(name) not in fits:
                yield SchemaMisfit(f"{at}/arguments/{name}", {"one_of": fits}, fits[0], here)


class _SchemaFit:
    """Validates a value against the narrowed schema. It knows only the keywords that this schema uses."""

    def __init__(self, frame: ProposalFrame) -> None:
        self._frame = frame
        self._defs: Mapping[str, Any] = frame.schema["$defs"]

    def misfits(self, schema: Mapping[str, Any], value: Any, at: str, of: tuple[str, str]) -> Iterator[SchemaMisfit]:
        """Yield what does not fit in `value`, which is `at` a pointer; `of` is the skill and the argument."""
        if "anyOf" in schema:
            yield from self._step(value, at)
        elif _NAMES.get(type(value)) != schema["type"]:
            limit = {"type": schema["type"], **(self._limit(schema, of) if schema["type"] == "string" else {})}
            near, why = self._near(schema, value, of)
            yield SchemaMisfit(at, limit, near, why=why)
        elif schema["type"] == "object":
            yield from self._object(schema, value, at, of)
        elif schema["type"] == "array":
            for number, each in enumerate(value):
                if number >= schema.get("maxItems", len(value)):
                    yield SchemaMisfit(f"{at}/{number}", ABSENT, None)
                else:
                    yield from self.misfits(schema["items"], each, f"{at}/{number}", of)
        elif not _fits(schema, value):
            near, why = self._near(schema, value, of)
            yield SchemaMisfit(at, self._limit(schema, of), near, why=why)

    def _step(self, value: Any, at: str) -> Iterator[SchemaMisfit]:
        """Yield what does not fit in a step, by the schema of the skill that it names."""
        named = _skill(value)
        if named in self._defs:
            yield from self.misfits(self._defs[named], value, at, (named, ""))
            return
        yield SchemaMisfit(f"{at}/skill", {"one_of": list(self._defs)}, _choice(named, list(self._defs))[0])

    def _object(self, schema: Mapping[str, Any], value: Any, at: str, of: tuple[str, str]) -> Iterator[SchemaMisfit]:
        skill, _ = of
        for name in value:
            if name not in schema["properties"]:
                yield SchemaMisfit(f"{at}{pointer_to((name,))}", ABSENT, None)
        for name, each in schema["properties"].items():
            here = (skill, name)
            if name in value:
                yield from self.misfits(each, value[name], f"{at}/{name}", here)
            elif name in schema["required"]:
                limit = {"required": True, **self._limit(each, here)}
                yield SchemaMisfit(f"{at}/{name}", limit, self._near(each, None, here)[0])

    def _limit(self, schema: Mapping[str, Any], of: tuple[str, str]) -> dict[str, Any]:
        choices, span = _choices(schema), self._frame.ranges.get(of)
        if choices is not None:
            return {"one_of": choices}
        if span is not None:
            return {"least": written(span.low, span.dimension), "most": written(span.high, span.dimension)}
        places = _places(schema)
        own = {key: schema[key] for key in ("type", "pattern", "maxLength") if key in schema}
        return own | ({"places": places} if places else {})

    def _near(self, schema: Mapping[str, Any], value: Any, of: tuple[str, str]) -> tuple[Any, str]:
        """Return the accepted value nearest to `value` (None if none is near) and why `value` is not accepted."""
        choices, span, kind = _choices(schema), self._frame.ranges.get(of), schema.get("type")
        if choices is not None:
            return (choices[0], "") if "const" in schema else _choice(value, choices)
        if span is not None:
            return nearest_quantity(value, span)
        if kind in ("object", "array"):
            return self._near_container(schema, value, of)
        if schema.get("pattern") in _UNRANGED:
            return _unranged(value, schema)
        if COORDINATES in schema.get("pattern", ""):
            return _place(value, _places(schema))
        return _name(schema, value) if kind == "string" else (None, "")

    def _near_container(self, schema: Mapping[str, Any], value: Any, of: tuple[str, str]) -> tuple[Any, str]:
        """Return the object or list that `value` means, perhaps as text."""
        kind = schema["type"]
        inner, why = _json_in(value)
        if _NAMES.get(type(inner)) == kind:
            return inner, f"write the {'list' if kind == 'array' else 'object'} itself, not a string with JSON,"
        if why:
            return None, why
        return self._near_list(schema, value, of) if kind == "array" else self._near_object(schema, value, of)

    def _near_list(self, schema: Mapping[str, Any], value: Any, of: tuple[str, str]) -> tuple[Any, str]:
        """Return the list of a value that is accepted in it."""
        if value is None or schema.get("maxItems", 1) == 0:
            return None, ""
        fits = next(self.misfits(schema["items"], value, "", of), None) is None
        return ([value], "write a list, even of one value,") if fits else (None, "")

    def _near_object(self, schema: Mapping[str, Any], value: Any, of: tuple[str, str]) -> tuple[Any, str]:
        """Return the only accepted object, or None, and its keys."""
        made = {name: self._near(schema["properties"][name], None, (of[0], name))[0] for name in schema["required"]}
        if (made or value is None) and all(each is not None for each in made.values()):
            return made, ""
        keys = ", ".join(f"`{name}`" for name in made or schema["properties"])
        return None, f"expected an object with {keys}" if keys else "expected an empty object"


def _json_in(value: Any) -> tuple[Any, str]:
    """Return the JSON value that a text holds, or None, and what is wrong with it; both empty if it is no such text."""
    if isinstance(value, str) and len(value) <= _MOST_JSON and value.lstrip().startswith(_JSON):
        return read_json_text(value, explained=len(value) <= _MOST_EXPLAINED)
    return None, ""


def _skill(step: Any) -> str:
    """The skill that a step names; empty if it names none."""
    named = step.get("skill") if isinstance(step, dict) else None
    return named if isinstance(named, str) else ""


def _arguments(step: Any) -> dict[str, Any] | None:
    found = step.get("arguments") if isinstance(step, dict) else None
    return found if isinstance(found, dict) else None


def _choices(schema: Mapping[str, Any]) -> list[Any] | None:
    """The only values that a schema accepts; None if it does not list them."""
    listed: list[Any] | None = schema.get("enum", [schema["const"]] if "const" in schema else None)
    return listed


def _fits(schema: Mapping[str, Any], value: Any) -> bool:
    choices = _choices(schema)
    if choices is not None:
        return value in choices
    if not isinstance(value, str):
        return True
    long = schema.get("maxLength", len(value)) < len(value)
    return not long and ("pattern" not in schema or re.fullmatch(schema["pattern"], value) is not None)


def nearest_quantity(value: Any, span: PermittedRange) -> tuple[str | None, str]:
    """Return the meant quantity in the language's form, or the end of the range that is nearest to it; None if it is
    unclear. And what was wrong.
    """
    text = quantity_text(value)
    found, why = (None, "") if text is None else read_quantity(text, span.dimension)
    if found is None:
        return None, why
    if why and not span.low <= found <= span.high:
        why = f"the value is {decimal(found, span.dimension)}, out of range"
    elif why and found.denominator != 1:
        why += ", rounded"
    return written(min(max(round(found), span.low), span.high), span.dimension), why


def _unranged(value: Any, schema: Mapping[str, Any]) -> tuple[str | None, str]:
    """Return the quantity in a string or number in the language's form; None if the language accepts it, because then
    the error is another one.
    """
    dimension, text = _UNRANGED[schema["pattern"]], quantity_text(value)
    if text is None:
        return None, f"expected a text such as `{written(2 * UNITS[unit_of(dimension)].numerator, dimension)}`"
    found, why = read_quantity(text, dimension)
    if found is None or not why:
        return None, why
    forms = [written(round(found), dimension)]
    if dimension is Dimension.DURATION:
        forms.append(f"{round(found * UNITS['ms'].denominator / UNITS['ms'].numerator)} ms")
    return next((each for each in forms if _fits(schema, each)), None), why


def _choice(value: Any, choices: list[Any]) -> tuple[Any, str]:
    """Return the choice that a text means, or the nearest one if no other is as near; the only one for no value."""
    if value is None and len(choices) == 1:
        return choices[0], ""
    if not isinstance(value, str) or len(value) > _MOST_NAME:
        return None, ""
    same = [each for each in choices if _letters(each) == _letters(value)]
    if len(same) == 1:
        return same[0], ""
    near = nearest(value, choices)
    if near is None:
        return None, ""
    own, others = _letters(value), [each for each in choices if each != near]
    best = likeness(own, _letters(near))
    return (near if all(likeness(own, _letters(each)) < best for each in others) else None), ""


def _letters(name: str) -> str:
    """The letters and digits of a name, without case."""
    return _NO_LETTER.sub("", unicodedata.normalize("NFKC", name).casefold())


def _place(value: Any, places: list[str]) -> tuple[str | None, str]:
    """Return coordinates in the language's form, or the place that a text means, and what was wrong."""
    found, why = read_place(value)
    if found is None and not why:
        return _choice(value, places)[0], "" if places else PLACE_FORM
    return found, why


def _places(schema: Mapping[str, Any]) -> list[str]:
    """The named places that a pattern accepts."""
    return [each.replace("\\", "") for each in re.findall(r"\w+\\\.entry", schema.get("pattern", ""))]


def _name(schema: Mapping[str, Any], value: Any) -> tuple[str | None, str]:
    """Return a name made of the letters and digits of `value` that fits the schema; None if it has none."""
    words = value[: schema.get("maxLength", _MOST_NAME)] if isinstance(value, str) else ""
    parts = _NO_NAME.sub("_", words)
    if parts.strip("_"):
        for text in (words, parts, f"m_{parts}"):
            if _fits(schema, text):
                return text, ""
    return None, "a name has letters, digits and `_`, and begins with a letter" if "pattern" in schema else ""
