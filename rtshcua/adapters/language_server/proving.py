"""Keeps the process that proves: one job at a time, of each source only the newest, and none that hangs.

A check cannot be interrupted. So a job whose source has changed meanwhile runs on for at most `PATIENCE`; then the
process is ended, and another one takes the newer text. A process that ends by itself, or answers what is no answer, is
replaced, and asked once more. What cannot be had is said, and the next change of the text tries again.
"""

import asyncio
import logging
import pickle
import sys
from collections.abc import Callable, Mapping, Sequence

from rtshcua.adapters.language_server.prover import LENGTH, Job
from rtshcua.diagnostics.diagnostic import Diagnostic

log = logging.getLogger("rtshcua.lsp")

Found = tuple[Diagnostic, ...] | None
PATIENCE = 10.0
"""Seconds that an outdated job may take."""
LONGEST = 120.0
"""Seconds that any job may take."""
LARGEST = 1 << 28
"""Bytes of an answer; what says that it is longer is none."""
TRIES = 2


class Broken(Exception):
    """The process has ended, or what it says is no answer."""


class Slow(Exception):
    """The job takes too long."""


class Proving:
    """Jobs for the process, which is started with the first of them. `end` stops it. `say` gets what goes wrong, in
    words; `command` is the process.
    """

    def __init__(
        self,
        library: str,
        say: Callable[[str], None] = log.warning,
        *,
        command: Sequence[str] = (sys.executable, "-P", "-m", "rtshcua.adapters.language_server.prover"),
        patience: float = PATIENCE,
        longest: float = LONGEST,
    ) -> None:
        self._command = (*command, library)
        self._say = say
        self._patience = patience
        self._longest = longest
        self._waiting: dict[str, tuple[Job, Callable[[Found], None]]] = {}
        self._newer = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._process: asyncio.subprocess.Process | None = None
        self._killed: list[asyncio.subprocess.Process] = []

    def ask(self, name: str, texts: Mapping[str, str], done: Callable[[Found], None]) -> None:
        """Has the program of `name` checked; `done` gets what was found, None where the check failed. A later question
        about the same takes the place of this one, if it still waits.
        """
        self._waiting[name] = ((name, dict(texts)), done)
        self._newer.set()
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._work())

    def forget(self, name: str) -> None:
        """Nobody wants to know of `name` any more."""
        self._waiting.pop(name, None)

    def end(self) -> None:
        """Ends the process."""
        if self._task is not None:
            self._task.cancel()
        self._kill()

    async def ended(self) -> None:
        """Returns when the processes that `end` and faults have ended are gone."""
        if self._task is not None:
            await asyncio.wait({self._task})
        for process in self._killed:
            await process.wait()
        await asyncio.sleep(0)  # their pipes are closed in the next turn of the loop

    async def _work(self) -> None:
        while self._waiting:
            name = next(iter(self._waiting))
            job, done = self._waiting.pop(name)
            self._newer.clear()
            done(await self._tried(job))

    async def _tried(self, job: Job) -> Found:
        for left in reversed(range(TRIES)):
            try:
                return await self._answer(job)
            except Slow:
                self._kill()
                self._say(f"the proofs of {job[0]} took too long and were given up: save it and run `rtshcua check`")
                return None
            except (OSError, Broken) as error:
                self._kill()
                if left and job[0] not in self._waiting:
                    continue
                self._say(f"the proofs of {job[0]} could not be had: {error}")
                return None
        return None

    async def _answer(self, job: Job) -> Found:
        """What the process says. Raises Slow, Broken, OSError."""
        asking = asyncio.ensure_future(self._exchange(job))
        try:
            await asyncio.wait({asking}, timeout=self._patience)
            if not asking.done() and not self._waiting:
                newer = asyncio.ensure_future(self._newer.wait())
                await asyncio.wait({asking, newer}, timeout=self._longest, return_when=asyncio.FIRST_COMPLETED)
                newer.cancel()
            if not asking.done():
                raise Slow
            return asking.result()
        finally:
            asking.cancel()

    async def _exchange(self, job: Job) -> Found:
        process = await self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        data = pickle.dumps(job)
        try:
            process.stdin.write(len(data).to_bytes(LENGTH, "big") + data)
            await process.stdin.drain()
            length = int.from_bytes(await process.stdout.readexactly(LENGTH), "big")
            if length > LARGEST:
                raise Broken("the process that proves gave no answer")
            answer = await process.stdout.readexactly(length)
        except (OSError, asyncio.IncompleteReadError) as error:
            raise Broken("the process that proves has ended") from error
        try:
            found = pickle.loads(answer)
        except Exception as error:  # whatever it is that garbage raises
            raise Broken("the process that proves gave no answer") from error
        if found is not None and not (type(found) is tuple and all(isinstance(each, Diagnostic) for each in found)):
            raise Broken("the process that proves gave no answer")
        return found

    async def _running(self) -> asyncio.subprocess.Process:
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                *self._command, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
            )
        return self._process

    def _kill(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        self._killed = [each for each in (*self._killed, process) if each.returncode is None or each is process]
        if process.returncode is None:
            process.kill()
        if process.stdin is not None and self._task is not None and not self._task.get_loop().is_closed():
            process.stdin.close()
