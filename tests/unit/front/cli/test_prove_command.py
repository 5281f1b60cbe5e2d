"""`rtshcua prove` and `rtshcua verify-proof`: files, output and exit codes."""

import json
from pathlib import Path

import pytest

from reference.proof_mutations import cosigned
from reference.sealed_log import LOG_KEY, PIN, sealed_log
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.writing import write_new
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.wire.key_file import dump_signing_key
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case

LOG = sealed_log()
SIGNED = LOG.signed


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a run, in which the commands are called."""
    (tmp_path / "log.jsonl").write_bytes(b"".join(LOG.lines))
    write_new(tmp_path / "log.key", dump_signing_key(LOG_KEY, passphrase=None), mode=0o600)
    (tmp_path / "root.trust").write_bytes(case.root()[1])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def prove(*words: object) -> int:
    return app.main(["prove", ".", *map(str, words)])


def verify(*words: object, root: object = PIN.hex()) -> int:
    return app.main(["verify-proof", "--root", str(root), *map(str, words)])


def told(capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_a_record_in_and_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert prove(3) == ExitCode.OK
    size = Path("record-3.tlog-proof").stat().st_size
    assert f"wrote `record-3.tlog-proof`: record 3; {size} bytes" in capsys.readouterr().out
    assert size < 8_000
    assert verify("record-3.tlog-proof", root="root.trust") == ExitCode.OK
    out = capsys.readouterr().out
    assert "PROVEN  record-3.tlog-proof" in out
    assert "vehicle  quad 07/é" in out
    assert "detail           goto 3" in out
    assert "record 3 is in the log as signed at 6 records" in out
    assert "Not proven" in out
    assert "complete" not in out
    assert "\033" not in out


def test_proof_verifies_without_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert prove(3, "-o", "p") == ExitCode.OK
    away = tmp_path / "away"
    away.mkdir()
    (tmp_path / "p").rename(away / "p")
    monkeypatch.chdir(away)
    assert verify("p") == ExitCode.OK


def test_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert prove(3, "--json") == ExitCode.OK
    made = told(capsys)
    assert (made["proof"], made["exit_code"]) == ("record-3.tlog-proof", 0)
    assert verify("record-3.tlog-proof", "--json") == ExitCode.OK
    object = told(capsys)
    assert (object["verdict"], object["kind"], object["size"], object["failure"]) == ("proven", "inclusion", 6, None)
    assert object["record"] == json.loads(LOG.lines[3])
    assert object["older"] is None
    assert object["log"] == {
        "origin": f"rtshcua/log/quad%2007%2F%C3%A9/{bytes(range(16)).hex()}",
        "vehicle": "quad 07/é",
        "boot": bytes(range(16)).hex(),
    }


def test_consistency_proof_since_a_signed_record_verifies(capsys: pytest.CaptureFixture[str]) -> None:
    assert prove("--since", SIGNED[1]) == ExitCode.OK
    assert verify(f"since-{SIGNED[1]}.consistency-proof") == ExitCode.OK
    out = capsys.readouterr().out
    assert f"the log of {SIGNED[3]} records begins with the {SIGNED[1]} records that were signed before" in out
    assert prove("--since", 0, "--at", SIGNED[2], "-o", "p") == ExitCode.OK
    capsys.readouterr()
    assert verify("p", "--json") == ExitCode.OK
    object = told(capsys)
    assert (object["kind"], object["size"], object["record"]) == ("consistency", SIGNED[2], None)


def test_a_receipt(capsys: pytest.CaptureFixture[str]) -> None:
    assert prove(3, "--cose", "--log-key", "log.key") == ExitCode.OK
    assert Path("record-3.cose").read_bytes()[:1] == b"\xd2"
    assert verify("record-3.cose") == ExitCode.OK
    assert "is in the log of 6 records" in capsys.readouterr().out
    assert verify("record-3.cose", "--json") == ExitCode.OK
    object = told(capsys)
    assert (object["kind"], object["size"]) == ("receipt", 6)
    assert "checkpoint" not in object


def test_the_close_is_proven_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    last = len(LOG.lines) - 1
    assert prove(last) == ExitCode.OK
    assert verify(f"record-{last}.tlog-proof") == ExitCode.OK
    assert f"record {last} is a signed record" in capsys.readouterr().out
    assert prove(last, "--cose", "--log-key", "log.key") == ExitCode.INPUT
    assert "has no receipt" in capsys.readouterr().err


def test_a_checkpoint_that_somebody_kept(capsys: pytest.CaptureFixture[str]) -> None:
    kept, other = (json.loads(LOG.lines[SIGNED[1]])["checkpoint"], json.loads(LOG.lines[SIGNED[2]])["checkpoint"])
    Path("kept").write_text(kept, encoding="utf-8")
    assert prove("--since", SIGNED[1], "-o", "p") == ExitCode.OK
    assert verify("p", "--checkpoint", "kept") == ExitCode.OK
    assert "the log contains the checkpoint that you kept" in capsys.readouterr().out
    Path("kept").write_text(other, encoding="utf-8")
    assert verify("p", "--checkpoint", "kept") == ExitCode.EVIDENCE
    lines = kept.split("\n")
    lines[2] = json.loads(LOG.lines[SIGNED[2]])["checkpoint"].split("\n")[2]
    Path("kept").write_text("\n".join(lines), encoding="utf-8")
    assert verify("p", "--checkpoint", "kept", "--json") == ExitCode.ANCHOR
    Path("kept").write_text("no checkpoint", encoding="utf-8")
    assert verify("p", "--checkpoint", "kept") == ExitCode.INPUT


def test_several_proofs(capsys: pytest.CaptureFixture[str]) -> None:
    assert prove(1, "-o", "a") == prove(2, "-o", "b") == ExitCode.OK
    Path("c").write_bytes(Path("a").read_bytes().replace(b"index 1", b"index 2"))
    assert verify("a", "b") == ExitCode.OK
    capsys.readouterr()
    assert verify("a", "c", "b") == ExitCode.EVIDENCE
    out = capsys.readouterr().out
    assert (out.count("PROVEN"), out.count("REFUSED")) == (2, 1)
    assert "found     1" in out


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        ([], ExitCode.USAGE, "nothing to prove"),
        ([3, "--since", 0], ExitCode.USAGE, "record 3 and `--since 0` require separate proofs"),
        (["--since", 0, "--cose"], ExitCode.USAGE, "cannot be combined"),
        ([99], ExitCode.INPUT, "the log has no record 99"),
        ([3, "--at", 4], ExitCode.INPUT, "record 4 is not a signed record"),
        ([7, "--at", 6], ExitCode.INPUT, "was signed before record 7"),
        ([3, "--cose"], ExitCode.UNTRUSTED, "holds no keys"),
    ],
)
def test_unprovable_records_are_refused(
    words: list[object], code: ExitCode, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert prove(*words) == code
    assert text in capsys.readouterr().err
    assert prove(*words, "--json") == code
    assert json.loads(capsys.readouterr().out)["exit_code"] == code


def test_proof_includes_cosignatures(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "log.anchors").write_text(f"{cosigned(LOG)}\n", encoding="utf-8")
    assert prove(3, "-o", "p") == prove(8, "-o", "q") == ExitCode.OK
    capsys.readouterr()
    assert verify("p") == ExitCode.OK
    out = capsys.readouterr().out
    assert "witnesses outside the vehicle cosigned this log at 6 records:" in out
    assert "2025-06-15 15:08:20Z" in out
    assert "unanchored" not in out
    assert verify("p", "--json") == ExitCode.OK
    object = told(capsys)
    assert object["anchored"] is True
    assert [witness["time_s"] for witness in object["witnesses"]] == [1_750_000_100]  # type: ignore[attr-defined]
    assert verify("q") == ExitCode.OK  # not witnessed after it
    assert "unanchored" in capsys.readouterr().out


def test_the_nearest_checkpoint_that_witnesses_saw_vouches_for_it(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, last = SIGNED[1], SIGNED[-1]
    assert prove(1, "-o", "bare") == ExitCode.OK
    assert "not anchored: too few witnesses" in capsys.readouterr().out
    (folder / "log.anchors").write_text(f"{cosigned(LOG, last)}\n", encoding="utf-8")
    assert prove(1, "-o", "p") == prove("--since", 0, "-o", "since") == ExitCode.OK
    out = capsys.readouterr().out
    assert "not anchored" not in out
    assert "since`: the records before record 0 have not changed; " in out
    for name, size in (("p", last), ("since", last)):
        assert verify(name, "--json") == ExitCode.OK
        object = told(capsys)
        assert (object["anchored"], object["size"]) == (True, size)
    assert verify("since") == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert "none of them was changed, added or removed" in out
    assert "- records added since record 0, and the contents of records" in out
    assert "that nothing was added" not in out
    assert prove(1, "--at", first, "-o", "at") == ExitCode.OK
    assert "not anchored: too few witnesses cosigned the checkpoint that covers it" in capsys.readouterr().out


def test_prove_overwrites_only_proofs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("log.jsonl", "root.trust", "log.key"):
        before = (folder / name).read_bytes()
        assert prove(3, "-o", name) == ExitCode.USAGE
        assert "exists and is not a proof" in capsys.readouterr().err
        assert (folder / name).read_bytes() == before
    for words in ([3], ["--since", 0], [3, "--cose", "--log-key", "log.key"], [4]):
        assert prove(*words, "-o", "p") == ExitCode.OK
        assert verify("p") == ExitCode.OK


def test_another_log_key(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.LOG, development=True)
    write_new(folder / "other.key", dump_signing_key(other, passphrase=None), mode=0o600)
    assert prove(3, "--cose", "--log-key", "other.key") == ExitCode.EVIDENCE
    assert "has no duty `log`" in capsys.readouterr().err
    assert not (folder / "record-3.cose").exists()


def test_a_log_that_was_changed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = folder / "log.jsonl"
    log.write_bytes(log.read_bytes().replace(b'"token":3', b'"token":4'))
    assert prove(3) == ExitCode.EVIDENCE
    assert "run `rtshcua verify-log`" in capsys.readouterr().err
    log.write_bytes(b"".join(LOG.lines[:5]))
    assert prove(3) == ExitCode.INCOMPLETE
    assert app.main(["prove", "nothing", "1"]) == ExitCode.INPUT
    assert app.main(["prove", "root.trust", "1"]) == ExitCode.INPUT
    log.write_bytes(LOG.lines[0].replace(b'"version":4}', b'"version":3}'))
    assert prove(0) == ExitCode.UNTRUSTED
    log.write_bytes(b"")
    assert prove(0) == ExitCode.INPUT


def test_invalid_arguments_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert prove(3, "-o", "p") == ExitCode.OK
    other = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.ROOT)
    capsys.readouterr()
    assert verify("p", root=other.public.hex()) == ExitCode.UNTRUSTED
    assert "if the flight used another trust root" in capsys.readouterr().out
    assert verify("p", root="p") == ExitCode.UNTRUSTED
    assert app.main(["verify-proof", "p"]) == ExitCode.UNTRUSTED
    assert "no root to trust" in capsys.readouterr().err
    assert verify("log.jsonl") == ExitCode.INPUT
    assert verify("none") == ExitCode.INPUT
    (folder / "receipt").write_bytes(b"\xd2\x84")
    assert verify("receipt") == ExitCode.INPUT


def test_the_key_stores_root_is_the_default(capsys: pytest.CaptureFixture[str]) -> None:
    store = KeyStore(data_folder())
    store.folder.mkdir(parents=True)
    store.root_path.write_bytes(case.root()[1])
    assert prove(3, "-o", "p") == ExitCode.OK
    assert app.main(["verify-proof", "p"]) == ExitCode.OK
    assert "pinned   the development root of your key store" in capsys.readouterr().out
