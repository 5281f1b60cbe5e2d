"""The boundary as a trusted application of OP-TEE under QEMU (boundary/home/optee), called through a client in the
guest's Linux.

The emulator is started here and ends with the run. A serial port of the guest carries the calls to the client. What
must outlive the application is in OP-TEE's secure storage: files of the guest, on a disk image that is kept here. There
is no monotonic counter, so who puts an old image back is not noticed by the boundary. Debian's public default key
signs the application. It is a model for development.
"""

import os
import shlex
import shutil
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from struct import Struct
from typing import Final, NamedTuple

from rtshcua.adapters.boundary.emulator import DONE, READY, EmulatedHome, Setup, is_quiet
from rtshcua.adapters.boundary.home import GREETING_BYTES, PATIENCE_S, BoundaryError, hold_kept, kept_file
from rtshcua.adapters.store.writing import PRIVATE_FILE, create_whole
from rtshcua.model.flat.home_limits import TRUSTZONE_M
from rtshcua.onboard.enforcement.isolated import LOAD

#: the program that emulates, and what installs it and builds the rest
EMULATOR: Final = "qemu-system-aarch64"
INSTALL: Final = "apt-get install qemu-system-arm, then `make optee` as root, which builds what it runs"
#: what makes it a model for development
DEVELOPMENT: Final = "a public key signs its trusted applications, and it has no monotonic counter"
#: how long firmware, OP-TEE and Linux may take to start, in s: 4 to 14 on two cores, by what else they do
BOOT_S: Final = 90.0
#: how long an answer may take, in s: longer than in other homes, as one may wait for secure storage (0.1 s and more on
#: a busy machine); less than clocks may be apart (APART_US)
ANSWER_S: Final = 1.5
_BUILT: Final = Path(__file__).resolve().parents[3] / "build" / "optee"
_FILES: Final = ("flash.bin", "machine.dtb", "kernel", "initrd.gz", "storage.img", "machine")
#: where `.make/optee` tells firmware and kernel that these are
_KERNEL_AT, _INITRD_AT = 0x40200000, 0x48000000
_HEAD: Final = Struct("<cI")
_MAILBOX: Final = 0x8000
#: room that the application needs behind the setup for what was kept
_KEPT_ROOM: Final = 0x2000


class Machine(NamedTuple):
    """What the emulator runs: a folder that `.make/optee` wrote."""

    folder: Path

    def words(self, storage: int, port: int) -> list[str]:
        """The command line, for the files of the disk and of the serial port."""
        there = {name: str(self.folder / name).replace(",", ",,") for name in _FILES}
        return [
            EMULATOR, *shlex.split((self.folder / "machine").read_text()), "-nodefaults", "-nographic", "-monitor",
            "none", "-no-reboot", "-serial", "null", "-serial", "null", "-bios", str(self.folder / "flash.bin"),
            "-dtb", str(self.folder / "machine.dtb"),
            "-device", f"loader,file={there['kernel']},addr={_KERNEL_AT:#x},force-raw=on",
            "-device", f"loader,file={there['initrd.gz']},addr={_INITRD_AT:#x},force-raw=on",
            "-drive", f"if=none,id=storage,format=raw,file=/proc/self/fd/{storage}",
            "-device", "virtio-blk-pci,drive=storage", "-chardev", f"socket,id=port,fd={port}",
            "-device", "virtio-serial-pci", "-device", "virtserialport,chardev=port",
        ]  # fmt: skip


def machine(folder: Path = _BUILT) -> Machine | None:
    """What a checkout has built; None where it was not."""
    return Machine(folder) if all((folder / name).is_file() for name in _FILES) else None


def missing_packages() -> BoundaryError | None:
    """Why this home cannot begin on this machine; None where it can."""
    if shutil.which(EMULATOR) is None:
        return BoundaryError("missing", f"`{EMULATOR}` is not installed", INSTALL)
    if machine() is None:
        return BoundaryError("missing", "the trusted application and its machine were not built", INSTALL)
    return None


class TrustedApplication(EmulatedHome):
    """A boundary in OP-TEE, started here, until `close`.

    The arguments are those of `process.BoundaryProcess`; there is no user. `progress` is called about once a second
    with the seconds since the start, while the machine boots. Raises BoundaryError, LinkKeyError and OSError.
    """

    part = TRUSTZONE_M["MAX_PART"]
    most_ahead = TRUSTZONE_M["MOST_AHEAD"]

    def __init__(
        self, root: bytes, pinned: bytes, vehicle: str, state: Path, *, link_key: Path | None = None,
        own_seed: bytes | None = None, log_seed: bytes | None = None, settings: bytes | None = None,
        owed: bytes | None = None, paced: bool = False, utc_error_us: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> None:  # fmt: skip
        missing, runs = missing_packages(), machine()
        if missing is not None or runs is None:
            raise missing or BoundaryError("missing", "the trusted application was not built", INSTALL)
        self._storage = kept_file(state, vehicle).with_suffix(".optee")
        self._lost = False
        self._port, theirs = socket.socketpair()
        setup = Setup(root, pinned, vehicle, link_key, own_seed, log_seed, settings, owed, paced, utc_error_us)
        try:
            self._lock = hold_kept(state, vehicle)
            create_whole(self._storage, (runs.folder / "storage.img").read_bytes(), mode=PRIVATE_FILE)
            setup.packed(b"", bytes(32), _MAILBOX - _KEPT_ROOM)  # what is wrong with it shows before the start
            storage = os.open(self._storage, os.O_RDWR | os.O_CLOEXEC)
            try:
                self._launch(runs.words(storage, theirs.fileno()), [storage, theirs.fileno()], INSTALL)
            finally:
                os.close(storage)
                theirs.close()
            self._boot(progress or (lambda _: None))
            self._begin(setup)
        except BaseException:
            theirs.close()
            self.close()
            raise

    @property
    def counter(self) -> int:
        """The counter of what was kept."""
        return self._counter

    def call(self, octets: bytes) -> bytes:
        """One call. Raises OSError when nobody answers; an empty answer says that it is gone."""
        code, answer = self._ask(b"C", octets, PATIENCE_S if octets[0] == LOAD else ANSWER_S)
        return answer if code == DONE else b""

    def kept(self) -> bytes:
        """What is in secure storage: `rt_kept` of boundary/enforcement/kept.h, and its check. Raises OSError."""
        return self._ask(b"L", b"", PATIENCE_S)[1]

    def close(self) -> None:
        """End the emulator, whatever state it is in; an application that answers first keeps what is to be kept."""
        if self._process is not None:
            with suppress(OSError):
                self._ask(b"E", b"", ANSWER_S)
        self._end()
        self._port.close()

    def _boot(self, progress: Callable[[int], None]) -> None:
        """Wait until the client says that the application is there."""
        began_s = time.monotonic()
        self._port.settimeout(1)
        while (passed_s := time.monotonic() - began_s) < BOOT_S:
            try:
                head = self._receive(_HEAD.size)
            except TimeoutError:
                progress(round(passed_s))
                continue
            except OSError:
                head = b""
            if head == _HEAD.pack(READY, 0):
                return
            raise BoundaryError("not-begun", "OP-TEE does not start in the emulator", INSTALL)
        raise BoundaryError("not-begun", f"OP-TEE did not start within {BOOT_S:.0f} s in the emulator")

    def _begin(self, setup: Setup) -> None:
        """Give it the setup, which names the time, and take its first message."""
        try:
            code, greeting = self._ask(b"B", setup.packed(b"", bytes(32), _MAILBOX - _KEPT_ROOM), PATIENCE_S)
            if code == READY:
                code, greeting = self._ask(b"G", b"", PATIENCE_S)
        except OSError:
            code, greeting = b"", b""
        if code != DONE or len(greeting) != GREETING_BYTES + 8:
            raise self._not_begun(code, greeting, self._storage, "OP-TEE")
        self._read_greeting(greeting[:-8])
        self._counter = int.from_bytes(greeting[-8:], "little")

    def _ask(self, want: bytes, octets: bytes, patience_s: float) -> tuple[bytes, bytes]:
        """What becomes of a wish, and its answer. Raises OSError."""
        if len(octets) > _MAILBOX - 8 or self._lost or not is_quiet(self._port):
            return b"", b""
        self._lost = True  # until all of it was exchanged: no answer may be taken for that to another call
        self._port.settimeout(patience_s)
        try:
            self._port.sendall(_HEAD.pack(want, len(octets)) + octets)
            head = self._receive(_HEAD.size)
            code, size = _HEAD.unpack(head) if head else (b"", 0)
            answer = self._receive(size) if size <= _MAILBOX else b""
        except TimeoutError:
            self._kill()
            raise
        if code == b"" or len(answer) != size:
            return b"", b""
        self._lost = False
        return code, answer

    def _receive(self, size: int) -> bytes:
        """So many octets; none where the other end is gone. Raises OSError."""
        found = b""
        while len(found) < size:
            more = self._port.recv(size - len(found))
            if not more:
                return b""
            found += more
        return found
