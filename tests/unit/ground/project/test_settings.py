"""The settings of a configuration, and the refusals of a wrong one with the nearest accepted value."""

import pytest

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.project.file_patterns import matches
from rtshcua.ground.project.project_settings import IgnoredCode, ProjectSettings, parse_settings
from virtual.rows import rows

WHOLE = """
[lint]
ignore = { E1304 = "the letter  says 30 m" }
exclude = ["drafts", "old/**"]
fail-on = "error"
with = ["site.rts"]
cache = false
[lint.per-file-ignore]
"tests/*.rts" = { naming = "names of the register" }
[format]
width = 100
exclude = ["generated.rts"]
[test]
fail-under = 80
exclude = ["slow"]
"""


def test_every_key_is_read() -> None:
    found = parse_settings(WHOLE, "rtshcua.toml")
    assert isinstance(found, ProjectSettings)
    assert found.lint.ignored == (
        IgnoredCode(codes.REPEATED_NUMBER, "the letter says 30 m"),
        IgnoredCode(codes.NAMING, "names of the register", "tests/*.rts"),
    )
    assert (found.lint.exclude, found.lint.fail_on, found.lint.further) == (
        ("drafts", "old/**"),
        "error",
        ("site.rts",),
    )
    assert (found.lint.cache, found.format.width, found.format.exclude) == (False, 100, ("generated.rts",))
    assert (found.test.fail_under, found.test.exclude) == (80, ("slow",))


def test_empty_configuration_gives_the_defaults() -> None:
    assert parse_settings("", "rtshcua.toml") == ProjectSettings()
    assert parse_settings("[project]\nname = 'x'\n[tool.ruff]", "pyproject.toml", shared=True) is None
    assert parse_settings("[tool.rtshcua]", "pyproject.toml", shared=True) == ProjectSettings()
    found = parse_settings("[tool.rtshcua.lint]\ncache = false", "pyproject.toml", shared=True)
    assert isinstance(found, ProjectSettings)
    assert found.lint.cache is False


@rows(
    ("text", "told", "help"),
    [
        ("x =", "r.toml: not valid TOML: invalid value", None),
        ("\nx y", "r.toml:2: not valid TOML: expected '=' after a key in a key/value pair", None),
        ("[lnt]", "r.toml:1: unknown key `lnt`", "did you mean `lint`?"),
        ("[lint]\nexlude = []", "r.toml:2: unknown key `exlude` in `[lint]`", "did you mean `exclude`?"),
        ("[format]\nxyz = 1", "r.toml:2: unknown key `xyz` in `[format]`", "known: `width`, `exclude`"),
        ("lint = 3", "r.toml:1: `lint` is a whole number; expected a table", None),
        ("lint.fail-on = 3", "r.toml:1: `fail-on` in `[lint]` is a whole number",
         "accepted: `error`, `warning`, `note`, `never`"),
        ("lint.fail-on = 'warn'", "r.toml:1: `warn` is not a value of `fail-on` in `[lint]`",
         "did you mean `warning`?"),
        ("lint.exclude = 'x'", "r.toml:1: `exclude` in `[lint]` is a string",
         'accepted: a list of strings, as in `exclude = ["drafts"]`'),
        ("lint.exclude = ['']", "r.toml:1: `exclude` in `[lint]` has an empty string in its list",
         "accepted: a list of strings"),
        ("lint.exclude = [1.5]", "r.toml:1: `exclude` in `[lint]` has a decimal number in its list",
         "accepted: a list of strings"),
        ("lint.cache = 3", "r.toml:1: `cache` in `[lint]` is a whole number",
         "accepted: `true` or `false`"),
        ("lint.ignore = ['E1304']", "r.toml:1: `lint.ignore` is a list; expected a table", None),
        ("[lint.ignore]\nE1304 = ' '", "r.toml:2: `E1304` in `[lint.ignore]` is ignored without a reason",
         'give a reason, as in `E1304 = "the authority\'s letter says 30 m"`'),
        ("[lint.ignore]\nE1304 = '...'", "r.toml:2: `E1304` in `[lint.ignore]` is ignored without a reason",
         'give a reason, as in `E1304 = "the authority\'s letter says 30 m"`'),
        ("[lint.ignore]\nE1304 = true", "r.toml:2: `E1304` in `[lint.ignore]` is `true`; expected a reason",
         'give a reason, as in `E1304 = "the authority\'s letter says 30 m"`'),
        ("[lint.ignore]\nnamin = 'why not'", "r.toml:2: unknown code `namin`", "did you mean `naming`?"),
        ("[lint.ignore]\nE0310 = 'why not'", "r.toml:2: `E0310` is an error, and errors cannot be ignored", None),
        ("[lint.ignore]\nE1309 = 'why not'",
         "r.toml:2: `E1309` is about ignores, and cannot be ignored", None),
        ("format.width = 39", "r.toml:1: `width` in `[format]` is 39", "accepted: a whole number from 40 to 400"),
        ("format.width = true", "r.toml:1: `width` in `[format]` is `true`", "accepted: a whole number from 40 to 400"),
        ("test.fail-under = 80.5", "r.toml:1: `fail-under` in `[test]` is a decimal number",
         "accepted: a whole number from 0 to 100"),
        ("test.fail-under = 101", "r.toml:1: `fail-under` in `[test]` is 101",
         "accepted: a whole number from 0 to 100"),
        ("x = 2020-01-01", "r.toml:1: unknown key `x`", "known: `lint`, `format`, `test`"),
    ],
)  # fmt: skip
def test_wrong_configuration_is_refused_with_place_and_help(text: str, told: str, help: str | None) -> None:
    found = parse_settings(text, "r.toml")
    assert found == Refusal("configuration", told, help or "")


@rows(
    ("pattern", "meant", "not_meant"),
    [
        ("drafts", ["drafts/a.rts", "x/drafts/y/a.rts", "drafts"], ["drafts2/a.rts", "a/mydrafts"]),
        ("drafts/", ["drafts/a.rts", "x/drafts/a.rts"], ["drafts2/a.rts"]),
        ("*.rts", ["a.rts", "x/y/b.rts"], ["a.rts2", "a"]),
        ("a/*.rts", ["a/b.rts"], ["a/b/c.rts", "x/a/b.rts"]),
        ("a/**", ["a/b.rts", "a/b/c.rts"], ["b/a/c.rts"]),
        ("**/old", ["old/a.rts", "x/y/old/z.rts"], ["older/a.rts"]),
        ("a/**/b.rts", ["a/b.rts", "a/x/y/b.rts"], ["b.rts"]),
        ("./a.rts", ["a.rts"], ["a_rts"]),
        ("a?.rts", ["ab.rts"], ["a.rts", "a/.rts"]),
        ("[x].rts", ["[x].rts"], ["x.rts"]),
    ],
)
def test_per_file_ignore_keeps_its_pattern(pattern: str, meant: list[str], not_meant: list[str]) -> None:
    assert [matches(pattern, path) for path in (*meant, *not_meant)] == [True] * len(meant) + [False] * len(not_meant)


@pytest.mark.slow
@rows("part", ["a", '"a,b"', "a-b_c ", "'a'"])
def test_key_with_too_many_parts_is_refused_before_parsing(part: str) -> None:
    """`tomllib` takes quadratic time in the number of parts: an hour for a file of a megabyte."""
    keys = ".".join([part] * 200_000)
    for text in (f"{keys} = 1", f"[{keys}]", f"x = {{{keys} = 1}}"):
        refused = parse_settings(text, "rtshcua.toml")
        assert isinstance(refused, Refusal)
        assert "more than 64 parts" in refused.text


def test_many_patterns_do_not_count_as_a_long_key() -> None:
    patterns = ", ".join(f'"missions/part.{number}.rts"' for number in range(500))
    found = parse_settings(f"[test]\nexclude = [{patterns}]\n", "rtshcua.toml")
    assert isinstance(found, ProjectSettings)
    assert len(found.test.exclude) == 500
