"""The boundary in the secure world of a Cortex-M33 under QEMU (boundary/home/trustzone_m), called by a mailbox.

The emulator is started here and ends with the run. Both sides see one piece of memory; a byte on a serial line says
that something is in it (boundary/home/trustzone_m/mailbox.h). The secure world has no storage: what must outlive it is
handed out sealed and with a counter, and is kept here. Who puts an old file back is not noticed by the boundary, only
by a witness that has seen a later log.
"""

import mmap
import os
import shutil
import socket
import threading
from contextlib import suppress
from pathlib import Path
from struct import Struct
from typing import Final, NamedTuple

from rtshcua.adapters.boundary.emulator import DONE, DONE_KEEP, KEEP_FIRST, READY, EmulatedHome, Setup, not_begun
from rtshcua.adapters.boundary.home import ANSWER_S, GREETING_BYTES, PATIENCE_S, BoundaryError, kept_file
from rtshcua.adapters.store.reading import read_if_there, read_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, create_whole, make_folder, replace
from rtshcua.model.flat.home_limits import TRUSTZONE_M
from rtshcua.onboard.enforcement.isolated import LOAD

#: the program that emulates, and what installs it
EMULATOR: Final = "qemu-system-arm"
INSTALL: Final = "apt-get install qemu-system-arm gcc-arm-none-eabi libnewlib-arm-none-eabi, then `make trustzone-m`"
_BUILT: Final = Path(__file__).resolve().parents[3] / "build" / "boundary" / "trustzone_m"
_PACKAGED: Final = Path(__file__).resolve().parents[2] / "boundary" / "trustzone_m"

#: where the setup is put, in secure memory, and how much fits
_SETUP_AT, _SETUP_SIZE = 0x38180000, 0x80000
_HEAD: Final = Struct("<II")
_MAILBOX: Final = 0x10000
_MEMORY: Final = 16 << 20


class Images(NamedTuple):
    """The programs of the two worlds."""

    secure: Path
    normal: Path


def images() -> Images | None:
    """The programs, in a checkout or as the package has them; None where they were not built."""
    found = (Images(folder / "secure.elf", folder / "normal.elf") for folder in (_BUILT, _PACKAGED))
    return next((each for each in found if each.secure.is_file() and each.normal.is_file()), None)


def missing_packages() -> BoundaryError | None:
    """Why this home cannot begin on this machine; None where it can."""
    if shutil.which(EMULATOR) is None:
        return BoundaryError("missing", f"`{EMULATOR}` is not installed", INSTALL)
    if images() is None:
        return BoundaryError("missing", "the programs of the secure world were not built", INSTALL)
    return None


class SecureWorld(EmulatedHome):
    """A boundary in the secure world, started here, until `close`.

    The arguments are those of `process.BoundaryProcess`; there is no user. Raises BoundaryError, LinkKeyError and
    OSError.
    """

    part = TRUSTZONE_M["MAX_PART"]
    most_ahead = TRUSTZONE_M["MOST_AHEAD"]

    def __init__(
        self, root: bytes, pinned: bytes, vehicle: str, state: Path, *, link_key: Path | None = None,
        own_seed: bytes | None = None, log_seed: bytes | None = None, settings: bytes | None = None,
        owed: bytes | None = None, paced: bool = False, utc_error_us: int | None = None,
        programs: Images | None = None,
    ) -> None:  # fmt: skip
        found = programs or images()
        missing = missing_packages() if programs is None else None
        if missing is not None or found is None:
            raise missing or BoundaryError("missing", "the programs of the secure world were not built", INSTALL)
        self._kept = kept_file(state, vehicle).with_suffix(".trustzone-m")
        make_folder(self._kept.parent, mode=PRIVATE_FOLDER)
        self._hold(self._kept.with_suffix(".trustzone-m-lock"), vehicle)
        self._later = _Keeper(self._kept)
        setup = Setup(root, pinned, vehicle, link_key, own_seed, log_seed, settings, owed, paced, utc_error_us)
        try:
            kept = read_if_there(self._kept, _SETUP_SIZE) or b""
            self._start(found, setup.packed(kept, self._device_key(), _SETUP_SIZE))
            self._greet()
        except BaseException:
            self.close()
            raise

    @property
    def counter(self) -> int:
        """The counter of what was handed out to be kept."""
        return self._counter

    def call(self, octets: bytes) -> bytes:
        """One call. Raises OSError when nobody answers; an empty answer says that it is gone."""
        code, answer = self._ask(b"C", octets, PATIENCE_S if octets[0] == LOAD else ANSWER_S)
        return answer if code == DONE else b""

    def violations(self) -> int:
        """How often the normal world reached for what is not its own."""
        _, answer = self._ask(b"S", b"", ANSWER_S)
        return int.from_bytes(answer, "little")

    def close(self) -> None:
        """End the emulator, whatever state it is in; one that answers hands out first what is to be kept."""
        if self._process is not None:
            with suppress(OSError):
                self._ask(b"E", b"", ANSWER_S)
        self._later.close()
        if self._process is not None:
            self._end()
            self._bell.close()
            self._memory.close()
        self._end()

    def _device_key(self) -> bytes:
        """What a chip has fused, and nothing but its secure world reads: here a file beside what is kept."""
        place = self._kept.with_suffix(".trustzone-m-device")
        create_whole(place, os.urandom(32), mode=PRIVATE_FILE)
        return read_regular(place, 64)

    def _start(self, programs: Images, setup: bytes) -> None:
        ram, given = os.memfd_create("mailbox"), os.memfd_create("setup")
        self._bell, theirs = socket.socketpair()
        try:
            os.ftruncate(ram, _MEMORY)
            self._memory = mmap.mmap(ram, _MAILBOX)
            os.pwrite(given, setup, 0)
            self._launch(
                [
                    EMULATOR, "-M", "mps2-an505,memory-backend=mailbox", "-nodefaults", "-nographic", "-monitor",
                    "none", "-no-reboot", "-object",
                    f"memory-backend-file,id=mailbox,mem-path=/proc/self/fd/{ram},size={_MEMORY},share=on",
                    "-kernel", str(programs.secure), "-device", f"loader,file={programs.normal}",
                    "-device", f"loader,file=/proc/self/fd/{given},addr={_SETUP_AT:#x},force-raw=on",
                    "-chardev", f"socket,id=bell,fd={theirs.fileno()}", "-serial", "chardev:bell",
                ],
                [ram, given, theirs.fileno()],
                INSTALL,
            )  # fmt: skip
        finally:
            theirs.close()
            os.close(ram)
            os.close(given)

    def _greet(self) -> None:
        self._bell.settimeout(PATIENCE_S)
        try:
            ready = self._bell.recv(1) == READY
            code, greeting = self._ask(b"G", b"", PATIENCE_S) if ready else (b"", b"")
        except OSError:
            code, greeting = b"", b""
        if code == DONE and len(greeting) == GREETING_BYTES + 8:
            self._read_greeting(greeting[:-8])
            self._counter = int.from_bytes(greeting[-8:], "little")
            return
        raise not_begun(code, greeting, self._kept, "the secure world")

    def _ask(self, want: bytes, octets: bytes, patience_s: float) -> tuple[bytes, bytes]:
        """What becomes of a wish, and its answer. What must be kept first is kept first. Raises OSError."""
        if len(octets) > _MAILBOX - _HEAD.size:
            return b"", b""
        code, answer, blob = self._exchange(want, octets, patience_s)
        if code == KEEP_FIRST:
            code, answer, _ = self._exchange(b"K" if self._later.keep(blob) else b"N", b"", patience_s)
        elif code == DONE_KEEP:
            code = DONE
            self._later.keep_later(blob)
        return code, answer

    def _exchange(self, want: bytes, octets: bytes, patience_s: float) -> tuple[bytes, bytes, bytes]:
        self._memory[: _HEAD.size] = _HEAD.pack(len(octets), 0)
        self._memory[_HEAD.size : _HEAD.size + len(octets)] = octets
        self._bell.settimeout(patience_s)
        try:
            self._bell.send(want)
            code = self._bell.recv(1)
        except TimeoutError:
            self._kill()
            raise
        answer, blob = _HEAD.unpack(self._memory[: _HEAD.size])
        end = _HEAD.size + answer
        if end + blob > _MAILBOX:
            return b"", b"", b""
        return code, self._memory[_HEAD.size : end], self._memory[end : end + blob]


class _Keeper:
    """Writes what is handed out to be kept: at once where an answer waits for it, else in a thread of its own."""

    def __init__(self, place: Path) -> None:
        self._place = place
        self._turn = threading.Condition()
        self._next: bytes | None = None
        self._over = False
        self._thread = threading.Thread(target=self._write_later, daemon=True)
        self._thread.start()

    def keep(self, blob: bytes) -> bool:
        """Write it now; False where it could not be."""
        with self._turn:
            self._next = None
            try:
                replace(self._place, blob, mode=PRIVATE_FILE)
            except OSError:
                return False
            return True

    def keep_later(self, blob: bytes) -> None:
        """Write it when there is time, unless a newer one comes before."""
        with self._turn:
            self._next = blob
            self._turn.notify_all()

    def close(self) -> None:
        """Write what is left, and end."""
        with self._turn:
            self._over = True
            self._turn.notify_all()
        self._thread.join(PATIENCE_S)

    def _write_later(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._next is not None or self._over)
                if self._next is None:
                    return
                blob, self._next = self._next, None
                with suppress(OSError):
                    replace(self._place, blob, mode=PRIVATE_FILE)
