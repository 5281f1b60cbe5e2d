"""Anchor files: appending, reading, and refusals."""

import os
from pathlib import Path

import pytest

from reference.witnessed import WITNESSES, Judge, Log
from rtshcua.adapters.store import logs
from rtshcua.adapters.store.logs import add_anchors, anchors_path, read_anchors, read_notes

LOG = Log()
LOG.effects(2)
LOG.seal()
MARKS = [Judge(key).blindly(note) for key in WITNESSES for note in LOG.notes]


def test_notes_one_after_another(tmp_path: Path) -> None:
    path = anchors_path(tmp_path / "log.jsonl")
    assert path == tmp_path / "log.anchors"
    assert read_notes(path) == []
    add_anchors(path, MARKS[:2])
    add_anchors(path, MARKS[2:])
    assert read_notes(path) == MARKS
    assert path.read_text() == "".join(f"{mark}\n" for mark in MARKS)


def test_all_files_beside_a_log_are_read_its_own_first(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    add_anchors(tmp_path / "another.anchors", MARKS[:1])
    add_anchors(anchors_path(log), MARKS[1:2])
    assert read_anchors(log) == [MARKS[1], MARKS[0]]


def test_a_file_that_ends_in_the_middle(tmp_path: Path) -> None:
    path = tmp_path / "log.anchors"
    add_anchors(path, MARKS[:2])
    data = path.read_bytes()
    for length in range(0, len(data), 41):
        path.write_bytes(data[:length])
        add_anchors(path, MARKS[2:4])
        assert read_notes(path)[-1] == MARKS[3]


def test_unreadable_anchor_files_are_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo(tmp_path / "pipe.anchors")
    (tmp_path / "folder.anchors").mkdir()
    (tmp_path / "gone.anchors").symlink_to(tmp_path / "nowhere")
    (tmp_path / "octets.anchors").write_bytes(b"\xff\xfe\n\n\xe2\x80\x94 \xff\n\n")
    assert [note for note in read_anchors(tmp_path / "log.jsonl") if note in MARKS] == []
    add_anchors(tmp_path / "log.anchors", MARKS)
    monkeypatch.setattr(logs, "_LARGEST", len(MARKS[0].encode()) + 1)
    assert read_notes(tmp_path / "log.anchors") == MARKS[:1]
    monkeypatch.setattr(os, "open", lambda *_, **__: (_ for _ in ()).throw(OSError(5, "broken")))
    assert read_notes(tmp_path / "log.anchors") == []
