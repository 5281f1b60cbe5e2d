"""`rtshcua keys`: keys are made once, kept private, and never printed."""

import json
import os
import re
import shlex
import struct
import time
from pathlib import Path

import pytest

from rtshcua.adapters.boundary.home import first_kept
from rtshcua.adapters.store import reading
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import PROPOSERS, KeyStore
from rtshcua.adapters.store.writing import write_new
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app, unlock
from rtshcua.front.cli.commands import keys
from rtshcua.wire import key_file
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import open_root
from rtshcua.wire.untrusted import Untrusted

PASSPHRASE = "correct horse battery"


@pytest.fixture(autouse=True)
def _cheap_guesses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make passphrases cheap to check, because these tests encrypt many keys."""
    monkeypatch.setattr(key_file, "COST", key_file.COSTS[0])


def keys_of(store: KeyStore) -> list[SigningKey]:
    """All signing keys of a store."""
    names = {Duty.MISSION: PROPOSERS, Duty.APPROVAL: ("owner-operator",)}
    whose = [(duty, each) for duty in Duty for each in names.get(duty, ("",))]
    return [store.signing_key(duty, whose=each) for duty, each in whose]


def test_init_makes_a_development_root(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["keys", "init"]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "development root" in out
    for key in keys_of(KeyStore(data_folder())):
        assert key.kid.hex() in out
    assert all(line.isprintable() for line in out.splitlines())


def test_secrets_are_never_printed(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["init"], ["list"], ["list", "--json"], ["show"], ["show", "--json"]):
        assert app.main(["keys", *words]) == ExitCode.OK
    out = capsys.readouterr().out
    store = KeyStore(data_folder())
    for key in keys_of(store):
        assert key.private.private_bytes_raw().hex() not in out
    for path in store.folder.glob("*.key"):
        assert path.read_text().splitlines()[3] not in out


def test_init_twice_changes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["keys", "init"]) == ExitCode.OK
    before = KeyStore(data_folder()).root()
    assert app.main(["keys", "init"]) == ExitCode.INPUT
    assert "keys already" in capsys.readouterr().err
    assert app.main(["keys", "init", "--if-missing"]) == ExitCode.OK
    assert KeyStore(data_folder()).root() == before


def test_list_shows_the_rights_of_each_key(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init", "--days", "2"])
    capsys.readouterr()
    assert app.main(["keys", "list", "--json"]) == ExitCode.OK
    listed = json.loads(capsys.readouterr().out)
    assert listed["expires_at_us"] - listed["issued_at_us"] == 2 * 86_400_000_000
    assert listed["development"] is True
    assert [(key["duty"], key["roles"], key["sources"], key["policies"]) for key in listed["keys"]] == [
        ("root", [], [], []),
        ("policy", [], [], []),
        ("mission", ["operator"], ["agent"], ["*"]),
        ("mission", ["operator"], ["operator"], ["*"]),
        ("approval", ["operator"], ["operator"], []),
        ("log", [], [], []),
        ("witness", [], [], []),
        ("boundary", [], [], []),
    ]
    assert all(Path(key["file"]).is_file() for key in listed["keys"])


def test_a_boundary_key_is_made_for_a_root_without_one(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    store = KeyStore(data_folder())
    made = store.signing_key(Duty.BOUNDARY)
    assert app.main(["keys", "revoke", made.kid.hex()]) == ExitCode.OK
    assert app.main(["keys", "boundary", "--vehicle", "quad-07"]) == ExitCode.OK
    (named,) = open_root(store.root(), pinned=store.pin(), now_us=0).keys_for(Duty.BOUNDARY).values()
    assert named.public == store.signing_key(Duty.BOUNDARY).public != made.public
    assert named.vehicles == ("quad-07",)
    capsys.readouterr()
    app.main(["keys", "list"])
    assert "signs what was decided, on vehicle quad-07" in capsys.readouterr().out


def test_show_gives_the_pin(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    capsys.readouterr()
    assert app.main(["keys", "show"]) == ExitCode.OK
    assert capsys.readouterr().out.strip() == KeyStore(data_folder()).signing_key(Duty.ROOT).public.hex()


@pytest.mark.parametrize("words", [["list"], ["show"]])
def test_without_keys(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["keys", *words]) == ExitCode.INPUT
    err = capsys.readouterr().err
    assert "holds no keys" in err
    assert " help: run `rtshcua keys init` to create a development root" in err


def test_a_damaged_root_is_not_listed(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    root = KeyStore(data_folder()).root_path
    data = root.read_bytes()
    root.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert app.main(["keys", "list"]) == ExitCode.UNTRUSTED
    assert "error[" in capsys.readouterr().err


def test_encrypted_keys_from_a_passphrase_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "passphrase"
    write_new(file, (PASSPHRASE + "\n").encode(), mode=0o600)
    assert app.main(["keys", "init", "--encrypted", "--policy", "field", "--passphrase-file", str(file)]) == ExitCode.OK
    assert "development" not in capsys.readouterr().out
    store = KeyStore(data_folder())
    assert unlock.unlock(store, Duty.LOG, passphrase_file=file).duty is Duty.LOG
    assert unlock.unlock(store, Duty.LOG, path=store.key_path(Duty.LOG), passphrase_file=file).duty is Duty.LOG


@pytest.mark.parametrize(
    "words",
    [
        ["keys", "init", "--encrypted", "--policy", "field", "--passphrase-file"],
        ["keys", "link", "link.key", "--passphrase-file"],
        ["keys", "rotate-root", "--passphrase-file"],
    ],
)
@pytest.mark.parametrize("what", ["0644", "0640", "another user"])
def test_a_passphrase_file_that_others_may_read_is_refused(
    what: str, words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    if words[1] == "rotate-root":
        app.main(["keys", "init"])
    file = tmp_path / "passphrase"
    write_new(file, PASSPHRASE.encode(), mode=int(what, 8) if what[0] == "0" else 0o600)
    if what == "another user":
        monkeypatch.setattr(os, "geteuid", lambda: file.stat().st_uid + 1)
        monkeypatch.setattr(reading, "ROOT", -1)
    capsys.readouterr()
    assert app.main([*words, str(file)]) == ExitCode.UNTRUSTED
    said = capsys.readouterr().err
    assert (f"its mode is {what}" if what[0] == "0" else "it belongs to user") in said
    assert "passphrase" in said
    assert not (tmp_path / "link.key").exists()


def test_a_passphrase_may_come_from_a_pipe() -> None:
    """As in a shell: `--passphrase-file <(pass show drone)`."""
    out, into = os.pipe()
    os.write(into, PASSPHRASE.encode() + b"\n")
    os.close(into)
    try:
        assert unlock.read_passphrase(Path(f"/dev/fd/{out}")) == PASSPHRASE.encode()
    finally:
        os.close(out)


def test_oversized_passphrase_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_new(tmp_path / "book", b"a" * 5_000, mode=0o600)
    words = ["keys", "init", "--encrypted", "--policy", "field", "--passphrase-file", str(tmp_path / "book")]
    assert app.main(words) == ExitCode.UNTRUSTED
    assert "exceeds 4096 bytes" in capsys.readouterr().err


def test_mission_keys_in_earnest_are_for_named_policies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "passphrase"
    write_new(file, PASSPHRASE.encode(), mode=0o600)
    assert app.main(["keys", "init", "--encrypted", "--passphrase-file", str(file)]) == ExitCode.USAGE
    assert "`--policy NAME`" in capsys.readouterr().err
    assert not KeyStore(data_folder()).exists()


def test_short_passphrase_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_new(tmp_path / "short", b"12345678901\n", mode=0o600)
    words = ["keys", "init", "--encrypted", "--policy", "field", "--passphrase-file", str(tmp_path / "short")]
    assert app.main(words) == ExitCode.USAGE
    assert not KeyStore(data_folder()).exists()
    assert "12 characters" in capsys.readouterr().err


def test_no_prompt_without_a_terminal(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(unlock, "getpass", lambda prompt: pytest.fail("asked"))
    monkeypatch.setattr(keys, "getpass", lambda prompt: pytest.fail("asked"))
    assert app.main(["keys", "init", "--encrypted", "--policy", "field"]) == ExitCode.USAGE
    write_new(tmp_path / "passphrase", PASSPHRASE.encode(), mode=0o600)
    app.main(["keys", "init", "--encrypted", "--policy", "field", "--passphrase-file", str(tmp_path / "passphrase")])
    with pytest.raises(Untrusted) as refused:
        unlock.unlock(KeyStore(data_folder()), Duty.LOG)
    assert refused.value.slug == "passphrase-needed"


class Terminal:
    """A standard input that is a terminal."""

    def isatty(self) -> bool:
        return True


def test_at_a_terminal_the_passphrase_is_typed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", Terminal())
    typed = iter([PASSPHRASE, "another one, mistyped", PASSPHRASE, PASSPHRASE, PASSPHRASE])
    for module in (keys, unlock):
        monkeypatch.setattr(module, "getpass", lambda prompt: next(typed))
    assert app.main(["keys", "init", "--encrypted", "--policy", "field"]) == ExitCode.USAGE
    assert app.main(["keys", "init", "--encrypted", "--policy", "field"]) == ExitCode.OK
    assert unlock.unlock(KeyStore(data_folder()), Duty.LOG).duty is Duty.LOG


def test_keys_stay_where_only_their_owner_reads(capsys: pytest.CaptureFixture[str]) -> None:
    before = os.umask(0)
    try:
        app.main(["keys", "init"])
    finally:
        os.umask(before)
    folder = KeyStore(data_folder()).folder
    assert {path.stat().st_mode & 0o077 for path in (folder, *folder.iterdir())} == {0}


def test_an_approver_is_a_person_in_a_role(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init", "--approver", "eve"])
    assert app.main(["keys", "approver", "ada", "--role", "supervisor", "--vehicle", "quad-07"]) == ExitCode.OK
    assert "ada in person as supervisor, on vehicle quad-07" in capsys.readouterr().out
    store = KeyStore(data_folder())
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    assert root.version == 2
    key = store.signing_key(Duty.APPROVAL, whose="ada-supervisor")
    named = root.keys_for(Duty.APPROVAL)[key.kid]
    assert (named.person, named.roles, named.sources) == ("ada", ("supervisor",), ("operator",))
    assert store.paths(root)[key.kid].stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["ada", "--role", "supervisor"], ExitCode.UNTRUSTED),  # there is one already
        (["Ada", "--role", "pilot"], ExitCode.USAGE),
        (["../ada", "--role", "pilot"], ExitCode.USAGE),
        (["ada", "--role", "*"], ExitCode.USAGE),
        (["ada", "--role", "../pilot"], ExitCode.USAGE),
    ],
)
def test_invalid_approver_is_refused(words: list[str], code: ExitCode, capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    app.main(["keys", "approver", "ada", "--role", "supervisor"])
    store = KeyStore(data_folder())
    before = (store.root(), sorted(store.folder.iterdir()))
    assert app.main(["keys", "approver", *words]) == code
    assert (store.root(), sorted(store.folder.iterdir())) == before


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["approver", "a/b", "--role", "pilot"], "`a/b` is not a valid name of a person"),
        (["mission", "agent", "--role", "a/b", "--policy", "field"], "`a/b` is not a valid role name"),
        (["mission", "agent", "--role", "pilot", "--policy", "a b"], "`a b` is not a valid policy name"),
        (["init", "--encrypted", "--policy", "field", "--approver", "A"], "`A` is not a valid name of a person"),
        (["init", "--encrypted", "--policy", "a b"], "`a b` is not a valid policy name"),
        (["init", "--role", ""], "`` is not a valid role name"),
    ],
)
def test_invalid_name_is_refused_before_the_passphrase_prompt(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keys, "_new_passphrase", lambda _: pytest.fail("too early"))
    monkeypatch.setattr(keys, "unlock", lambda *_, **__: pytest.fail("too early"))
    assert app.main(["keys", *words]) == ExitCode.USAGE
    assert says in capsys.readouterr().err


def test_added_mission_key_is_limited_to_its_names(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    words = ["keys", "mission", "agent", "--role", "surveyor", "--policy", "field", "--json"]
    capsys.readouterr()
    assert app.main(words) == ExitCode.OK
    made = json.loads(capsys.readouterr().out)["keys"][-1]
    assert (made["sources"], made["roles"], made["policies"]) == (["agent"], ["surveyor"], ["field"])
    assert Path(made["file"]).name == "mission-agent-2.key"
    assert app.main(["keys", "mission", "reflex", "--role", "r", "--policy", "p"]) == ExitCode.USAGE


@pytest.mark.slow
def test_keys_in_earnest_are_added_under_passphrases(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, own = tmp_path / "first", tmp_path / "own"
    write_new(first, PASSPHRASE.encode(), mode=0o600)
    write_new(own, b"another long passphrase", mode=0o600)
    app.main(["keys", "init", "--encrypted", "--policy", "field", "--passphrase-file", str(first)])
    words = ["keys", "approver", "ada", "--role", "supervisor"]
    assert app.main([*words, "--passphrase-file", str(first)]) == ExitCode.USAGE
    assert app.main([*words, "--own-passphrase-file", str(own), "--passphrase-file", str(own)]) == ExitCode.UNTRUSTED
    assert app.main([*words, "--own-passphrase-file", str(own), "--passphrase-file", str(first)]) == ExitCode.OK
    store = KeyStore(data_folder())
    assert store.signing_key(Duty.APPROVAL, whose="ada-supervisor", passphrase=own.read_bytes()).duty is Duty.APPROVAL


def test_approval_key_is_selected_by_person(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    store = KeyStore(data_folder())
    assert unlock.unlock_person(store, None, None).kid == store.signing_key(Duty.APPROVAL, whose="owner-operator").kid
    app.main(["keys", "approver", "ada", "--role", "supervisor"])
    ada = store.signing_key(Duty.APPROVAL, whose="ada-supervisor")
    assert unlock.unlock_person(store, "ada", None).kid == ada.kid
    assert unlock.unlock_person(store, None, "supervisor").kid == ada.kid
    for person, role, slug in ((None, None, "several-approvers"), ("ada", "operator", "no-approver")):
        with pytest.raises(Untrusted) as refused:
            unlock.unlock_person(store, person, role)
        assert refused.value.slug == slug


def listed(capsys: pytest.CaptureFixture[str]) -> dict[str, list[str]]:
    """The ids of the keys by duty, and the revoked ones."""
    capsys.readouterr()
    assert app.main(["keys", "list", "--json"]) == ExitCode.OK
    told = json.loads(capsys.readouterr().out)
    found: dict[str, list[str]] = {"revoked": told["revoked"]}
    for key in told["keys"]:
        found.setdefault(key["duty"], []).append(key["kid"])
        assert Path(key["file"]).is_file()
    return found


def test_a_key_is_revoked_by_id_by_its_first_digits_or_by_its_file(capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init", "--witnesses", "3"])
    app.main(["keys", "approver", "ada", "--role", "supervisor"])
    before = listed(capsys)
    first, second, third = before["witness"]
    assert app.main(["keys", "revoke", first, second[:8], "approval-ada-supervisor"]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "rtshcua keys accept" in out
    after = listed(capsys)
    assert after["witness"] == [third]
    assert after["approval"] == before["approval"][:1]
    assert set(after["revoked"]) == {first, second, before["approval"][1]}
    store = KeyStore(data_folder())
    assert store.signing_key(Duty.WITNESS).kid.hex() == third, "its file follows its number"
    assert app.main(["keys", "revoke", "witness"]) == ExitCode.OK, "the name is that of the third now"
    assert listed(capsys).get("witness") is None
    assert [open_root(each, pinned=store.pin(), now_us=0).version for each in store.chain()] == [1, 2, 3, 4]
    store.earlier_path(2).unlink()
    assert len(store.chain()) == 2, "what lies before a gap leads nowhere"


@pytest.mark.slow
def test_a_key_is_replaced_by_one_with_its_bounds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "passphrase"
    write_new(file, PASSPHRASE.encode(), mode=0o600)
    words = ["--passphrase-file", str(file)]
    app.main(["keys", "init", "--encrypted", "--policy", "field", *words])
    store = KeyStore(data_folder())
    (old,) = (key for key in open_root(store.root(), pinned=store.pin(), now_us=0).keys if key.duty is Duty.APPROVAL)
    assert app.main(["keys", "replace", "approval-owner-operator", *words]) == ExitCode.USAGE, (
        "and none for the new one"
    )
    assert listed(capsys)["revoked"] == []
    assert app.main(["keys", "replace", old.kid.hex(), *words, "--own-passphrase-file", str(file)]) == ExitCode.OK
    (new,) = (key for key in open_root(store.root(), pinned=store.pin(), now_us=0).keys if key.duty is Duty.APPROVAL)
    assert new.public != old.public
    assert (new.person, new.roles, new.sources, new.vehicles) == (old.person, old.roles, old.sources, old.vehicles)
    assert listed(capsys)["revoked"] == [old.kid.hex()]
    assert unlock.unlock_person(store, "owner", "operator", passphrase_file=file).kid == new.kid
    assert app.main(["keys", "rotate-root", *words]) == ExitCode.USAGE
    assert app.main(["keys", "rotate-root", *words, "--own-passphrase-file", str(file)]) == ExitCode.OK
    assert unlock.unlock(store, Duty.ROOT, passphrase_file=file).kid == store.pin()


def test_an_expired_root_is_renewed_by_another_root_key(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    app.main(["keys", "init", "--days", "1"])
    now_us = time.time_ns() + 2 * 86_400 * 10**9
    monkeypatch.setattr(time, "time_ns", lambda: now_us)
    assert app.main(["keys", "revoke", "log"]) == ExitCode.UNTRUSTED
    assert "expired" in capsys.readouterr().err
    assert app.main(["keys", "rotate-root", "--days", "3"]) == ExitCode.OK
    assert app.main(["keys", "replace", "log"]) == ExitCode.OK


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["revoke"], "KEY is missing"),
        (["revoke", "root"], "rotate-root"),
        (["replace", "root"], "rotate-root"),
        (["revoke", "0123456789"], "is not a key of the trust root"),
        (["replace", "nobody"], "is not a key of the trust root"),
        (["revoke", "--link", "0123"], "no such file"),
        (["revoke", "--link", "no.key"], "is not a link key"),
    ],
)
def test_unknown_keys_are_not_revoked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("no.key").touch(0o600)
    app.main(["keys", "init"])
    assert app.main(["keys", *words]) == (ExitCode.INPUT if "no such" in text else ExitCode.USAGE)
    assert text in capsys.readouterr().err
    assert not KeyStore(data_folder()).earlier_path(1).exists()


def test_accept_prints_the_accepted_root(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    app.main(["keys", "revoke", "witness"])
    root = str(KeyStore(data_folder()).root_path)
    capsys.readouterr()
    accept = ["keys", "accept", root, "--vehicle", "quad-07", "--state-dir", str(tmp_path)]
    assert app.main(accept) == ExitCode.OK
    assert "trust root version 2 is in force on `quad-07`" in capsys.readouterr().out
    assert app.main([*accept, "--json"]) == ExitCode.OK
    told = json.loads(capsys.readouterr().out)
    assert (told["vehicle"], told["version"], len(told["revoked"])) == ("quad-07", 2, 1)
    (tmp_path / "trust").rename(tmp_path / "away")
    (tmp_path / "trust").mkdir()
    (tmp_path / "trust" / "vehicle-quad-07").mkdir()
    assert app.main(accept) == ExitCode.INPUT
    assert "not a regular file" in capsys.readouterr().err
    damaged = tmp_path / "damaged.trust"
    damaged.write_bytes(b"nothing")
    accept[2] = str(damaged)
    (tmp_path / "trust" / "vehicle-quad-07").rmdir()
    assert app.main(accept) == ExitCode.INPUT
    assert capsys.readouterr().err.startswith(f"error[root-malformed]: `{damaged}` is no trust root: ")


def test_list_shows_files_and_version_and_revoking_twice_fails(
    capsys: pytest.CaptureFixture[str],
) -> None:
    app.main(["keys", "init"])
    app.main(["keys", "approver", "ada", "--role", "supervisor"])
    told = capsys.readouterr().out
    assert "  version  2\n" in told
    assert re.search(r"approval  [0-9a-f]{32}  approval-ada-supervisor\.key  ada in person", told)
    gone = listed(capsys)["approval"][-1]
    assert app.main(["keys", "revoke", gone]) == ExitCode.OK
    hint = capsys.readouterr().out.splitlines()[-1]
    assert re.search(r"accept \S+/root-1\.trust \S+/root-2\.trust \S+/root\.trust --vehicle", hint)
    assert app.main(["keys", "revoke", gone[:8]]) == ExitCode.USAGE
    assert f"`{gone[:8]}` is already revoked" in capsys.readouterr().err
    assert app.main(["keys", "revoke", "--link", "0" * 16]) == ExitCode.OK
    assert app.main(["keys", "revoke", "--link", "0" * 16]) == ExitCode.USAGE
    assert "is already revoked" in capsys.readouterr().err


# ---------------------------------------------------------------- a folder for a boundary that listens


def provisioned(capsys: pytest.CaptureFixture[str], folder: Path, *words: str) -> tuple[int, str]:
    """The exit code, and the slug of a refusal."""
    capsys.readouterr()
    code = app.main(["keys", "provision", str(folder), "--vehicle", "quad-07", "--json", *words])
    told = capsys.readouterr()
    return code, "" if code == ExitCode.OK else json.loads(told.out)["error"]["slug"]


def first_of(folder: Path) -> tuple[int, bytes]:
    """The time from which a folder opens missions, and its boundary."""
    data = (folder / "quad-07" / "kept").read_bytes()
    since_us, public = struct.unpack_from("<q32s", data, 8)
    assert data == first_kept(since_us, public)
    return since_us, public


def test_a_folder_is_provisioned_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A second folder does not know the opened bundles of the first, so it needs an extra option and another key."""
    app.main(["keys", "init"])
    store, begun_us = KeyStore(data_folder()), time.time_ns() // 1_000
    key = store.signing_key(Duty.BOUNDARY)
    assert provisioned(capsys, tmp_path / "one") == (ExitCode.OK, "")
    since_us, public = first_of(tmp_path / "one")
    assert since_us >= begun_us
    assert public == key.public
    assert provisioned(capsys, tmp_path / "two") == (ExitCode.REFUSED, "provisioned-before")
    assert provisioned(capsys, tmp_path / "two", "--again") == (ExitCode.REFUSED, "same-instance")
    assert not (tmp_path / "two").exists()
    assert app.main(["keys", "replace", key.kid.hex()[:8]]) == ExitCode.OK
    assert provisioned(capsys, tmp_path / "two") == (ExitCode.REFUSED, "provisioned-before")
    assert provisioned(capsys, tmp_path / "two", "--again") == (ExitCode.OK, "")
    later_us, other = first_of(tmp_path / "two")
    assert later_us > since_us
    assert other != public, "the trust root names another boundary, and revokes the one before"


@pytest.mark.parametrize("data", [b"", b"nonsense\n"])
def test_damaged_provisioning_record_is_reported(
    data: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    app.main(["keys", "init"])
    assert provisioned(capsys, tmp_path / "one") == (ExitCode.OK, "")
    (data_folder() / "provisioned" / "vehicle-quad-07").write_bytes(data)
    assert provisioned(capsys, tmp_path / "two") == (ExitCode.REFUSED, "provisioned-before")


def test_list_fits_a_terminal_and_commands_can_be_pasted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert app.main(["keys", "init"]) == ExitCode.OK
    said = capsys.readouterr().out
    heading, beneath = said[said.index("  duty") :].splitlines()[:2]
    assert heading.split() == ["duty", "key", "file"]
    assert beneath.strip() == "may sign for"
    assert "\n            role operator through operator, under any policy, on any vehicle\n" in said
    assert app.main(["keys", "approver", "owner", "--role", "supervisor"]) == ExitCode.OK
    said = capsys.readouterr().out
    typed = said[said.index("  rtshcua keys accept") :]
    assert [line for line in typed.splitlines()[:-1] if not line.endswith(" \\")] == []
    words = shlex.split(typed.replace("\\\n", ""))  # as a shell joins lines
    assert words[:3] == ["rtshcua", "keys", "accept"]
    assert words[-2:] == ["--vehicle", "IDENTITY"]
    assert all(Path(each).exists() for each in words[3:-2])
    monkeypatch.setenv("COLUMNS", "400")
    assert app.main(["keys", "list"]) == ExitCode.OK
    assert re.search(r"  duty +key +file +may sign for\n", capsys.readouterr().out)
