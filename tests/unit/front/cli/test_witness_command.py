"""`rtshcua witness` with files, and the keys of witnesses."""

import json
import os
import shutil
import signal
import time
from pathlib import Path

import pytest

from reference.witnessed import Log
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.logs import read_anchors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.log_writer import Recorder, origin_of
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Anchors
from rtshcua.front.cli import app
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import open_root

BOOT = bytes(16)
ORIGIN = origin_of("quad-07", BOOT.hex())


class Flown:
    """A log of the key store's log key."""

    def __init__(self, path: Path, log_key: SigningKey, seed: int = 0) -> None:
        self.path, self.at = path, 0
        seeds = iter(range(seed, 256))
        self.recorder = Recorder(
            lambda text: log_key.sign(text, duty=Duty.LOG), log_key.public, lambda: bytes([next(seeds)]) * 32
        )
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(
            self.recorder.genesis(
                self.now(), bundle=b"b", root=b"r", boot=BOOT, vehicle="quad-07", mission="m", mode="software"
            )
        )

    def now(self) -> Now:
        self.at += 1_000
        return Now(self.at, time.time_ns() // 1_000, 0)

    def epoch(self, event: str = "said", *, close: bool = False) -> None:
        lines = [self.recorder.effect(self.now(), event) for _ in range(3)]
        end = self.recorder.close(self.now(), ending="x", tlog=None) if close else self.recorder.seal(self.now())
        with self.path.open("ab") as file:
            file.write(b"".join([*lines, end]))

    @property
    def count(self) -> int:
        return self.recorder.count


@pytest.fixture
def store(capsys: pytest.CaptureFixture[str]) -> KeyStore:
    assert app.main(["keys", "init", "--witnesses", "3", "--witness-threshold", "2"]) == ExitCode.OK
    assert "2 witnesses must cosign a record for it to be anchored" in capsys.readouterr().out
    return KeyStore(data_folder())


@pytest.fixture
def flown(tmp_path: Path, store: KeyStore) -> Flown:
    flown = Flown(tmp_path / "run" / "log.jsonl", store.signing_key(Duty.LOG))
    flown.epoch()
    return flown


def said(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def anchored(flown: Flown, store: KeyStore) -> AnchoredExtent:
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    held = Anchors(ORIGIN, root.witnesses("quad-07", time.time_ns() // 1_000), root.witness_threshold)
    for note in read_anchors(flown.path):
        assert held.anchor(note) is None
    for line in flown.path.read_bytes().splitlines():
        if checkpoint := json.loads(line).get("checkpoint"):
            assert held.checkpoint(checkpoint) is None
    found = held.finish(flown.count)
    assert isinstance(found, AnchoredExtent)
    return found


def test_the_keys_of_witnesses(store: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["keys", "list", "--json"]) == ExitCode.OK
    (listed,) = said_whole(capsys)
    keys = [key for key in listed["keys"] if key["duty"] == "witness"]  # type: ignore[union-attr, attr-defined]
    assert [Path(key["file"]).name for key in keys] == ["witness.key", "witness-2.key", "witness-3.key"]
    assert all(Path(key["file"]).is_file() for key in keys)
    assert listed["witness_threshold"] == 2
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    assert len(root.witnesses("any", 0)) == 3
    assert app.main(["show", str(store.root_path)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "what 2 witnesses cosigned" in out
    assert "cosigns logs of any vehicle" in out


def said_whole(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    return [json.loads(capsys.readouterr().out)]


def test_a_threshold_above_the_witnesses(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--witness-threshold", "2"], ["--witnesses", "3", "--witness-threshold", "4"]):
        assert app.main(["keys", "init", *words]) == ExitCode.USAGE
        assert "exceeds `--witnesses" in capsys.readouterr().err
    assert app.main(["keys", "init", "--witnesses", "0"]) == ExitCode.OK
    assert not KeyStore(data_folder()).key_path(Duty.WITNESS).exists()
    assert app.main(["witness", str(data_folder())]) == ExitCode.INPUT


def test_two_witnesses_by_file(flown: Flown, store: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["witness", str(flown.path)]) == ExitCode.OK
    assert capsys.readouterr().out == f"{flown.path}: cosigned 5 of 5 records\n"
    assert anchored(flown, store)[:2] == (0, 5)
    second = ["witness", str(flown.path.parent), "--key", str(store.key_path(Duty.WITNESS, 2)), "--json"]
    assert app.main(second) == ExitCode.OK
    assert said(capsys) == [{"event": "cosigned", "log": str(flown.path), "records": 5, "anchored": 5, "fresh": True}]
    assert anchored(flown, store)[:2] == (5, 0)
    flown.epoch(close=True)
    for words in (["witness", str(flown.path)], second):
        assert app.main(words) == ExitCode.OK
    assert anchored(flown, store)[:2] == (9, 0)
    capsys.readouterr()
    size = flown.path.with_suffix(".anchors").stat().st_size
    assert app.main(second) == ExitCode.OK
    assert said(capsys)[0]["fresh"] is False
    assert flown.path.with_suffix(".anchors").stat().st_size == size


def test_anchors_that_were_lost_are_made_again(flown: Flown, store: KeyStore) -> None:
    for number in (1, 2):
        app.main(["witness", str(flown.path), "--key", str(store.key_path(Duty.WITNESS, number))])
    flown.path.with_suffix(".anchors").unlink()
    for number in (1, 2):
        app.main(["witness", str(flown.path), "--key", str(store.key_path(Duty.WITNESS, number))])
    assert anchored(flown, store)[:2] == (5, 0)


def test_a_log_that_was_cut(flown: Flown, capsys: pytest.CaptureFixture[str]) -> None:
    lines = flown.path.read_bytes().splitlines(keepends=True)
    app.main(["witness", str(flown.path)])
    capsys.readouterr()
    flown.path.write_bytes(b"".join(lines[:3]))
    assert app.main(["witness", str(flown.path), "--json"]) == ExitCode.ANCHOR
    (told,) = said(capsys)
    assert (told["event"], told["slug"], told["contradiction"]) == ("refused", "anchor/beyond", True)


def test_a_log_that_was_written_anew(
    flown: Flown, store: KeyStore, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A holder of the log key rewrote it: the witness keeps the note that shows it."""
    app.main(["witness", str(flown.path)])
    other = Flown(tmp_path / "other" / "log.jsonl", store.signing_key(Duty.LOG))
    other.epoch("landed")
    capsys.readouterr()
    assert app.main(["witness", str(other.path), "--json"]) == ExitCode.ANCHOR
    (told,) = said(capsys)
    assert (told["slug"], told["contradiction"]) == ("witness/409", True)
    note = Path(str(told["proof"])).read_text()
    assert note in [json.loads(line).get("checkpoint") for line in other.path.read_bytes().splitlines()]
    assert not read_anchors(other.path)
    assert app.main(["witness", str(other.path)]) == ExitCode.ANCHOR
    assert "; proof: " in capsys.readouterr().out


def test_log_that_differs_from_its_signature_is_not_cosigned(flown: Flown, capsys: pytest.CaptureFixture[str]) -> None:
    flown.path.write_bytes(flown.path.read_bytes().replace(b'"said"', b'"sand"'))
    assert app.main(["witness", str(flown.path)]) == ExitCode.EVIDENCE
    assert "not cosigned: record 4: the checkpoint does not match the records before it" in capsys.readouterr().out


def test_a_log_of_a_key_that_the_root_does_not_name(tmp_path: Path, store: KeyStore) -> None:
    stranger = Flown(tmp_path / "x" / "log.jsonl", SigningKey.from_seed(b"x" * 32, duty=Duty.LOG))
    assert app.main(["witness", str(stranger.path)]) == ExitCode.EVIDENCE


def test_a_witness_that_the_root_does_not_name(
    flown: Flown, store: KeyStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(store.key_path(Duty.WITNESS), tmp_path / "old.key")
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(tmp_path / "other"))
    app.main(["keys", "init"])
    words = ["witness", str(flown.path), "--key", str(tmp_path / "old.key"), "--json"]
    capsys.readouterr()
    assert app.main(words) == ExitCode.UNTRUSTED
    assert said(capsys)[0]["error"]["slug"] == "unknown-key"  # type: ignore[index]
    assert app.main([*words[:-1], "--root", str(store.root_path)]) == ExitCode.OK


def test_two_processes(flown: Flown, capsys: pytest.CaptureFixture[str]) -> None:
    from rtshcua.adapters.store.witness import WitnessStore

    held = WitnessStore(state_folder(), KeyStore(data_folder()).signing_key(Duty.WITNESS))
    assert app.main(["witness", str(flown.path)]) == ExitCode.REFUSED
    err = capsys.readouterr().err
    assert "another process cosigns" in err
    assert "help: stop the other process, or use a different witness key with `--key`" in err
    assert app.main(["witness", str(flown.path), "--json"]) == ExitCode.REFUSED
    assert said(capsys)[0]["error"]["slug"] == "in-use"  # type: ignore[index]
    held.close()


@pytest.mark.parametrize(
    "words",
    [[], ["--watch", "1"], ["--connect", "nowhere"], ["--connect", "udpout:127.0.0.1:15000"]],
)
def test_invalid_options_are_refused(words: list[str], store: KeyStore) -> None:
    assert app.main(["witness", *words]) == ExitCode.USAGE


def test_without_keys_or_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["witness", str(tmp_path)]) == ExitCode.UNTRUSTED
    assert "`rtshcua keys init`" in capsys.readouterr().err
    app.main(["keys", "init"])
    assert app.main(["witness", str(tmp_path / "none")]) == ExitCode.INPUT


def test_a_folder_is_watched(
    flown: Flown, store: KeyStore, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    turns = iter(range(3))

    def sleep(seconds: float) -> None:
        assert seconds == 0.5
        turn = next(turns, None)
        if turn is None:
            signal.raise_signal(signal.SIGTERM)
        if turn == 1:
            flown.epoch()
            os.utime(flown.path)

    monkeypatch.setattr(time, "sleep", sleep)
    assert app.main(["witness", str(flown.path.parent), "--watch", "0.5", "--json"]) == ExitCode.OK
    assert [each["anchored"] for each in said(capsys)] == [5, 9]


def test_a_port_that_is_taken(store: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", 0))
        port = holder.getsockname()[1]
        assert app.main(["witness", "--connect", f"udpin:127.0.0.1:{port}"]) == ExitCode.LINK
    assert "cannot listen" in capsys.readouterr().err


def test_a_survey_needs_a_log(tmp_path: Path, store: KeyStore) -> None:
    (tmp_path / "x.jsonl").write_text("junk\n")
    assert app.main(["witness", str(tmp_path)]) == ExitCode.EVIDENCE
    assert Log().lines  # the shared log is another vehicle's, and of another key
    (tmp_path / "x.jsonl").write_bytes(b"".join(Log().lines))
    assert app.main(["witness", str(tmp_path)]) == ExitCode.EVIDENCE


def test_unreadable_log_does_not_delay_the_others(
    flown: Flown, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A user who may add files to the watched folder must not be able to end the watch."""
    (tmp_path / "a.jsonl").mkdir()
    (tmp_path / "b.jsonl").symlink_to("b.jsonl")
    os.mkfifo(tmp_path / "c.jsonl")
    (tmp_path / "d.jsonl").symlink_to(tmp_path / "nowhere")
    turns = iter(range(2))

    def sleep(_: float) -> None:
        if next(turns, None) is None:
            signal.raise_signal(signal.SIGTERM)
        (tmp_path / "b.jsonl").unlink(missing_ok=True)

    monkeypatch.setattr(time, "sleep", sleep)
    assert app.main(["witness", str(tmp_path), "--watch", "0.5", "--json"]) == ExitCode.OK
    told = [(Path(str(each["log"])).name, each["event"], each.get("text")) for each in said(capsys)]
    assert [each[:2] for each in told] == [("b.jsonl", "unread"), ("c.jsonl", "unread"), ("log.jsonl", "cosigned")]
    assert told[1][2] == "not a regular file"
    assert app.main(["witness", str(tmp_path)]) == ExitCode.INPUT
    assert f"{tmp_path / 'c.jsonl'}: cannot be read: not a regular file" in capsys.readouterr().out
    assert app.main(["witness", str(tmp_path / "c.jsonl")]) == ExitCode.INPUT


def test_log_with_unwritten_anchors_is_tried_again(
    flown: Flown, store: KeyStore, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    beside = flown.path.with_suffix(".anchors")
    beside.mkdir()
    turns = iter(range(2))

    def sleep(_: float) -> None:
        if next(turns, None) is None:
            signal.raise_signal(signal.SIGTERM)
        elif beside.is_dir():
            beside.rmdir()

    monkeypatch.setattr(time, "sleep", sleep)
    assert app.main(["witness", str(flown.path), "--watch", "0.5", "--json"]) == ExitCode.OK
    assert [each["event"] for each in said(capsys)] == ["unread", "cosigned"]
    assert beside.is_file()


def test_altered_cosigned_record_is_detected(
    flown: Flown, store: KeyStore, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The lines before the seal are the same, the seal is not; both logs go on from there with the same key."""
    other = tmp_path / "other" / "log.jsonl"
    other.parent.mkdir()
    lines = flown.path.read_bytes().splitlines(keepends=True)
    genesis = json.loads(lines[0])
    app.main(["witness", str(flown.path)])
    capsys.readouterr()
    again = Flown(other, store.signing_key(Duty.LOG))
    again.epoch()
    assert json.loads(other.read_bytes().splitlines()[0])["next_key"] == genesis["next_key"]
    again.epoch()
    assert app.main(["witness", str(other), "--json"]) == ExitCode.ANCHOR
    (told,) = said(capsys)
    assert (told["slug"], told["contradiction"]) == ("witness/409", True)
    assert told["proof"] is not None


def test_a_folder_without_logs(tmp_path: Path, store: KeyStore, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["witness", str(tmp_path)]) == ExitCode.INPUT
    assert f"no logs found in `{tmp_path}`" in capsys.readouterr().err
    assert app.main(["witness", str(tmp_path), "--json"]) == ExitCode.INPUT
    assert said(capsys)[0]["error"]["slug"] == "input"  # type: ignore[index]


def test_a_request_to_stop_ends_a_witness_as_ctrl_c_does(
    flown: Flown, store: KeyStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(time, "sleep", lambda _: signal.raise_signal(signal.SIGTERM))
    assert app.main(["witness", str(flown.path.parent), "--watch", "0.5"]) == ExitCode.OK
    assert signal.getsignal(signal.SIGTERM) is before


def test_data_after_the_close_is_not_cosigned(flown: Flown, capsys: pytest.CaptureFixture[str]) -> None:
    flown.epoch(close=True)
    data = flown.path.read_bytes()
    flown.path.write_bytes(data + b"\n")
    assert app.main(["witness", str(flown.path)]) == ExitCode.EVIDENCE
    assert "not cosigned: record 9:" in capsys.readouterr().out
    flown.path.write_bytes(data)
    assert app.main(["witness", str(flown.path)]) == ExitCode.OK


def test_links_that_others_put_into_the_folder_are_not_followed(
    flown: Flown, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Such links must not make us append anchors to our own files, or read them."""
    (tmp_path / "victim").write_text("mine")
    flown.path.with_suffix(".anchors").symlink_to(tmp_path / "victim")
    assert app.main(["witness", str(flown.path.parent)]) != ExitCode.OK
    assert (tmp_path / "victim").read_text() == "mine"
    (tmp_path / "dropped").mkdir()
    (tmp_path / "dropped" / "log.jsonl").symlink_to(flown.path)
    capsys.readouterr()
    assert app.main(["witness", str(tmp_path / "dropped")]) == ExitCode.INPUT
    assert "log.jsonl: cannot be read: symbolic links are not followed here" in capsys.readouterr().out
    assert app.main(["witness", str(tmp_path / "dropped" / "log.jsonl")]) == ExitCode.OK
