"""SARIF: valid by the published schema for any findings, with places, fixes and reasons."""

import json
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote, urlsplit

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix, Label
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.report.sarif import FINGERPRINT, Ignored, sarif
from rtshcua.diagnostics.span import Source, Span

TEXT = "policy a version 1 {\n  permit goto by any\n  permit goto by any\n}\n"
NAME = "flights/côté 1%.rts"
FILES = {NAME: Source(NAME, TEXT), "/opt/lib/hover.rts": Source("/opt/lib/hover.rts", "skill hover\n")}
FIRST, SECOND = (Span(NAME, at, at + 6) for at in (23, 44))
BROAD = Diagnostic(
    codes.BROAD_AUTHORITY,
    "`any` permits {everyone}, see [here](1)",
    FIRST,
    help="name a role",
    labels=(Label(Span("/opt/lib/hover.rts", 6, 11), "declared here"),),
    fixes=(Fix(Span(NAME, 38, 41), "role operator", "name the role", Applicability.SAFE),),
)


@cache
def validator() -> Any:
    schema = json.loads((Path(__file__).parents[3] / "vectors/sarif/sarif-schema-2.1.0.json").read_text("utf-8"))
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)


def run(*found: Diagnostic, files: dict[str, Source] = FILES, **more: Any) -> dict[str, Any]:
    """The one run of a log, which is valid, also when it has been through JSON."""
    log = sarif(found, files, **({"version": "1.2.3", "code": ExitCode.DIAGNOSTICS} | more))
    errors = list(validator().iter_errors(json.loads(json.dumps(log))))
    assert errors == []
    assert log["version"] == "2.1.0"
    (one,) = log["runs"]
    return one


def test_schema_refuses_invalid_sarif() -> None:
    log = sarif((BROAD,), FILES, version="1", code=ExitCode.OK)
    log["runs"][0]["results"][0]["level"] = "fatal"
    assert not validator().is_valid(log)


def test_finding_has_rule_level_message_and_place() -> None:
    one = run(BROAD)
    (rule,), (result,) = one["tool"]["driver"]["rules"], one["results"]
    assert (rule["id"], rule["name"]) == ("E1303", "BroadAuthority")
    assert rule["shortDescription"]["text"] == "A rule permits unusually much."
    assert rule["defaultConfiguration"] == {"level": "warning"}
    assert (result["ruleId"], result["ruleIndex"], result["level"]) == ("E1303", 0, "warning")
    assert result["message"]["text"] == "`any` permits {{everyone}}, see [here] (1)\nhelp: name a role"
    (place,) = result["locations"]
    assert place["physicalLocation"] == {
        "artifactLocation": {"uri": "flights/c%C3%B4t%C3%A9%201%25.rts", "uriBaseId": "SRCROOT"},
        "region": {"startLine": 2, "startColumn": 3, "endLine": 2, "endColumn": 9, "charOffset": 23, "charLength": 6},
    }
    assert one["columnKind"] == "unicodeCodePoints"


def test_labels_become_related_locations_and_fixes_changes() -> None:
    (result,) = run(BROAD)["results"]
    (related,) = result["relatedLocations"]
    assert related["message"] == {"text": "declared here"}
    assert related["physicalLocation"]["artifactLocation"] == {"uri": "file:///opt/lib/hover.rts"}
    (fix,) = result["fixes"]
    assert fix["properties"] == {"applicability": "safe"}
    (change,) = fix["artifactChanges"]
    (replacement,) = change["replacements"]
    region = replacement["deletedRegion"]
    end = region["charOffset"] + region["charLength"]
    mended = TEXT[: region["charOffset"]] + replacement["insertedContent"]["text"] + TEXT[end:]
    assert mended == TEXT.replace("any", "role operator", 1)


def test_code_page_is_the_help_of_the_rule() -> None:
    page = SimpleNamespace(text="# E1303\n\n## What it means\n\n`{` stays.\n", what="`{` stays.")
    (rule,) = run(BROAD, pages={"E1303": page})["tool"]["driver"]["rules"]
    assert rule["help"] == {"text": page.text, "markdown": page.text}
    assert rule["fullDescription"] == {"text": "`{` stays."}


def test_rules_are_listed_once() -> None:
    other = Diagnostic(codes.NAMING, "a name", SECOND)
    one = run(BROAD, other, BROAD)
    assert [rule["id"] for rule in one["tool"]["driver"]["rules"]] == ["E1303", "E1302"]
    assert [result["ruleIndex"] for result in one["results"]] == [0, 1, 0]


def test_ignored_finding_is_suppressed_with_its_reason() -> None:
    written = Ignored(Diagnostic(codes.NAMING, "a name", SECOND), "the register says so", Span(NAME, 0, 3))
    configured = Ignored(Diagnostic(codes.UNUSED, "unused", SECOND), "kept for later")
    told, source, setting = run(BROAD, ignored=(written, configured))["results"]
    assert told["suppressions"] == []
    (suppression,) = source["suppressions"]
    assert (suppression["kind"], suppression["justification"]) == ("inSource", "the register says so")
    assert suppression["location"]["physicalLocation"]["region"]["startLine"] == 1
    assert setting["suppressions"] == [{"kind": "external", "status": "accepted", "justification": "kept for later"}]


def test_fingerprint_survives_moved_lines_and_numbers_duplicates() -> None:
    twin = Diagnostic(BROAD.code, BROAD.message, SECOND)
    before = run(Diagnostic(BROAD.code, BROAD.message, FIRST), twin)["results"]
    above = "// a remark\n\n"
    moved = {NAME: Source(NAME, above + TEXT.replace("  permit", "\tpermit "))}
    spans = [Span(NAME, at + len(above), at + len(above) + 6) for at in (22, 43)]
    after = run(*(Diagnostic(BROAD.code, "in other words", span) for span in spans), files=moved)["results"]
    marks = [[each["partialFingerprints"][FINGERPRINT] for each in results] for results in (before, after)]
    assert marks[0] == marks[1]
    assert len(set(marks[0])) == 2
    (changed,) = run(Diagnostic(codes.NAMING, BROAD.message, FIRST))["results"]
    assert changed["partialFingerprints"][FINGERPRINT] not in marks[0]


def test_unreadable_file_is_a_notification_of_a_failed_run() -> None:
    one = run(Diagnostic(codes.NO_SUCH_FILE, "`x.rts` cannot be read"), BROAD, code=ExitCode.INPUT)
    (invocation,) = one["invocations"]
    assert (invocation["executionSuccessful"], invocation["exitCode"]) == (False, 3)
    (notice,) = invocation["toolExecutionNotifications"]
    assert (notice["level"], notice["associatedRule"]["id"]) == ("error", "E0108")
    assert [result["ruleId"] for result in one["results"]] == ["E1303"]


def test_finding_in_a_specification_has_its_pointer() -> None:
    (result,) = run(Diagnostic(codes.SPECIFICATION_SHAPE, "no such key", pointer="/phases/0"))["results"]
    assert result["locations"] == [{"logicalLocations": [{"fullyQualifiedName": "/phases/0", "kind": "value"}]}]


@pytest.mark.parametrize(("folder", "uri"), [("/", "file:///"), ("/a b/c", "file:///a%20b/c/"), (None, None)])
def test_base_folder_becomes_the_uri_base(folder: str | None, uri: str | None) -> None:
    assert run(base=folder)["originalUriBaseIds"]["SRCROOT"].get("uri") == uri


def test_finding_in_an_unread_file_keeps_its_offsets() -> None:
    (result,) = run(BROAD, files={})["results"]
    assert result["locations"][0]["physicalLocation"]["region"] == {"charOffset": 23, "charLength": 6}


words = st.text(max_size=30)


@given(words, words, words.filter(bool), st.data())
def test_hostile_text_stays_text(message: str, text: str, file: str, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(text)))
    span = Span(file, start, data.draw(st.integers(start, len(text))))
    label, fix = Label(span, message), Fix(span, message, message)
    found = Diagnostic(codes.SYNTAX, message, span, message, (label,), (fix,), message)
    (result,) = run(found, files={file: Source(file, text)}, ignored=(Ignored(found, message, span),))["results"][:1]
    assert "](" not in result["message"]["text"]
    assert all(part.isprintable() for part in result["message"]["text"].split("\n"))
    uri = result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert unquote(urlsplit(uri).path) == file
    region = result["locations"][0]["physicalLocation"]["region"]
    lines = text.split("\n")
    before = sum(len(line) + 1 for line in lines[: region["startLine"] - 1])
    assert before + region["startColumn"] - 1 == region["charOffset"] == start
    assert result["fixes"][0]["artifactChanges"][0]["replacements"][0]["insertedContent"]["text"] == message
