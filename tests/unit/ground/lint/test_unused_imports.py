"""E1305: unused imports, and that a program means the same without them."""

from pathlib import Path

import pytest

from reference.linted import CHECKOUT, HEAD, POLICY, found, program
from rtshcua.diagnostics.diagnostic import Applicability
from rtshcua.ground.language.load import load
from rtshcua.ground.lint.linter import lint
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect

TWINS = sorted(path.name for path in (CHECKOUT / "tests" / "accepted").glob("e0[1-8]*1_*.rts"))


def test_unused_imports_are_reported() -> None:
    assert found(HEAD + 'import "lib:skills/hover.rts"\n' + POLICY) == [("E1305", 'import "lib:skills/hover.rts"')]
    assert found(HEAD + 'import "lib:policies/site.rts"\n' + POLICY) == [("E1305", 'import "lib:policies/site.rts"')]


def test_import_is_used_if_only_it_provides_a_used_declaration() -> None:
    gathered = "// gathers others\n" + HEAD
    assert found('import "all.rts"\n' + POLICY, all=gathered) == []
    assert found('import "all.rts"\n' + HEAD + POLICY, all=gathered) == [("E1305", 'import "all.rts"')]
    assert found(gathered) == []
    assert found(HEAD + 'import "none.rts"\n' + POLICY, none="// nothing yet") == [("E1305", 'import "none.rts"')]


def test_import_of_an_importable_file_is_not_reported() -> None:
    site = "zone pad = circle(47.3977 N, 8.5456 E, 10 m)"
    assert found('import "lib:skills/signals.rts"\n' + site) == []
    assert found('import "lib:skills/signals.rts"\nimport "lib:skills/goto.rts"\n' + site) == [
        ("E1305", 'import "lib:skills/signals.rts"')
    ]


def test_policy_uses_zones_and_signals_without_mention() -> None:
    """Its missions may fly to any of its zones, and every decision reads the well-known signals."""
    zones = "zone pad = circle(47.3977 N, 8.5456 E, 10 m)"
    assert found(HEAD + 'import "zones.rts"\n' + POLICY, zones=zones) == []
    assert found(HEAD + 'import "lib:skills/signals.rts"\n' + POLICY) == []
    every = POLICY.replace("permit ret", "permit any by role operator permit ret")
    assert [code for code, _ in found(HEAD + 'import "lib:skills/hover.rts"\n' + every)] == ["E1303"]


def test_import_of_sizes_is_used_by_the_policy() -> None:
    sizes = HEAD + "sizes return_home(longest = 6 min)"
    assert found('import "sizes.rts"\n' + HEAD + POLICY, sizes=sizes) == []
    assert found(sizes) == []


def fix_of(text: str) -> tuple[str, bool]:
    """Return the text after the only fix, and whether that fix is safe."""
    (fix,) = (fix for each in lint(program({"main.rts": text})) for fix in each.fixes)
    return text[: fix.span.start] + fix.replacement + text[fix.span.end :], fix.applicability is Applicability.SAFE


TWICE = 'import "lib:skills/emergency_land.rts"'


def test_fix_deletes_the_line_of_the_import() -> None:
    assert fix_of(f"  {TWICE}  \n" + HEAD + POLICY) == (HEAD + POLICY, True)
    assert fix_of(f"{TWICE} import" + HEAD.replace("import", "", 1) + POLICY)[1]


def test_fix_is_not_safe_if_only_this_import_provides_a_file() -> None:
    """A file that imports this one may use it, even if it is not linted."""
    assert fix_of(HEAD + 'import "lib:skills/hover.rts"\n' + POLICY) == (HEAD + POLICY, False)
    mission = 'import "main.rts"\npolicy q version 1 { permit hover by any permit return_home, emergency_land by any '
    mission += "contingency return_home, emergency_land }"
    both = {"main.rts": HEAD + 'import "lib:skills/hover.rts"\n' + POLICY, "other.rts": mission}
    one = program(both, "other.rts")
    assert not one.diagnostics
    assert lint(one, set(both)) == ()


@pytest.mark.parametrize("comment", ["// for later", "/* for later */", "// rtshcua: ignore E1302 because it is so"])
def test_fix_keeps_a_comment_on_the_line(comment: str) -> None:
    assert fix_of(f"{TWICE} {comment}\n" + HEAD + POLICY) == (f" {comment}\n" + HEAD + POLICY, False)
    if comment.startswith("/*"):
        assert fix_of(f"{comment} {TWICE}\n" + HEAD + POLICY) == (f"{comment} \n" + HEAD + POLICY, False)


@pytest.mark.parametrize("name", TWINS)
def test_source_compiles_alike_without_its_unused_imports(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The twins of other rules import more than they need, so each tests whether unused imports can be deleted."""
    monkeypatch.chdir(CHECKOUT)
    path, library = f"tests/accepted/{name}", "tests/golden/checker/library"
    kept: dict[str, bytes] = {}
    before = load([path], lambda file: Path(file).read_bytes(), library)
    text = before.sources[path].text
    fixes = [fix for each in lint(before) for fix in each.fixes]
    for fix in reversed(fixes):
        text = text[: fix.span.start] + text[fix.span.end :]
    kept[path] = text.encode()
    after = load([path], lambda file: kept.get(file) or Path(file).read_bytes(), library)
    assert check_program(after, dialect.load()) == ()
    assert "E1305" not in {each.code.id for each in lint(after)}


def test_import_of_a_role_is_used() -> None:
    policy = POLICY.replace("permit ret", "forbid return_home by role ranger through agent permit ret")
    people = 'import "people.rts"\n' + HEAD + policy
    assert found(people, people="role ranger, mate") == []
    assert found(people + "role ranger", people="role mate") == [("E1305", 'import "people.rts"')]
