"""The extension for VS Code: its grammar has every keyword, its snippets parse, its files exist.

A small tokeniser replaces VS Code's; the real one (vscode-textmate) was tried manually, see editors/vscode.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import render
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.parse import parse
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[2]
EXTENSION = CHECKOUT / "editors" / "vscode"
FOLDERS = ("policies", "skills", "missions", "evaluation")
SOURCES = sorted(path for folder in FOLDERS for path in (CHECKOUT / folder).glob("*.rts"))
SAMPLE = CHECKOUT / "tests" / "unit" / "ground" / "report" / "everything.rts"


def read(name: str) -> Any:
    return json.loads((EXTENSION / name).read_text(encoding="utf-8"))


GRAMMAR = read("syntaxes/rtshcua.tmLanguage.json")
PACKAGE = read("package.json")


def rules(name: str = "$self") -> Iterator[dict[str, Any]]:
    """Yield the rules of a pattern list, in order, with included ones."""
    listed = GRAMMAR["patterns"] if name == "$self" else GRAMMAR["repository"][name]["patterns"]
    for rule in listed:
        if "include" in rule:
            yield from rules(rule["include"].removeprefix("#"))
        else:
            yield rule


def tokens(text: str) -> Iterator[tuple[str, str]]:
    """Yield each part of a text with its innermost scope, empty for none."""
    inside: dict[str, Any] | None = None
    known = [(rule, re.compile(rule.get("match") or rule["begin"])) for rule in rules()]
    for line in text.split("\n"):
        at = 0
        while at < len(line):
            if inside is not None:
                end = re.compile(inside["end"]).search(line, at)
                stop = len(line) if end is None else end.start()
                nested = [each.search(line, at) for each in map(re.compile, matches(inside))]
                first = min((each for each in nested if each), key=lambda each: each.start(), default=None)
                if first is not None and first.start() < stop:
                    yield line[at : first.end()], inside["name"]
                    at = first.end()
                    continue
                stop = len(line) if end is None else end.end()
                yield line[at:stop], inside["name"]
                at, inside = stop, inside if end is None else None
                continue
            found = [(match.start(), order, rule, match) for order, (rule, pattern) in enumerate(known)
                     if (match := pattern.search(line, at)) is not None and match.end() > match.start()]  # fmt: skip
            if not found:
                yield line[at:], ""
                break
            start, _, rule, match = min(found, key=lambda each: each[:2])
            yield line[at:start], ""
            if "begin" in rule:
                inside = rule
                yield match[0], rule["name"]
            else:
                yield from captured(rule, match)
            at = match.end()
        if inside is not None and re.compile(inside["end"]).search(line, len(line)):
            inside = None


def matches(rule: dict[str, Any]) -> list[str]:
    """Return the patterns inside a begin/end rule."""
    return [each["match"] for each in rule.get("patterns", ())]


def captured(rule: dict[str, Any], match: re.Match[str]) -> Iterator[tuple[str, str]]:
    if "captures" not in rule:
        yield match[0], rule["name"]
        return
    at = match.start()
    for number, capture in sorted(rule["captures"].items()):
        if match.start(int(number)) >= at:
            yield match.string[at : match.start(int(number))], rule.get("name", "")
            yield match[int(number)], capture["name"]
            at = match.end(int(number))
    yield match.string[at : match.end()], rule.get("name", "")


def test_grammar_has_exactly_the_keywords() -> None:
    text = (CHECKOUT / "grammar" / "rtshcua.lark").read_text(encoding="utf-8")
    quoted = set(re.findall(r'^[A-Z_.0-9]+: "([a-z_]+)"', text, re.MULTILINE))
    # keywords that need a regular expression: only before a bracket, or in a phrase
    special = re.findall(r"^_?(?!NAME|UNIT|REASON|LINK_NAME|STRING)[A-Z_]+(?:\.\d)?: /(.*?)/", text, re.MULTILINE)
    phrased = {word for pattern in special for word in re.findall(r"(?<![\\[a-z])[a-z]{2,}(?![a-z-]*\])", pattern)}
    words = {word for rule in rules("words") for word in re.findall(r"[a-z]+", rule["match"].replace(r"\b", ""))}
    assert len(quoted) > 100
    assert words == quoted
    known = {word for rule in rules("phrases") for word in re.findall(r"[a-z]{2,}", rule["match"].replace(r"\b", ""))}
    assert phrased - known - quoted == set()
    assert {word for word in known - phrased if word != "phase"} == set()
    assert {"local", "inadmissible", "grow", "circle", "difference", "abs", "repeat", "rising"} <= phrased


@rows("path", [*SOURCES, SAMPLE], ids=lambda path: path.stem)
def test_every_token_has_a_scope(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    found = list(tokens(text))
    assert "".join(part for part, _ in found) == text.replace("\n", "")
    assert not [part for part, scope in found if part.strip() and not scope]


@rows(
    ("text", "part", "scope"),
    [
        ("policy p version 7 {", "p", "entity.name.type"),
        ("policy p version 7 {", "version", "keyword.other"),
        ("permit goto by any", "permit", "keyword.control.rule"),
        ("hover(10 s)", "hover", "entity.name.function"),
        ("zone a = circle(47.3 N, 8.5 E, 60 m)", "circle", "support.function.shape"),
        ("zone a = circle(47.3 N, 8.5 E, 60 m)", "47.3", "constant.numeric.coordinate"),
        ("require battery > 35 %", "%", "keyword.other.unit"),
        ("require battery > 35 %", "battery", "variable.other"),
        ("altitude: altitude in 5 m .. 60 m", "altitude", "variable.parameter"),
        ("signal x : ratio = BATTERY_STATUS.battery_remaining", "ratio", "support.type"),
        ("signal x : ratio = BATTERY_STATUS.battery_remaining", "BATTERY_STATUS.battery_remaining", "support.constant"),
        ("local time in 22:00 .. 06:00", "22:00", "constant.numeric.time"),
        ("phase inspection {", "inspection", "entity.name.section"),
        ("phase in {departure}", "in", "keyword.operator.word"),
        ("phase in {departure}", "phase", "variable.language"),
        ("position inside city", "position", "variable.other"),
        ("position error 3 m", "position", "keyword.other"),
        ("3 m + speed * 2 s", "speed", "variable.other"),
        ("airspace inside city", "airspace", "keyword.control.rule"),
        ("issued in 5 s", "issued", "keyword.control.test"),
        ("expect deny because state/violated", "state/violated", "constant.other.reason"),
        ('intent "a // b"', 'a // b"', "string.quoted.double"),
        ('// a "b', ' a "b', "comment.line"),
        ("/* a\n * b */ permit", " * b */", "comment.block"),
        ("/* a\n * b */ permit", "permit", "keyword.control.rule"),
        ("speed / 2 // half", "/", "keyword.operator.arithmetic"),
    ],
)
def test_tokens_have_their_scopes(text: str, part: str, scope: str) -> None:
    assert any(each == part and found.startswith(scope) for each, found in tokens(text)), list(tokens(text))


def test_every_pattern_has_a_scope_of_this_language() -> None:
    for rule in rules():
        names = [rule.get("name"), *(each["name"] for each in rule.get("captures", {}).values())]
        assert any(names)
        assert all(name.endswith(".rtshcua") for name in names if name)


def expanded(body: str) -> str:
    """Return a snippet with every placeholder filled by its default, or its first choice."""
    body = re.sub(r"\$\{\d+\|([^,|]*)[^|]*\|\}", r"\1", body)
    while True:
        found = re.sub(r"\$\{\d+:([^${}]*)\}", r"\1", body)
        if found == body:
            return re.sub(r"\$\d+", "", body)
        body = found


SNIPPETS = read("snippets/rtshcua.json")


@rows("name", SNIPPETS)
def test_snippets_parse(name: str) -> None:
    body = SNIPPETS[name]["body"]
    text = expanded("\n".join(body) if isinstance(body, list) else body)
    if re.match(r"permit|forbid|confirm|degrade|delegate|use", text):
        text = f"policy p version 1 {{\n{text}\n}}"
    parsed = parse(Source("snippet.rts", text))
    assert parsed.diagnostics == (), text


def test_every_declaration_has_a_snippet() -> None:
    text = (CHECKOUT / "grammar" / "rtshcua.lark").read_text(encoding="utf-8")
    declared = re.search(r"^\?declaration: (.*?)\n\n", text, re.MULTILINE | re.DOTALL)
    assert declared is not None
    names = {name.strip().removesuffix("_file") for name in declared[1].split("|")}
    prefixes = [SNIPPETS[name]["prefix"] for name in SNIPPETS]
    first = {each.split()[0] for some in prefixes for each in ([some] if isinstance(some, str) else some)}
    assert names <= first


def test_extension_files_exist_and_are_pinned() -> None:
    contributed = PACKAGE["contributes"]
    parts = [PACKAGE["main"], contributed["languages"][0]["configuration"], contributed["grammars"][0]["path"]]
    for part in (*parts, contributed["snippets"][0]["path"], "README.md"):
        assert (EXTENSION / part).is_file()
    read("language-configuration.json")
    pins = {**PACKAGE["dependencies"], **PACKAGE["devDependencies"]}
    assert all(re.fullmatch(r"\d+\.\d+\.\d+", version) for version in pins.values())
    assert not list(EXTENSION.glob("*lock*"))
    assert GRAMMAR["scopeName"] == contributed["grammars"][0]["scopeName"]


def test_untrusted_workspace_runs_nothing() -> None:
    trust = PACKAGE["capabilities"]["untrustedWorkspaces"]
    settings = PACKAGE["contributes"]["configuration"]["properties"]
    assert trust["supported"] == "limited"
    assert set(trust["restrictedConfigurations"]) == {"rtshcua.path", "rtshcua.arguments"} <= set(settings)
    script = (EXTENSION / "extension.js").read_text(encoding="utf-8")
    assert "workspace.isTrusted" in script


def test_problem_matcher_reads_lint_output() -> None:
    source = Source("policies/a b.rts", "\nzone x = circle(1 N, 2 E, 3 m)\n")
    for code in (codes.SYNTAX, codes.UNUSED):
        found = Diagnostic(code, "the message", Span(source.file, 6, 7), "help")
        first, second, *_ = render([found], {source.file: source}).splitlines()
        head, place = (each["regexp"] for each in PACKAGE["contributes"]["problemPatterns"][0]["patterns"])
        assert re.search(head, first).groups() == (code.severity.value, code.id, "the message")  # type: ignore[union-attr]
        assert re.search(place, second).groups() == (source.file, "2", "6")  # type: ignore[union-attr]
