"""Whole flights over real UDP: they complete, are recorded, and can be verified.

All tests share two flights: a PX4 with two witnesses, after a dry run of the same bundle, and an ArduCopter that
requires a signed link, with an absent witness.
"""

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rtshcua.adapters.store.signing import fingerprint, read_link_key, write_link_key
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.mavlink import tlog
from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS, message_id
from rtshcua.mavlink.radio import RADIO_STATUS
from virtual.forked import Forked

pytestmark = pytest.mark.slow


class Flown(NamedTuple):
    """A flight that is over, and what else ran beside it or before."""

    ground: Any
    bundle: str
    run: Any
    others: tuple[Any, ...]
    modules: tuple[str, ...] = ()


#: `rtshcua`, which says at its end which modules it loaded
TELLING = """
import sys
from pathlib import Path
from rtshcua.front.cli.app import main
code = main(sys.argv[1:])
Path("modules").write_text(" ".join(sys.modules))
sys.exit(code)
"""


@pytest.fixture(scope="module")
def watched(grounds: Any, free_port: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flown]:
    """A PX4, and its two witnesses, both of whom must have cosigned; `others` is the dry run."""
    top = tmp_path_factory.mktemp("watched")
    with grounds(top, top / "data", witnesses=2, witness_threshold=2) as ground:
        ground.command = ground.afresh
        bundle = ground.bundle()
        rehearsal = ground.run(bundle, "--dry-run").end()
        ports = (free_port(), free_port())
        watching = [witness(ground, name, at) for name, at in zip(("witness.key", "witness-2.key"), ports, strict=True)]
        words = [word for at in ports for word in ("--witness", f"udpout:127.0.0.1:{at}")]
        command, ground.command = ground.command, [sys.executable, "-c", TELLING]
        run = ground.run(bundle, *words).end()
        ground.command = command
        assert run.code == ExitCode.OK, run.log()
        for each in watching:
            each.until("cosigned", size=len(run.log()) - 1)
            each.signal(signal.SIGINT)
            assert each.end().code == ExitCode.OK
        yield Flown(ground, bundle, run, (rehearsal,), tuple((top / "modules").read_text().split()))


def witness(ground: Any, name: str, port: int) -> Any:
    words = ["--connect", f"udpin:127.0.0.1:{port}", "--key", str(ground.store.folder / name), "--json"]
    run = ground.start("witness", *words)
    run.until("ready")
    return run


@pytest.fixture(scope="module")
def signed(grounds: Any, free_port: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flown]:
    """An ArduCopter of `rtshcua sim`, which ends on SIGINT after the flight and is the only one of `others`."""
    top = tmp_path_factory.mktemp("signed")
    with grounds(top, top / "data") as ground:
        port, key = free_port(), ["--signing-key", str(top / "link.key")]
        write_link_key(top / "link.key", bytes(range(32)))
        words = ["--connect", f"udpout:127.0.0.1:{port}", "--flavour", "ardupilot", "--speed", str(ground.speed), *key]
        ground.command = ground.afresh
        vehicle = ground.start("sim", *words, "--json")
        ground.command = None
        ready = vehicle.until("ready")
        assert (ready["flavour"], ready["peer"]) == ("ardupilot", port)
        link = ["--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", *key, "--unsigned-radio"]
        link += ["--mode", "software"]  # by a process of its own: test_run_process.py
        bundle = ground.bundle(return_mm=0)
        run = ground.run(bundle, *link, "--witness", f"udpout:127.0.0.1:{free_port()}").end()
        assert run.code == ExitCode.OK, run.stderr
        vehicle.signal(signal.SIGINT)
        yield Flown(ground, bundle, run, (vehicle,))


@pytest.fixture(params=["watched", "signed"])
def flown(request: pytest.FixtureRequest) -> Flown:
    """Either of them."""
    found: Flown = request.getfixturevalue(request.param)
    return found


def said(commands: Forked, ground: Any, *words: str) -> list[dict[str, Any]]:
    """What a command that goes well says, on the ground's machine."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("RTSHCUA_DATA_DIR", "TZ"):
            patch.setenv(name, ground.environment[name])
        done = commands.run([*words, "--json"], ground.folder, 60)
    assert done.code == ExitCode.OK, done
    return [json.loads(line) for line in done.out.splitlines()]


def audited(commands: Forked, ground: Any, folder: Path) -> dict[str, Any]:
    """What `verify-log --audit` says of a sound log."""
    (found,) = said(commands, ground, "verify-log", str(folder / "log.jsonl"), "--audit")
    return found


def kept(flown: Flown, folder: Path) -> Path:
    """A copy of the run's folder, to be changed."""
    return Path(shutil.copytree(flown.run.folder, folder / "kept"))


# -------------------------------------------------------------------------------------------- the flight


def test_short_mission_is_flown_and_recorded(flown: Flown) -> None:
    run = flown.run
    assert run.dispatched() == ["takeoff", "goto", "return_home"]
    assert run.effects().count("succeeded") == 3
    records = run.log()
    assert (records[0]["type"], records[-1]["type"], records[-1]["ending"]) == ("genesis", "close", "completed")
    assert records[-1]["tlog"] is not None
    summary = json.loads((run.folder / "summary.json").read_text())
    assert summary == {key: value for key, value in run.summary.items() if key != "event"}
    assert (summary["steps_done"], summary["whole"]) == (3, True)
    frames = list(tlog.read((run.folder / "telemetry.tlog").read_bytes()))
    assert [entry.at_us for entry in frames] == sorted(entry.at_us for entry in frames)
    names = {frame.name for entry in frames for frame in Codec(1, 1).parse(entry.frame)}
    assert {"HEARTBEAT", "GLOBAL_POSITION_INT", "COMMAND_LONG", "COMMAND_ACK"} <= names


def test_summary_names_the_autopilot(watched: Flown, signed: Flown) -> None:
    assert (watched.run.summary["flavour"], signed.run.summary["flavour"]) == ("px4", "ardupilot")


def test_decision_is_written_before_it_takes_effect(flown: Flown) -> None:
    kinds = [(r["type"], r.get("event") or r.get("outcome")) for r in flown.run.log() if r.get("step") == 1]
    assert kinds == [("decision", "allow"), *[("effect", each) for each in ("dispatched", "obeyed", "succeeded")]]


def test_sim_ends_cleanly_after_a_run(signed: Flown) -> None:
    (vehicle,) = signed.others
    assert vehicle.end().code == ExitCode.OK


def test_dry_run_decides_the_mission_without_side_effects(watched: Flown) -> None:
    """The bundle flew after it, in the only folder of a run that there is."""
    (rehearsal,) = watched.others
    assert rehearsal.code == ExitCode.OK, rehearsal.stderr
    (told,) = rehearsal.events
    assert (told["event"], told["ready"], told["exit_code"]) == ("rehearsal", True, 0)
    waits = [step for step in told["steps"] if step["outcome"] != "allow"]
    unknown = ("defer", "state/unknown", "wind.speed < 10 m/s")  # no autopilot knows the wind before it flies
    assert [(step["outcome"], step["reason"], step["clause"]) for step in waits] == [unknown]
    assert len(list((watched.ground.folder / "runs").iterdir())) == 1


def test_dry_run_names_the_reason_of_a_refusal(watched: Flown) -> None:
    poor = watched.ground.run(watched.ground.bundle(name="poor"), "--dry-run", "--battery", "30").end()
    assert poor.code == ExitCode.REFUSED
    first = poor.events[0]["steps"][0]
    assert (first["outcome"], first["hopeful"]) == ("fallback", False)
    assert first["nearest"][0]["subject"] == "battery"


def test_bundle_flies_once(watched: Flown) -> None:
    """A run that follows is a new process: it is on the disk."""
    again = watched.ground.run(watched.bundle).end()
    assert again.code == ExitCode.REFUSED
    assert "a bundle flies once" in again.stderr
    (said,) = again.events
    assert (said["event"], said["slug"], said["exit_code"]) == ("refused", "replayed", 5)
    assert said["help"] == "compile the mission again to issue a new bundle"
    assert len(list((watched.ground.folder / "runs").iterdir())) == 1
    state = watched.ground.store.folder.parent / "state"
    assert (state / "simulated" / "replay").is_dir()
    assert not (state / "replay").exists(), "the real vehicle may still fly it"


def test_bundle_flies_again_with_fresh_state_and_a_pipe_gets_plain_lines(watched: Flown, tmp_path: Path) -> None:
    words = ["run", watched.bundle, "--fresh-state", "--runs", str(tmp_path), "--speed", str(watched.ground.speed)]
    run = subprocess.run(
        [sys.executable, "-m", "rtshcua", *words], cwd=watched.ground.folder, env=watched.ground.environment,
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    lines = run.stdout.splitlines()
    assert lines[0].startswith("mission inspect_bridge_a under bridge_inspection@7 on quad-07")
    called = [line.split(" dispatched ")[1].strip().partition("(")[0] for line in lines if " dispatched " in line]
    assert called == ["takeoff", "goto", "return_home"]
    assert lines[-4].startswith("completed: 3 of 3 steps done in ")
    assert lines[-1].split()[:3] == ["next", "rtshcua", "verify-log"]


# ----------------------------------------------------------------------------------------- a signed link


def test_raw_frames_verify_with_the_link_key(
    signed: Flown,
) -> None:
    frames = [entry.frame for entry in tlog.read((signed.run.folder / "telemetry.tlog").read_bytes())]
    link_key = read_link_key(signed.ground.folder / "link.key")
    sealed = [frame for frame in frames if frame[FLAGS] & FLAG_SIGNED]
    assert len(sealed) > 100
    assert all(sha256(link_key + frame[:-6]).digest()[:6] == frame[-6:] for frame in sealed)
    assert {frame[5:7] for frame in sealed} == {bytes([1, 1]), bytes([1, 191])}
    assert {message_id(frame, 0) for frame in frames if not frame[FLAGS] & FLAG_SIGNED} <= {RADIO_STATUS}
    (state,) = (signed.ground.folder / "data").rglob(fingerprint(link_key))
    streams = json.loads(state.read_text())["streams"]
    assert [stream[:2] for stream in streams] == [[1, 1]]


# ------------------------------------------------------------------------------------------- witnesses


def test_witnessed_flight_is_anchored_to_its_end(commands: Forked, watched: Flown, tmp_path: Path) -> None:
    count = len(watched.run.log())
    assert watched.run.effects().count("anchored") >= 4
    assert audited(commands, watched.ground, watched.run.folder)["anchored"] == count
    # Without what stands beside the log it is anchored as far as its own records say, and says what is not.
    folder = kept(watched, tmp_path)
    (folder / "log.anchors").unlink()
    assert 0 < audited(commands, watched.ground, folder)["anchored"] < count


def test_witness_detects_a_truncated_log(watched: Flown, tmp_path: Path) -> None:
    """A holder of the log's keys cannot truncate the log: the witness has its checkpoints."""
    log = kept(watched, tmp_path) / "log.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[: len(lines) // 2]))
    assert watched.ground.start("witness", str(log), "--json").end().code == ExitCode.ANCHOR


def test_absent_witness_is_reported(commands: Forked, signed: Flown) -> None:
    assert any("did not cosign the end of the log" in str(event) for event in signed.run.events)
    assert "anchored" not in signed.run.effects()
    assert audited(commands, signed.ground, signed.run.folder)["anchored"] == 0


# ---------------------------------------------------------------------------------------------- proofs

PROOFS = ("whole", "receipt", "since")


def test_records_are_proved_without_the_log(commands: Forked, watched: Flown, tmp_path: Path) -> None:
    folder = kept(watched, tmp_path)
    records = watched.run.log()
    number = next(record["seq"] for record in records if record["type"] == "decision")
    words = ([str(number)], [str(number), "--cose"], ["--since", "0"])
    made = [str(tmp_path / name) for name in PROOFS]
    for name, inputs in zip(made, words, strict=True):
        said(commands, watched.ground, "prove", str(folder), *inputs, "-o", name)
    shutil.rmtree(folder)
    whole, receipt, since = said(commands, watched.ground, "verify-proof", *made)
    assert whole["record"] == receipt["record"] == records[number]
    assert (since["kind"], since["size"]) == ("consistency", len(records) - 1)


# ---------------------------------------------------------------------------------------- what it is made of


def test_run_loads_no_ground_module(watched: Flown) -> None:
    loaded = watched.modules
    ours = [name for name in loaded if name.startswith("rtshcua.")]
    assert "rtshcua.onboard.runtime.runtime" in ours
    ground_only = ("lark", "shapely", "rtshcua.ground", "rtshcua.model.ir")
    assert not [name for name in loaded if name.startswith(ground_only)]
    # typer reads options with pydantic; nothing of ours needs it.
    program = f"import sys\nfor name in {ours}: __import__(name)\nprint('pydantic' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert run.stdout == "False\n"
