"""Logs are copied byte for byte, verified before they are indexed, and never indexed twice."""

import json
import os
import signal
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest

from reference import documents, forgery, generated_logs
from reference import world as small_world
from reference.archived import CHECK, NOW_US, records, refused
from rtshcua.adapters.archive import adding, index
from rtshcua.adapters.archive.adding import Done, reindex, verify
from rtshcua.adapters.archive.asking import ArchiveReader, canned
from rtshcua.adapters.archive.entry import AUDIT, ArchiveEntry
from rtshcua.adapters.archive.folder import TABLES, ArchiveFolder
from rtshcua.adapters.store.writing import UNFINISHED
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.note import split
from rtshcua.evidence.witnessing.cosign import cosign
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted
from virtual import case
from virtual.sampling import each_once

Add = Callable[..., list[Done]]


def asked(folder: ArchiveFolder, sql: str) -> list[tuple[object, ...]]:
    asker = ArchiveReader(folder)
    try:
        return list(asker.ask(sql).rows)
    finally:
        asker.close()


def question(folder: ArchiveFolder, name: str) -> list[tuple[object, ...]]:
    return asked(folder, canned()[name].sql)


def entries(folder: ArchiveFolder) -> list[ArchiveEntry]:
    return list(index.read_catalogue(folder).values())


def test_archive_entry_describes_its_log(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    first, second = take([fleet / "quad-07-0.jsonl", fleet / "quad-07-1.jsonl"])
    data = (fleet / "quad-07-0.jsonl").read_bytes()
    lines = data.splitlines(keepends=True)
    genesis = json.loads(lines[0])
    entry = first.entry
    assert not first.known
    assert (entry.log, entry.bytes, entry.name) == (sha256(data).hexdigest(), len(data), str(fleet / "quad-07-0.jsonl"))
    assert (entry.status, entry.finding, entry.checked) == ("verified", None, "records")
    assert (entry.added_us, entry.checked_us, entry.pinned) == (NOW_US, NOW_US, case.KEYS[Duty.ROOT].kid.hex())
    assert (entry.vehicle, entry.mission, entry.mode) == ("quad-07", "inspect_bridge_a", "software")
    assert (entry.policy, entry.policy_version, entry.boot) == ("bridge_inspection", 7, genesis["boot"])
    assert (entry.begun_us, entry.ending) == (genesis["utc_us"], "completed")
    assert entry.lasted_us == json.loads(lines[-1])["at_us"] - genesis["at_us"]
    assert (entry.records, entry.indexed, entry.anchored, entry.recoveries) == (len(lines), len(lines), 0, 0)
    assert (entry.before, entry.last_leaf) == (None, sha256(b"\0" + lines[-1]).hexdigest())
    assert second.entry.before == entry.last_leaf
    assert entries(folder) == [entry, second.entry]


def test_copies_of_a_log_are_added_once_and_each_is_reported(
    take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path
) -> None:
    """A valid log is never reported as failed: each copy has the result of the first."""
    sound, broken = fleet / "quad-08-0.jsonl", tmp_path / "broken.jsonl"
    broken.write_bytes(sound.read_bytes()[:-1] + b"#\n")
    paths = []
    for log in (sound, broken):
        for number in range(2):
            paths.append(tmp_path / f"copy-{number}-of-{log.name}")
            paths[-1].write_bytes(log.read_bytes())
    done = take([sound, broken, *paths])
    told = {each.path.name: (each.entry.status, each.known) for each in done}
    assert told == {
        sound.name: ("verified", False), broken.name: ("failed", False),
        **{path.name: ("verified" if sound.name in path.name else "failed", True) for path in paths},
    }  # fmt: skip
    assert all((each.entry.finding is None) is (each.entry.status == "verified") for each in done)
    assert len(entries(folder)) == 2


def test_a_log_is_kept_octet_for_octet_under_its_digest(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    (done,) = take([fleet / "quad-08-0.jsonl"])
    kept = folder.log(done.entry.log)
    assert kept.read_bytes() == (fleet / "quad-08-0.jsonl").read_bytes()
    assert kept.stat().st_mode & 0o222 == 0
    assert kept.parent.name == done.entry.log
    assert not list(folder.scratch.iterdir())


@pytest.mark.slow
def test_every_record_has_its_row(filled: ArchiveFolder, fleet: Path) -> None:
    wanted = {"decision": 0, "effect": 0, "signed": 0}
    for log in fleet.glob("*.jsonl"):
        for record in records(log):
            wanted[record["type"] if record["type"] in wanted else "signed"] += 1
    found = [asked(filled, f"SELECT COUNT(*) FROM {table}")[0][0] for table in TABLES]
    assert found == list(wanted.values())


def test_refusals_are_those_of_the_lines(filled: ArchiveFolder, fleet: Path) -> None:
    columns = "utc_us, vehicle, skill, outcome, reason, clause, policy_version, seq"
    found = asked(filled, f"SELECT {columns} FROM decided WHERE outcome <> 'allow' ORDER BY ALL")
    assert found == refused(fleet.glob("*.jsonl"))
    assert len(found) > 50


@pytest.mark.slow
def test_adding_again_changes_nothing(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    logs = sorted(fleet.glob("*.jsonl"))
    before = take(logs)
    rows = question(folder, "refused")
    again = take([*logs, logs[0]])
    assert [each.known for each in again] == [True] * (len(logs) + 1)
    assert [each.entry for each in again[:-1]] == [each.entry for each in before]
    assert question(folder, "refused") == rows


@pytest.mark.slow
def test_failed_log_is_kept_but_not_indexed(take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path) -> None:
    data = bytearray((fleet / "quad-07-1.jsonl").read_bytes())
    data[len(data) // 2] ^= 1
    changed = tmp_path / "changed.jsonl"
    changed.write_bytes(data)
    sound, failed = take([fleet / "quad-08-0.jsonl", changed])
    assert sound.entry.status == "verified"
    assert failed.entry.status == "failed"
    assert failed.entry.finding is not None
    assert failed.entry.finding.startswith(("chain/", "record/"))
    assert failed.entry.vehicle == "quad-07", "its genesis was sound, and signed by a key that the root names"
    assert (failed.entry.indexed, failed.entry.part, failed.entry.last_leaf) == (0, "", None)
    assert folder.log(failed.entry.log).read_bytes() == data
    for table in TABLES:
        assert asked(folder, f"SELECT DISTINCT log FROM {table}") == [(sound.entry.log,)]
    ((log, name, status, finding, *_),) = question(folder, "findings")
    assert (log, name, status, finding) == (failed.entry.log, str(changed), "failed", failed.entry.finding)


def test_log_under_another_root_is_indexed_only_with_that_root(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    stranger = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.ROOT, development=True)
    (untrusted,) = take([fleet / "quad-07-0.jsonl"], CHECK._replace(pinned=stranger.public))
    assert (untrusted.entry.status, untrusted.entry.vehicle) == ("failed", None)
    assert (untrusted.entry.finding or "").startswith("trust/root")
    assert asked(folder, "SELECT * FROM decisions") == []
    (trusted,) = take([fleet / "quad-07-0.jsonl"])
    assert (trusted.entry.status, trusted.known, trusted.entry.vehicle) == ("verified", False, "quad-07")
    assert question(folder, "refused")


def test_the_root_may_be_named_by_its_key_or_its_name(take: Add, fleet: Path) -> None:
    take([fleet / "quad-07-0.jsonl"])
    (done,) = take([fleet / "quad-07-0.jsonl"], CHECK._replace(pinned=case.KEYS[Duty.ROOT].kid))
    assert done.known


def test_of_an_unclosed_log_only_what_is_signed_for_is_indexed(
    take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path
) -> None:
    whole = b"".join(generated_logs.lines("quad-07", 9, records=1_500, ending=None))
    torn = tmp_path / "torn.jsonl"
    torn.write_bytes(whole[:-20])
    (done,) = take([torn])
    entry = done.entry
    assert (entry.status, entry.finding) == ("incomplete", "tail/torn")
    assert entry.records == 1_498
    assert entry.indexed == 1_025, "the genesis, 1,023 records, and the seal"
    assert asked(folder, "SELECT MAX(seq) FROM decisions UNION ALL SELECT MAX(seq) FROM seals") == [(1_023,), (1_024,)]
    assert folder.log(entry.log).read_bytes() == whole[:-20]


@pytest.mark.slow
def test_changed_archive_file_is_found_and_excluded(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    one, other = take([fleet / "quad-07-0.jsonl", fleet / "quad-08-0.jsonl"])
    path = folder.log(one.entry.log)
    data = bytearray(path.read_bytes())
    data[1_000] ^= 1
    path.chmod(0o644)
    path.write_bytes(data)
    assert {done.entry.log: done.entry.finding for done in verify(folder, CHECK)} == {
        one.entry.log: "archive/changed",
        other.entry.log: None,
    }
    assert asked(folder, "SELECT DISTINCT log FROM decided") == [(other.entry.log,)]
    path.write_bytes((fleet / "quad-07-0.jsonl").read_bytes())
    assert {done.entry.status for done in verify(folder, CHECK)} == {"verified"}
    assert len(asked(folder, "SELECT DISTINCT log FROM decided")) == 2
    assert asked(folder, "SELECT COUNT(*), COUNT(DISTINCT log || seq) FROM decisions")[0][0] == sum(
        record["type"] == "decision"
        for name in ("quad-07-0.jsonl", "quad-08-0.jsonl")
        for record in records(fleet / name)
    )


@pytest.mark.slow
def test_crash_before_the_catalogue_duplicates_nothing(
    take: Add, fleet: Path, folder: ArchiveFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    take([fleet / "quad-07-0.jsonl"])
    rows = question(folder, "refused")

    def dies(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(adding, "write_catalogue", dies)
        with pytest.raises(KeyboardInterrupt):
            take([fleet / "quad-07-1.jsonl", fleet / "quad-08-0.jsonl"])
    assert question(folder, "refused") == rows, "what the catalogue does not name is not there"
    parts = {path.name for path in folder.table("decisions").iterdir()}
    take([fleet / "quad-07-1.jsonl"])
    left = {path.name for path in folder.table("decisions").iterdir()}
    assert len(parts) == len(left) == 3
    assert left != parts
    assert question(folder, "refused-by-vehicle")
    assert len(question(folder, "refused")) == len(refused([fleet / "quad-07-0.jsonl", fleet / "quad-07-1.jsonl"]))


@pytest.mark.slow
@pytest.mark.parametrize(("damage", "seen"), each_once(["changed", "shorter", "gone"], [False, True]))
def test_a_copy_that_was_damaged_is_replaced_by_the_log_taken_in_again(
    take: Add, fleet: Path, folder: ArchiveFolder, damage: str, seen: bool
) -> None:
    source = fleet / "quad-07-0.jsonl"
    (one,) = take([source])
    place, data = folder.log(one.entry.log), source.read_bytes()
    place.chmod(0o644)
    match damage:
        case "changed":
            place.write_bytes(data[:-100] + bytes([data[-100] ^ 1]) + data[-99:])
        case "shorter":
            place.write_bytes(data[:-1])
        case _:
            place.unlink()
    if seen and damage != "gone":
        assert [done.entry.finding for done in verify(folder, CHECK)] == ["archive/changed"]
        assert asked(folder, "SELECT count(*) FROM decided") == [(0,)]
    (again,) = take([source])
    assert not again.known
    assert (again.entry.status, again.entry.finding) == ("verified", None)
    assert place.read_bytes() == data
    assert place.stat().st_mode & 0o222 == 0
    assert asked(folder, "SELECT count(*) > 0 FROM decided") == [(True,)]
    assert [done.known for done in take([source])] == [True]


@pytest.mark.slow
def test_an_index_that_was_changed_is_made_anew(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    """Whoever can write to the folder can forge the index, but not the logs."""
    done = take(sorted(fleet.glob("*.jsonl")))
    rows, known = question(folder, "refused"), entries(folder)
    for path in [folder.catalogue, *folder.parts()]:
        path.write_bytes(b"nothing of the kind")
    with pytest.raises(Untrusted, match="cannot be read"):
        ArchiveReader(folder)
    later = CHECK._replace(now_us=NOW_US + 1)
    assert [each.entry.status for each in reindex(folder, later)].count("verified") == len(done) - 1
    assert question(folder, "refused") == rows
    assert [entry.log for entry in entries(folder)] == [entry.log for entry in known]
    entry = entries(folder)[0]
    assert (entry.added_us, entry.checked_us) == (NOW_US + 1, NOW_US + 1), (
        "when it was added is lost with the catalogue"
    )
    assert {each.entry.added_us for each in reindex(folder, CHECK)} == {NOW_US + 1}
    assert question(folder, "refused") == rows


def test_only_one_at_a_time_changes_an_archive(folder: ArchiveFolder, take: Add, fleet: Path) -> None:
    with folder.writing(), pytest.raises(BlockingIOError):
        take([fleet / "quad-07-0.jsonl"])


def test_unreadable_log_ends_adding_after_the_others(take: Add, fleet: Path, folder: ArchiveFolder) -> None:
    with pytest.raises(FileNotFoundError):
        take([fleet / "quad-07-0.jsonl", fleet / "gone.jsonl", fleet / "quad-07-1.jsonl"])
    assert len(entries(folder)) == 1


def test_a_real_flight_is_audited_whole(take: Add, tmp_path: Path, folder: ArchiveFolder) -> None:
    log = tmp_path / "flight.jsonl"
    log.write_bytes(b"".join(forgery.flight()))
    (done,) = take([log], CHECK._replace(depth=AUDIT))
    assert (done.entry.status, done.entry.checked) == ("verified", "audit")
    found = asked(folder, "SELECT skill, outcome FROM decided ORDER BY seq")
    assert found == [("takeoff", "allow"), ("goto", "allow"), ("return_home", "allow")]
    assert ("dispatched", 3, 1, 1) in question(folder, "effects")
    assert take([log])[0].known, "an audit says no less"


def test_a_generated_log_does_not_pass_the_audit(take: Add, fleet: Path) -> None:
    (done,) = take([fleet / "quad-07-0.jsonl"], CHECK._replace(depth=AUDIT))
    assert done.entry.status == "failed"
    assert (done.entry.finding or "").startswith("decision/")


@pytest.mark.parametrize("depth", ["records", "audit"])
def test_after_a_replacement_steps_have_other_skills(
    depth: str, take: Add, tmp_path: Path, folder: ArchiveFolder
) -> None:
    run = small_world.Run(small_world.renewed(documents.low())).until_flies("goto")
    assert documents.hand(run, documents.replacement(run.loaded)) == "accepted"
    run.until_over()
    close = run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)
    log = tmp_path / "replaced.jsonl"
    log.write_bytes(b"".join([*run.lines, close]))
    (done,) = take([log], CHECK._replace(pinned=small_world.ROOT_KEY.public, depth=depth))
    assert done.entry.finding is None
    steps = asked(folder, "SELECT step, skill FROM decided WHERE outcome = 'allow' AND kind = 0 ORDER BY seq")
    assert steps == [(0, "takeoff"), (1, "goto"), (2, "return_home")]


def anchored(log: Path, key: SigningKey) -> str:
    """An anchor for the last signed record of a log."""
    note = records(log)[-1]["checkpoint"]
    text, _ = split(note)
    line = cosign(text, 1_760_000_000, key.public, lambda data: key.sign(data, duty=Duty.WITNESS))
    return f"{note}{line}"


@pytest.mark.slow
def test_anchors_beside_a_log_come_along_and_count(
    take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path
) -> None:
    log = tmp_path / "run" / "log.jsonl"
    log.parent.mkdir()
    log.write_bytes((fleet / "quad-07-0.jsonl").read_bytes())
    (before,) = take([log])
    assert before.entry.anchored == 0
    assert {row[0] for row in asked(folder, "SELECT DISTINCT witness FROM decided")} == {"unwitnessed"}
    log.with_name("ground.anchors").write_text(anchored(log, case.KEYS[Duty.WITNESS]) + "\n")
    (after,) = take([log])
    assert (after.known, after.entry.anchored, after.entry.records) == (
        False,
        before.entry.records,
        before.entry.records,
    )
    assert {row[0] for row in asked(folder, "SELECT DISTINCT witness FROM decided")} == {"witnessed"}
    assert question(folder, "unanchored") == []
    assert take([log])[0].known


def test_an_anchor_for_another_log_of_the_same_boot_fails_it(take: Add, fleet: Path, tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    lines = (fleet / "quad-07-0.jsonl").read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines))
    log.with_name("ground.anchors").write_text(anchored(log, case.KEYS[Duty.WITNESS]) + "\n")
    log.write_bytes(b"".join(lines[:-1]))
    (done,) = take([log])
    assert (done.entry.status, done.entry.finding) == ("failed", "anchor/beyond")


#: texts that a vehicle may report
SAID = (
    "", "plain", 'a "quote" and \\', "two\nlines\ttab", "\0 nothing", "\x7f\u2028", "ünï ✓ 🚁", "x" * 3_000, "'; DROP",
)  # fmt: skip


def test_texts_of_others_are_archived_unchanged(take: Add, tmp_path: Path, folder: ArchiveFolder) -> None:
    key, now = case.KEYS[Duty.LOG], Now(5_000_000, generated_logs.BEGUN_US, 1_000)
    recorder = Recorder(lambda text: key.sign(text, duty=Duty.LOG), key.public, lambda: bytes(32))
    lines = [
        recorder.genesis(
            now, bundle=generated_logs.bundle("quad-07", 7), root=case.root()[1], boot=bytes(16), vehicle="quad-07",
            mission="inspect_bridge_a", mode="software",
        ),
        *(recorder.effect(now, "said", detail=detail) for detail in SAID),
        recorder.close(now, ending="completed", tlog=None),
    ]  # fmt: skip
    log = tmp_path / "said.jsonl"
    log.write_bytes(b"".join(lines))
    (done,) = take([log])
    assert done.entry.status == "verified"
    found = asked(folder, "SELECT event, detail FROM happened ORDER BY seq")
    assert found == [("said", detail[:1_000]) for detail in SAID]


def test_an_archive_that_was_only_begun_is_made_whole(tmp_path: Path) -> None:
    (tmp_path / "begun").mkdir()
    (tmp_path / "begun" / f"{UNFINISHED}1.new").write_bytes(b"{")
    ArchiveFolder(tmp_path / "begun", make=True)
    (tmp_path / "begun" / "tmp").rmdir()
    assert ArchiveFolder(tmp_path / "begun", make=True).scratch.is_dir()


def test_no_archive_is_made_among_other_things(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("x")
    with pytest.raises(Untrusted, match="other files"):
        ArchiveFolder(tmp_path, make=True)
    with pytest.raises(Untrusted, match="is not an archive"):
        ArchiveFolder(tmp_path)


@pytest.mark.parametrize("name", ["a*b", "a[b]", "a?b", "{a}"])
def test_no_archive_at_a_path_that_is_a_pattern(name: str, tmp_path: Path) -> None:
    with pytest.raises(Untrusted, match="the path of an archive"):
        ArchiveFolder(tmp_path / name, make=True)


def test_an_archive_of_another_version_is_left_alone(folder: ArchiveFolder) -> None:
    (folder.path / "archive.json").write_text('{"format": "rtshcua/archive", "version": 2}')
    with pytest.raises(Untrusted, match="another version"):
        ArchiveFolder(folder.path)


def test_reading_an_empty_archive_is_refused(folder: ArchiveFolder) -> None:
    with pytest.raises(Untrusted, match="no log was added yet"):
        ArchiveReader(folder)


@pytest.mark.slow
def test_a_witness_holds_both_flights_of_a_bundle_that_flew_twice(
    take: Add, fleet: Path, folder: ArchiveFolder, tmp_path: Path
) -> None:
    """What keeps used bundles was put back, which nobody aboard can tell. Each flight's log is sound and cosigned: side
    by side they tell, and whoever has every key of the vehicle cannot write the first one anew without that flight.
    """
    logs = [tmp_path / str(number) / "log.jsonl" for number in range(2)]
    for number, log in enumerate(logs):
        log.parent.mkdir()
        log.write_bytes((fleet / f"quad-07-{number}.jsonl").read_bytes())
        log.with_name("ground.anchors").write_text(anchored(log, case.KEYS[Duty.WITNESS]) + "\n")
    first, second = take(logs)
    assert {first.entry.status, second.entry.status} == {"verified"}
    assert question(folder, "unanchored") == []
    ((vehicle, _, digest, *_),) = question(folder, "twice")
    assert (vehicle, digest) == ("quad-07", first.entry.bundle_digest)
    generated_logs.write(logs[0], "quad-07", 0, records=2)  # of the same boot, and nothing was sent
    (anew,) = take([logs[0]])
    assert (anew.entry.status, anew.entry.finding) == ("failed", "anchor/beyond")


def test_a_forked_process_reads_the_catalogue_too(filled: ArchiveFolder) -> None:
    """The engine of its parent would wait for threads that a fork does not copy."""
    many = len(index.read_catalogue(filled))
    child = os.fork()
    if not child:
        signal.alarm(60)
        os._exit(0 if len(index.read_catalogue(filled)) == many else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
