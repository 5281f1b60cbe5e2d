"""Threat: a compromised runtime wants the keys of the boundary's process, or frames that no permit covers. It has the
socket, the files of its own user, and the rights of that user.

Outcomes: the keys cannot be read; requests out of turn, ahead of time or with a seal of another session are
refused; malformed calls are answered without an effect; a second runtime finds the boundary in use; after the
death of the boundary only frames that it signed ahead are sent.
"""

import os
import signal
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as m

from reference.flying import refusal_of, request
from rtshcua.adapters.boundary import home
from rtshcua.adapters.boundary import process as boundary_process
from rtshcua.adapters.boundary.home import ANSWER_S, PATIENCE_S, BoundaryError, first_kept, kept_file
from rtshcua.adapters.boundary.process import AGAIN_S, BoundaryProcess, Measure
from rtshcua.adapters.clock import monotonic_ns
from rtshcua.adapters.store.signing import LinkKeyError, fingerprint, read_link_key
from rtshcua.adapters.store.writing import lock
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.app.fly.start_boundary import start_home
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.enforcement.ahead import NO_COPY
from rtshcua.onboard.enforcement.isolated import DISPATCH, ENFORCE, LOAD, LOST, OBSERVE, PART, SEAL, Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.wire.boundary_chain import MARK_BYTES, MOST_MARKS
from rtshcua.wire.keys import Duty
from rtshcua.wire.permit import Permit, seal
from rtshcua.wire.request import STEP, Request, encode
from rtshcua.wire.response import Status, decode
from rtshcua.wire.statement import open_statement
from virtual import case
from virtual.shipped import shipped

VEHICLE = "quad-07"
ROOT_USER = pytest.mark.skipif(os.geteuid() != 0, reason="only root may start what runs as another user")


def issued_us() -> int:
    return time.time_ns() // 1_000 - 60_000_000


def now() -> Now:
    return Now(monotonic_ns() // 1_000, time.time_ns() // 1_000, 1_000)


class Held:
    """A boundary's process with a bundle in force, and the runtime's copy of the bundle."""

    def __init__(
        self, state: Path, user: tuple[int, int] | None = None, *, issued: int | None = None, **more: Any
    ) -> None:
        self.issued = issued or issued_us()
        self.root, signed = case.root(self.issued)
        pin = case.KEYS[next(iter(case.KEYS))].kid
        more = {"utc_error_us": 1_000} | more
        self.process = BoundaryProcess(signed, pin, VEHICLE, state, user=user, **more)
        self.caller = Caller(self.process.call)
        self.caller.time(settle=True)
        self.bundle = shipped("short", self.issued)

    def load(self) -> Loaded:
        loaded = load(
            self.bundle, root=self.root, vehicle=VEHICLE, now=now(), mode=EnforcementMode.PROCESS,
            session_key=bytes(32),
            flight=bytes(16), peer_is_own_simulator=False, caller=self.caller,
        )  # fmt: skip
        assert isinstance(loaded, Loaded), loaded
        self.loaded = loaded
        return loaded

    def ask(self, step: int = 0, at: Now | None = None) -> Decision | Status | Refusal:
        at = at or now()
        policy, invocation = self.loaded.bundle.policy, self.loaded.bundle.mission.invocations[step]
        state = State((None,) * policy.slots, (0,) * policy.slots, (4,) * len(policy.monitors))
        released = self.loaded.in_force.received_us(0)
        request = encode(Request(STEP, step, -1, invocation.binding, at, state, released, 0, 0))
        return decode(self.loaded.boundary.enforce(request), policy, invocation.contract)


@pytest.fixture
def held(tmp_path: Path) -> Iterator[Held]:
    made = Held(tmp_path)
    made.load()
    yield made
    made.process.close()


def armed_frame() -> bytes:
    return Codec(1, 191).pack(m.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))


@ROOT_USER
def test_another_user_cannot_read_boundary(tmp_path: Path) -> None:
    """As the runtime's user: no memory, no ptrace, no core dump; the process itself has few rights."""
    held = Held(tmp_path, (65_534, 65_534))
    try:
        assert Measure.OWN_USER in held.process.measures
        assert not set(held.process.missing) & {"Landlock (not in this kernel)"}
        status = Path(f"/proc/{held.process.pid}/status").read_text()
        said = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
        assert (said["Seccomp"].strip(), said["NoNewPrivs"].strip()) == ("2", "1")
        assert int(said["CapEff"].strip(), 16) == 0
        assert "0" in Path(f"/proc/{held.process.pid}/limits").read_text().split("Max core file size")[1].split()[:1]
        for user in (65_533, 65_534):  # the runtime's, and its own
            assert as_user(user, held.process.pid) == 0
    finally:
        held.process.close()


def as_user(user: int, pid: int) -> int:
    """A program of another user that tries to read a process; 0 if it reads nothing."""
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setresgid(user, user, user)
            os.setresuid(user, user, user)
            got = 0
            for name in ("mem", "maps", "environ", "syscall"):
                try:
                    with open(f"/proc/{pid}/{name}", "rb") as file:  # noqa: PTH123
                        got += len(file.read(1))
                except OSError:
                    pass
            import ctypes

            libc = ctypes.CDLL(None, use_errno=True)
            attach = 16
            got += libc.ptrace(attach, pid, 0, 0) == 0
            os._exit(min(got, 100))
        finally:
            os._exit(101)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_second_runtime_finds_boundary_in_use(held: Held, tmp_path: Path) -> None:
    with pytest.raises(BoundaryError, match="another run") as refused:
        Held(tmp_path)
    assert refused.value.slug == "in-use"


def test_permit_cannot_be_forged_or_reused(held: Held, tmp_path: Path) -> None:
    """Permits sealed by the runtime with any of its keys, and permits of another session of the same bundle."""
    at = struct.pack(">q", now().monotonic_us)
    step = Permit(STEP, 0, -1, 1, 0, 0, 1 << 62)
    for key in (bytes(32), b"\x01" * 32, os.urandom(32)):
        answer = held.caller(DISPATCH, at, seal(step, key))
        assert isinstance(answer, Refusal)
        assert answer.slug == "permit/forged"
    frame = held.caller(SEAL, at, armed_frame())
    assert isinstance(frame, Refusal)


def test_step_out_of_turn_is_refused_by_process(held: Held) -> None:
    assert held.ask(2) is Status.NOT_CURRENT
    first = held.ask(0)
    assert isinstance(first, Decision)
    assert not first.permit, "nothing is known of the vehicle"


def test_invented_time_is_refused_by_process(held: Held) -> None:
    """Nothing is decided ahead of time, or for a time long past, because the boundary has its own clock."""
    here = now()
    for by_us in (10_000_000, -10_000_000):
        at = replace(here, monotonic_us=here.monotonic_us + by_us, utc_us=here.utc_us + by_us)
        assert held.ask(0, at) is Status.MALFORMED
        answer = held.caller(SEAL, struct.pack(">q", at.monotonic_us), armed_frame())
        assert isinstance(answer, Refusal)
        assert answer.slug == "time-apart"


def test_bundle_flies_once_despite_runtime(tmp_path: Path) -> None:
    """The boundary stores the opened missions itself. After a restart it loads the bundle, but lets no step of it
    begin.
    """
    first = Held(tmp_path)
    first.load()
    os.kill(first.process.pid, signal.SIGKILL)
    first.process.close()
    again = Held(tmp_path, issued=first.issued)
    loaded = again.load()
    assert again.ask(0) is Status.NOT_CURRENT
    assert loaded.in_force.flight != first.loaded.in_force.flight
    again.process.close()


def test_frames_without_bundle_are_equal_in_both_processes(tmp_path: Path) -> None:
    """It passes a greeting, and the id of its next flight is known; a refused bundle changes neither."""
    made = Held(tmp_path)
    at = struct.pack(">q", now().monotonic_us)
    assert made.caller.flight() == made.caller.flight()
    ahead = made.caller.flight()
    refused = made.caller.load(made.bundle[:-1], now())
    assert isinstance(refused, Refusal)
    greeting = Codec(1, 191).pack(m.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    assert made.caller(SEAL, at, greeting) == greeting
    answer = made.caller(SEAL, at, armed_frame())
    assert isinstance(answer, Refusal)
    assert made.load().in_force.flight == ahead
    assert made.caller.flight() != ahead
    made.process.close()


def test_bundle_with_nothing_sent_may_be_loaded_again(tmp_path: Path) -> None:
    """By the next process, and by this one, which drops its decisions."""
    first = Held(tmp_path)
    first.load()
    first.process.close()
    again = Held(tmp_path, issued=first.issued)
    for _ in range(2):
        again.load()
        assert isinstance(again.ask(0), Decision)
    again.process.close()


@pytest.mark.parametrize("emptied", [b"", b"\0", first_kept()[:-1], bytes(len(first_kept()))])
def test_emptied_state_file_is_damage(emptied: bytes, tmp_path: Path) -> None:
    """Otherwise opened missions could fly again. At the first start the file says that there is no state."""
    held = Held(tmp_path)
    held.load()
    held.process.close()
    path = kept_file(tmp_path, VEHICLE)
    path.write_bytes(emptied)
    with pytest.raises(BoundaryError, match="damaged"):
        Held(tmp_path)
    assert path.read_bytes() == emptied, "and it stays for somebody to look at"


def test_interrupted_first_start_counts_as_first_start(tmp_path: Path) -> None:
    Held(tmp_path).process.close()
    path = kept_file(tmp_path, VEHICLE)
    slot = path.stat().st_size // 2
    torn = first_kept().ljust(slot, b"\0") + bytes(100)
    path.write_bytes(torn)
    held = Held(tmp_path)
    assert isinstance(held.load(), Loaded)
    held.process.close()
    path.write_bytes(first_kept().ljust(2 * slot, b"\0"))
    with pytest.raises(BoundaryError, match="damaged"):
        Held(tmp_path)


def test_mission_issued_before_provisioning_is_refused(tmp_path: Path) -> None:
    """The new folder does not know the missions that an earlier one opened."""
    (tmp_path / "boundary").mkdir()
    path = kept_file(tmp_path, VEHICLE)
    issued = issued_us()
    for since_us, opens in ((issued + 1, False), (issued, True)):
        path.write_bytes(first_kept(since_us))
        held = Held(tmp_path, issued=issued)
        answer = held.caller.load(held.bundle, now())
        assert (answer.slug == "before-provisioned") if isinstance(answer, Refusal) else opens
        held.process.close()


def test_a_file_of_another_boundary_is_damage(tmp_path: Path) -> None:
    (tmp_path / "boundary").mkdir()
    own = case.BOUNDARY_KEY.private.private_bytes_raw()
    kept_file(tmp_path, VEHICLE).write_bytes(first_kept(0, case.BOUNDARY_KEY.public))
    for seed in (None, case.KEYS[Duty.LOG].private.private_bytes_raw()):
        with pytest.raises(BoundaryError, match="damaged"):
            Held(tmp_path, own_seed=seed)
    Held(tmp_path, own_seed=own).process.close()
    with pytest.raises(BoundaryError, match="damaged"):
        Held(tmp_path)


def test_damaged_stored_state_is_not_read(tmp_path: Path) -> None:
    Held(tmp_path).process.close()
    path = kept_file(tmp_path, VEHICLE)
    path.write_bytes(bytes(len(path.read_bytes())))
    with pytest.raises(BoundaryError, match=f"`{path}` is damaged"):
        Held(tmp_path)


LINK_KEYS = {
    "octets": bytes(range(32)), "digits": b"5a" * 32, "a line": b"5A" * 32 + b"\n", "spaces": b" 5a" * 32 + b" \r\n",
    "nothing": b"", "short": b"5a" * 31, "long": b"5a" * 33, "an octet more": bytes(33), "no digits": b"5x" * 32,
    "zeros": bytes(32), "zero digits": b"0" * 64, "something behind it": b"5a" * 32 + b"\n#",
    "a split octet": b"5 a" * 32, "an odd digit": b"5a" * 32 + b"5", "a sign": b"+a" * 32,
}  # fmt: skip


@pytest.mark.parametrize("what", LINK_KEYS)
def test_boundary_accepts_key_files_of_run(what: str, tmp_path: Path) -> None:
    key = tmp_path / "link.key"
    key.write_bytes(LINK_KEYS[what])
    key.chmod(0o600)
    try:
        name, refused = fingerprint(read_link_key(key)), ""
    except LinkKeyError as error:
        name, refused = "", str(error)
    if refused:
        with pytest.raises(LinkKeyError) as raised:
            Held(tmp_path, link_key=key)
        assert (raised.value.slug, str(raised.value)) == ("malformed", refused)
    else:
        held = Held(tmp_path, link_key=key)
        assert held.process.link_name is not None
        assert held.process.link_name.hex() == name
        held.process.close()


def test_key_file_readable_by_others_is_refused(tmp_path: Path) -> None:
    key = tmp_path / "link.key"
    key.write_bytes(LINK_KEYS["digits"])
    key.chmod(0o640)
    with pytest.raises(LinkKeyError, match="its mode is 0640"):
        Held(tmp_path, link_key=key)


def test_malformed_call_is_answered_without_effect(held: Held) -> None:
    random = Random(5)
    request = encode(
        Request(
            STEP,
            0,
            -1,
            bytes(32),
            now(),
            State((None,) * held.loaded.bundle.policy.slots, (0,) * held.loaded.bundle.policy.slots, ()),
            0,
            0,
            0,
        )
    )
    for _ in range(3_000):
        kind = random.choice(
            (PART, LOAD, ENFORCE, 4, DISPATCH, 6, 7, 8, 9, OBSERVE, SEAL, 12, 13, 14, random.randrange(256))
        )
        body = random.choice((request, armed_frame(), random.randbytes(random.randrange(200))))
        if kind == PART and random.random() < 0.5:
            body = bytes([4]) + random.randbytes(4 + random.randrange(100))
        elif kind == PART:
            continue  # a bundle that is handed over anew takes the place of the one in force
        answer = held.process.call(bytes([kind]) + body[: random.randrange(len(body) + 1)])
        assert answer
        assert answer[0] in (0, 1)
        assert not (kind == SEAL and answer[0] == 0)
    assert isinstance(held.ask(0), (Decision, Status))


def test_longest_statement_is_transferred_completely(tmp_path: Path) -> None:
    """A flood of requests must not make its evidence unreadable: all marks that a statement may contain."""
    held = Held(tmp_path, own_seed=case.BOUNDARY_KEY.private.private_bytes_raw())
    held.load()
    held.loaded.attestation.begin(BoundaryKey(case.BOUNDARY_KEY, 1, bytes(32)))
    for _ in range(2 * MOST_MARKS):
        held.caller(DISPATCH, struct.pack(">q", now().monotonic_us), bytes(56))
    signed = held.loaded.attestation.statement(now())
    held.process.close()
    assert signed is not None
    kid = case.BOUNDARY_KEY.kid
    said = open_statement(signed, {kid: case.BOUNDARY_KEY.verification(vehicles=("*",))})
    assert len(said.marks) == MARK_BYTES * MOST_MARKS


def test_unresponsive_boundary_counts_as_lost(held: Held) -> None:
    os.kill(held.process.pid, signal.SIGSTOP)
    begun_s = time.monotonic()
    assert held.caller(ENFORCE, b"anything") is LOST
    assert time.monotonic() - begun_s < PATIENCE_S, "something flies: it is not waited for as it is to load"
    assert ANSWER_S + AGAIN_S < 2
    os.kill(held.process.pid, signal.SIGCONT)
    assert held.caller(ENFORCE, b"anything") is LOST, "an answer that comes late is not taken for another's"


def test_stall_of_whole_machine_loses_nothing(held: Held, monkeypatch: pytest.MonkeyPatch) -> None:
    """The runtime continues first, and its time limit is over; the answer comes right after."""
    monkeypatch.setattr(boundary_process, "AGAIN_S", PATIENCE_S)  # right after, on a busy machine too
    os.kill(held.process.pid, signal.SIGSTOP)
    goes_on = threading.Timer(ANSWER_S + AGAIN_S / 2, os.kill, (held.process.pid, signal.SIGCONT))
    goes_on.start()
    assert held.ask(0) is not Status.MALFORMED
    goes_on.join()
    assert not held.caller.lost
    assert held.ask(0) is not Status.MALFORMED, "answers belong to their calls"


def test_dead_boundary_sends_only_frames_signed_ahead(held: Held) -> None:
    os.kill(held.process.pid, signal.SIGKILL)
    gate = held.loaded.executor.frames
    assert gate.seal(armed_frame(), now().monotonic_us) is NO_COPY
    assert held.caller(SEAL, armed_frame()) is LOST
    assert held.ask(0) is Status.MALFORMED
    assert held.caller.lost
    assert held.caller(ENFORCE) is LOST


# ---------------------------------------------------------------------------------------- what keeps it from beginning


def tried(state: Path) -> BoundaryProcess | Refusal:
    """Start it as `run` does."""
    _, signed = case.root(issued_us())
    of = request(state=state, link=Address(LinkCarrier.UDP_IN, "127.0.0.1", 1), mode=EnforcementMode.PROCESS)
    return start_home(of, VEHICLE, signed, None, case.KEYS[Duty.LOG], {}, lambda _: None)


def begun(state: Path) -> BoundaryProcess:
    found = tried(state)
    assert isinstance(found, BoundaryProcess)
    return found


def why_not(state: Path) -> tuple[ExitCode, str]:
    found = refusal_of(tried(state))
    assert found.code is not None
    return found.code, found.slug


def test_each_reason_not_to_begin_has_a_slug_and_an_exit_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(home, "ENDING_S", 0.05)
    first = begun(tmp_path)
    assert why_not(tmp_path) == (ExitCode.REFUSED, "boundary-in-use")
    first.close()
    path = kept_file(tmp_path, VEHICLE)
    path.write_bytes(bytes(path.stat().st_size))
    assert why_not(tmp_path) == (ExitCode.INPUT, "boundary-damaged")
    empty = tmp_path / "empty"
    empty.write_bytes(b"")
    empty.chmod(0o755)
    monkeypatch.setattr(boundary_process, "program", lambda: empty)
    assert why_not(tmp_path) == (ExitCode.REFUSED, "boundary-not-begun")
    monkeypatch.setattr(boundary_process, "program", lambda: None)
    assert why_not(tmp_path) == (ExitCode.REFUSED, "boundary-missing")


def test_ending_boundary_is_awaited(tmp_path: Path) -> None:
    begun(tmp_path).close()
    held = lock(kept_file(tmp_path, VEHICLE))
    ends = threading.Timer(0.3, os.close, (held,))
    ends.start()
    begun(tmp_path).close()
    ends.join()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may mount a disk that is small")
def test_full_disk_at_first_start_is_not_damage(tmp_path: Path) -> None:
    """A partly written file does not remain."""
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(tmp_path)]
    if subprocess.run(mount, check=False, capture_output=True).returncode != 0:
        pytest.skip("no file system may be mounted here")
    try:
        assert why_not(tmp_path) == (ExitCode.FULL, "boundary-not-kept")
        subprocess.run(["mount", "-o", "remount,size=2m", str(tmp_path)], check=True, capture_output=True)
        begun(tmp_path).close()
    finally:
        subprocess.run(["umount", "-l", str(tmp_path)], check=True, capture_output=True)
