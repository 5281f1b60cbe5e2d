"""The trades of `examples`: their decisions, their pictures in docs/library.md, and their flights."""

import os
import re
import shlex
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.front.cli.table import COMMANDS
from virtual.examples import failures_of, flights_of

CHECKOUT = Path(__file__).resolve().parents[2]
TRADES = CHECKOUT / "examples" / "trades"
PAGE = CHECKOUT / "docs" / "library.md"
FLIGHTS = TRADES / "tests" / "flights.rts"
MISSIONS = sorted(path.stem for path in (TRADES / "missions").glob("*.rts"))
#: flown with each change; the others take minutes, and are flown in the soak
SAMPLE = {("the front of a building", "ardupilot"), ("a load is delivered", "px4")}


@pytest.fixture
def trades(monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(TRADES)
    return TRADES


@pytest.mark.slow
def test_decisions_of_all_trades_are_tested(trades: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tests = [f"tests/{name}.rts" for name in ("inspection", "patrol", "delivery")]
    assert app.main(["test", "--coverage", *tests]) == ExitCode.OK, capsys.readouterr().out
    shares = re.findall(r"(?m)^coverage of \w+@\d+ on kestrel: ([\d.]+) %", capsys.readouterr().out)
    assert len(shares) == 3
    assert all(float(share) >= 90 for share in shares)


@pytest.mark.slow
@pytest.mark.parametrize("name", MISSIONS)
def test_picture_of_a_mission_is_that_of_the_page(
    trades: Path, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`UPDATE_GOLDENS=1` draws them anew: look at the difference."""
    drawn, golden = tmp_path / "drawn.svg", CHECKOUT / "docs" / "library" / f"{name}.svg"
    assert app.main(["check", f"missions/{name}.rts", "--picture", str(drawn)]) == ExitCode.OK, capsys.readouterr().err
    found = drawn.read_text(encoding="utf-8")
    if os.environ.get("UPDATE_GOLDENS"):
        golden.write_text(found, encoding="utf-8")
    assert found == golden.read_text(encoding="utf-8")


def test_each_mission_has_a_row_with_its_picture_and_parameters() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert sorted(path.stem for path in (CHECKOUT / "docs" / "library").glob("*.svg")) == MISSIONS
    for name in MISSIONS:
        (row,) = [line for line in page.splitlines() if f"(library/{name}.svg)" in line]
        assert f"missions/{name}.rts" in row
        source = (TRADES / "missions" / f"{name}.rts").read_text(encoding="utf-8")
        declared = re.findall(r"(?m)^  (\w+): +(?:one of|altitude|length|speed)", source)
        assert declared
        assert [each for each in declared if f"`{each}`" not in row] == []


@pytest.mark.parametrize(("folder", "declares"), [("skills", "skill"), ("policies", "template")])
def test_each_skill_and_template_of_the_library_is_on_the_page(folder: str, declares: str) -> None:
    page = PAGE.read_text(encoding="utf-8")
    sources = [path.read_text(encoding="utf-8") for path in (CHECKOUT / folder).glob("*.rts")]
    names = [name for text in sources for name in re.findall(rf"(?m)^{declares} (\w+)\(", text)]
    assert len(names) >= 4
    assert [name for name in names if f"| `{name}` |" not in page] == []


def test_policy_of_the_page_has_no_findings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"(?s)```rts\n(.*?)```", PAGE.read_text(encoding="utf-8"))
    Path("low_flights.rts").write_text(block, encoding="utf-8")
    for command in ("check", "lint"):
        assert app.main([command, "low_flights.rts"]) == ExitCode.OK, capsys.readouterr()


def test_sizes_of_the_language_page_are_those_of_the_library() -> None:
    page = (CHECKOUT / "docs" / "language.md").read_text(encoding="utf-8")
    for path in (CHECKOUT / "skills").glob("*.rts"):
        for name, sizes in re.findall(
            r"(?ms)^skill (\w+)\(.*?\) sizes \((.*?)^\) \{", path.read_text(encoding="utf-8")
        ):
            declared = re.findall(r"(?m)^  (\w+): .* = (.*?),(?: +//.*)?$", sizes)
            assert declared
            row = ", ".join(f"`{size}` {value}" for size, value in declared)
            assert f"| `{name}` | {row} |" in page, f"| `{name}` | {row} |"


@pytest.mark.parametrize(
    ("name", "flavour"),
    [
        pytest.param(*each, marks=pytest.mark.slow if each in SAMPLE else pytest.mark.soak)
        for each in flights_of(FLIGHTS)
    ],
)
def test_scenarios_fly_as_expected(trades: Path, name: str, flavour: str) -> None:
    assert failures_of(FLIGHTS, name, flavour) == []


def test_sample_of_flights_exists() -> None:
    assert set(flights_of(FLIGHTS)) >= SAMPLE


def test_page_of_the_example_names_existing_commands_and_sources() -> None:
    page = (TRADES / "README.md").read_text(encoding="utf-8")
    lines = [shlex.split(line, comments=True) for line in page.splitlines() if line.startswith("rtshcua ")]
    assert len(lines) >= 6
    assert {words[1] for words in lines} <= {command.name for command in COMMANDS}
    for path in (word for words in lines for word in words if word.endswith(".rts")):
        assert (TRADES / path).is_file(), path
