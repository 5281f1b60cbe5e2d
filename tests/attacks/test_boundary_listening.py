"""Threat: a compromised runtime, with a boundary that listens under a user of its own, and the keys in a folder of
that user. The attacker has the rights of the run's user and may connect any number of times.

Outcomes: it can read no key, file or memory of the boundary, and cannot signal it; the boundary does not take
root, keys, identity or time from it; a second connection is refused; the kernel ends a boundary that hangs, and
the next one serves.
"""

import ctypes
import os
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from reference.flying import refusal_of
from rtshcua.adapters.boundary import process as boundary_process
from rtshcua.adapters.boundary.home import BoundaryError, first_kept
from rtshcua.adapters.boundary.process import ListeningBoundary, Measure
from rtshcua.adapters.clock import monotonic_ns
from rtshcua.app.fly import start_boundary
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import ENFORCE, LOAD, LOST, SEAL, Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.listening import ROOT, RUN_USER, VEHICLE, Listening, listening
from virtual.shipped import shipped

OTHER_USER = pytest.mark.skipif(not ROOT, reason="only root may start what runs as another user")
LOG_SEED, OWN_SEED = (key.private.private_bytes_raw() for key in (case.KEYS[Duty.LOG], case.BOUNDARY_KEY))


def now() -> Now:
    return Now(monotonic_ns() // 1_000, time.time_ns() // 1_000, 1_000)


class Provisioned:
    """A boundary that listens, the contents of its folder, and a bundle for it."""

    def __init__(self, made: Listening) -> None:
        self.made, self.socket = made, made.socket
        self.issued = time.time_ns() // 1_000 - 60_000_000
        self.root, signed = case.root(self.issued)
        made.own.mkdir(parents=True)
        made.own.chmod(0o700)
        self.put("root.trust", signed)
        self.put("root.pin", case.KEYS[Duty.ROOT].kid.hex().encode())
        self.put("log.seed", LOG_SEED.hex().encode() + b"\n")
        self.put("boundary.seed", OWN_SEED.hex().encode() + b"\n")
        self.put("link.key", b"5a" * 32 + b"\n")
        self.put("kept", first_kept())
        made.give()

    def put(self, name: str, octets: bytes) -> None:
        path = self.made.own / name
        path.write_bytes(octets)
        path.chmod(0o600)

    def load(self, process: ListeningBoundary, caller: Caller | None = None) -> Loaded | Refusal:
        return load(
            shipped("short", self.issued), root=self.root, vehicle=VEHICLE, now=now(), mode=EnforcementMode.PROCESS,
            session_key=bytes(32), flight=bytes(16), peer_is_own_simulator=False,
            caller=caller or Caller(process.call, signs=True),
        )  # fmt: skip

    def why_not(self) -> str:
        with pytest.raises(BoundaryError) as refused:
            ListeningBoundary(self.socket)
        return refused.value.slug


@pytest.fixture
def provisioned(monkeypatch: pytest.MonkeyPatch) -> Iterator[Provisioned]:
    monkeypatch.setattr(boundary_process, "LISTENING_ENDING_S", 0.2)
    with listening() as made:
        yield Provisioned(made)


def test_listening_boundary_uses_keys_of_its_folder(provisioned: Provisioned) -> None:
    process = ListeningBoundary(provisioned.socket)
    assert process.log_public == case.KEYS[Duty.LOG].public
    assert process.own_public == case.BOUNDARY_KEY.public
    assert process.link_name is not None
    assert (Measure.OWN_USER in process.measures) is ROOT
    assert process.own_clock
    assert isinstance(provisioned.load(process), Loaded)
    process.close()
    provisioned.made.await_gone(1)


def as_user(user: int, act: Callable[[], int]) -> int:
    """The result of a program that acts as another user; 101 if it fails."""
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setresgid(user, user, user)
            os.setresuid(user, user, user)
            os._exit(min(act(), 100))
        finally:
            os._exit(101)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@OTHER_USER
def test_user_of_run_cannot_read_or_signal_boundary(provisioned: Provisioned) -> None:
    def connects() -> int:
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as made:
            made.connect(str(provisioned.socket))
            return len(made.recv(100))

    def reads() -> int:
        process = ListeningBoundary(provisioned.socket)
        (pid,) = provisioned.made.boundaries()
        names = [Path(f"/proc/{pid}/{name}") for name in ("mem", "maps", "environ", "syscall", "auxv")]
        names += [Path(f"/proc/{pid}/fd/{each}") for each in range(3, 20)]
        own = ("kept", "log.seed", "boundary.seed", "link.key", "root.trust")
        got = 0
        for path in (*names, *(provisioned.made.own / name for name in own)):
            with suppress(OSError), path.open("rb") as file:
                got += len(file.read(1))
        for path in (provisioned.made.folder, provisioned.made.own):
            with suppress(OSError):
                got += len(list(path.iterdir()))
        for number in (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM, 0):
            with suppress(PermissionError):
                os.kill(pid, number)
                got += 1
        libc, attach, seize = ctypes.CDLL(None, use_errno=True), 16, 0x4206
        got += (libc.ptrace(attach, pid, 0, 0) == 0) + (libc.ptrace(seize, pid, 0, 0) == 0)
        process.call(b"\x14")
        return got

    provisioned.made.folder.chmod(0o700)
    assert as_user(RUN_USER, connects) == 77, "the one who may connect does"
    assert as_user(RUN_USER, reads) == 0
    assert as_user(RUN_USER + 10, connects) == 101, "nobody else may"


def test_a_second_connection_is_turned_away(provisioned: Provisioned) -> None:
    first = ListeningBoundary(provisioned.socket)
    loaded = provisioned.load(first)
    assert provisioned.why_not() == "in-use"
    assert isinstance(loaded, Loaded)
    assert Caller(first.call).flight() != LOST, "and the first goes on"
    first.close()


@pytest.mark.parametrize("pending", [False, True])
def test_halted_boundary_ends(provisioned: Provisioned, pending: bool) -> None:
    """The connected user may not kill it: the kernel does, and the next one begins no step of the bundle again."""
    process = ListeningBoundary(provisioned.socket)
    provisioned.load(process)
    (halted,) = provisioned.made.boundaries()
    os.kill(halted, signal.SIGSTOP)
    if pending:
        assert Caller(process.call)(ENFORCE, b"anything") is LOST
    else:
        process.close()
    provisioned.made.await_gone(5)
    again = ListeningBoundary(provisioned.socket)
    assert isinstance(provisioned.load(again), Loaded)
    again.close()
    process.close()


def test_passed_descriptors_are_closed(provisioned: Provisioned) -> None:
    process = ListeningBoundary(provisioned.socket)
    (pid,) = provisioned.made.boundaries()
    given, other = os.pipe()
    os.set_blocking(given, False)
    try:
        for _ in range(20):
            socket.send_fds(process._socket, [b"\x14"], [other] * 100)
            assert process._socket.recv(2_112)
        os.close(other)
        other = -1
        assert os.read(given, 1) == b"", "nobody has the other end"
    finally:
        for each in (given, other):
            if each >= 0:
                os.close(each)
    assert provisioned.made.boundaries() == [pid]
    process.close()


def test_unread_answer_ends_session(provisioned: Provisioned) -> None:
    """Filling the socket only affects the present boundary, and the next one serves."""
    process = ListeningBoundary(provisioned.socket)
    process._socket.settimeout(0.5)
    with suppress(TimeoutError):
        while True:
            process._socket.send(b"\x14")
    provisioned.made.await_gone(6)
    process.close()
    ListeningBoundary(provisioned.socket).close()


def test_hanging_boundary_is_awaited(provisioned: Provisioned, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that restarts at once finds it serving; on a link with a key nothing else can bring the vehicle down."""
    monkeypatch.undo()
    process = ListeningBoundary(provisioned.socket)
    (halted,) = provisioned.made.boundaries()
    os.kill(halted, signal.SIGSTOP)
    process.close()
    ListeningBoundary(provisioned.socket).close()


def test_invented_time_is_refused(provisioned: Provisioned) -> None:
    """No run can request invented time either: `--speed` requires a boundary that was started with it."""
    process = ListeningBoundary(provisioned.socket)
    provisioned.load(process)
    at = struct.pack(">q", now().monotonic_us + 10_000_000)
    answer = Caller(process.call)(SEAL, at, b"anything")
    assert isinstance(answer, Refusal)
    assert answer.slug == "time-apart"
    process.close()
    provisioned.made.await_gone(1)
    assert "its own clock" in refusal_of(start_boundary.connect_boundary(provisioned.socket, paced=True)).text


@pytest.mark.parametrize("name", ["root.trust", "root.pin", "log.seed"])
def test_missing_file_is_reported(provisioned: Provisioned, name: str) -> None:
    """The message names the file."""
    (provisioned.made.own / name).unlink()
    with pytest.raises(BoundaryError) as refused:
        ListeningBoundary(provisioned.socket)
    assert refused.value.slug == "not-begun"
    assert f"`{name}`" in refused.value.help


@pytest.mark.parametrize("name", ["root.trust", "root.pin", "log.seed", "boundary.seed", "link.key"])
def test_unreadable_file_is_reported(provisioned: Provisioned, name: str) -> None:
    """Without its link key the vehicle would have a boundary that signs nothing."""
    place = provisioned.made.own / name
    kept = place.read_bytes()
    place.rename(place.with_name("elsewhere"))
    place.symlink_to("elsewhere")
    assert provisioned.why_not() == "not-begun", "a link is not followed"
    for make in (Path.mkdir, os.mkfifo):
        place.rmdir() if place.is_dir() and not place.is_symlink() else place.unlink()
        make(place)
        assert provisioned.why_not() == "not-begun", make
    place.unlink()
    place.write_bytes(kept)
    place.chmod(0)
    assert provisioned.why_not() == "not-begun", "its user may not read it"


@pytest.mark.parametrize("octets", [b"", b"\n", b"no key\n", b"5a" * 600, b" " * 200])
def test_invalid_pin_is_reported(provisioned: Provisioned, octets: bytes) -> None:
    """A development root is not trusted when the pin is missing."""
    provisioned.put("root.pin", octets)
    assert provisioned.why_not() == "untrusted"


def test_runtime_gone_before_answer_is_handled(provisioned: Provisioned) -> None:
    """The bundle is released, because nothing of it was sent."""
    process = ListeningBoundary(provisioned.socket)
    (halted,) = provisioned.made.boundaries()

    def call(octets: bytes) -> bytes:
        if octets[0] == LOAD:
            os.kill(halted, signal.SIGSTOP)
            process._socket.send(octets)
            process.close()
            os.kill(halted, signal.SIGCONT)
            return b""
        return process.call(octets)

    provisioned.load(process, Caller(call, signs=True))
    provisioned.made.await_gone(3)
    again = ListeningBoundary(provisioned.socket)
    caller = Caller(again.call, signs=True)
    assert isinstance(provisioned.load(again, caller), Loaded)
    assert not caller.reopened
    again.close()


def test_invalid_files_are_reported(provisioned: Provisioned) -> None:
    own, put = provisioned.made.own, provisioned.put
    pin = (own / "root.pin").read_bytes()
    put("root.pin", case.KEYS[Duty.LOG].kid.hex().encode())
    assert provisioned.why_not() == "untrusted", "signed by another key than the pinned one"
    put("root.pin", pin)
    root = (own / "root.trust").read_bytes()
    put("root.trust", root[:-1] + bytes([root[-1] ^ 1]))
    assert provisioned.why_not() == "untrusted"
    put("root.trust", root)
    put("link.key", b"no key")
    assert provisioned.why_not() == "not-begun"
    put("link.key", b"5a" * 32)
    (own / "kept").write_bytes(bytes((own / "kept").stat().st_size))
    assert provisioned.why_not() == "damaged"
    (own / "kept").unlink()
    (own / "kept").symlink_to("/dev/null")
    assert provisioned.why_not() == "not-kept"
    (own / "kept").unlink()
    assert provisioned.why_not() == "damaged", "whoever provisions the folder makes it"
    put("kept", b"")
    provisioned.made.give()
    assert provisioned.why_not() == "damaged"
    put("kept", first_kept(0, case.KEYS[Duty.LOG].public))
    provisioned.made.give()
    assert provisioned.why_not() == "damaged", "it is another boundary's"
    put("kept", first_kept(0, case.BOUNDARY_KEY.public))
    provisioned.made.give()
    ListeningBoundary(provisioned.socket).close()
    provisioned.made.await_gone(1)
    own.chmod(0o750)
    assert provisioned.why_not() == "not-begun", "other users have access to the folder"


def test_boundary_serves_only_its_vehicle(provisioned: Provisioned) -> None:
    """Another vehicle in the runtime's request changes nothing, because there is no folder for it."""
    provisioned.made.own.rename(provisioned.made.folder / "quad-08")
    assert provisioned.why_not() == "not-begun"


def test_boundary_of_another_release_is_refused(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(tmp_path / "s"))
        listener.listen()

        def greet() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.send(bytes(12))

        answers = threading.Thread(target=greet)
        answers.start()
        with pytest.raises(BoundaryError, match="another release") as refused:
            ListeningBoundary(tmp_path / "s")
        answers.join()
    assert refused.value.slug == "not-begun"


def test_missing_listener_is_reported(tmp_path: Path) -> None:
    with pytest.raises(BoundaryError, match="no boundary listens") as refused:
        ListeningBoundary(tmp_path / "none")
    assert refused.value.slug == "missing"
