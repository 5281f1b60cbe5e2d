"""Each `*.rts` here has syntax errors; the `*.txt` beside it has their messages, spans, helps and fixes.

`UPDATE_GOLDENS=1 pytest tests/golden/syntax` writes them anew; read the difference before you keep it.
"""

import os
from pathlib import Path

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.parse import parse
from virtual.rows import rows

CASES = sorted(Path(__file__).parent.glob("*.rts"))


def underlined(source: Source, span: Span) -> str:
    line, column = source.position(span.start)
    return f"{line}:{column} `{source.slice(span)}`"


def rendering(source: Source, found: Diagnostic) -> str:
    assert found.span is not None
    lines = [f"{found.code.id} {found.span.start}-{found.span.end} {underlined(source, found.span)}"]
    lines += [f"  {found.message}", f"  help: {found.help}"]
    lines += [f"  label: {underlined(source, label.span)} {label.text}" for label in found.labels]
    lines += [f"  fix: {underlined(source, fix.span)} -> `{fix.replacement}` ({fix.title})" for fix in found.fixes]
    return "\n".join(lines)


@rows("path", CASES, ids=lambda path: path.stem)
def test_findings_match_the_golden(path: Path) -> None:
    source = Source(path.name, path.read_bytes().decode())
    found = "\n\n".join(rendering(source, each) for each in parse(source).diagnostics) + "\n"
    golden = path.with_suffix(".txt")
    if os.environ.get("UPDATE_GOLDENS"):
        golden.write_text(found, encoding="utf-8")
    assert found == golden.read_text(encoding="utf-8")


@rows("path", CASES, ids=lambda path: path.stem)
def test_messages_follow_the_style(path: Path) -> None:
    for found in parse(Source(path.name, path.read_bytes().decode())).diagnostics:
        assert found.message[0] == "`" or found.message[0].islower()
        assert not found.message.endswith(".")
        assert found.message.count("`") % 2 == 0
        assert "<" not in found.message.replace("`<`", "").replace("`<=`", ""), "a kind of token is not a person's word"
