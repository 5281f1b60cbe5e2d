"""Descriptions of conditions are unambiguous: an independent reader parses them back."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from html import unescape
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.ground.report.chapter import chapter
from rtshcua.ground.report.html_page import page
from rtshcua.ground.report.permissions import rule_names
from rtshcua.ground.report.policy_report import ReportPart
from rtshcua.ground.report.prose.condition_phrases import describe_clauses, describe_condition
from rtshcua.ground.report.prose.phrases import Vocabulary
from rtshcua.ground.report.prose.rules_and_skills import describe_delegation, describe_rule
from rtshcua.ground.report.prose.zones_and_vehicle import describe_shape
from rtshcua.ground.report.report_model import PolicyReport
from rtshcua.ground.report.reported_policy import ReportedPolicy
from rtshcua.model.ir.expression import Condition, ForLast, Junction, Not
from rtshcua.model.ir.places import Combination, Shape
from rtshcua.model.ir.policies import PolicyDecl, RuleDecl
from rtshcua.model.ir.program import Unit

NAMES = Vocabulary(
    frozenset({"battery", "wind.speed", "gps.fix", "height", "landed"}),
    frozenset({"yard", "pond"}),
    frozenset({"target", "altitude"}),
    frozenset({"target"}),
)
ATOMS = [
    "battery > 35 %", "battery < 20 %", "gps.fix in {fix_3d, dgps, rtk_fixed}", "landed == in_air", "landed != in_air",
    "local time in 22:00 .. 06:00", "local time in 08:00 .. 18:00", "local time on monday, friday .. sunday",
    "local time in 22:00 .. 06:00 on friday", "local time in 08:00 .. 18:00 on monday .. friday",
    "max(wind.speed, 3 m/s) <= 8 m/s",
    "wind.speed in 0 m/s .. 8 m/s", "min(wind.speed, 3 m/s) + 1 m/s < 5 m/s", "target inside yard",
    "target outside grow(pond, 20 m)", "position inside pond", "altitude <= 30 m",
    "battery < 30 % within 5 s of wind.speed > 9 m/s",
]  # fmt: skip
#: a parsed description: the text of an atom, or a node with operands
Tree = Any

texts = st.recursive(
    st.sampled_from(ATOMS).map(lambda text: f"({text})"),
    lambda inner: st.one_of(
        st.tuples(inner, st.lists(inner, min_size=1, max_size=2), st.sampled_from(["and", "or"])).map(
            lambda one: f"({f' {one[2]} '.join([one[0], *one[1]])})"
        ),
        inner.map(lambda text: f"(not {text})"),
        inner.map(lambda text: f"({text} for the last 3 s)"),
    ),
    max_leaves=7,
)


def unit(text: str) -> Unit:
    parsed = parse(Source("x.rts", text))
    assert parsed.diagnostics == ()
    return parsed.unit


def policy(*rules: str) -> PolicyDecl:
    return unit("policy p version 1 {\n" + "\n".join(rules) + "\n}").policies[0]


def condition(text: str) -> Condition:
    when = policy(f"permit goto by role operator when {text}").rules[0].when
    assert when is not None
    return when


def flat(tree: Tree) -> Tree:
    """The tree with `a and (b and c)` as `a and b and c`, which is equivalent."""
    if isinstance(tree, str):
        return tree
    kind, *parts = tree[0], *map(flat, tree[1:])
    if kind in ("and", "or"):
        parts = [one for part in parts for one in (part[1:] if part[0] == kind else [part])]
    return (kind, *parts)


def tree_of(one: Condition, names: Vocabulary) -> Tree:
    """The tree of a condition, with the texts of its atoms."""
    if isinstance(one, Junction):
        return flat((one.operator, *(tree_of(each, names) for each in one.operands)))
    if isinstance(one, Not):
        return ("not", tree_of(one.operand, names))
    if isinstance(one, ForLast):
        return ("for", tree_of(one.operand, names))
    return ("atom", describe_condition(one, names))


def split(words: str, between: str) -> list[str]:
    """The parts of a text, split at separators outside brackets and names."""
    parts, depth, start, at = [], 0, 0, 0
    while at < len(words):
        if words[at] == "`":
            at = words.index("`", at + 1)
        depth += (words[at] == "(") - (words[at] == ")")
        assert depth >= 0
        if depth == 0 and (found := re.compile(between).match(words, at)) is not None:
            parts.append(words[start:at])
            start = at = found.end()
            continue
        at += 1
    assert depth == 0
    return [*parts, words[start:]]


def closed(words: str) -> bool:
    """Whether one pair of brackets encloses the whole text."""
    depth = 0
    for at, letter in enumerate(words):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return letter == ")" and at == len(words) - 1
    return False


def read(words: str, atoms: frozenset[str]) -> Tree:
    """Parse a description. Fails if `and` and `or` are mixed at one level."""
    if words in atoms:
        return ("atom", words)
    if closed(words):
        return read(words[1:-1], atoms)
    if words.startswith("it is not so that "):
        rest = words.removeprefix("it is not so that ")
        assert rest in atoms or len(split(rest, ", | and | or ")) == 1
        return ("not", read(rest, atoms))
    if words.endswith(", all through the last 3 s"):
        rest = words.removesuffix(", all through the last 3 s")
        assert rest in atoms or len(split(rest, ", | and | or ")) == 1
        return ("for", read(rest, atoms))
    kinds = [kind for kind in ("and", "or") if len(split(words, f" {kind} ")) > 1]
    assert len(kinds) == 1, words
    before, last = split(words, f" {kinds[0]} ")
    return flat((kinds[0], *(read(part, atoms) for part in (*split(before, ", "), last))))


@cache
def atoms_of(names: Vocabulary) -> frozenset[str]:
    return frozenset(describe_condition(condition(text), names) for text in ATOMS)


@settings(max_examples=settings().max_examples * 2)
@given(text=texts)
def test_description_of_a_condition_parses_back(text: str) -> None:
    one = condition(text)
    assert read(describe_condition(one, NAMES), atoms_of(NAMES)) == tree_of(one, NAMES)
    clauses = [read(each, atoms_of(NAMES)) for each in describe_clauses(one, NAMES)]
    assert (clauses[0] if len(clauses) == 1 else flat(("and", *clauses))) == tree_of(one, NAMES)


@given(first=texts, second=texts)
def test_rules_and_delegations_with_other_conditions_read_differently(first: str, second: str) -> None:
    one, other = (tree_of(condition(text), NAMES) for text in (first, second))
    kinds = (
        "permit goto by role operator when {}",
        "forbid goto by any when {}",
        "confirm goto when {} by role chief within 30 s",
        "degrade any when {} to hover",
    )
    told = [
        [describe_rule(rule, NAMES) for rule in policy(*(kind.format(text) for kind in kinds)).rules]
        for text in (first, second)
    ]
    delegated = [
        describe_delegation(policy(f"delegate goto by role a to role b when {text}").delegations[0], NAMES)
        for text in (first, second)
    ]
    for a, b in (*zip(*told, strict=True), delegated):
        assert (a == b) == (one == other)


SHAPES = ["circle(47.3 N, 8.5 E, 20 m)", "circle(47.4 N, 8.5 E, 20 m)", "yard", "pond"]
shapes = st.recursive(
    st.sampled_from(SHAPES),
    lambda inner: st.tuples(st.sampled_from(["union", "difference"]), st.lists(inner, min_size=2, max_size=3)).map(
        lambda one: f"{one[0]}({', '.join(one[1])})"
    ),
    max_leaves=6,
)


def read_shape(words: str) -> Tree:
    if closed(words):
        words = words[1:-1]
    if words.startswith("what lies in any of these: "):
        return ("union", *map(read_shape, split(words.removeprefix("what lies in any of these: "), "; ")))
    if words.startswith("what lies in "):
        return ("difference", *map(read_shape, split(words.removeprefix("what lies in "), ", but not in | nor in ")))
    assert ";" not in words
    assert "what" not in words
    return words


def shape_tree(shape: Shape) -> Tree:
    if isinstance(shape, Combination):
        return (shape.operator, *map(shape_tree, shape.shapes))
    return describe_shape(shape)


@given(text=shapes.filter(lambda text: "(" in text))
def test_description_of_a_shape_parses_back(text: str) -> None:
    shape = unit(f"zone z = {text}").zones[0].shape
    assert read_shape(describe_shape(shape)) == shape_tree(shape)


def conditions(count: int) -> Iterator[str]:
    """Different conditions of two or three operands, deep enough to need brackets."""
    chance = Random(1)
    for _ in range(count):
        a, b, c = chance.sample(ATOMS, 3)
        inner = f"({a} {chance.choice(['and', 'or'])} {b})"
        yield f"{chance.choice(['', 'not '])}{inner} {chance.choice(['and', 'or'])} {c}"


def text_of(html: str) -> str:
    """The text of a fragment, with a list of conditions as a conjunction."""
    html = re.sub(r"</?code>", "`", html)
    found = re.search(r'all of these at once:(?:</span>|</p>)<ul class="all">(.*?)</ul>', html, re.DOTALL)
    if found is not None:
        items = " and ".join(f"({text_of(each)})" for each in re.findall(r"<li>(.*?)</li>", found[1], re.DOTALL))
        html = html[: found.start()] + items + html[found.end() :]
    words = unescape(re.sub(r"<[^>]*>", "", html)).replace("\u00a0", " ")
    return " ".join(re.sub(r" \(rule \d+\)", "", words).removeprefix("or: ").removeprefix("and besides: ").split())


def listed(words: str, names: Vocabulary) -> Tree:
    """A text whose outermost conjunction may have more than two operands."""
    parts = split(words, r"(?<=\)) and (?=\()")
    atoms = atoms_of(names)
    return flat(("and", *(read(part, atoms) for part in parts))) if len(parts) > 1 else read(words, atoms)


@pytest.mark.slow
def test_different_conditions_read_differently_everywhere_on_the_page(
    everything: PolicyReport, part: Callable[[Path], ReportPart]
) -> None:
    lowered = part(Path(__file__).with_name("everything.rts")).policies[0]
    program = part(Path(__file__).with_name("everything.rts")).program
    wanted = list(conditions(40))
    kinds = ["permit goto by role operator when {}", "forbid goto by role operator when {}"]
    kinds += ["confirm goto when {} by role chief within 30 s", "degrade goto when {} to hover"]
    rules: tuple[RuleDecl, ...] = policy(*(kind.format(text) for kind in kinds for text in wanted)).rules
    base = structs.replace(lowered.policy.rules[0], skills=(lowered.skills["goto"],))
    signed = structs.replace(lowered.policy, rules=(base,) * len(rules))
    subject = ReportedPolicy(program, replace(lowered, policy=signed, rules=rules))
    names = rule_names(subject, rules[0])
    trees = [tree_of(condition(text), names) for text in wanted]
    made = chapter(subject)
    clauses = [describe_clauses(condition(text), names) for text in wanted]
    skills = tuple(replace(made.skills[0], require=each) for each in clauses)
    html = page(replace(everything, chapters=(made,)))

    told = [text_of(each) for each in re.findall(r'<tr id="p1-rule-\d+">.*?</td><td>(.*?)<pre>', html, re.DOTALL)]
    told += [text_of(each) for each in re.findall(r"<li>(.*?)</li>", html[html.index('chain replaced"') :])][:40]
    assert [read(each.split(", if ")[1].rstrip("."), atoms_of(names)) for each in told] == trees * 5

    own = html[html.index("The role <code>operator</code>") :].split("<h4>")[0]
    group = next(each for each in own.split("<tbody>") if re.search(r"<code>goto</code></a></th>", each))
    for label, before in (("Only if", ""), ("Never if", ""), ("A person must approve", ", if ")):
        cells = re.findall(rf'data-label="{label}"[^>]*>(.*?)</td>', group, re.DOTALL)
        ones = [
            text_of(each) for cell in cells for each in re.findall(r'<div class="one">(.*?)</div>', cell, re.DOTALL)
        ]
        assert [listed(each.split(before)[-1] if before else each, names) for each in ones] == trees, label
    html = page(replace(everything, chapters=(replace(made, skills=skills, rights=()),)))
    begins = re.findall(r'<p class="must">Before it begins[,:](.*?</p><ul class="all">.*?</ul>)', html, re.DOTALL)
    assert [listed(text_of(each), names) for each in begins] == trees
