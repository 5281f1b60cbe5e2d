"""Threat: an attacker who controls the runtime harms the boundary's process, or its state: the boundary or the
runtime is killed at any point; its disk or its tables are full; an old version of its file is restored; calls are
too long, incomplete, or mixed; two runtimes call it at once; a permit comes from another session.

Outcomes: nothing is dispatched without a permit, the stored state is intact, and a mission of which something was
sent does not fly again, unless both its file and the run's were restored: a witness shows that.
"""

import os
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from random import Random

import pytest
from msgspec.structs import replace

from boundary.kept import HEAD, LAYOUT, MOST_OPENED, OPENED
from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT
from reference import flat_case as flat
from reference import outlines
from reference.documents import presented, replacement
from reference.flat_case import M, S
from reference.world import (
    ROOT,
    START,
    VEHICLE,
    allowed,
    answer_to,
    request_for,
    sealed,
)
from rtshcua.adapters.boundary.home import PATIENCE_S, BoundaryError, kept_file
from rtshcua.adapters.boundary.process import BoundaryProcess, program
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.executor import FORGED, OUT_OF_TURN, USED
from rtshcua.onboard.enforcement.isolated import BEGIN, ENFORCE, LOAD, MAX_PART, PART, PRESENT, STATEMENT, Caller
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command
from rtshcua.wire.response import Status

pytestmark = pytest.mark.skipif(program() is None, reason="the boundary's program was not built")
AT_US = START.monotonic_us


class Held:
    """A boundary's process with its caller's time, and a bundle for it."""

    def __init__(self, state: Path, *, own: bool = False) -> None:
        seed = b"the seed of its own signing key." if own else None
        self.process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, state, own_seed=seed, paced=True)
        self.caller = Caller(self.process.call)

    def session(self, proposed: int) -> tuple[int, bytes]:
        """Begin a session of its own evidence; returns its number, and the digest of the previous one."""
        answer = self.caller(BEGIN, proposed.to_bytes(8, "big"), bytes([proposed]) * 32)
        assert isinstance(answer, bytes)
        return int.from_bytes(answer[:8], "big"), answer[8:]

    def load(self, bundle: bytes | None = None) -> Loaded | Refusal:
        return load(
            bundle or sealed(), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.PROCESS,
            session_key=bytes(32),
            flight=bytes(16), peer_is_own_simulator=False, caller=self.caller,
        )  # fmt: skip

    def loaded(self) -> Loaded:
        found = self.load()
        assert isinstance(found, Loaded), found
        return found

    def kill(self) -> None:
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.close()


@pytest.fixture
def held(tmp_path: Path) -> Iterator[Held]:
    made = Held(tmp_path)
    yield made
    made.process.close()


# -------------------------------------------------------------------------------------------- sessions and turns


def test_permit_of_another_session_is_refused(tmp_path: Path) -> None:
    """The same bundle in the previous process: its permits were sealed with a key that no longer exists."""
    first = Held(tmp_path)
    permit = allowed(first.loaded())
    first.process.close()
    second = Held(tmp_path)
    of = second.loaded()
    assert of.executor.dispatch(permit, AT_US) is FORGED
    assert isinstance(of.executor.dispatch(allowed(of), AT_US), Command)
    second.process.close()


def test_step_out_of_turn_is_refused(held: Held) -> None:
    of = held.loaded()
    assert answer_to(of, request_for(of, step=2)) is Status.NOT_CURRENT
    first = allowed(of)
    second = allowed(of, step=1)
    assert isinstance(of.executor.dispatch(first, AT_US), Command)
    assert of.executor.dispatch(second, AT_US) is OUT_OF_TURN, "the first one runs"
    assert of.executor.dispatch(first, AT_US) is USED
    of.executor.ended()
    assert isinstance(of.executor.dispatch(second, AT_US), Command)


def test_two_runtimes_at_one_socket_get_no_more_than_one(held: Held) -> None:
    """They call at once and read each other's answers; a permit is dispatched only once."""
    of = held.loaded()
    permit, sent = allowed(of), list[bytes]()
    call = bytes([5]) + struct.pack(">q", AT_US) + permit

    def runtime() -> None:
        sent.extend(held.process.call(call) for _ in range(200))

    both = [threading.Thread(target=runtime) for _ in range(2)]
    for each in both:
        each.start()
    for each in both:
        each.join()
    assert len(sent) == 400
    assert sum(answer[0] == 0 for answer in sent) == 1


# ------------------------------------------------------------------------------------- too long, half, and mixed


def test_a_call_that_is_too_long_is_not_read_beyond_its_end(held: Held) -> None:
    of = held.loaded()
    for size in (MAX_PART + 64, MAX_PART + 65, 2 * MAX_PART):
        for kind in (PART, LOAD, ENFORCE, PRESENT, 5, 11):
            assert held.process.call(bytes([kind]) + bytes(size - 1))[:1] in (b"\0", b"\1")
            held.process.call(bytes([PART, PRESENT]) + struct.pack(">I", 0))
    assert isinstance(answer_to(of, request_for(of)), Decision)


def test_partial_bundle_is_refused(held: Held) -> None:
    """Truncated anywhere, in any parts, with the size of the whole."""
    bundle, times = sealed(), struct.pack(">qqq", AT_US, START.utc_us, START.utc_error_us)
    for size in (0, 1, len(bundle) // 2, len(bundle) - 1):
        assert held.caller.put(LOAD, bundle[:size]) is None
        for claimed in (size, len(bundle)):
            refused = held.caller(LOAD, times, struct.pack(">I", claimed))
            assert isinstance(refused, Refusal), size
            assert refused.slug in ("malformed", "truncated", "bad-signature"), refused
        refused = held.caller(ENFORCE, b"")
        assert isinstance(refused, Refusal)
        assert refused.slug == "not-loaded"
    assert isinstance(held.load(), Loaded)


def test_parts_of_two_objects_do_not_combine(held: Held) -> None:
    """A part that does not continue the previous one is refused, whatever came between."""
    bundle, random = sealed(), Random(3)
    for _ in range(30):
        at = 0
        while at < len(bundle):
            size = random.randrange(1, 3_000)
            astray = bytes([PART, random.choice((LOAD, PRESENT))])
            answer = held.process.call(astray + struct.pack(">I", at + 1 + random.randrange(99)) + random.randbytes(50))
            assert answer[0] == 1
            part = held.caller(PART, bytes([LOAD]) + struct.pack(">I", at), bundle[at : at + size])
            assert part == b""
            at += size
    whole = struct.pack(">qqqI", AT_US, START.utc_us, START.utc_error_us, len(bundle))
    answer = held.caller(LOAD, whole)
    assert isinstance(answer, bytes), answer


def long_ways(legs: int) -> tuple[Policy, Mission]:
    """A survey of many legs beside an area whose edges all run through nearly all heights."""
    band = outlines.polygon(tuple((x + 300 * M, y) for x, y in outlines.zig_zag(2_000)))
    airspace = flat.POLICY.airspace
    assert airspace is not None
    closed = replace(airspace, outside=(*airspace.outside, len(flat.ZONES)))
    policy = replace(flat.POLICY, zones=(*flat.ZONES, band), airspace=closed)
    path = tuple(part for at in range(legs + 1) for part in (110 * M + 20 * at, -20 * M * (-1) ** at))
    steps = list(flat.MISSION.invocations)
    inspection = steps[flat.INSPECTION_STEP]
    steps[flat.INSPECTION_STEP] = replace(inspection, plan=replace(inspection.plan, path=path))
    return policy, replace(flat.MISSION, invocations=tuple(steps))


def test_longest_path_is_answered_in_time(tmp_path: Path) -> None:
    """What a path answers about each zone is found when its step is asked for, in the air: there a boundary that takes
    longer than a second is given up. A mission with such a path is refused, and so is a replacement.
    """
    held = Held(tmp_path)
    refused = held.load(sealed(*long_ways(2_000)))
    assert isinstance(refused, Refusal)
    assert refused.slug == "malformed"
    policy, mission = long_ways(500)
    flown = held.load(sealed(policy, mission))
    assert isinstance(flown, Loaded), flown
    worse = replace(long_ways(2_000)[1], issued_at_us=mission.issued_at_us + S)
    for step in range(3):
        if step == flat.INSPECTION_STEP:
            assert presented(flown, replacement(flown, step, worse)).slug == "malformed"
        answer = answer_to(flown, request_for(flown, step=step))
        assert isinstance(answer, Decision), answer
        assert answer.outcome is Outcome.ALLOW
        assert isinstance(flown.executor.dispatch(answer.permit, AT_US), Command)
        flown.executor.ended()
    assert not held.caller.lost
    held.process.close()


# ---------------------------------------------------------------------------------------------------- kill -9

POINTS = ("begun", "half a bundle", "handed over", "in force", "asked", "sent", "ended")


def up_to(held: Held, point: str) -> Loaded | None:
    """A session up to a given point."""
    number = POINTS.index(point)
    of = None
    if number == 1:
        held.caller(PART, bytes([LOAD]) + struct.pack(">I", 0), sealed()[:500])
    if number == 2:
        held.caller.put(LOAD, sealed())
    if number >= 3:
        of = held.loaded()
    if of is not None and number >= 4:
        permit = allowed(of)
        if number >= 5:
            assert isinstance(of.executor.dispatch(permit, AT_US), Command)
        if number >= 6:
            of.executor.ended()
    return of


@pytest.mark.parametrize("point", POINTS)
def test_killed_boundary_passes_nothing_and_keeps_state(point: str, tmp_path: Path) -> None:
    """Once the bundle is in force, no step of it begins after a restart; before that, all of it may fly."""
    first = Held(tmp_path)
    of = up_to(first, point)
    first.kill()
    if of is not None:
        assert isinstance(of.executor.frames.seal(b"\xfd" + bytes(20), AT_US), Refusal)
        assert answer_to(of, request_for(of)) is Status.MALFORMED
    second = Held(tmp_path)
    again = second.loaded()
    answer = answer_to(again, request_for(again))
    if of is None:
        assert isinstance(answer, Decision)
        assert answer.permit
    else:
        assert answer is Status.NOT_CURRENT
    second.process.close()


def test_state_file_is_intact_after_kill_during_write(tmp_path: Path) -> None:
    """If a write is interrupted at any moment, the other copy remains."""
    random = Random(7)
    for _ in range(25):
        held = Held(tmp_path)  # raises where what was kept is damaged
        held.caller.put(LOAD, sealed())
        size = struct.pack(">qqqI", AT_US, START.utc_us, START.utc_error_us, len(sealed()))
        killed = threading.Timer(random.random() * 0.006, os.kill, (held.process.pid, signal.SIGKILL))
        killed.start()
        held.caller(LOAD, size)
        killed.join()
        held.process.close()
    Held(tmp_path).process.close()


RUNTIME = """
import os, sys
sys.path[:0] = {path!r}
from pathlib import Path
from attacks.test_boundary_process_harmed import Held, up_to
held = Held(Path({state!r}))
up_to(held, {point!r})
print(held.process.pid, flush=True)
sys.stdin.read()
"""


@pytest.mark.slow
@pytest.mark.parametrize("point", ["begun", "half a bundle", "in force", "sent"])
def test_boundary_ends_when_runtime_is_killed(point: str, tmp_path: Path) -> None:
    code = RUNTIME.format(path=sys.path, state=str(tmp_path), point=point)
    runtime = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert runtime.stdout is not None
    assert runtime.stdin is not None
    assert runtime.stdout.readline().strip().isdigit()
    runtime.kill()
    runtime.wait()
    runtime.stdout.close()
    runtime.stdin.close()
    second, until_s = None, time.monotonic() + PATIENCE_S
    while second is None:
        assert time.monotonic() < until_s, "the boundary goes on without its runtime"
        with suppress(BoundaryError):  # in use
            second = Held(tmp_path)
    again = second.loaded()
    answer = answer_to(again, request_for(again))
    assert (answer is Status.NOT_CURRENT) == (point == "sent"), "what nothing was sent of may be flown"
    second.process.close()


# ----------------------------------------------------------------------------------------- what it keeps, and where


def test_mission_beyond_memory_limit_is_refused(tmp_path: Path) -> None:
    """The file says that the greatest number of missions is opened, none of which has expired."""
    Held(tmp_path).process.close()
    path = kept_file(tmp_path, VEHICLE)
    data = path.read_bytes()
    slot = len(data) // 2
    body = bytearray(data[:slot])
    head = list(HEAD.unpack_from(body))
    assert head[0] == LAYOUT
    head[1], head[4] = 1_000, MOST_OPENED
    HEAD.pack_into(body, 0, *head)
    for number in range(MOST_OPENED):
        OPENED.pack_into(body, HEAD.size + number * OPENED.size, number.to_bytes(32, "big"), 1 << 60)
    body[-32:] = sha256(body[:-32]).digest()
    path.write_bytes(bytes(body) + data[slot:])
    held = Held(tmp_path)
    refused = held.load()
    assert isinstance(refused, Refusal)
    assert refused.slug == "full"
    refused = held.caller(ENFORCE, b"")
    assert isinstance(refused, Refusal)
    assert refused.slug == "not-loaded"
    held.process.close()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may mount a disk that is small")
def test_full_disk_prevents_start(tmp_path: Path) -> None:
    """A mission that cannot be recorded is not opened; with room again it is, and the earlier state is intact."""
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(tmp_path)], check=False, capture_output=True
    )
    if mounted.returncode != 0:
        pytest.skip("no file system may be mounted here")
    try:
        held = Held(tmp_path)
        size = kept_file(tmp_path, VEHICLE).stat().st_size
        filler = tmp_path / "filler"
        with filler.open("wb", buffering=0) as file, suppress(OSError):
            while True:
                file.write(bytes(4_096))
        refused = held.load()
        assert isinstance(refused, Refusal), "the second place of its file has no room"
        assert refused.slug == "not-kept"
        assert kept_file(tmp_path, VEHICLE).stat().st_size < 2 * size
        held.process.close()
        filler.unlink()
        again = Held(tmp_path)
        assert isinstance(again.load(), Loaded)
        again.process.close()
    finally:
        subprocess.run(["umount", "-l", str(tmp_path)], check=True, capture_output=True)


def test_restored_state_file_forgets_opened_missions(tmp_path: Path) -> None:
    """The limit, stated: whoever may write the state folder can put it back, and the boundary cannot tell. Permits that
    it sealed are not good again, nor is the flight's id the same; the logs of both flights are there for a witness.
    """
    Held(tmp_path).process.close()
    path = kept_file(tmp_path, VEHICLE)
    before = path.read_bytes()
    first = Held(tmp_path)
    of = first.loaded()
    permit = allowed(of)
    assert isinstance(of.executor.dispatch(permit, AT_US), Command)
    first.process.close()
    path.write_bytes(before)
    second = Held(tmp_path)
    again = second.loaded()
    assert again.executor.dispatch(permit, AT_US) is FORGED
    assert again.in_force.flight != of.in_force.flight
    assert isinstance(answer_to(again, request_for(again)), Decision)
    second.process.close()


def test_a_file_that_is_cut_or_changed_is_damage(tmp_path: Path) -> None:
    """Except for damage to one of the two copies, when the other is used."""
    for _ in range(2):
        Held(tmp_path).process.close()
    path = kept_file(tmp_path, VEHICLE)
    data = path.read_bytes()
    slot = len(data) // 2
    for changed in (data[:100], bytes(len(data)), data[: slot - 1]):
        path.write_bytes(changed)
        with pytest.raises(BoundaryError) as refused:
            Held(tmp_path)
        assert refused.value.slug == "damaged"
    for place in (0, slot):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        Held(tmp_path).process.close()


def rewritten(path: Path, layout: int, opened: int) -> None:
    """Its file in the previous layout, with so many missions opened, the last of which expires last."""
    data = path.read_bytes()
    slot = len(data) // 2
    body = bytearray(data[:slot])
    head = list(HEAD.unpack_from(body))
    head[0], head[1], head[4] = layout, 1_000, opened
    HEAD.pack_into(body, 0, *head)
    for number in range(max(opened, 3)):
        OPENED.pack_into(body, HEAD.size + number * OPENED.size, number.to_bytes(32, "big"), number + 1)
    body[-32:] = sha256(body[:-32]).digest()
    path.write_bytes(bytes(body) + data[slot:])


@pytest.mark.parametrize(("before", "opened"), [(1, 0), (1, 3), (1, MOST_OPENED + 1), (2, 3), (2, MOST_OPENED + 2)])
def test_state_file_of_older_layout_is_accepted(before: int, opened: int, tmp_path: Path) -> None:
    """The old layout has no sessions; if it is full, the mission that no longer fits cannot be opened again."""
    Held(tmp_path, own=True).process.close()
    path = kept_file(tmp_path, VEHICLE)
    rewritten(path, LAYOUT - before, opened)
    held = Held(tmp_path, own=True)
    held.loaded()
    assert held.session(7) == (7, b"\x07" * 32), "as the state folder says"
    held.process.close()
    data = path.read_bytes()
    heads = [HEAD.unpack_from(data, at) for at in (0, len(data) // 2)]
    newest = max(heads, key=lambda head: head[1])
    assert newest[0] == LAYOUT
    assert newest[3] == (opened or -1), "what has expired, or lost its place, counts as opened"
    rewritten(path, LAYOUT - 3, opened)
    path.write_bytes(path.read_bytes()[: len(data) // 2])
    with pytest.raises(BoundaryError, match="damaged"):
        Held(tmp_path)


def test_boundary_counts_its_sessions(tmp_path: Path) -> None:
    """A restored state folder does not reset its count; a folder that is ahead counts."""
    digests = []
    for proposed, found in ((1, 1), (1, 2), (0, 3), (3, 4), (9, 9), (1, 10)):
        held = Held(tmp_path, own=True)
        loaded = held.loaded()
        session, before = held.session(proposed)
        assert session == found
        assert before == (bytes([proposed]) * 32 if proposed == found else digests[-1])
        final = loaded.attestation.digest
        if found != 4:
            held.caller(STATEMENT, b"\1", bytes(24))
            held.process.close()
        else:  # killed, and what it had at its beginning counts
            os.kill(held.process.pid, signal.SIGKILL)
            held.process.close()
        digests.append(final)


# --------------------------------------------------------------------------------------------------- its keys


def test_boundary_keys_are_not_in_files_or_core_dumps(tmp_path: Path) -> None:
    """A crash leaves no core; its file and its command line contain no octets of its keys."""
    key, seed = tmp_path / "link.key", b"the seed of its own signing key."
    key.write_bytes(b"the key of the link, 32 octets..")
    key.chmod(0o600)
    process = BoundaryProcess(SIGNED_ROOT, PIN, VEHICLE, tmp_path, link_key=key, own_seed=seed, paced=True)
    said = Path(f"/proc/{process.pid}/cmdline").read_bytes()
    os.kill(process.pid, signal.SIGSEGV)
    _, status = os.waitpid(process.pid, 0)
    process.close()
    kept = kept_file(tmp_path, VEHICLE).read_bytes()
    for secret in (key.read_bytes(), seed):
        assert secret not in said
        assert secret not in kept
    assert os.WIFSIGNALED(status)
    assert not os.WCOREDUMP(status)
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == {
        "link.key",
        kept_file(tmp_path, VEHICLE).name,
    }
