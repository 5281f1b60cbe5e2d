"""`--fix` applies safe fixes until none is left, but no fix that causes an error."""

from pathlib import Path

import pytest

from reference.lint_project import HABITS, MISSION, POLICY, UNUSED, Lint, put
from rtshcua.adapters.store.writing import rewrite
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.span import Source, Span
from rtshcua.front.cli.app import main
from rtshcua.ground.lint import linter as rules
from rtshcua.ground.lint.fixes import fixed
from virtual.rows import rows

IDLE = "// rtshcua: ignore E1304 because the register says so\n"
WITHOUT = POLICY.replace(f"{UNUSED}\n", "")


def test_fix_applies_only_safe_fixes(here: Path, lint: Lint) -> None:
    Path("policy.rts").chmod(0o640)
    assert lint(".", "--fix") == (ExitCode.DIAGNOSTICS, [HABITS[0], HABITS[2]])
    assert Path("policy.rts").read_text() == WITHOUT
    assert Path("policy.rts").stat().st_mode & 0o777 == 0o640
    assert Path("one.rts").read_text() == MISSION


def test_only_requested_files_are_fixed(here: Path, lint: Lint) -> None:
    assert lint("one.rts", "--fix") == (ExitCode.DIAGNOSTICS, HABITS[:1])
    assert Path("policy.rts").read_text() == POLICY


def test_fix_keeps_byte_order_mark_and_line_ends(here: Path, lint: Lint) -> None:
    data = b"\xef\xbb\xbf" + POLICY.replace("\n", "\r\n").encode()
    Path("policy.rts").write_bytes(data)
    lint(".", "--fix")
    assert Path("policy.rts").read_bytes() == b"\xef\xbb\xbf" + WITHOUT.replace("\n", "\r\n").encode()


def test_fix_keeps_a_symbolic_link(here: Path, lint: Lint) -> None:
    Path("policy.rts").rename("real.rts")
    Path("policy.rts").symlink_to("real.rts")
    lint("one.rts", "policy.rts", "--fix")
    assert Path("policy.rts").is_symlink()
    assert Path("real.rts").read_text() == WITHOUT


def test_fix_replaces_only_the_named_hard_link(here: Path, lint: Lint) -> None:
    put({"policy.rts": WITHOUT + IDLE})
    Path("other").hardlink_to("policy.rts")
    lint("policy.rts", "--fix")
    assert (Path("policy.rts").read_text(), Path("other").read_text()) == (WITHOUT, WITHOUT + IDLE)


def test_layout_is_fixed_if_the_configuration_enables_it(here: Path, lint: Lint) -> None:
    put({"policy.rts": WITHOUT.replace("  permit takeoff", "permit   takeoff")})
    assert lint("policy.rts") == (ExitCode.OK, [])
    put({"rtshcua.toml": "[lint]\nformat = true"})
    assert ("E1501", "policy.rts") in lint("policy.rts")[1]
    assert lint("policy.rts", "--fix") == (ExitCode.OK, [])
    assert main(["fmt", "--check", "policy.rts"]) == ExitCode.OK


def test_unused_ignores_are_removed(here: Path, lint: Lint) -> None:
    top = "// rtshcua: ignore-file E1304, E1302 because of the register\n"
    put({"one.rts": top + MISSION.replace("inspection {", "inspection {  // rtshcua: ignore E1301 because it is so\n")})
    assert lint("one.rts", "--fix") == (ExitCode.OK, [])
    assert Path("one.rts").read_text() == top.replace("E1304, ", "") + MISSION.replace("inspection {", "inspection {\n")


def test_suggestions_need_unsafe_fixes(here: Path, lint: Lint) -> None:
    put({"one.rts": MISSION.replace("policy.rts", "polcy.rts").replace("Look", "look")})
    assert lint("one.rts", "--fix")[1] == [("E0108", "one.rts")]
    assert lint("one.rts", "--unsafe-fixes") == (ExitCode.OK, [])
    assert Path("one.rts").read_text() == MISSION.replace("Look", "look")


def test_diff_is_printed_without_writing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint", ".", "--diff"]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr().out
    assert f"-{UNUSED}" in said.splitlines()
    assert said.startswith("--- policy.rts\n+++ policy.rts\n")
    assert Path("policy.rts").read_text() == POLICY
    put({"policy.rts": WITHOUT})
    assert main(["lint", ".", "--diff"]) == ExitCode.OK


def test_fix_that_causes_an_error_is_not_applied(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def rule(subject):  # type: ignore[no-untyped-def]
        for unit in subject.requested:
            for each in unit.imports[:1]:
                fix = Fix(each.span, "", "away with it", Applicability.SAFE)
                yield Diagnostic(codes.UNUSED_IMPORT, "no import is any good", each.span, fixes=(fix,))

    monkeypatch.setattr(rules, "RULES", (rule,))
    assert main(["lint", "one.rts", "policy.rts", "--fix", "--no-cache"]) == ExitCode.DIAGNOSTICS
    assert (Path("one.rts").read_text(), Path("policy.rts").read_text()) == (MISSION, POLICY)
    said = capsys.readouterr().err
    assert "the fixes of `one.rts` were not applied, because they would cause an error" in said


def finding(start: int, end: int, replacement: str, how: Applicability = Applicability.SAFE) -> Diagnostic:
    fix = Fix(Span("x", start, end), replacement, "do it", how)
    return Diagnostic(codes.NAMING, "it is so", fix.span, fixes=(fix,))


@rows(
    ("findings", "expected"),
    [
        ([finding(0, 1, "A"), finding(3, 4, "")], "Abc"),
        ([finding(0, 3, "X"), finding(2, 4, "Y")], "Xd"),  # of overlapping fixes, the first
        ([finding(0, 1, "X"), finding(1, 2, "Y")], "Xbcd"),  # of touching fixes, the first
        ([finding(1, 2, "X"), finding(1, 2, "X")], "aXcd"),  # equal fixes count once
        ([finding(2, 2, "!"), finding(4, 4, "?")], "ab!cd?"),
        ([finding(0, 1, "A", Applicability.SUGGESTED)], None),
    ],
)
def test_overlapping_fixes_are_applied_one_at_a_time(findings: list[Diagnostic], expected: str | None) -> None:
    made = fixed(findings, {"x": Source("x", "abcd")}, ["x"])
    assert made == ({} if expected is None else {"x": expected})
    assert fixed(findings, {"x": Source("x", "abcd")}, []) == {}


def test_diff_splits_lines_only_at_line_feeds(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd = WITHOUT.replace("\n", "  // a\fb\n", 1) + IDLE
    Path("policy.rts").write_bytes(b"\xef\xbb\xbf" + odd.encode())
    assert main(["lint", ".", "--diff"]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr().out.split("\n")
    assert said[2:] == ["@@ -10,4 +10,3 @@", *(f" {line}" for line in odd.split("\n")[9:12]), f"-{IDLE[:-1]}", ""]
    Path("policy.rts").write_bytes(b"\xef\xbb\xbf" + IDLE.encode() + odd.encode())
    assert main(["lint", "policy.rts", "--diff"]) == ExitCode.DIAGNOSTICS
    assert capsys.readouterr().out.split("\n")[3:5] == [f"-\ufeff{IDLE[:-1]}", f"-{odd.split(chr(10))[0]}"]


def test_unwritable_file_is_reported_and_kept(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put({"policy.rts": POLICY + IDLE})
    Path("policy.rts").chmod(0o444)
    assert main(["lint", ".", "--fix"]) == ExitCode.FULL
    said = capsys.readouterr()
    assert Path("policy.rts").read_text() == POLICY + IDLE
    assert "error: cannot write `policy.rts`: the file is read-only\n" in said.err
    assert "warning[E1309]" in said.err  # it still exists
    assert "fixed" not in said.out


def test_file_changed_by_another_process_is_kept(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def meanwhile(path: Path, before: bytes, data: bytes) -> None:
        Path("policy.rts").write_text("// mine\n")
        rewrite(path, before, data)

    put({"policy.rts": POLICY + IDLE})
    monkeypatch.setattr("rtshcua.adapters.store.writing.rewrite", meanwhile)
    assert main(["lint", ".", "--fix"]) == ExitCode.FULL
    assert Path("policy.rts").read_text() == "// mine\n"
    assert "cannot write `policy.rts`: it was changed in the meantime" in capsys.readouterr().err
