"""A listening boundary as under systemd: `rtshcua-boundary@.socket` and `.service`, without the sandbox."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rtshcua.adapters.boundary.home import PATIENCE_S
from rtshcua.adapters.boundary.process import program

VEHICLE: Final = "quad-07"
#: the users of the boundary and of the run if the test may choose, otherwise the current user
ROOT: Final = os.geteuid() == 0
BOUNDARY_USER: Final = 65_533 if ROOT else os.geteuid()
RUN_USER: Final = 65_532
#: the flags of a listening socket in /proc/net/unix
_ACCEPTS: Final = "00010000"
#: a replacement for systemd: it passes each connection as descriptor 3
_ACCEPT: Final = """
import os, signal, socket, sys
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
listener.bind(sys.argv[1])
listener.listen()
while True:
    connection, _ = listener.accept()
    if os.fork() == 0:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.dup2(connection.fileno(), 3)
        os.execvp(sys.argv[2], sys.argv[2:])
    connection.close()
"""


class Listening:
    """A folder of boundaries, and a service that starts one for each connection to `socket`, under its own user."""

    def __init__(self, place: Path, words: Sequence[str]) -> None:
        place.chmod(0o755)
        self.folder, self.socket = place / "folder", place / "run" / VEHICLE
        self.own = self.folder / VEHICLE
        self.socket.parent.mkdir(mode=0o755)
        built = program()
        assert built is not None
        copied = shutil.copy(built, place / "rtshcua-boundary")
        systemd = shutil.which("systemd-socket-activate")
        command = [sys.executable, "-c", _ACCEPT, str(self.socket)]
        if systemd is not None:
            command = [systemd, "--accept", "--seqpacket", "-l", str(self.socket)]
        if ROOT:
            command += ["/usr/bin/setpriv", f"--reuid={BOUNDARY_USER}", f"--regid={BOUNDARY_USER}", "--clear-groups"]
        command += [str(copied), "--socket", "3", "--folder", str(self.folder), *words]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until_s = time.monotonic() + PATIENCE_S
        while not self._is_listened_at():
            assert time.monotonic() < until_s
            time.sleep(0.01)

    def _is_listened_at(self) -> bool:
        found = (line.split() for line in Path("/proc/net/unix").read_text().splitlines())
        return any(fields[3] == _ACCEPTS and fields[-1] == str(self.socket) for fields in found)

    def give(self) -> None:
        """Give the provisioned folder to its user, and the socket to the connecting user."""
        for path in (self.folder, self.own, *self.own.iterdir()):
            os.chown(path, BOUNDARY_USER, BOUNDARY_USER if ROOT else -1)
        if ROOT:
            os.chown(self.socket, RUN_USER, RUN_USER)
        self.socket.chmod(0o600)

    def boundaries(self) -> list[int]:
        """Return the process ids of running boundaries."""
        pid, found = self._process.pid, []
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            with suppress(OSError):
                found += [int(child)] if Path(f"/proc/{child}/cmdline").read_bytes() else []
        return found

    def await_gone(self, within_s: float) -> None:
        """Wait until no boundary runs."""
        until_s = time.monotonic() + within_s
        while self.boundaries():
            assert time.monotonic() < until_s, "it goes on"
            time.sleep(0.02)

    def close(self) -> None:
        """End all boundaries and the service."""
        if self._process.poll() is not None:
            return
        for pid in self.boundaries():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.kill()
        self._process.wait()
        self.socket.unlink()


@contextmanager
def listening(*words: str) -> Iterator[Listening]:
    """Create one with an empty folder; `words` are arguments of the program."""
    with TemporaryDirectory(dir="/tmp", prefix="rtshcua-") as place:  # the address of a socket is short
        made = Listening(Path(place), words)
        try:
            yield made
        finally:
            made.close()
