"""Bindings that were forged, moved to another log, or signed by keys that may not."""

import json
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.bound_run import ROOT, bind_words, run_folder, with_log
from reference.forgery import LOG_KEY
from rtshcua.adapters.store.writing import write_new
from rtshcua.app.autopilot_bindings import read_bindings, trusted_binding
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.wire.autopilot_binding import AutopilotBinding, sign_autopilot_binding
from rtshcua.wire.key_file import dump_signing_key
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted
from virtual import case

STRANGER = SigningKey.from_seed(b"\x77" * 32, duty=Duty.LOG, development=True)


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A run with a binding."""
    run = run_folder(tmp_path / "run")
    assert app.main(bind_words(run, with_log(run))) == ExitCode.OK
    capsys.readouterr()
    return run


def slugs(run: Path, capsys: pytest.CaptureFixture[str]) -> set[str]:
    """What verification says of the bindings; the verdict of the log never changes."""
    assert app.main(["verify-log", "--json", "--root", ROOT, str(run)]) == ExitCode.OK
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "verified"
    shown = {each["slug"] for each in told["proven"]}
    return {each["slug"] for each in told["unproven"] if "autopilot" in each["slug"]} | (shown & {"autopilot"})


def content(run: Path) -> tuple[Path, AutopilotBinding]:
    (found,) = read_bindings(run)
    assert isinstance(found.content, AutopilotBinding)
    return found.path, found.content


def test_any_changed_octet_is_noticed(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, _ = content(run)
    data = path.read_bytes()
    assert slugs(run, capsys) == {"autopilot"}
    for place in range(0, len(data), 23):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        assert slugs(run, capsys) == {"autopilot/untrusted"}
    for cut in (0, 1, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:cut])
        assert slugs(run, capsys) == {"autopilot/untrusted"}
    path.write_bytes(data + bytes(1 << 17))
    assert slugs(run, capsys) == {"autopilot/untrusted"}


def test_better_result_needs_the_log_key(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, binding = content(run)
    path.write_bytes(sign_autopilot_binding(replace(binding, horizontal=0), STRANGER))
    assert slugs(run, capsys) == {"autopilot/untrusted"}


def test_binding_moved_to_another_log(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, binding = content(run)
    other = run_folder(tmp_path / "other", other=True)
    (other / path.name).write_bytes(path.read_bytes())
    (other / binding.file).write_bytes((run / binding.file).read_bytes())
    assert slugs(other, capsys) == {"autopilot/other-log"}


def test_binding_of_a_longer_log(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, binding = content(run)
    for changed in (
        replace(binding, records=binding.records + 1),
        replace(binding, root=bytes(32)),
        replace(binding, genesis=bytes(32)),
    ):
        path.write_bytes(sign_autopilot_binding(changed, LOG_KEY))
        assert slugs(run, capsys) == {"autopilot/other-log"}


def test_binding_of_another_vehicle(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, binding = content(run)
    path.write_bytes(sign_autopilot_binding(replace(binding, vehicle="quad-08"), LOG_KEY))
    assert slugs(run, capsys) == {"autopilot/untrusted"}


def test_swapped_file_is_noticed_and_links_are_not_followed(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, binding = content(run)
    file = run / binding.file
    data = file.read_bytes()
    file.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert slugs(run, capsys) == {"autopilot", "autopilot/changed"}
    file.unlink()
    file.symlink_to("/dev/zero")
    assert slugs(run, capsys) == {"autopilot", "autopilot/missing"}


def test_key_of_a_stranger_binds_nothing(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, binding = content(run)
    path.unlink()
    (run / "log.key").unlink()
    write_new(run / "log.key", dump_signing_key(STRANGER, passphrase=None), mode=0o600)
    assert app.main(bind_words(run, run / binding.file)) == ExitCode.UNTRUSTED
    assert "the key cannot sign for this log" in capsys.readouterr().err
    assert not list(run.glob("*.binding"))


def test_revoked_key_binds_nothing(run: Path) -> None:
    path, binding = content(run)
    root = case.root()[0]
    newer = replace(root, version=2, keys=(), revoked=(LOG_KEY.kid,))
    assert trusted_binding(path.read_bytes(), [root], binding.vehicle) == binding
    with pytest.raises(Untrusted) as refused:
        trusted_binding(path.read_bytes(), [root, newer], binding.vehicle)
    assert refused.value.slug == "revoked-key"


@pytest.mark.parametrize(
    ("wrong", "code"), [({"file": "\x1b[2Ja\n.ulg"}, ExitCode.INPUT), ({"source": "\x1b[1m"}, ExitCode.OK)]
)
def test_control_characters_of_a_binding_reach_no_terminal(
    wrong: dict[str, str], code: ExitCode, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, binding = content(run)
    path.write_bytes(sign_autopilot_binding(replace(binding, **wrong), LOG_KEY))
    assert app.main(["show", str(path)]) == code
    assert app.main(["verify-log", "--root", ROOT, str(run)]) == ExitCode.OK
    told = capsys.readouterr()
    assert "\x1b" not in told.out + told.err
