"""Files that are not what a command takes: pipes for sources, pages for bundles, logs, proofs and keys."""

import os
from pathlib import Path

import pytest

from rtshcua.adapters.store.keystore import KeyStoreError, read_key
from rtshcua.adapters.store.signing import LinkKeyError, open_link_key, read_link_key, write_link_key
from rtshcua.app.documents import no_bundle, no_log
from rtshcua.app.files import missing
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.wire.key_file import KeyFileError, dump_signing_key
from rtshcua.wire.keys import Duty, SigningKey


@pytest.mark.parametrize("command", ["check", "compile", "lint"])
@pytest.mark.parametrize("name", ["-", "pipe.rts"])
def test_source_that_is_not_a_file_is_reported(
    command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe.rts")
    assert main([command, name]) == ExitCode.INPUT
    said = "".join(capsys.readouterr())
    assert f"cannot read `{name}`: {'no such file' if name == '-' else 'not a regular file'}" in said
    assert "save the source as a file that ends in `.rts`: its imports are relative to that file" in said


def test_pipe_as_source_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    reads, writes = os.pipe()
    try:
        assert main(["check", f"/dev/fd/{reads}"]) == ExitCode.INPUT
    finally:
        os.close(reads)
        os.close(writes)
    said = "".join(capsys.readouterr())
    assert "save the source as a file" in said
    assert "did you mean" not in said


def test_a_name_that_was_typed_is_never_suggested(tmp_path: Path) -> None:
    (tmp_path / "log.rts").symlink_to("nowhere")
    assert missing(tmp_path / "log.rts") is None


def test_help_for_a_page_names_accepted_kinds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "README.md"
    page.write_text("# A page\n")
    mistaken = no_bundle(page)
    assert mistaken is not None
    assert mistaken.help == "accepted: a bundle, as `rtshcua compile` makes it"
    assert no_log(page, page, "accepted: a log")[1] == "accepted: a log"
    main(["check", str(page)])
    assert "a source is a plain text file that ends in `.rts`" in "".join(capsys.readouterr())


def test_wrong_kind_is_reported_before_the_mode_of_a_key(tmp_path: Path) -> None:
    page, long, link, own = (tmp_path / name for name in ("page", "long", "link", "own"))
    page.write_text("# A page\n")
    long.write_text("# A page\n" * 1_000)
    for each in (page, long):
        each.chmod(0o644)
        with pytest.raises(KeyFileError, match="not a key file"):
            read_key(each, Duty.LOG, passphrase=None)
        with pytest.raises(LinkKeyError, match="is not a link key"):
            read_link_key(each)
    with pytest.raises(LinkKeyError, match="is not a link key"):
        open_link_key(long)
    write_link_key(link, bytes(range(32)))
    own.write_bytes(dump_signing_key(SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True), passphrase=None))
    own.chmod(0o600)
    assert read_link_key(link) == bytes(range(32))
    assert read_key(own, Duty.LOG, passphrase=None).duty is Duty.LOG
    for each in (link, own):
        each.chmod(0o644)
    with pytest.raises(KeyStoreError, match="other users may read"):
        read_key(own, Duty.LOG, passphrase=None)
    for reads in (read_link_key, open_link_key):
        with pytest.raises(LinkKeyError, match="other users may read"):
            reads(link)
