"""`rtshcua run --boundary-socket`: a boundary started separately, under its own user, with the keys."""

import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters.agent_socket import hand_in
from rtshcua.adapters.boundary.process import ListeningBoundary
from rtshcua.front.cli.app import main
from rtshcua.wire.keys import Duty
from virtual.listening import Listening, listening

#: faster than life, so that its time is the vehicle's, and hardly: a permit lasts as long as what was read is fresh,
#: 0.5 s of flight, of which a busy machine must not take all at once; at three times the speed that is 0.17 s
SPEED = 1.5


class Aboard:
    """A vehicle, and a boundary for it that has the keys; the run's key store has none."""

    def __init__(self, ground: Any, made: Listening, port: int, *, signed: bool, speed: float = SPEED) -> None:
        self.ground, self.made, self.port, self.speed = ground, made, port, speed
        self.key = ground.folder / "link.key"
        self.key.write_text("5a" * 32 + "\n")
        self.key.chmod(0o600)
        linked = ["--signing-key", str(self.key)] if signed else []
        words = ["keys", "provision", str(made.folder), "--vehicle", "quad-07", *linked]
        assert ground.start(*words).process.wait() == 0
        made.give()
        self.bundles = [ground.bundle(), ground.bundle(name="another")]
        ground.vehicle(port, speed, *linked)
        self.key.unlink()
        self.log_key = ground.store.key_path(Duty.LOG).read_bytes()
        for secret in ground.store.folder.glob("*.key"):
            secret.unlink()

    def run(self, bundle: int = 0, *words: str) -> Any:
        where = ("--connect", f"udpin:127.0.0.1:{self.port}", "--vehicle", "quad-07", "--unsigned-radio")
        socket = ("--boundary-socket", str(self.made.socket))
        return self.ground.run(self.bundles[bundle], *where, *socket, *words, speed=self.speed)

    def verified(self, folder: Path) -> tuple[int, dict[str, Any]]:
        done = self.ground.start("verify-log", "--audit", str(folder), "--json").end()
        (said,) = done.events
        return done.code, said

    def runs(self) -> set[Path]:
        return set((self.ground.folder / "runs").iterdir())


@pytest.fixture
def made() -> Iterator[Listening]:
    """Its time is the run's: the vehicle is flown faster than life."""
    with listening("--paced") as found:
        yield found


@pytest.mark.slow
@pytest.mark.long
def test_run_without_keys_flies_by_a_listening_boundary(ground: Any, made: Listening, port: int) -> None:
    aboard = Aboard(ground, made, port, signed=True)
    run = aboard.run()
    run.until("dispatched", step=0)
    second = aboard.run(1).end()
    assert (second.code, second.events[-1]["slug"]) == (5, "boundary-in-use")
    assert run.end().code == 0, run.stderr
    notes = [event["text"] for event in run.events if event["event"] == "note"]
    assert any(str(made.socket) in text and "decides" in text for text in notes), notes
    code, said = aboard.verified(run.folder)
    assert code == 0, said
    assert "boundary" in {claim["slug"] for claim in said["proven"]}
    assert run.log()[0]["mode"] == "process"
    made.await_gone(1)
    again = aboard.run().end()
    assert again.code == 5, "a bundle flies once"


@pytest.mark.slow
@pytest.mark.long
def test_vehicle_of_a_killed_runtime_is_brought_down(ground: Any, made: Listening, port: int) -> None:
    """The boundary is gone at once, and the next run brings the vehicle down. The log that broke off stays open: its
    key is not here.
    """
    aboard = Aboard(ground, made, port, signed=False)
    first = aboard.run()
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    made.await_gone(1)
    (killed,) = aboard.runs()
    second = aboard.run().end()
    assert second.code == 6, second.stderr
    (other,) = aboard.runs() - {killed}
    records = [json.loads(line) for line in (other / "log.jsonl").read_text().splitlines()]
    assert "resumed" in [record.get("event") for record in records]
    assert records[0]["mode"] == "process"
    assert any("run `rtshcua recover` where the log's key is" in event.get("text", "") for event in second.events)
    assert aboard.verified(killed)[0] == 10
    assert aboard.verified(other)[0] == 0

    key = ground.store.key_path(Duty.LOG)
    key.write_bytes(aboard.log_key)
    key.chmod(0o600)
    assert ground.start("recover", str(killed / "log.jsonl")).process.wait() == 0
    assert aboard.verified(killed)[0] == 0, "it is ended where the log's key is"


@pytest.mark.slow
@pytest.mark.long
def test_broken_off_flight_lands_without_the_boundary(ground: Any, made: Listening, port: int) -> None:
    """Nobody can verify that log, for the log's key is drawn; nothing new flies."""
    aboard = Aboard(ground, made, port, signed=False)
    first = aboard.run()
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    made.await_gone(1)
    made.close()
    (killed,) = aboard.runs()
    other = aboard.run(1).end()
    assert (other.code, other.events[-1]["slug"]) == (5, "boundary-missing")
    second = aboard.run().end()
    assert second.code == 6, second.stderr
    assert any("nobody can verify it" in event.get("text", "") for event in second.events)
    (log,) = aboard.runs() - {killed}
    assert aboard.verified(log)[0] == 4


@pytest.mark.slow
@pytest.mark.long
def test_signing_vehicle_is_not_awaited_without_the_boundary(ground: Any, made: Listening, port: int) -> None:
    """Nothing that this run could send is obeyed: it ends, and one that is begun once the boundary is there does it."""
    aboard = Aboard(ground, made, port, signed=True, speed=1)  # who cannot ask it does not know that it is simulated
    first = aboard.run()
    first.until("dispatched", step=1)
    first.signal(signal.SIGKILL)
    assert first.process.wait() == -signal.SIGKILL
    made.await_gone(1)
    away = made.socket.rename(made.socket.with_name("away"))
    without = aboard.run().end()
    refused = without.events[-1]
    assert (without.code, refused["slug"]) == (5, "not-obeyed"), without.stderr
    assert str(made.socket) in refused["text"]
    away.rename(made.socket)
    assert aboard.run().end().code == 6


@pytest.mark.slow
@pytest.mark.long
def test_boundary_killed_in_flight_is_survived(ground: Any, made: Listening, port: int) -> None:
    """What it signed ahead brings the vehicle down, which enforces signing."""
    aboard = Aboard(ground, made, port, signed=True)
    run = aboard.run()
    run.until("obeyed", step=1)
    (boundary,) = made.boundaries()
    os.kill(boundary, signal.SIGKILL)
    assert run.end().code == 6, run.stderr
    records = run.log()
    (lost,) = [record for record in records if record.get("event") == "boundary-lost"]
    after = [record for record in records[lost["seq"] :] if record.get("event") == "dispatched"]
    assert after[-1]["detail"] in ("return_home", "emergency_land")
    code, said = aboard.verified(run.folder)
    assert (code, said["shortfall"]["slug"]) == (10, "boundary/lost")


@contextmanager
def away(folder: Path) -> Iterator[None]:
    """Without a folder, which is back at the end."""
    elsewhere = folder.rename(folder.with_name("elsewhere"))
    try:
        yield
    finally:
        elsewhere.rename(folder)


@pytest.mark.slow
@pytest.mark.long
def test_waiting_run_flies_and_recovers(ground: Any, made: Listening, port: int) -> None:
    """As the unit has it, with no key store at all: what is handed in flies; one that is killed is begun again, and
    brings the vehicle down.
    """
    aboard = Aboard(ground, made, port, signed=True)
    store = ground.store.folder
    assert ground.start("keys", "accept", str(store / "root.trust"), "--vehicle", "quad-07").process.wait() == 0
    place = made.socket.with_name("agent")
    words = ("--wait", "--agent-socket", str(place))
    with away(store):
        first = aboard.run(0, *words)
        first.until("waiting")
        (waiting,) = made.boundaries()
        assert hand_in(place, (ground.folder / aboard.bundles[1]).read_bytes()).slug == "accepted"
        first.until("dispatched", step=1)
        assert made.boundaries() == [waiting], "one boundary over the waiting and the flight"
        first.signal(signal.SIGKILL)
        assert first.process.wait() == -signal.SIGKILL
        second = aboard.run(0, *words).end()
        assert second.code == 6, second.stderr
    (other,) = [run for run in aboard.runs() if "resumed" in (run / "log.jsonl").read_text()]
    assert json.loads((other / "log.jsonl").read_bytes().splitlines()[0])["mode"] == "process"
    assert aboard.verified(other)[0] == 0


@pytest.mark.slow
def test_owed_parameters_are_left_to_a_permitted_run(ground: Any, made: Listening, port: int) -> None:
    """This one may set nothing, and its log says so."""
    aboard = Aboard(ground, made, port, signed=False)
    owed = Path(ground.environment["RTSHCUA_DATA_DIR"]) / "state" / "parameters" / "vehicle-quad-07"
    owed.parent.mkdir(parents=True)
    kept = '{"GF_ACTION": ["3", "2"]}'
    owed.write_text(kept)
    run = aboard.run()
    run.until("dispatched", step=0)
    run.signal(signal.SIGINT)
    run.end()
    assert json.loads(owed.read_text()) == json.loads(kept)
    assert "not-prepared" in run.effects()
    assert "prepared" not in run.effects()


def test_keys_missing_in_the_trust_root_are_refused(ground: Any, made: Listening, port: int) -> None:
    """A log that nobody could verify does not begin; neither does one without what the boundary signs."""
    assert ground.start("keys", "provision", str(made.folder), "--vehicle", "quad-07").process.wait() == 0
    made.give()
    where = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07", "--boundary-socket", str(made.socket))
    bundle = ground.bundle()
    ground.vehicle(port, SPEED)
    for name, codes in (("boundary.seed", (3, 3)), ("log.seed", (4, 5))):
        seed = made.own / name
        kept = seed.read_bytes()
        for octets, code in zip((b"7a" * 32, None), codes, strict=True):
            seed.write_bytes(octets) if octets else seed.unlink()
            refused = ground.run(bundle, *where, speed=SPEED).end()
            assert refused.code == code, (name, refused.events, refused.stderr)
        seed.write_bytes(kept)
        made.give()


@pytest.mark.slow
def test_doctor_examines_the_boundary_without_side_effects(ground: Any, made: Listening, port: int) -> None:
    aboard = Aboard(ground, made, port, signed=False)
    words = ("doctor", "--connect", f"udpin:127.0.0.1:{port}", "--seconds", "3", "--json", "--boundary-socket")
    for place, verdict in ((made.socket, "ok"), (made.socket.with_name("none"), "stop")):
        looked = aboard.ground.start(*words, str(place))
        out = looked.process.stdout.read()
        (found,) = [each for each in json.loads(out)["findings"] if each["slug"] == "boundary/process"]
        assert found["verdict"] == verdict, found
        looked.process.wait()
    made.await_gone(1)
    ListeningBoundary(made.socket).close()


WRONG = [
    (("--boundary-socket", "s"), "requires `--connect`"),
    (("--boundary-socket", "s", "--connect", "udpin:127.0.0.1:1", "--vehicle", "v", "--mode", "software"), "software"),
    *(
        (("--boundary-socket", "s", "--connect", "udpin:127.0.0.1:1", "--vehicle", "v", name, *value), f"`{name}` ")
        for name, *value in (
            ("--signing-key", "k"), ("--boundary-user", "nobody"), ("--log-key", "k"), ("--boundary-key", "k"),
            ("--passphrase-file", "k"), ("--set", "GF_ACTION=2"), ("--dry-run",), ("--utc-error", "1s"),
        )
    ),
]  # fmt: skip


def test_conflicting_options_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for words, said in WRONG:
        assert main(["run", "b.bundle", *words]) == 2, words
        assert said in capsys.readouterr().err


def test_provisioning_is_atomic(ground: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "boundaries"
    words = ["keys", "provision", str(folder), "--vehicle"]
    for name in ("", ".", "..", "a/b", "/a", "a\n", "a b", "é", "a@b", ".a", "a" * 81):
        assert main([*words, name]) == 2, name
    assert main([*words, "quad-07", "--signing-key", str(tmp_path / "none")]) == 3
    assert not folder.exists() or not list(folder.iterdir())
    assert main([*words, "quad-07", "--json"]) == 0
    said = capsys.readouterr().out
    (told,) = map(json.loads, said.splitlines())
    own = folder / "quad-07"
    assert (told["folder"], told["link_key"]) == (str(own), None)
    assert {each.name for each in own.iterdir()} == {"root.trust", "root.pin", "log.seed", "boundary.seed", "kept"}
    assert own.stat().st_mode & 0o777 == 0o700
    assert {each.stat().st_mode & 0o777 for each in own.iterdir()} == {0o600}
    for name in ("log.seed", "boundary.seed"):
        assert (own / name).read_text().strip() not in said
    before = {each.name: each.read_bytes() for each in own.iterdir()}
    assert main([*words, "quad-07"]) == 5
    assert before == {each.name: each.read_bytes() for each in own.iterdir()}
