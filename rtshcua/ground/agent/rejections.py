"""Rejections of a proposal, for a program to correct it: the place, the limit, the value found, and the nearest one.

The compiler finds what is wrong. The schema that its policy narrows gives the limit and the nearest value that fits;
where it gives none, a fix of the finding does, or its help.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, Final, NamedTuple

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.agent.json_tree import pointer as pointer_to
from rtshcua.ground.agent.narrowed_schema import PermittedSkill
from rtshcua.ground.agent.quantity_reading import decimal, read_quantity
from rtshcua.ground.agent.specification_schema import uncounted_findings
from rtshcua.ground.agent.value_patterns import written
from rtshcua.model.flat.contract import QUANTITY
from rtshcua.model.quantity import Dimension

#: the limit of what does not belong there: it is to be left out
ABSENT: Final[Mapping[str, Any]] = {"absent": True}
_NO_NAME = re.compile(r"[^A-Za-z0-9_]+")
_MOST = 40
#: places that do not fit, of each kind, that errors are held against: more would take long, and few are told
_MOST_MISFITS = 1_000
_NAMES = {dict: "object", list: "array", str: "string", bool: "boolean", int: "integer"}
_ARTICLED = {
    "object": "an object", "array": "a list", "string": "a text", "boolean": "true or false",
    "integer": "a whole number",
}  # fmt: skip
#: characters of a text that is read as JSON for advice
_MOST_JSON = 65_536


class PermittedRange(NamedTuple):
    """The least and the most of an argument that some permit leaves, in the canonical unit of its dimension."""

    low: int
    high: int
    dimension: Dimension


class ProposalFrame(NamedTuple):
    """What a policy leaves an agent: the narrowed schema, the ranges of quantities by skill and argument, and the
    phases that a skill is bound to.
    """

    schema: Mapping[str, Any]
    ranges: Mapping[tuple[str, str], PermittedRange]
    phases: Mapping[str, tuple[str, ...]]


class SchemaMisfit(NamedTuple):
    """A place that does not fit. `near` is the value that fits and says the same, or the nearest one; None where the
    limit is `ABSENT`, or what stands there says nothing that can be asked for. `of` is what it is found by, where that
    is another place; `why` says what is wrong, or how it should stand there.
    """

    pointer: str
    limit: Mapping[str, Any]
    near: Any
    of: str = ""
    why: str = ""


def frame_of(schema: Mapping[str, Any], skills: Iterable[PermittedSkill]) -> ProposalFrame:
    """What a policy leaves an agent: `schema` is narrowed by it, `skills` are those that it permits."""
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
    """The first rejections of a proposal, and how many more there are."""

    told: list[dict[str, Any]]
    more: int


def rejections(value: Any, found: Iterable[Diagnostic], source: Source, frame: ProposalFrame) -> Rejections:
    """One rejection for each error of the compiler on the specification `value`, whose text is `source`. Of many the
    first 40, and how many more there are: findings that the compiler counts and does not tell are among them.
    """
    fit = islice(_SchemaFit(frame).misfits(frame.schema, value, "", ("", "")), _MOST_MISFITS)
    misfits = [*fit, *islice(_StepOrder(frame, value).misfits(), _MOST_MISFITS)]
    told: dict[str, dict[str, Any]] = {}
    more = 0
    for each in found:
        if uncounted_findings(each):
            more += uncounted_findings(each)
        elif each.severity is Severity.ERROR:
            for one in _rejections(each, value, source, misfits):
                told.setdefault(json.dumps([one["field"], one["limit"] or one["code"]]), one)
    return Rejections(list(told.values())[:_MOST], max(len(told) - _MOST, 0) + more)


def _rejections(found: Diagnostic, value: Any, source: Source, misfits: list[SchemaMisfit]) -> Iterator[dict[str, Any]]:
    pointer = found.pointer or ""
    about = _about(pointer, misfits)
    for misfit in about:
        yield _rejection(found, misfit.pointer, value, misfit.limit, misfit.near, misfit.why)
    if not about:
        near = _fixed(found, source)
        yield _rejection(found, pointer, value, None if near is None else {"one_of": [near]}, near)


def _about(pointer: str, misfits: list[SchemaMisfit]) -> list[SchemaMisfit]:
    """The misfits at a place; where there are none those below it, or else those that it is below."""
    own = [each for each in misfits if pointer == (each.of or each.pointer)]
    others = [each for each in misfits if not each.of]
    below = [each for each in others if each.pointer.startswith(f"{pointer}/")]
    return own or below or [each for each in others if pointer.startswith(f"{each.pointer}/")]


def _rejection(
    found: Diagnostic, pointer: str, value: Any, limit: Mapping[str, Any] | None, near: Any, why: str = ""
) -> dict[str, Any]:
    there, observed = _at(value, pointer)
    message = found.message
    if there and limit is not None and set(limit) == {"type"} and pointer != (found.pointer or ""):
        message = f"expected {_ARTICLED[limit['type']]}; this is `{observed}`"  # `found` is the first of several
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
    """What to do, in words, as far as the limit, the nearest value or the reason tell it."""
    accepted = limit.get("one_of", limit.get("places"))
    if limit == ABSENT:
        return f"leave `{pointer}` out"
    if isinstance(near, dict | list) and why:
        return f"{why} at `{pointer}`"
    if near is not None:
        return f"write {json.dumps(near, ensure_ascii=False)} at `{pointer}`" + (f": {why}" if why else "")
    if "least" in limit:
        return (f"{why}; " if why else "") + f"from {limit['least']} to {limit['most']} is permitted at `{pointer}`"
    if accepted:
        listed = ", ".join(json.dumps(each, ensure_ascii=False) for each in accepted)
        return f"accepted at `{pointer}`: {listed}" + ("" if "one_of" in limit else ", or a place in degrees")
    return why


def _at(value: Any, pointer: str) -> tuple[bool, Any]:
    """What stands at a pointer; objects and arrays are told by their size alone."""
    for part in pointer.split("/")[1:]:
        key = part.replace("~1", "/").replace("~0", "~")
        try:
            value = value[int(key)] if isinstance(value, list) else value[key]
        except (KeyError, IndexError, ValueError, TypeError):
            return False, None
    if isinstance(value, dict | list):
        return True, f"{_NAMES[type(value)]} of {len(value)}"
    return True, value[:200] if isinstance(value, str) else value


def _fixed(found: Diagnostic, source: Source) -> Any:
    """The value that the first fix writes there, where it writes a whole one."""
    for fix in found.fixes:
        if fix.span.file == source.file:
            try:
                return json.loads(fix.replacement)
            except ValueError:
                return fix.replacement if source.text[fix.span.start - 1 : fix.span.start] == '"' else None
    return None


class _StepOrder:
    """Holds the steps of a specification against each other: in which phase each may stand, and that each begins where
    the one before it ended.
    """

    def __init__(self, frame: ProposalFrame, value: Any) -> None:
        self._frame = frame
        self._phases = value.get("phases") if isinstance(value, dict) else None

    def misfits(self) -> Iterator[SchemaMisfit]:
        """What does not fit beside the rest."""
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
                    yield from self._continued(before, step, here)
                before = (here, step)

    def _continued(self, before: tuple[str, Any], step: Mapping[str, Any], here: str) -> Iterator[SchemaMisfit]:
        """What the step before would have to say for this one to begin where that one ends."""
        at, earlier = before
        old, new = (each.get("arguments") if isinstance(each, dict) else None for each in (earlier, step))
        schema = self._frame.schema["$defs"].get(_skill(earlier))
        if not isinstance(old, dict) or not isinstance(new, dict) or schema is None:
            return
        for name, wanted in new.items():
            if name in old and old[name] != wanted and (_skill(step), name) in self._frame.ranges:
                yield SchemaMisfit(f"{at}/arguments/{name}", {"one_of": [wanted]}, wanted, here)
        entries = [f"{each}.entry" for each in new.values() if isinstance(each, str)]
        for name, each in schema["properties"]["arguments"]["properties"].items():
            fits = [entry for entry in entries if "pattern" in each and _fits(each, entry)]
            if fits and old.get(name) not in fits:
                yield SchemaMisfit(f"{at}/arguments/{name}", {"one_of": fits}, fits[0], here)


class _SchemaFit:
    """Holds a value against the narrowed schema: the keywords that it uses, and no others."""

    def __init__(self, frame: ProposalFrame) -> None:
        self._frame = frame
        self._defs: Mapping[str, Any] = frame.schema["$defs"]

    def misfits(self, schema: Mapping[str, Any], value: Any, at: str, of: tuple[str, str]) -> Iterator[SchemaMisfit]:
        """What of `value`, which stands `at` a pointer, does not fit; `of` names the skill and the argument."""
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
        """A step: the skill that it names says what else it has."""
        named = _skill(value)
        if named in self._defs:
            yield from self.misfits(self._defs[named], value, at, (named, ""))
            return
        near = nearest(named, self._defs)
        given = value.get("arguments") if isinstance(value, dict) else None
        yield SchemaMisfit(f"{at}/skill", {"one_of": list(self._defs)}, near or self._alike(given))

    def _alike(self, given: Any) -> str:
        """The skill whose arguments are most like those that are given."""
        named = frozenset(given) if isinstance(given, dict) else frozenset()

        def differs(skill: str) -> int:
            own = self._defs[skill]["properties"]["arguments"]
            return len(named - set(own["properties"])) * 2 + len(set(own["required"]) - named)

        return min(self._defs, key=differs)

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
        span = self._frame.ranges.get(of)
        if "const" in schema or "enum" in schema:
            return {"one_of": schema.get("enum", [schema.get("const")])}
        if span is not None:
            return {"least": written(span.low, span.dimension), "most": written(span.high, span.dimension)}
        places = _places(schema)
        own = {key: schema[key] for key in ("type", "pattern", "maxLength") if key in schema}
        return own | ({"places": places} if places else {})

    def _near(self, schema: Mapping[str, Any], value: Any, of: tuple[str, str]) -> tuple[Any, str]:
        """The value that fits and says what `value` says, as far as that can be told, and why another one is asked;
        None where nothing that fits is near to it, or nothing was said.
        """
        span = self._frame.ranges.get(of)
        if "const" in schema:
            return schema["const"], ""
        if "enum" in schema:
            only = schema["enum"][0] if len(schema["enum"]) == 1 else None
            return (nearest(value, schema["enum"]) if isinstance(value, str) else None) or only, ""
        if span is not None:
            return _clamped(value, span)
        kind = schema.get("type")
        if kind in ("object", "array"):
            inner = _unquoted(value) if isinstance(value, str) else None
            if _NAMES.get(type(inner)) == kind:
                return inner, f"write the {'list' if kind == 'array' else 'object'} itself, not a text that holds it,"
        if kind == "object":
            made = {name: self._near(schema["properties"][name], None, (of[0], name))[0] for name in schema["required"]}
            return None if any(each is None for each in made.values()) else made, ""
        return _name(schema, value) if kind == "string" else None, ""


def _skill(step: Any) -> str:
    """The skill that a step names; empty where it names none."""
    named = step.get("skill") if isinstance(step, dict) else None
    return named if isinstance(named, str) else ""


def _fits(schema: Mapping[str, Any], value: Any) -> bool:
    if "const" in schema:
        return bool(value == schema["const"])
    if "enum" in schema:
        return value in schema["enum"]
    if not isinstance(value, str):
        return True
    long = schema.get("maxLength", len(value)) < len(value)
    return not long and ("pattern" not in schema or re.fullmatch(schema["pattern"], value) is not None)


def _clamped(value: Any, span: PermittedRange) -> tuple[str | None, str]:
    """The quantity that a text or a number says, within the range, as the language writes it; and why that is asked."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return None, ""
    found, why = read_quantity(str(value), span.dimension)
    if found is None:
        return None, why
    near = min(max(round(found), span.low), span.high)
    if near != round(found) and why:
        why = f"the value is {decimal(found, span.dimension)}, out of range"
    return written(near, span.dimension), why


def _unquoted(text: str) -> Any:
    """What a text says as JSON; None where it is none."""
    try:
        return json.loads(text) if len(text) <= _MOST_JSON else None
    except (ValueError, RecursionError):
        return None


def _places(schema: Mapping[str, Any]) -> list[str]:
    """The places that a pattern has by their names."""
    return [each.replace("\\", "") for each in re.findall(r"\w+\\\.entry", schema.get("pattern", ""))]


def _name(schema: Mapping[str, Any], value: Any) -> str | None:
    """A text that fits a pattern of names, made of what was written; of places the one that was probably meant."""
    words: str = (value if isinstance(value, str) else "")[: schema.get("maxLength", 200)]
    places = _places(schema)
    if places:
        return nearest(words, places)
    for text in (words, _NO_NAME.sub("_", words), f"m_{_NO_NAME.sub('_', words)}", "a"):
        if _fits(schema, text):
            return text
    return None
