"""`approve`, `recall`, `replace` and `compile --replaces`, from the command line to the boundary's answer."""

import json
import re
import subprocess
import sys
import tempfile
import threading
import time
from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.low_source import low_source
from rtshcua.adapters.agent_socket import AgentSocket
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.prepared_mission import Subject, after, prepared, unpacked
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.app import main
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.wire.keys import Duty
from rtshcua.wire.receipt import Receipt, decode
from rtshcua.wire.trust import open_root

LOW = low_source()
#: without the inspection; the intent moves every step in its source
SHORTER = LOW.replace("    inspect_area(bridge_a, altitude = 9 m, pattern = perimeter)\n", "    hover(5 s)\n").replace(
    "when a supervisor agrees", "but the supervisor is away today, so only look"
)


#: the flight that `in_force` has
FLIGHT = ("--flight", bytes(16).hex())


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    monkeypatch.chdir(tmp_path)
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["keys", "approver", "owner", "--role", "supervisor"]) == ExitCode.OK
    (tmp_path / "low.rts").write_text(LOW)
    (tmp_path / "shorter.rts").write_text(SHORTER)
    assert main(["compile", "low.rts"]) == ExitCode.OK
    capsys.readouterr()
    return tmp_path


def in_force(bundle: Path) -> Loaded:
    store = KeyStore(data_folder())
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    found = load(
        bundle.read_bytes(), root=root, vehicle="quad-07", now=now(), mode=EnforcementMode.SOFTWARE,
        session_key=bytes(SESSION_KEY_BYTES), flight=bytes(16), peer_is_own_simulator=True,
    )  # fmt: skip
    assert isinstance(found, Loaded)
    return found


def now() -> Now:
    utc_us = time.time_ns() // 1000
    return Now(utc_us, utc_us, 100_000)


def presented(of: Loaded, document: Path) -> Receipt:
    receipt = decode(of.boundary.present(document.read_bytes(), now(), 0))
    assert isinstance(receipt, Receipt)
    return receipt


def test_a_replacement_by_a_key_of_another_root_is_warned_of(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    own = data_folder()
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(here / "other"))
    assert main(["keys", "init"]) == ExitCode.OK
    other = KeyStore(data_folder())
    kid = other.signing_key(Duty.MISSION, whose="operator").kid
    path = other.paths(open_root(other.root(), pinned=other.pin(), now_us=0))[kid]
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(own))
    capsys.readouterr()
    words = ["compile", "shorter.rts", "--replaces", "low.bundle", "--from", "3", *FLIGHT, "--mission-key", str(path)]
    assert main([*words, "--deny-warnings"]) == ExitCode.UNTRUSTED
    assert not (here / "shorter.replacement").exists()
    capsys.readouterr()
    assert main([*words, "--json"]) == ExitCode.OK
    said = capsys.readouterr()
    assert f"does not name this mission key: {kid.hex()}" in json.loads(said.out)["warnings"][0]
    assert said.err.startswith("warning: the trust root of this key store")


def test_from_the_command_line_to_the_boundary(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    of = in_force(here / "low.bundle")
    assert main(["approve", "low.bundle", "--step", "3", "-o", "yes", *FLIGHT]) == ExitCode.OK
    said = capsys.readouterr()
    assert "approved as supervisor" in said.out
    assert re.search(r" along \d+ points, \d+\.\d m in all", said.out + said.err), "who signed chose it"
    assert (here / "yes").stat().st_mode & 0o777 == 0o600
    assert presented(of, here / "yes").granted == 1
    assert main(["compile", "shorter.rts", "--replaces", "low.bundle", "--from", "3", *FLIGHT]) == ExitCode.OK
    assert "4 steps, new from step 3" in capsys.readouterr().out
    assert presented(of, here / "shorter.replacement").slug == "accepted"
    assert [each.contract.name for each in of.bundle.mission.invocations] == ["takeoff", "goto", "hover", "return_home"]
    again = [*FLIGHT, "--replaces", "low.bundle", "--replaces", "shorter.replacement"]
    assert main(["compile", "low.rts", *again, "--from", "3", "-o", "back", "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["replacement"]["from_step_number"] == 3
    assert presented(of, here / "back").slug == "accepted"
    assert presented(of, here / "yes").slug == "other-mission", "what was approved stood there before"
    put = ["--replacement", "shorter.replacement", "--replacement", "back"]
    assert (
        main(["approve", "low.bundle", *put, "--step", "3", "--refuse", "--role", "supervisor", "-o", "no", *FLIGHT])
        == 0
    )
    assert presented(of, here / "no").granted == 0
    for words in (["--policy"], []):
        assert main(["recall", "low.bundle", *words, "-o", "home", *FLIGHT]) == ExitCode.OK
    assert presented(of, here / "home").slug == "accepted"


def test_a_replacement_that_drops_a_phase_is_followed_in_a_log(here: Path) -> None:
    """A kept step may also refer to that phase: it flies, and its log can be explained."""
    two = LOW.replace("  }\n  phase recovery {", "   ").replace(
        "inspect_area(bridge_a, altitude = 9 m, pattern = perimeter)", ""
    )
    (here / "two.rts").write_text(two)
    assert main(["compile", "two.rts", "--replaces", "low.bundle", "--from", "3", *FLIGHT]) == ExitCode.OK
    of, replacement = in_force(here / "low.bundle"), here / "two.replacement"
    assert presented(of, replacement).slug == "accepted"
    before = unpacked((here / "low.bundle").read_bytes(), "low.bundle")
    assert isinstance(before, Subject)
    found = after(before, b64encode(replacement.read_bytes()).decode())
    assert isinstance(found, Subject)
    assert found.mission == of.bundle.mission
    assert [each.invocation for each in found.invocations] == [*of.bundle.mission.invocations]
    wrong = replace(before.mission, name="")
    refused = prepared(before.policy.policy, wrong)
    assert isinstance(refused, Refusal)
    assert "the vehicle would refuse this: the name of the mission is invalid" in refused.text


def test_unsignable_documents_are_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def says(code: ExitCode, words: str, *command: str) -> None:
        assert main(list(command)) == code
        assert words in capsys.readouterr().err

    says(ExitCode.USAGE, "no destination for the answer", "approve", "low.bundle", "--step", "3")
    says(ExitCode.USAGE, "no destination for the recall", "recall", "low.bundle")
    says(ExitCode.USAGE, "the flight of the answer is unknown", "approve", "low.bundle", "--step", "3", "-o", "x")
    says(ExitCode.USAGE, "the flight of the recall is unknown", "recall", "low.bundle", "-o", "x")
    says(ExitCode.USAGE, "the mission has no step 5", "approve", "low.bundle", "--step", "5", "-o", "x")
    says(ExitCode.USAGE, "no `confirm` rule of the policy", "approve", "low.bundle", "--step", "2", "-o", "x")
    (here / "high.rts").write_text(LOW.replace("altitude = 9 m", "altitude = 20 m"))
    assert main(["compile", "high.rts"]) == ExitCode.OK
    capsys.readouterr()
    high = ["approve", "high.bundle", "--step", "3", "-o", "x", *FLIGHT]
    says(ExitCode.USAGE, "no `confirm` rule of the policy applies to step 3", *high)
    says(ExitCode.USAGE, "within 30 s` cannot hold for the step's arguments", *high)
    says(
        ExitCode.USAGE,
        "step 3 requires no confirmation by `operator`",
        "approve",
        "low.bundle",
        "--step",
        "3",
        "--role",
        "operator",
        "-o",
        "x",
    )
    says(ExitCode.USAGE, "for", "approve", "low.bundle", "--step", "3", "--for", "100000", "-o", "x")
    says(ExitCode.INPUT, "no such file", "approve", "nothing.bundle", "--step", "3", "-o", "x")
    says(ExitCode.USAGE, "require each other", "compile", "shorter.rts", "--replaces", "low.bundle")
    says(ExitCode.USAGE, "require each other", "compile", "shorter.rts", "--from", "3")
    says(
        ExitCode.REFUSED,
        "step 3 should be kept",
        "compile",
        "shorter.rts",
        "--replaces",
        "low.bundle",
        "--from",
        "4",
        *FLIGHT,
    )
    says(ExitCode.INPUT, "is not a replacement", "replace", "low.bundle", "--to", "s")
    assert main(["recall", "low.bundle", "-o", "home", *FLIGHT]) == ExitCode.OK
    says(ExitCode.INPUT, "but `rtshcua/recall`", "replace", "home", "--to", "s")
    says(ExitCode.INPUT, "no such file or directory: `s`", "recall", "low.bundle", "--to", "s")
    other = (here / "shorter.rts").read_text().replace("bridge_inspection", "training_field").replace("@7", "@2")
    other = other.replace("    goto(bridge_a.entry, altitude = 9 m)\n", "")
    (here / "other.rts").write_text(other)
    says(
        ExitCode.REFUSED,
        "the policy of the sources differs",
        "compile",
        "other.rts",
        "--replaces",
        "low.bundle",
        "--from",
        "2",
        *FLIGHT,
    )
    damaged = bytearray((here / "low.bundle").read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (here / "damaged.bundle").write_bytes(damaged)
    says(ExitCode.UNTRUSTED, "key", "approve", "damaged.bundle", "--step", "3", "-o", "x")
    says(ExitCode.USAGE, "has 4 steps", "compile", "shorter.rts", "--replaces", "low.bundle", "--from", "100", *FLIGHT)
    assert not (here / "x").exists()
    assert not (here / "other.replacement").exists()


@pytest.mark.parametrize("whose", ["mission-agent", "policy"])
def test_flight_can_be_stopped_after_its_keys_are_revoked(here: Path, whose: str) -> None:
    """The flight continues under its first root, so that an operator may recall and replace in any order."""
    flies, again = in_force(here / "low.bundle"), in_force(here / "low.bundle")
    first = here / "first.trust"
    first.write_bytes(KeyStore(data_folder()).root())
    for _ in range(2):
        assert main(["keys", "replace", whose]) == ExitCode.OK
    answer = ["approve", "low.bundle", "--step", "3", "-o", "answer", *FLIGHT]
    assert main([*answer, "--refuse"]) == ExitCode.OK
    assert presented(flies, here / "answer").granted == 0
    assert main(answer) == ExitCode.UNTRUSTED, "what lets it fly on is signed under the root of today"
    for of, words in ((flies, ()), (again, ("--policy",))):
        assert main(["recall", "low.bundle", "-o", "home", *FLIGHT, *words]) == ExitCode.OK
        assert presented(of, here / "home").slug == "accepted"
    assert main(["recall", "low.bundle", "-o", "home", *FLIGHT, "--root", str(first)]) == ExitCode.OK


@pytest.mark.parametrize("named", [(), ("--root", "now.trust")])
def test_a_bundle_that_no_root_ever_trusted_is_not_recalled(
    here: Path, capsys: pytest.CaptureFixture[str], named: tuple[str, ...]
) -> None:
    assert main(["keys", "revoke", "mission-agent"]) == ExitCode.OK
    (here / "now.trust").write_bytes(KeyStore(data_folder()).root())
    forged = bytearray((here / "low.bundle").read_bytes())
    forged[-1] ^= 1
    (here / "low.bundle").write_bytes(forged)
    capsys.readouterr()
    assert main(["recall", "low.bundle", "-o", "home", *FLIGHT, *named]) == ExitCode.UNTRUSTED
    assert "is revoked by the trust root" in capsys.readouterr().err
    assert not (here / "home").exists()


def test_recall_accepts_the_replaced_key_of_the_flight(here: Path) -> None:
    """The flight began under a root with only the old key."""
    of = in_force(here / "low.bundle")
    assert main(["keys", "replace", "approval-owner-operator"]) == ExitCode.OK
    (old,) = (data_folder() / "keys").glob("revoked-*.key")
    recall = ["recall", "low.bundle", "-o", "home", "--as", "owner", *FLIGHT]
    assert main([*recall, "--approval-key", str(old)]) == ExitCode.OK
    assert presented(of, here / "home").slug == "accepted"


@pytest.mark.parametrize(
    "words",
    [
        "show cut.bundle",
        "why cut.bundle --step 1",
        "run cut.bundle --runs r",
        "doctor --connect udpin:127.0.0.1:14999 cut.bundle",
        "approve cut.bundle --step 3 -o x",
        "recall cut.bundle -o x",
        "compile shorter.rts --replaces cut.bundle --from 2 --flight 00000000000000000000000000000000",
    ],
)
def test_a_bundle_that_was_cut_is_malformed_for_everybody(
    words: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "cut.bundle").write_bytes((here / "low.bundle").read_bytes()[:-100])
    assert main(words.split()) == ExitCode.INPUT
    assert "error[" in capsys.readouterr().err
    assert main([*words.split(), "--json"]) == ExitCode.INPUT
    found = json.loads(capsys.readouterr().out)
    assert "malformed" in (found.get("slug"), found.get("error", {}).get("slug"))


@pytest.fixture
def listening() -> Iterator[Path]:
    """A flight's socket that accepts the first document and refuses later ones, the second as of another mission."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        agents = AgentSocket(Path(name) / "s", lambda: b'{"type":"hello","flight":"' + b"00" * 16 + b'"}\n')
        over = threading.Event()

        def serve() -> None:
            slugs = ["other-mission", "accepted"]
            while not over.wait(0.005):
                event = agents.poll(time.monotonic_ns() // 1000)
                if event is not None:
                    agents.answer(event.sender, slugs.pop() if slugs else "expired", "as it says")

        thread = threading.Thread(target=serve)
        thread.start()
        yield agents.path
        over.set()
        thread.join()
        agents.close()


def test_command_reports_the_answer_of_the_flight(
    here: Path, listening: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    to = ["--to", str(listening)]
    assert main(["approve", "low.bundle", "--step", "3", *to]) == ExitCode.OK
    assert "approved as supervisor for 300 s: step 3" in capsys.readouterr().out
    assert main(["recall", "low.bundle", *to]) == ExitCode.REFUSED
    assert "`--policy` recalls every mission under the policy" in capsys.readouterr().err
    assert main(["recall", "low.bundle", *to, "--json"]) == ExitCode.REFUSED
    said = json.loads(capsys.readouterr().out)
    text = "the flight refused it: as it says (expired)"
    assert (said["slug"], said["text"], said["exit"], said["exit_code"]) == ("expired", text, "refused", 5)
    assert said["error"]["text"] == text
    assert main(["recall", "low.bundle", *to]) == ExitCode.REFUSED
    assert "the flight refused it" in capsys.readouterr().err


def test_a_recall_that_was_signed_before_is_sent_without_a_key(
    here: Path, listening: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["recall", "low.bundle", "-o", "home", *FLIGHT]) == ExitCode.OK
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(here / "empty"))
    send = ["recall", "--send", "home", "--to", str(listening)]
    assert main(send) == ExitCode.OK
    assert "sent `home`: as it says" in capsys.readouterr().out
    assert main(send) == ExitCode.REFUSED
    assert "`--policy` recalls every mission under the policy" in capsys.readouterr().err
    assert main(send) == ExitCode.REFUSED
    assert "sign a new one" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--send", "home"], ExitCode.USAGE, "`--send` requires `--to SOCKET`"),
        (["low.bundle", "--send", "home", "--to", "s"], ExitCode.USAGE, "conflicts with BUNDLE"),
        (["--send", "low.bundle", "--to", "s"], ExitCode.INPUT, ""),
        (["--send", "none", "--to", "s"], ExitCode.INPUT, "no such file or directory: `none`"),
        (["--to", "s"], ExitCode.USAGE, "BUNDLE is missing"),
    ],
)
def test_send_refuses_other_files(
    here: Path, capsys: pytest.CaptureFixture[str], words: list[str], code: ExitCode, said: str
) -> None:
    assert main(["recall", "low.bundle", "-o", "home", *FLIGHT]) == ExitCode.OK
    capsys.readouterr()
    assert main(["recall", *words]) == code
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_operator_follows_and_recalls_a_flight(here: Path, listening: Path) -> None:
    words = [str(Path(sys.executable).with_name("rtshcua")), "operator", "low.bundle", "--to", str(listening), "--json"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as console:
        assert console.stdin is not None
        assert console.stdout is not None
        lines = (json.loads(line) for line in console.stdout)

        def typed(text: str, *events: str) -> None:
            print(text, file=console.stdin, flush=True)
            assert tuple(next(lines)["event"] for _ in events) == events

        assert [next(lines)["event"] for _ in range(2)] == ["following", "ready"]
        typed("fly on", "ready")
        typed("recall", "sent", "accepted")
        typed("policy", "sent", "refused")
        typed("quit", "left")
        assert console.wait(30) == ExitCode.REFUSED, "by the last answer"


def test_operator_without_a_flight_is_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["operator", "low.bundle", "--to", "none"]) == ExitCode.INPUT
    assert "no such file or directory: `none`" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["approver", "bob"], ["mission", "agent", "--policy", "low"]])
def test_a_role_that_no_policy_of_the_project_knows_is_warned_of(
    command: list[str], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["keys", *command, "--role", "nosuch"]) == ExitCode.OK
    said = " ".join(capsys.readouterr().err.split())
    assert "warning: no policy here declares the role `nosuch`; declared roles:" in said
    assert "`supervisor`" in said
    assert main(["keys", *command, "--role", "supervisor"]) == ExitCode.OK
    assert "warning" not in capsys.readouterr().err
    for source in here.glob("*.rts"):
        source.unlink()
    assert main(["keys", *command, "--role", "other"]) == ExitCode.OK
    assert "warning" not in capsys.readouterr().err, "no policy is here: nothing is known"


def test_wrong_role_is_refused_before_the_prompt(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["keys", "approver", "bob", "--role", "nosuch"]) == ExitCode.OK
    monkeypatch.setattr("rtshcua.front.cli.commands.approve.terminal", lambda: True)
    monkeypatch.setattr("typer.confirm", lambda *_, **__: pytest.fail("it was asked"))
    capsys.readouterr()
    words = ["approve", "low.bundle", "--step", "3", "-o", "yes", "--as", "bob", *FLIGHT]
    assert main(words) == ExitCode.USAGE
    said = " ".join(capsys.readouterr().err.split())
    assert "the key of bob may sign as `nosuch`, but not as supervisor" in said
    assert not (here / "yes").exists()
