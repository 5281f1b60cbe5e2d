"""The boundary in a separate process (boundary/home/process.c), called over a socket.

A run starts it (`BoundaryProcess`) with open files and no paths: the trust root, one file for its persistent state, and
the link's key, which is not read here. Or another program, such as systemd, starts it for whoever connects to its
socket (`ListeningBoundary`): then it has its own keys and trust root, and a run has none of them. One process at a time
holds the file of a vehicle, so two runtimes cannot share its state.
"""

import os
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from enum import IntFlag
from pathlib import Path
from typing import Final

from rtshcua.adapters.boundary.home import (
    ANSWER_S,
    GREETING_BYTES,
    PATIENCE_S,
    BoundaryError,
    BoundaryHome,
    hold_kept,
    kept_file,
    not_kept,
)  # fmt: skip
from rtshcua.adapters.store.signing import no_link_key, open_link_key
from rtshcua.onboard.enforcement.isolated import LOAD, MAX_PART

#: an extra time: if the whole machine stood still, both times are over, and one process resumes first
AGAIN_S: Final = 0.2
#: the same for a listening one: if it hangs, the kernel ends it 3 s after its last activity, and nobody else may
LISTENING_ENDING_S: Final = 5.0
_PACKAGED: Final = Path(__file__).resolve().parents[2] / "boundary" / "rtshcua-boundary"
_BUILT: Final = Path(__file__).resolve().parents[3] / "build" / "boundary" / "rtshcua-boundary"
#: the interval of attempts with a listening one, in s: each writes a line to systemd's journal
_ASKING_S: Final = 0.1
#: octets of the largest call and answer
_CALL, _ANSWER = MAX_PART + 64, 2_112

#: the message without a program, if none was requested
UNBUILT: Final = "the boundary's program was not built, so the run decides in its own process, without isolation"
UNBUILT_HELP: Final = "`make setup` builds it in a checkout; the wheels for Linux on x86-64 and aarch64 have it"


class Measure(IntFlag):
    """The measures that isolate the process (boundary/home/isolation.h)."""

    OWN_USER = 1
    OWN_NETWORK = 2
    NO_FILES = 4
    FEW_CALLS = 8
    NOT_DUMPABLE = 16
    LOCKED_MEMORY = 32
    SECRET_MEMORY = 64


#: the message for each measure that is not in force
MISSING: Final = {
    Measure.OWN_USER: "a separate user: every process of the present user can read its key files (`--boundary-user`)",
    Measure.OWN_NETWORK: "a separate network namespace (needs root or CAP_SYS_ADMIN)",
    Measure.NO_FILES: "Landlock (not in this kernel)",
    Measure.FEW_CALLS: "seccomp (not in this kernel)",
    Measure.NOT_DUMPABLE: "protection from being read (PR_SET_DUMPABLE)",
    Measure.LOCKED_MEMORY: "locked memory for its keys: raise RLIMIT_MEMLOCK",
    Measure.SECRET_MEMORY: "memfd_secret: the kernel can read its keys (`secretmem.enable=1`)",
}

_UNTRUSTED, _NO_KEY, _MISSING, _IO, _IN_USE, _DAMAGED = 65, 66, 72, 74, 75, 78
_ENDED: Final = {
    64: "its command line or one of its keys is invalid",
    _UNTRUSTED: "it does not trust the trust root",
    _NO_KEY: "its link key is not a valid key",
    _MISSING: "a file in its folder is missing or unreadable, or other users have access to the folder",
}
#: what to check for a listening boundary
_ENDED_HELP: Final = {
    64: "`log.seed` and `boundary.seed` of its folder: 64 hexadecimal digits each",
    _UNTRUSTED: "`root.trust` and `root.pin` of its folder; `rtshcua keys provision` writes both",
    _NO_KEY: "`link.key` of its folder: 64 hexadecimal digits",
    _MISSING: "its user's folder, mode 0700, of the vehicle's identity: `root.trust`, `root.pin`, `log.seed`; no links",
    _IO: "change the owner of its folder to its user (`chown -R`), or free disk space",
}
_DAMAGED_HELP: Final = (
    "docs/flying/isolation.md says what to do; an empty file, a file of another boundary key, "
    "or a file missing from a provisioned folder counts as damage too"
)


def program() -> Path | None:
    """The program, in a checkout or in the package; None where it was not built."""
    return next((each for each in (_BUILT, _PACKAGED) if each.is_file()), None)


def measures_here(user: tuple[int, int] | None) -> Measure:
    """The measures that a boundary's process takes on this machine, as this user and group or ours: one is started,
    reports them, and ends. Raises BoundaryError.
    """
    path = program()
    if path is None:
        raise BoundaryError("missing", "the boundary's program was not built", UNBUILT_HELP)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    words = ["--socket", str(theirs.fileno()), "--measures"]
    words += [] if user is None else ["--user", str(user[0]), "--group", str(user[1])]
    with ours, theirs:
        try:
            subprocess.run(
                [path, *words], pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, env={}, cwd="/", timeout=PATIENCE_S, check=True,
            )  # fmt: skip
            greeting = ours.recv(_ANSWER, socket.MSG_DONTWAIT)
        except (OSError, subprocess.SubprocessError) as error:
            raise BoundaryError("not-begun", f"the boundary's process did not start: {error}") from None
    return Measure(int.from_bytes(greeting[:4], "little"))


class _Connected(BoundaryHome):
    """A boundary at the other end of a socket."""

    _socket: socket.socket
    #: the measures in force
    measures: Measure

    @property
    def missing(self) -> Sequence[str]:
        """The measures that are not in force, in words."""
        return [text for measure, text in MISSING.items() if measure not in self.measures]

    def call(self, octets: bytes) -> bytes:
        """Send one call and return the answer. Raises OSError without an answer; an empty answer means that the
        boundary ended. A boundary that is late is ended: it must not continue unnoticed.
        """
        loads = octets[0] == LOAD
        try:
            self._socket.send(octets)
            if loads:
                self._socket.settimeout(PATIENCE_S)
            return self._socket.recv(_ANSWER)
        except TimeoutError:
            return self._once_more()
        finally:
            if loads:
                self._socket.settimeout(ANSWER_S)

    def _once_more(self) -> bytes:
        self._socket.settimeout(AGAIN_S)
        try:
            return self._socket.recv(_ANSWER)
        except TimeoutError:
            self._end()
            raise
        finally:
            self._socket.settimeout(ANSWER_S)

    def _end(self) -> None:
        """End the process."""
        raise NotImplementedError

    def _take_in(self, greeting: bytes) -> None:
        self.measures = Measure(self._read_greeting(greeting))
        self._socket.settimeout(ANSWER_S)


def _sized(connection: socket.socket) -> socket.socket:
    """A socket with room for the largest call."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2 * _CALL)
    return connection


class ListeningBoundary(_Connected):
    """A boundary that another program starts for the client of the socket at `path`; until `close`. It ends with that
    connection: if it hangs, the kernel ends it (boundary/home/process.c), because a run may not end another user's
    process. A boundary that is ending, or in use by another run, is waited for. Raises BoundaryError.
    """

    def __init__(self, path: Path) -> None:
        until_s = time.monotonic() + LISTENING_ENDING_S
        while (greeting := self._greeted(path)) is None:
            if time.monotonic() > until_s:
                text = f"another run uses the boundary at `{path}`, or its program did not start"
                raise BoundaryError("in-use", text, "wait until that run ends, or look into `journalctl`")
            time.sleep(_ASKING_S)
        self._take_in(greeting)

    def close(self) -> None:
        """Close the socket, which ends it."""
        self._socket.close()

    def _end(self) -> None:
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def _greeted(self, path: Path) -> bytes | None:
        """The first message; None if the connection was closed without one, or the vehicle's file is locked."""
        self._socket = _sized(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
        self._socket.settimeout(PATIENCE_S)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            text = f"no boundary listens at `{path}`: {(error.strerror or str(error)).lower()}"
            raise BoundaryError("missing", text, "`systemctl status 'rtshcua-boundary@*'`") from None
        try:
            greeting = self._socket.recv(_ANSWER)
        except TimeoutError:
            self._socket.close()
            raise BoundaryError("not-begun", f"the boundary at `{path}` did not start") from None
        except OSError:
            greeting = b""
        if len(greeting) == GREETING_BYTES:
            return greeting
        self._socket.close()
        if greeting in (b"", bytes([_IN_USE])):
            return None
        if len(greeting) > 1:
            raise BoundaryError("not-begun", f"the boundary at `{path}` belongs to another release")
        code = greeting[0]
        raise _unbegun(code, f"what the boundary at `{path}` keeps", _ENDED_HELP.get(code, ""))


class BoundaryProcess(_Connected):
    """A running boundary, started here. `own_seed` is the seed of the key for its own evidence, `log_seed` that of the
    log's key. `settings` are the parameters to set before the flight, and `owed` those that earlier runs set and did
    not restore, each as the body of a preparation (`wire.preparation`). `user` is its user and group, None for ours.
    `paced`: the caller's time is not the machine's, as for a simulated vehicle that runs faster. `utc_error_us` is the
    operator's bound on the error of the time of day, for use without the kernel's. Raises BoundaryError, LinkKeyError,
    and OSError for files that cannot be opened.
    """

    def __init__(
        self, root: bytes, pinned: bytes, vehicle: str, state: Path, *, link_key: Path | None = None,
        own_seed: bytes | None = None, log_seed: bytes | None = None, settings: bytes | None = None,
        owed: bytes | None = None, user: tuple[int, int] | None = None, paced: bool = False,
        utc_error_us: int | None = None,
    ) -> None:  # fmt: skip
        path = program()
        if path is None:
            raise BoundaryError("missing", "the boundary's program was not built", UNBUILT_HELP)
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        files: list[int] = [theirs.fileno()]
        try:
            words = ["--socket", str(files[0]), "--pin", pinned.hex(), "--vehicle", vehicle]
            words += ["--paced"] if paced else []
            words += [] if utc_error_us is None else ["--utc-error", str(utc_error_us)]
            given = {
                "--root": root,
                "--boundary-key": own_seed,
                "--log-key": log_seed,
                "--settings": settings,
                "--owed": owed,
            }
            for name, handle in self._handles(vehicle, state, link_key, given):
                files.append(handle)
                words += [name, str(handle)]
            if user is not None:
                words += ["--user", str(user[0]), "--group", str(user[1])]
            _sized(ours)
            _sized(theirs)
            try:
                self._process = subprocess.Popen(
                    [path, *words], pass_fds=files, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL, env={}, cwd="/", start_new_session=True,
                )  # fmt: skip
            except OSError as error:
                text = f"the boundary's program `{path}` does not start: {(error.strerror or str(error)).lower()}"
                raise BoundaryError("not-begun", text, UNBUILT_HELP) from None
        except BaseException:
            ours.close()
            raise
        finally:
            theirs.close()
            for handle in files[1:]:
                os.close(handle)
        ours.settimeout(PATIENCE_S)
        self._socket = ours
        self._take_in(self._greeting(link_key, kept_file(state, vehicle)))

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    def close(self) -> None:
        """Close the socket, which ends it."""
        self._socket.close()
        try:
            self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _end(self) -> None:
        self._process.kill()

    def _handles(
        self, vehicle: str, state: Path, link_key: Path | None, given: Mapping[str, bytes | None]
    ) -> Iterator[tuple[str, int]]:
        yield "--kept", hold_kept(state, vehicle)
        for name, data in given.items():
            if data is not None:
                handle = os.memfd_create(name, os.MFD_CLOEXEC)
                yield name, handle
                os.pwrite(handle, data, 0)
        if link_key is not None:
            with open_link_key(link_key) as file:
                yield "--link-key", os.dup(file.fileno())

    def _greeting(self, link_key: Path | None, kept: Path) -> bytes:
        try:
            greeting = self._socket.recv(_ANSWER)
        except TimeoutError:
            greeting = b""
        if len(greeting) == GREETING_BYTES:
            return greeting
        self._socket.close()
        self._process.kill()
        ended = self._process.wait()
        code = greeting[0] if greeting else ended
        if link_key is not None and code == _NO_KEY:
            raise no_link_key(link_key)
        raise _unbegun(code, f"`{kept}`")


def _unbegun(code: int, kept: str, help: str = "") -> BoundaryError:
    """The error for an exit code of its program; `kept` names its state, `help` what to check."""
    if code == _DAMAGED:
        text = f"{kept} is damaged, so the bundles that the boundary has opened are not known"
        return BoundaryError("damaged", text, _DAMAGED_HELP)
    if code == _IO:
        return not_kept(kept, help)
    text = f"the boundary's process did not start: {_ENDED.get(code, f'it ended with {code}')}"
    return BoundaryError("untrusted" if code == _UNTRUSTED else "not-begun", text, help)
