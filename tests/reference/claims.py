"""The theorems and assumptions of the paper, and the tests that attack them: what docs/theorems.md is made from.

The module of a claim in tests/theorems states it in its docstring, in paragraphs. A test that attacks a claim over
random histories has the marker `claim("T1")`, in any folder. It is a property test, or says how its histories are
`drawn`. A test that shows that such a test finds something `broken` says what. Markers are read from the
source, not from a run.
"""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from textwrap import wrap
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[2]
#: the claims in the order of the page, and the modules that state them
CLAIMS: Final = {
    "T1": "test_theorem_1_admission.py", "C1": "test_corollary_1_agent.py", "T2": "test_theorem_2_fallback.py",
    "T3": "test_theorem_3_evidence.py", "A1": "test_assumption_1_mediation.py",
    "A2": "test_assumption_2_enforcement.py", "A3": "test_assumption_3_bounded.py", "A4": "test_assumption_4_path.py",
}  # fmt: skip
#: the paragraphs of a statement, by how they begin in the docstring
PARTS: Final = ("Statement.", "Attacker:", "Enforced by:", "Not covered:")
#: the markers of tests that `make test` does not run, and what does
RUNS: Final = {"soak": "make soak", "clients": "make clients", "slow": "make slow"}
USUAL: Final = "make test"
PAGE: Final = "docs/theorems.md"
WHAT: Final = (
    "The theorems of the paper and the assumptions that they need, as built here: the statement, what enforces it, the "
    "tests that attack it over random histories, and what they do not cover. The paper proves the theorems from the "
    "assumptions; here each is tested, and nothing on this page is a proof of the code."
)
RULE: Final = (
    "This page is made from the tests by `.make/theorems`. A claim without a test in `make test`, without a soak test, "
    "or without a test which shows that something broken is found, fails the build "
    "(`tests/architecture/test_theorems.py`). The symbols: [paper-map.md](paper-map.md)."
)


class Marked(NamedTuple):
    """A marked test: its file below the checkout, what runs it, and how it draws histories, or what it shows."""

    claim: str
    file: str
    test: str
    runs: str
    drawn: str
    broken: str


def marked(text: str, file: str) -> Iterator[Marked]:
    """The marked tests of a module. Raises ValueError for a marker that is written in another way."""
    module = ast.parse(text)
    shared = [_marks(each.value) for each in module.body if isinstance(each, ast.Assign) and _is_pytestmark(each)]
    everywhere = [mark for marks in shared for mark in marks]
    for function in ast.walk(module):
        if isinstance(function, ast.FunctionDef) and function.name.startswith("test_"):
            marks = [*everywhere, *(mark for each in function.decorator_list for mark in _marks(each))]
            names = {ast.unparse(getattr(each, "func", each)).removeprefix("pytest.mark.") for each in marks}
            runs = next((how for name, how in RUNS.items() if name in names), USUAL)
            properties = {ast.unparse(each.func) for each in function.decorator_list if isinstance(each, ast.Call)}
            for mark in marks:
                if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.claim":
                    given = "property test" if "given" in properties else ""
                    said = _said(mark, file, function.name)
                    drawn, broken = said.get("drawn", given), said.get("broken", "")
                    yield Marked(said["name"], file, function.name, runs, drawn, broken)


def _is_pytestmark(node: ast.Assign) -> bool:
    return any(isinstance(each, ast.Name) and each.id == "pytestmark" for each in node.targets)


def _marks(node: ast.expr) -> list[ast.expr]:
    return list(node.elts) if isinstance(node, ast.List | ast.Tuple) else [node]


def _said(mark: ast.Call, file: str, test: str) -> dict[str, str]:
    """The arguments of a marker."""
    said = {"name": mark.args[0] if len(mark.args) == 1 else None} | {
        each.arg or "": each.value for each in mark.keywords
    }
    texts = {name: value.value for name, value in said.items() if isinstance(value, ast.Constant)}
    if texts.keys() != said.keys() or not texts.keys() <= {"name", "drawn", "broken"}:
        raise ValueError(f'{file}, {test}: write claim("T1"), claim("T1", drawn="..") or claim("T1", broken="..")')
    return {name: str(value) for name, value in texts.items()}


def collected(root: Path = ROOT) -> list[Marked]:
    """All marked tests of a checkout, by file."""
    found: list[Marked] = []
    for path in sorted((root / "tests").rglob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        if "mark.claim(" in text:
            found += marked(text, str(path.relative_to(root)))
    return found


def statement(docstring: str) -> Mapping[str, str]:
    """The paragraphs of a statement, and its `title`. A part that is not there is empty."""
    paragraphs = [" ".join(each.split()) for each in docstring.split("\n\n")]
    said = {"title": paragraphs[0].partition(": ")[2].rstrip(".")}
    for part in PARTS:
        said[part] = " ".join(each.removeprefix(part).strip() for each in paragraphs if each.startswith(part))
    return said


def stated(root: Path = ROOT) -> dict[str, Mapping[str, str]]:
    """The statement of each claim, from the docstring of its module; empty without a module."""
    made = {}
    for name, file in CLAIMS.items():
        path = root / "tests" / "theorems" / file
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) if path.exists() else ""
        made[name] = statement(text or "")
    return made


def problems(tests: Iterable[Marked], statements: Mapping[str, Mapping[str, str]]) -> list[str]:
    """What is missing: a statement, a part of it, or a test; and markers that name no claim."""
    tests = list(tests)
    wrong = [f"{each.file}, {each.test}: there is no claim {each.claim}" for each in tests if each.claim not in CLAIMS]
    wrong += [
        f"{each.file}, {each.test}: it is no property test; say how its histories are drawn, or what is broken"
        for each in tests
        if not each.drawn and not each.broken
    ]
    for name in CLAIMS:
        attacks = [each for each in tests if each.claim == name and not each.broken]
        wrong += [] if any(each.runs == USUAL for each in attacks) else [f"{name}: no test of `{USUAL}` attacks it"]
        wrong += [] if any(each.runs == "make soak" for each in attacks) else [f"{name}: no soak test attacks it"]
        shows = any(each.claim == name and each.broken for each in tests)
        wrong += [] if shows else [f"{name}: no test shows that something broken is found"]
        said = statements.get(name, {})
        wrong += [f"{name}: its module does not say `{part}`" for part in PARTS if not said.get(part)]
    return wrong


def named_files(statements: Mapping[str, Mapping[str, str]]) -> set[str]:
    """The files and folders that the statements name."""
    texts = (text for said in statements.values() for text in said.values())
    return {path for text in texts for path in re.findall(r"`((?:rtshcua|boundary|tests|docs)/[\w./]+)`", text)}


def page(tests: Iterable[Marked], statements: Mapping[str, Mapping[str, str]]) -> str:
    """docs/theorems.md."""
    tests = list(tests)
    lines = ["# Theorems and assumptions", "", *wrap(WHAT, 120), "", *wrap(RULE, 120)]
    lines += ["", "| claim | | attacked by | finds |", "|---|---|---|---|"]
    for name in CLAIMS:
        attacks = [each for each in tests if each.claim == name and not each.broken]
        shows = sum(each.claim == name and bool(each.broken) for each in tests)
        modules = len({each.file for each in attacks})
        number = f"{len(attacks)} tests in {modules} module{'s' if modules > 1 else ''}"
        title = statements[name]["title"].partition(". ")[0]
        lines.append(f"| [{name}](#{name.lower()}) | {title} | {number} | {shows} broken systems |")
    for name in CLAIMS:
        said = statements[name]
        lines += ["", f"## {name}", "", f"**{said['title'][:1].upper()}{said['title'][1:]}.**"]
        for part in PARTS:
            head = "" if part == "Statement." else f"*{part.rstrip(':')}.* "
            lines += [
                "",
                *wrap(
                    head + said[part][:1].upper() + said[part][1:], 120, break_long_words=False, break_on_hyphens=False
                ),
            ]
        lines += ["", "| attacked by | test | drawn | run by |", "|---|---|---|---|"]
        lines += [
            f"| `{each.file}` | `{each.test}` | {each.drawn} | `{each.runs}` |"
            for each in tests
            if each.claim == name and not each.broken
        ]
        shown = [each for each in tests if each.claim == name and each.broken]
        lines += ["", "These tests find:", "", *(f"- {each.broken} (`{each.test}`)" for each in shown)]
    return "\n".join(lines) + "\n"
