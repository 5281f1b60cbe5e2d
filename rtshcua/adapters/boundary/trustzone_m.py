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

from rtshcua.adapters.boundary.emulator import DONE, DONE_KEEP, KEEP_FIRST, READY, EmulatedHome, Setup, is_quiet
from rtshcua.adapters.boundary.home import (
    ANSWER_S,
    GREETING_BYTES,
    PATIENCE_S,
    BoundaryError,
    hold_kept,
    kept_file,
)  # fmt: skip
from rtshcua.adapters.clock import monotonic_ns
from rtshcua.adapters.store.reading import read_if_there, read_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, create_whole, replace
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.home_limits import TRUSTZONE_M
from rtshcua.onboard.enforcement.isolated import LOAD, Caller

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
#: octets of a sealed blob (RT_BLOB_SIZE)
_BLOB: Final = 6_224
_KEY_BYTES: Final = 32
#: how far the clock of the secure world may lag, in us: a fraction of what clocks may be apart
_LAG_US: Final = 500_000
#: how often it is started before a machine counts as too busy
_STARTS: Final = 3


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
    _given = -1

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
        self._lock = hold_kept(state, vehicle)
        setup = Setup(root, pinned, vehicle, link_key, own_seed, log_seed, settings, owed, paced, utc_error_us)
        try:
            for start in range(1, _STARTS + 1):
                self._begin(found, setup)
                if paced or self._is_on_time():
                    return
                if start < _STARTS:
                    self._stop()
            text = f"the emulator took too long to start, {_STARTS} times"
            raise BoundaryError("not-begun", text, "try again on a machine at rest")
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
        """How often the normal world reached for what is not its own. Raises OSError, also where nobody says it."""
        code, answer = self._ask(b"S", b"", ANSWER_S)
        if code != DONE:
            raise ConnectionResetError
        return int.from_bytes(answer, "little")

    def close(self) -> None:
        """End the emulator, whatever state it is in; one that answers hands out first what is to be kept."""
        try:
            self._stop()
        finally:
            self._end()

    def _stop(self) -> None:
        try:
            if self._process is not None:
                with suppress(OSError):
                    self._ask(b"E", b"", ANSWER_S)
        finally:
            started = self._process is not None
            self._forget_setup()
            self._end_process()
            self._later.close()
            if started:
                self._bell.close()
                self._memory.close()

    def _forget_setup(self) -> None:
        """Empty the file of the setup, which the emulator keeps open."""
        if self._given >= 0:
            os.ftruncate(self._given, 0)
            os.close(self._given)
            self._given = -1

    def _read_kept(self) -> bytes:
        """The sealed blob; empty at the first start. A blob that is missing after that is damage."""
        self._device = self._kept.with_suffix(".trustzone-m-device")
        self._first = self._kept.with_suffix(".trustzone-m-first")
        kept = read_if_there(self._kept, _SETUP_SIZE)
        if kept is None and not self._device.exists():
            create_whole(self._first, b"", mode=PRIVATE_FILE)
        if (kept is None and self._first.exists()) or (kept is not None and len(kept) == _BLOB):
            return kept or b""
        text = f"`{self._kept}` is missing, empty or cut: which bundles the boundary has opened is not known"
        raise BoundaryError("damaged", text, "docs/flying/isolation.md says what to do")

    def _device_key(self) -> bytes:
        """What a chip has fused, and nothing but its secure world reads: here a file beside what is kept."""
        create_whole(self._device, os.urandom(_KEY_BYTES), mode=PRIVATE_FILE)
        key = read_regular(self._device, 2 * _KEY_BYTES)
        if len(key) != _KEY_BYTES:
            raise BoundaryError("damaged", f"`{self._device}` is not the device key that was made here")
        return key

    def _is_on_time(self) -> bool:
        """Whether its clock may be used: it begins at the time of the setup, and so lags by the emulator's start."""
        told = Caller(self.call).time()
        return not isinstance(told, Refusal) and monotonic_ns() // 1_000 - told.now.monotonic_us <= _LAG_US

    def _begin(self, programs: Images, setup: Setup) -> None:
        self._lost = False
        self._later = _Keeper(self._kept)
        self._given = os.memfd_create("setup")
        kept = self._read_kept()
        self._start(programs, setup.packed(kept, self._device_key(), _SETUP_SIZE))
        self._greet()
        self._first.unlink(missing_ok=True)

    def _start(self, programs: Images, setup: bytes) -> None:
        ram, given = os.memfd_create("mailbox"), self._given
        self._bell, theirs = socket.socketpair()
        try:
            os.ftruncate(ram, _MEMORY)
            self._memory = mmap.mmap(ram, _MAILBOX)
            os.pwrite(given, setup, 0)
            self._launch(
                [
                    EMULATOR, "-M", "mps2-an505,memory-backend=mailbox,dump-guest-core=off", "-nodefaults",
                    "-nographic", "-monitor", "none", "-no-reboot", "-object",
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

    def _greet(self) -> None:
        self._bell.settimeout(PATIENCE_S)
        try:
            ready = self._bell.recv(1) == READY
            code, greeting = self._ask(b"G", b"", PATIENCE_S) if ready else (b"", b"")
        except OSError:
            code, greeting = b"", b""
        self._forget_setup()
        if code == DONE and len(greeting) == GREETING_BYTES + 8:
            self._read_greeting(greeting[:-8])
            self._counter = int.from_bytes(greeting[-8:], "little")
            return
        raise self._not_begun(code, greeting, self._kept, "the secure world")

    def _ask(self, want: bytes, octets: bytes, patience_s: float) -> tuple[bytes, bytes]:
        """What becomes of a wish, and its answer. What must be kept first is kept first. Raises OSError."""
        if len(octets) > _MAILBOX - _HEAD.size or self._lost or not is_quiet(self._bell):
            return b"", b""
        self._lost = True  # until all of it was exchanged: no answer may be taken for that to another call
        code, answer, blob = self._exchange(want, octets, patience_s)
        if code in (KEEP_FIRST, DONE_KEEP) and len(blob) != _BLOB:
            return b"", b""
        if code == KEEP_FIRST:
            code, answer, _ = self._exchange(b"K" if self._later.keep(blob) else b"N", b"", patience_s)
        elif code == DONE_KEEP:
            code = DONE
            self._later.keep_later(blob)
        self._lost = False
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
    """Writes sealed blobs in a thread of its own, the newest one only; an answer may wait for one."""

    def __init__(self, place: Path) -> None:
        self._place = place
        self._turn = threading.Condition()
        self._next = b""
        self._given = self._written = self._failed = 0
        self._over = False
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()

    def keep(self, blob: bytes) -> bool:
        """Wait until it is on the disk; False if it could not be written."""
        number = self.keep_later(blob)
        with self._turn:
            self._turn.wait_for(lambda: self._written >= number)
            return self._failed < number

    def keep_later(self, blob: bytes) -> int:
        """Write it when there is time, unless a newer one comes before; returns its number."""
        with self._turn:
            self._next = blob
            self._given += 1
            self._turn.notify_all()
            return self._given

    def close(self) -> None:
        """Write what is left, and end."""
        with self._turn:
            self._over = True
            self._turn.notify_all()
        self._thread.join(PATIENCE_S)

    def _write(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._given > self._written or self._over)
                if self._given == self._written:
                    return
                blob, number = self._next, self._given
            try:
                replace(self._place, blob, mode=PRIVATE_FILE)
                failed = 0
            except OSError:
                failed = number
            with self._turn:
                self._written, self._failed = number, failed or self._failed
                self._turn.notify_all()
