"""A whole flight over real UDP with a key at both ends: signed both ways, kept for the next run, and not in the log."""

import json
from typing import Any

from rtshcua.adapters.files.folders import state_folder
from rtshcua.adapters.files.signing import fingerprint, read_link_key, write_link_key
from rtshcua.mavlink import tlog
from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS


def test_a_mission_is_flown_on_a_signed_link(ground: Any) -> None:
    key_file = ground.folder / "link.key"
    write_link_key(key_file, bytes(range(32)))
    words = ["--signing-key", str(key_file), "--unsigned-radio", "--flavour", "ardupilot"]
    run = ground.run(ground.bundle(), *words).end()
    assert run.code == 0, run.stderr
    assert run.dispatched() == ["takeoff", "goto", "return_home"]
    frames = [entry.frame for entry in tlog.read((run.folder / "telemetry.tlog").read_bytes())]
    assert len(frames) > 100
    assert not any(frame[FLAGS] & FLAG_SIGNED for frame in frames)
    (kept,) = state_folder().rglob(fingerprint(read_link_key(key_file)))
    streams = json.loads(kept.read_text())["streams"]
    assert [stream[:2] for stream in streams] == [[1, 1]]
