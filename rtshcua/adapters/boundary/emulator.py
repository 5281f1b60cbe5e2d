"""What the homes of the boundary in an emulated machine share: the setup, the process, and how a start fails."""

import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from struct import Struct
from typing import Final, NamedTuple

from rtshcua.adapters.boundary.home import BoundaryError, BoundaryHome, not_kept
from rtshcua.adapters.clock import monotonic_ns
from rtshcua.adapters.store.signing import read_link_key
from rtshcua.model.flat.situation import UTC_UNKNOWN_US

#: what it does not keep out
EMULATED: Final = "hardware: its secure world is emulated, and root and the run's user can read the emulator's memory"
#: what becomes of a wish (boundary/home/trustzone_m/mailbox.h)
READY, DONE, DONE_KEEP, KEEP_FIRST, NOT_BEGUN = b"r", b"d", b"k", b"f", b"b"

#: boundary/home/trustzone_m/world.c
_SETUP: Final = Struct("<4sI32s32s32s32s32sqqqq8I")
_LINK_KEY, _BOUNDARY_KEY, _LOG_KEY, _PACED, _SETTINGS, _OWED = 1, 2, 4, 8, 16, 32
_UNTRUSTED, _DAMAGED = 65, 78
#: starts a program that leaves no core dump, and that the kernel ends when the thread ends that started it
#: (PR_SET_PDEATHSIG, SIGKILL); not at all if that thread has ended already
_WITH_US: Final = (
    "import ctypes, os, resource, sys; ctypes.CDLL(None).prctl(1, 9, 0, 0, 0); "
    "resource.setrlimit(resource.RLIMIT_CORE, (0, 0)); "
    "os.getppid() == int(sys.argv[1]) and os.execvp(sys.argv[2], sys.argv[2:])"
)


class Setup(NamedTuple):
    """What a home in an emulator is given at its start."""

    root: bytes
    pinned: bytes
    vehicle: str
    link_key: Path | None
    own_seed: bytes | None
    log_seed: bytes | None
    settings: bytes | None
    owed: bytes | None
    paced: bool
    utc_error_us: int | None

    def packed(self, kept: bytes, device_key: bytes, most: int) -> bytes:
        """The octets, `most` at most. Raises BoundaryError and LinkKeyError."""
        given: Mapping[int, object] = {
            _LINK_KEY: self.link_key, _BOUNDARY_KEY: self.own_seed, _LOG_KEY: self.log_seed,
            _PACED: self.paced or None, _SETTINGS: self.settings, _OWED: self.owed,
        }  # fmt: skip
        parts = (self.root, self.pinned, self.vehicle.encode(), self.settings or b"", self.owed or b"", kept)
        link_key = read_link_key(self.link_key) if self.link_key is not None else bytes(32)
        head = _SETUP.pack(
            b"RTZ1", sum(flag for flag, value in given.items() if value is not None), os.urandom(32), link_key,
            self.own_seed or bytes(32), self.log_seed or bytes(32), device_key, monotonic_ns() // 1_000,
            time.time_ns() // 1_000, UTC_UNKNOWN_US, -1 if self.utc_error_us is None else self.utc_error_us,
            *map(len, parts), 0, 0,
        )  # fmt: skip
        if len(head) + sum(map(len, parts)) > most:
            raise BoundaryError("not-begun", "what the boundary is given does not fit: the trust root is too large")
        return head + b"".join(parts)


class EmulatedHome(BoundaryHome):
    """A boundary in an emulator that is started here and ends with the run."""

    _process: subprocess.Popen[bytes] | None = None
    _lock = _errors = -1

    @property
    def missing(self) -> Sequence[str]:
        """See `BoundaryHome`: an emulator is no hardware."""
        return (EMULATED,)

    @property
    def pid(self) -> int:
        """The emulator's process."""
        assert self._process is not None
        return self._process.pid

    def _launch(self, words: Sequence[str], files: Sequence[int], help: str) -> None:
        """Start the emulator, which gets these files."""
        if self._errors >= 0:
            os.close(self._errors)
        self._errors = os.memfd_create("errors")
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _WITH_US, str(os.getpid()), *words],
                pass_fds=files, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=self._errors, start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            text = f"`{words[0]}` does not start: {(error.strerror or str(error)).lower()}"
            raise BoundaryError("not-begun", text, help) from None

    def _kill(self) -> None:
        """End the emulator at once: it must not go on behind the back of who did not wait for it."""
        if self._process is not None:
            with suppress(ProcessLookupError):
                self._process.kill()

    def _end_process(self) -> None:
        """End the emulator."""
        if self._process is not None:
            self._kill()
            self._process.wait()
            self._process = None

    def _end(self) -> None:
        """End the emulator, and let go of what is kept."""
        self._end_process()
        for file in (self._lock, self._errors):
            if file >= 0:
                os.close(file)
        self._lock = self._errors = -1

    def _not_begun(self, code: bytes, said: bytes, kept: Path, where: str) -> BoundaryError:
        """Why the boundary did not begin, by its answer to the first wish; `where`: its home, in words."""
        found = _reason(code, said, kept, where)
        if found is not None:
            return found
        # what the emulator complains of last, such as an option that this version does not have
        lines = os.pread(self._errors, 4_096, max(0, os.fstat(self._errors).st_size - 4_096)).splitlines()
        last = lines[-1].decode("ascii", "replace") if lines else ""
        return BoundaryError("not-begun", f"the boundary in {where} does not begin" + (f": {last}" if last else ""))


def is_quiet(port: socket.socket) -> bool:
    """Whether nothing waits there: what came before a wish is no answer to it."""
    return not select.select([port], [], [], 0)[0]


def _reason(code: bytes, said: bytes, kept: Path, where: str) -> BoundaryError | None:
    if code == NOT_BEGUN and said == bytes([_DAMAGED]):
        text = f"`{kept}` is damaged: which bundles the boundary has opened is not known"
        return BoundaryError("damaged", text, "docs/flying/isolation.md says what to do")
    if code == NOT_BEGUN and said == bytes([_UNTRUSTED]):
        return BoundaryError("untrusted", f"the boundary in {where} does not trust the trust root")
    if code == DONE and said[1:] == b"not-kept":
        return not_kept(f"`{kept}`")
    return None
