"""Workflow commands of GitHub, parsed by the rules of its runner."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.report.github import github
from rtshcua.diagnostics.span import Source, Span

FILES = {"a.rts": Source("a.rts", "one two\nthree\n")}


def read(line: str) -> tuple[str, dict[str, str], str]:
    """Command, properties and message of a line, by the rules of the runner (`ActionCommand.TryParseV2`)."""
    found = re.fullmatch(r"::(\w+) (.*?)::(.*)", line)
    assert found is not None, line
    properties = {}
    for part in found[2].split(","):
        name, value = part.split("=", 1)
        for escape, meant in (("%0D", "\r"), ("%0A", "\n"), ("%3A", ":"), ("%2C", ","), ("%25", "%")):
            value = value.replace(escape, meant)
        properties[name] = value
    message = found[3].replace("%0D", "\r").replace("%0A", "\n").replace("%25", "%")
    return found[1], properties, message


@pytest.mark.parametrize(
    ("code", "command"), [(codes.SYNTAX, "error"), (codes.NAMING, "warning"), (codes.UNDECIDED, "notice")]
)
def test_severities_map_to_commands(code: codes.Code, command: str) -> None:
    assert github([Diagnostic(code, "so", Span("a.rts", 4, 7))], FILES) == (
        f"::{command} file=a.rts,line=1,endLine=1,col=5,endColumn=8,title={code.id}::"
        f"a.rts:1:5: {code.id} {code.slug}: so\n"
    )


def test_help_labels_and_pointer_are_lines_of_the_message() -> None:
    label = Label(Span("a.rts", 8, 13), "declared here")
    found = Diagnostic(codes.SYNTAX, "so", Span("a.rts", 0, 3), "do that", (label,), pointer="/a")
    message = read(github([found], FILES).rstrip("\n"))[2]
    assert message.split("\n")[1:] == ["at: /a", "a.rts:2:1: declared here", "help: do that"]


def test_span_over_lines_has_no_columns() -> None:
    _, properties, _ = read(github([Diagnostic(codes.SYNTAX, "so", Span("a.rts", 4, 10))], FILES).rstrip("\n"))
    assert properties == {"file": "a.rts", "line": "1", "endLine": "2", "title": "E0101"}


def test_file_name_is_relative_to_the_repository_root() -> None:
    (named,) = github([Diagnostic(codes.SYNTAX, "so", Span("a.rts", 0, 1))], FILES, "/work/drones/").splitlines()
    assert read(named)[1]["file"] == "/work/drones/a.rts"
    (named,) = github([Diagnostic(codes.SYNTAX, "so", Span("/lib/a.rts", 0, 1))], FILES, "/work").splitlines()
    assert read(named)[1] == {"file": "/lib/a.rts", "title": "E0101"}


def test_finding_without_a_file_has_no_place() -> None:
    assert github([Diagnostic(codes.NO_SUCH_FILE, "`x: 5 %`, gone")], {}) == (
        "::error title=E0108::E0108 no-such-file: `x: 5 %25`, gone\n"
    )


texts = st.text(max_size=20) | st.text("%:,\r\n]=2503AaDd", max_size=12)


@given(texts, texts, texts.filter(bool), texts)
def test_hostile_text_is_one_command_and_reads_back(message: str, help: str, file: str, text: str) -> None:
    found = Diagnostic(codes.SYNTAX, message, Span(file, 0, 0), help, (Label(Span(file, 0, 0), text),))
    printed = github([found], {file: Source(file, text)})
    (line,) = re.split(r"[\r\n]", printed.removesuffix("\n"))
    command, properties, told = read(line)
    assert (command, properties["file"], properties["title"]) == ("error", visible(file), "E0101")
    assert all(part.isprintable() for part in told.split("\n"))
    assert len(told.split("\n")) == 3
