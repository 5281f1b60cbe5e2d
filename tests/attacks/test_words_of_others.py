"""Threats to people who sign: texts of a proposer, in a bundle or in a file's name, that misrepresent what is
signed.
"""

import io
import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.low_source import low_source
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.vehicle_records import opened_root
from rtshcua.app.fly.story import FlightPlanView
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.report.github import github
from rtshcua.diagnostics.span import Source, Span
from rtshcua.front.cli.app import main
from rtshcua.front.cli.documents import deliver
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.render.live.lines import plain
from rtshcua.front.cli.unlock import unlock_person
from rtshcua.ground.agent.specification import parse_specification
from rtshcua.ground.language.parse import parse
from rtshcua.library import root
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import envelopes, mission_payload, open_bundle, seal_under
from rtshcua.wire.keys import Duty

ESCAPES = "\x1b[2K\r\x9b1mapproved\u202e\u2066\u200b\u00ad\ufe0f\U000e0041\u3164\nerror: none"
PROPOSAL = (root() / "missions" / "proposal.json").read_bytes()
FLIGHT = ("--flight", bytes(16).hex())
LOW = low_source("inspect_area(bridge_a, /* only hover(5 s), near home */ altitude = 9 m, pattern = perimeter)")


def harmless(text: str) -> bool:
    return all(line.isprintable() for line in text.replace("\t", " ").split("\n")) and not {*text} & {*"\ufe0f\u3164"}


#: file names that this system allows
NAME = ESCAPES.replace("/", "")


@pytest.fixture
def low(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    monkeypatch.chdir(tmp_path)
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["keys", "approver", "owner", "--role", "supervisor"]) == ExitCode.OK
    (tmp_path / "low.rts").write_text(LOW)
    assert main(["compile", "low.rts"]) == ExitCode.OK
    capsys.readouterr()
    return tmp_path


@pytest.mark.parametrize("answer", [(), ("--refuse",), ("--json",)])
def test_approval_prompt_uses_bound_values(
    low: Path, capsys: pytest.CaptureFixture[str], answer: tuple[str, ...]
) -> None:
    """A comment among the arguments is the proposer's, and what is signed is the skill with its arguments."""
    command = ["approve", "low.bundle", "--step", "3", "-o", "yes", "--flight", bytes(16).hex(), *answer]
    assert main(command) == ExitCode.OK
    out = capsys.readouterr().out
    assert "hover" not in out
    assert "/*" not in out
    assert "`inspect_area(" in out
    assert "altitude = 9 m" in out
    assert "pattern = perimeter" in out
    assert "area = bridge_a [77.0 m from west to east by 53.4 m, its middle 176.8 m from home, bearing 47°]" in out


@pytest.mark.parametrize(("typed", "code"), [("y\n", ExitCode.OK), ("n\n", ExitCode.REFUSED), ("", ExitCode.INPUT)])
def test_approval_prompt_comes_before_signature(
    low: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, typed: str, code: ExitCode
) -> None:
    """A person at a terminal sees the step, and only then says whether to sign it."""
    seen: list[str] = []
    monkeypatch.setattr("rtshcua.front.cli.commands.approve.terminal", lambda: True)
    monkeypatch.setattr(
        "rtshcua.front.cli.commands.approve.unlock_person",
        lambda *a, **k: (seen.append("key"), unlock_person(*a, **k))[1],
    )
    monkeypatch.setattr("sys.stdin", io.StringIO(typed))
    assert main(["approve", "low.bundle", "--step", "3", "-o", "yes", *FLIGHT]) == code
    err = capsys.readouterr().err
    assert "step 3 of `low` on `quad-07`: `inspect_area(" in err
    assert "sign as supervisor that the step may be flown? [y/N]" in err
    assert err.index("inspect_area(") < err.index("[y/N]")
    assert (low / "yes").exists() == bool(seen) == (code is ExitCode.OK)


def test_mission_name_cannot_imitate_signed_content(low: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A holder of a mission key signs a mission whose name imitates the step and displaces our text."""
    store = KeyStore(data_folder())
    trusted, data = opened_root(store.root()), (low / "low.bundle").read_bytes()
    bundle = open_bundle(data, root=trusted, vehicle=None, now_us=0)
    key = store.signing_key(Duty.MISSION, whose="agent")

    def named(name: str) -> ExitCode:
        mission = bind(replace(bundle.mission, name=name), bundle.policy_digest)
        (low / "low.bundle").write_bytes(seal_under(envelopes(data)[0], mission_payload(mission), mission_key=key))
        capsys.readouterr()
        return main(["approve", "low.bundle", "--step", "3", "-o", "yes", *FLIGHT])

    assert named(f"low` on `quad-07`: `hover(time = 5 s)`{' ' * 4000}`") == ExitCode.INPUT
    assert "would be refused on board: the name of the mission is invalid" in capsys.readouterr().err
    assert not (low / "yes").exists()
    assert named("hover_5_s_above_home" * 400) == ExitCode.OK
    assert len(capsys.readouterr().err.split("`inspect_area(")[0]) < 160


def test_scripts_are_not_prompted(
    low: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtshcua.front.cli.commands.approve.terminal", lambda: True)
    assert main(["approve", "low.bundle", "--step", "3", "-o", "no", "--refuse", "--yes", *FLIGHT]) == ExitCode.OK
    assert "step 3 of `low` on `quad-07`: `inspect_area(" in capsys.readouterr().err


@pytest.mark.parametrize("as_json", [False, True])
def test_document_result_is_one_escaped_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], as_json: bool) -> None:
    deliver(b"", f"recalled `{ESCAPES}`", to=None, output=tmp_path / "out", as_json=as_json)
    out = capsys.readouterr().out
    assert harmless(out)
    assert out.count("\n") == 1


def test_error_is_one_escaped_line(capsys: pytest.CaptureFixture[str]) -> None:
    say(f"no such file: `{ESCAPES}`")
    assert main(["show", f"{ESCAPES}.bundle"]) == ExitCode.INPUT
    err = capsys.readouterr().err
    assert harmless(err)
    assert "\nerror: none" not in err


#: commands on files with foreign names, and their exit codes, successful ones included
OVER_NAMES = [
    (("check", "{source}"), ExitCode.OK), (("check", "{source}", "--json"), ExitCode.OK),
    (("compile", "{source}", "-o", "{made}"), ExitCode.OK),
    (("compile", "{source}", "-o", "{made}", "--json"), ExitCode.OK),
    (("show", "{bundle}"), ExitCode.OK), (("show", "{bundle}", "--json"), ExitCode.OK),
    (("show", "{source}"), ExitCode.INPUT), (("show", "{source}", "--json"), ExitCode.INPUT),
    (("why", "{bundle}", "--step", "1"), ExitCode.OK), (("why", "{bundle}", "--step", "1", "--json"), ExitCode.OK),
    (("approve", "{bundle}", "--step", "3", "-o", "{made}", *FLIGHT), ExitCode.OK),
    (("approve", "{bundle}", "--step", "3", "-o", "{made}", *FLIGHT, "--json"), ExitCode.OK),
    (("recall", "{bundle}", "-o", "{made}", *FLIGHT), ExitCode.OK),
    (("recall", "{bundle}", "-o", "{made}", *FLIGHT, "--json"), ExitCode.OK),
    (("fmt", "--check", "{untidy}"), ExitCode.DIAGNOSTICS), (("fmt", "--diff", "{untidy}"), ExitCode.DIAGNOSTICS),
    (("fmt", "--check", "--json", "{untidy}"), ExitCode.DIAGNOSTICS), (("fmt", "{untidy}"), ExitCode.OK),
    (("lint", "{source}", "--no-cache"), None), (("lint", "{source}", "--json"), None),
    *(((("lint", "{source}", "--format", form), None)) for form in ("github", "sarif", "junit")),
    (("lint", "{source}", "--fix", "--diff"), None), (("lint", "{source}", "--statistics"), None),
    (("test", "{source}"), None), (("test", "{source}", "--json"), None),
    (("docs", "{source}", "-o", "{made}.html"), ExitCode.OK), (("docs", "{source}", "--json"), ExitCode.OK),
    (("init", "{folder}", "--name", "site"), ExitCode.OK),
    (("init", "{folder}2", "--name", "site", "--json"), ExitCode.OK),
    (("keys", "link", "{made}.key"), ExitCode.OK),
    (("verify-log", "{source}"), ExitCode.INPUT), (("verify-log", "{source}", "--json"), ExitCode.INPUT),
    (("archive", "check", "{folder}"), None), (("archive", "check", "{folder}", "--json"), None),
    (("recover", "{source}", "--json"), ExitCode.INPUT), (("run", "{source}", "--json"), ExitCode.INPUT),
    (("schema", "--policy", "{source}"), None), ((NAME,), ExitCode.USAGE), (("check", f"--{NAME}"), ExitCode.USAGE),
    (("check", f"--{NAME}", "--json"), ExitCode.USAGE),
]  # fmt: skip


def test_foreign_names_are_escaped_everywhere(low: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """For every command that takes a file: its text output, JSON, reports and errors."""
    names = {"source": f"{NAME}.rts", "bundle": f"{NAME}.bundle", "untidy": f"{NAME} u.rts", "folder": f"{NAME}-site"}
    (low / names["source"]).write_text(LOW.replace("/* only hover(5 s), near home */ ", ""))
    (low / names["untidy"]).write_text(LOW.replace("  intent", " intent"))
    (low / "low.bundle").rename(low / names["bundle"])
    for command, code in OVER_NAMES:
        words = [word.format(made=f"{NAME} made", **names) for word in command]
        found = main(words)
        said = capsys.readouterr()
        assert code in (None, found), (words, said)
        assert harmless(said.out), (words, said.out)
        assert harmless(said.err), (words, said.err)
        assert "\nerror: none" not in said.out + said.err, words
        if "--json" in words:
            json.loads(said.out)


def test_json_output_keeps_names_unchanged(low: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (low / f"{NAME}.rts").write_text(LOW)
    assert main(["fmt", "--check", "--json", f"{NAME}.rts"]) == ExitCode.DIAGNOSTICS
    assert json.loads(capsys.readouterr().out)["files"][0]["file"] == f"{NAME}.rts"


def test_run_header_is_one_escaped_line() -> None:
    fields = dict.fromkeys(FlightPlanView.__struct_fields__, ESCAPES)
    (line,) = plain(FlightPlanView(**fields))  # type: ignore[arg-type]
    assert harmless(line)
    assert "\n" not in line


def test_annotation_is_one_escaped_line() -> None:
    name = f"{ESCAPES}.rts"
    found = Diagnostic(codes.SYNTAX, ESCAPES, Span(name, 0, 1), ESCAPES, pointer=ESCAPES)
    for sources in ({}, {name: Source(name, ESCAPES)}):
        (line,) = github([found], sources).splitlines()
        assert harmless(line)


@pytest.mark.parametrize("character", [*"\x1b\x9b\u202e\u2066\u200b\u00ad\ufe0f\u2028\u3164\x08\r\ufeff", "\U000e0041"])
def test_misleading_source_text_is_refused(character: str) -> None:
    """Also in comments and strings, where the grammar accepts any character."""
    for source in (LOW.replace("only", character), LOW.replace("Low", character), f"x{character}"):
        found = parse(Source("low.rts", source)).diagnostics
        assert [each.code for each in found] == [codes.HIDDEN_CHARACTER]
        assert found[0].span is not None
        assert source[found[0].span.start] == character


def test_a_source_with_white_space_and_other_scripts_is_read() -> None:
    source = "\ufeff" + LOW.replace("only", "nur \u00fcber \u0627\u0644\u062c\u0633\u0631 \t\f").replace("\n", "\r\n")
    assert parse(Source("low.rts", source)).diagnostics == ()


@pytest.mark.parametrize("character", [*ESCAPES.removesuffix("error: none"), "\t"])
def test_a_specification_holds_no_control_character(character: str) -> None:
    if character.isascii() and character.isprintable():
        return
    for written in (json.dumps(character), f'"{character}"'):
        data = PROPOSAL.replace(b'"intent": "', b'"intent": "' + written[1:-1].encode(), 1)
        codes_found = {each.code for each in parse_specification("p.json", data).diagnostics}
        assert codes_found & {codes.HIDDEN_CHARACTER, codes.NOT_JSON}, written


@pytest.mark.parametrize("comment", ["// only 2 m", "/* only 2 m */"])
def test_a_specification_holds_no_comment(comment: str) -> None:
    value = PROPOSAL.replace(b'"altitude": "', f'"altitude": "{comment[:2]} only 2 m {comment[12:]}'.encode(), 1)
    assert value != PROPOSAL
    (found, *_) = parse_specification("p.json", value).diagnostics
    assert "comment" in found.message


def test_escaped_texts_stay_distinct() -> None:
    assert visible("a b\u00e9\u6f22") == "a b\u00e9\u6f22"
    assert visible("a\u202eb\ufe0fc\u2800\n") == "a<U+202E>b<U+FE0F>c<U+2800><U+000A>"
