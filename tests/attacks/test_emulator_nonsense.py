"""An emulator that answers with nonsense: no call counts as answered, then or later."""

import os
import signal
import stat
import sys
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from struct import pack
from typing import Any

import pytest

from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT
from reference.world import VEHICLE
from rtshcua.adapters.boundary import optee
from rtshcua.adapters.boundary.emulator import EmulatedHome
from rtshcua.adapters.boundary.home import GREETING_BYTES, BoundaryError
from rtshcua.adapters.boundary.optee import Machine, TrustedApplication
from rtshcua.adapters.boundary.trustzone_m import Images, SecureWorld
from rtshcua.onboard.enforcement.isolated import DIGEST, LOST, Caller

GREETING, BLOB = pack(f"<{GREETING_BYTES - 1}x?q", True, 7), bytes(6_224)
FINE = b"\0" + bytes(32)

#: what stands in for the client in the guest: it begins as the client does, then answers each call with `NONSENSE`
CLIENT = """
import re, socket, sys
port = socket.socket(fileno=int(re.search(r"id=port,fd=(\\d+)", " ".join(sys.argv))[1]))
def said(code, octets): return code + len(octets).to_bytes(4, "little") + octets
port.sendall(said(b"r", b""))
while True:
    head = port.recv(5, socket.MSG_WAITALL)
    if len(head) < 5: break
    port.recv(int.from_bytes(head[1:], "little"), socket.MSG_WAITALL)
    if head[:1] == b"E": break
    port.sendall({b"B": said(b"r", b""), b"G": said(b"d", GREETING)}.get(head[:1], NONSENSE))
"""

#: what stands in for the secure world: a mailbox and a bell
WORLD = """
import mmap, re, socket, sys
words = " ".join(sys.argv)
bell = socket.socket(fileno=int(re.search(r"id=bell,fd=(\\d+)", words)[1]))
box = mmap.mmap(int(re.search(r"self/fd/(\\d+),size", words)[1]), 0x10000)
def put(code, answer, blob, sizes=None):
    box[:8] = b"".join(each.to_bytes(4, "little") for each in sizes or (len(answer), len(blob)))
    box[8 : 8 + len(answer) + len(blob)] = answer + blob
    bell.sendall(code)
bell.sendall(b"r")
held_back = iter((GREETING, b""))
while want := bell.recv(1):
    if want == b"G": put(b"f", b"", BLOB)
    elif want == b"K": put(b"d", next(held_back), b"")
    elif want == b"E": break
    else: put(*NONSENSE)
"""


def stand_in(folder: Path, name: str, text: str, **values: object) -> None:
    """Put a program of this name first in the path."""
    program = folder / "bin" / name
    program.parent.mkdir()
    given = "".join(f"{each} = {value!r}\n" for each, value in values.items())
    program.write_text(f"#!{sys.executable}\n{given}{text}")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)


@pytest.fixture
def in_front(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Programs of `bin` come before those of the system."""
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}")
    return tmp_path


def application(folder: Path, monkeypatch: pytest.MonkeyPatch) -> TrustedApplication:
    (folder / "machine").write_text("-M virt")
    (folder / "storage.img").write_bytes(bytes(1_024))
    monkeypatch.setattr(optee, "missing_packages", lambda: None)
    monkeypatch.setattr(optee, "machine", lambda: Machine(folder))
    return TrustedApplication(SIGNED_ROOT, PIN, VEHICLE, folder, paced=True)


def secure_world(folder: Path) -> SecureWorld:
    return SecureWorld(SIGNED_ROOT, PIN, VEHICLE, folder, paced=True, programs=Images(folder, folder))


def is_lost(home: EmulatedHome) -> None:
    caller = Caller(home.call)
    first: Any = caller(DIGEST)
    assert first is LOST
    assert caller.lost
    for _ in range(2):
        with suppress(OSError):
            assert home.call(bytes([DIGEST])) == b""


def said(code: bytes, octets: bytes, size: int | None = None) -> bytes:
    return code + (len(octets) if size is None else size).to_bytes(4, "little") + octets


@pytest.mark.parametrize(
    "nonsense",
    [said(b"w", FINE), said(b"v", FINE), said(b"r", FINE), said(b"d", b""), said(b"d", b"", 0xFFFFFFFF), b"\xff" * 5],
)
def test_nonsense_of_a_trusted_application_is_no_answer(
    nonsense: bytes, in_front: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(in_front, optee.EMULATOR, CLIENT, GREETING=GREETING, NONSENSE=nonsense)
    with closing(application(in_front, monkeypatch)) as home:
        assert home.counter == 7
        is_lost(home)


def test_second_answer_of_a_trusted_application_is_not_taken_for_the_next(
    in_front: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(in_front, optee.EMULATOR, CLIENT, GREETING=GREETING, NONSENSE=2 * said(b"d", FINE))
    with closing(application(in_front, monkeypatch)) as home:
        assert home.call(bytes([DIGEST])) == FINE
        is_lost(home)


@pytest.mark.parametrize("cut", [said(b"d", FINE)[:3], said(b"d", FINE)[:9], b""])
def test_half_an_answer_of_a_trusted_application_is_none(
    cut: bytes, in_front: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It hangs: it is killed, so that it does not go on."""
    monkeypatch.setattr(optee, "ANSWER_S", 0.2)
    stand_in(in_front, optee.EMULATOR, CLIENT, GREETING=GREETING, NONSENSE=cut)
    with closing(application(in_front, monkeypatch)) as home:
        is_lost(home)
        assert home._process is not None
        assert home._process.wait(10) == -signal.SIGKILL


@pytest.mark.parametrize(
    "nonsense",
    [
        (b"w", FINE, b""), (b"v", FINE, b""), (b"f", b"", BLOB[:-1]), (b"k", FINE, b""), (b"d", b"", b""),
        (b"d", FINE, b"", (0xFFFFFFFF, 0)), (b"d", FINE, b"", (33, 0xFFFFFFFF)), (b"f", b"", BLOB), (b"?", FINE, b""),
    ],
)  # fmt: skip
def test_nonsense_of_a_secure_world_is_no_answer(nonsense: object, in_front: Path) -> None:
    stand_in(in_front, "qemu-system-arm", WORLD, GREETING=GREETING, BLOB=BLOB, NONSENSE=nonsense)
    with closing(secure_world(in_front)) as home:
        assert home.counter == 7
        is_lost(home)


def test_second_bell_of_a_secure_world_is_not_taken_for_the_next(in_front: Path) -> None:
    stand_in(in_front, "qemu-system-arm", WORLD, GREETING=GREETING, BLOB=BLOB, NONSENSE=(b"dd", FINE, b""))
    with closing(secure_world(in_front)) as home:
        assert home.call(bytes([DIGEST])) == FINE
        is_lost(home)


@pytest.mark.parametrize("first", [b"d", b"b\x4e", b"b\x41", b""])
def test_home_that_does_not_begin_says_why(first: bytes, in_front: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last line of the emulator is part of the message, where it is nothing that the boundary said."""
    text = "sys.stderr.write('no such machine\\n')\n" + CLIENT.replace('said(b"d", GREETING)', "FIRST")
    text = text.replace("sys.stderr", "import sys\nsys.stderr")
    stand_in(in_front, optee.EMULATOR, text, FIRST=said(first[:1] or b"?", first[1:]), NONSENSE=b"")
    with pytest.raises(BoundaryError) as raised:
        application(in_front, monkeypatch)
    slug = {b"b\x4e": "damaged", b"b\x41": "untrusted"}.get(first, "not-begun")
    assert raised.value.slug == slug
    assert ("no such machine" in str(raised.value)) == (slug == "not-begun")


def test_full_disk_at_the_start_is_not_kept(in_front: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(in_front, optee.EMULATOR, CLIENT, GREETING=b"\1not-kept", NONSENSE=b"")
    with pytest.raises(BoundaryError) as raised:
        application(in_front, monkeypatch)
    assert raised.value.slug == "not-kept"


def test_both_homes_wait_for_the_boundary_of_a_killed_run(in_front: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And have one lock: a vehicle has one boundary, whatever its home."""
    monkeypatch.setattr("rtshcua.adapters.boundary.home.ENDING_S", 0.05)
    stand_in(in_front, optee.EMULATOR, CLIENT, GREETING=GREETING, NONSENSE=b"")
    with closing(application(in_front, monkeypatch)):
        for begin in (partial(secure_world, in_front), partial(application, in_front, monkeypatch)):
            with pytest.raises(BoundaryError) as raised:
                begin()
            assert raised.value.slug == "in-use"
