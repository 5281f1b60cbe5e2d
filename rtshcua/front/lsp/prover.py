"""The process that runs complete checks (parse, check, lower, prove, lint), and its client.

It runs one job at a time, and for each source only the newest. A check cannot be interrupted, so an outdated job runs
on for at most `PATIENCE` seconds; then the process is killed, and a new one checks the newer text. A process that ends
or sends an invalid answer is replaced once. A failure is reported, and the next change of the text tries again.

`python -P -m rtshcua.front.lsp.prover LIBRARY` reads jobs from its standard input and writes what was
found to its standard output, each as its length in eight bytes and a pickle. Both ends are ours: nothing that comes
from a workspace is ever unpickled. `-P` keeps the folder that it was started in off the module path.
"""

import asyncio
import logging
import os
import pickle
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

from rtshcua.adapters.store.project import Project, Projects
from rtshcua.adapters.store.source_access import ReadableSources
from rtshcua.app.lint.examine import find
from rtshcua.app.lint.scope import ignored_in
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.front.lsp.disk import desk
from rtshcua.ground.editor.workspace import ProgramView, Workspace
from rtshcua.ground.lint.filter import filter_findings
from rtshcua.ground.project.project_settings import IgnoredCode

LENGTH = 8  # bytes, in front of each message
PATIENCE = 10.0
"""The longest time of an outdated job, in seconds."""
LONGEST = 120.0
"""The longest time of a job, in seconds."""
LARGEST = 1 << 28
"""The most bytes of an answer; a longer one is invalid."""
TRIES = 2

log = logging.getLogger("rtshcua.lsp")

Job = tuple[str, dict[str, str], tuple[str, ...]]
"""The name of a source, the texts that are open in the editor, and the folders that imports may lead to. Plain, so
that it is the same on both ends."""
Found = tuple[Diagnostic, ...] | None


def main(library: str) -> None:
    """Process jobs until the input ends."""
    incoming, outgoing = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # printed text must not get between the messages
    os.nice(5)  # answers to keystrokes have priority
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING)
    readable = ReadableSources(library)
    known = desk(library, readable)
    while (job := _take(incoming)) is not None:
        readable.folders = list(job[2])
        try:
            found: Found = examined(known, job)
        except Exception:
            log.exception("the check of %s failed", job[0])
            found = None
        outgoing.write(_message(found))
        outgoing.flush()


def examined(known: Workspace, job: Job) -> tuple[Diagnostic, ...]:
    """The findings of `rtshcua lint` in a program, with the lint rules applied to its first file."""
    file, texts, _ = job
    for name in [each for each in known.open if each not in texts]:
        known.close(name)
    for name, text in texts.items():
        known.put(name, text)
    known.forget()
    view = known.view(file)
    result = find(view.program, {file: None})
    untold = {file} if has_errors(result.found) else ()
    found = (*result.found, *result.habits)
    return filter_findings(found, view.program.sources, {file}, _configured(view), untold).found


def _configured(view: ProgramView) -> dict[str, tuple[IgnoredCode, ...]]:
    """The codes that the project's configuration ignores in the first file."""
    project = Projects().of(Path(view.name))
    return {view.name: ignored_in(project, Path(view.name))} if isinstance(project, Project) else {}


def _take(incoming: BinaryIO) -> Job | None:
    head = incoming.read(LENGTH)
    if len(head) < LENGTH:
        return None
    data = incoming.read(int.from_bytes(head, "big"))
    job: Job = pickle.loads(data)
    return job


def _message(content: Job | Found) -> bytes:
    data = pickle.dumps(content)
    return len(data).to_bytes(LENGTH, "big") + data


# ------------------------------------------------------------------------------------------ what keeps it


class Broken(Exception):
    """The process has ended, or sent an invalid answer."""


class Slow(Exception):
    """The job takes too long."""


class Proving:
    """Runs jobs in the process, which is started with the first job. `end` stops it. `say` receives error texts;
    `command` is the command of the process.
    """

    def __init__(
        self,
        library: str,
        say: Callable[[str], None] = log.warning,
        *,
        command: Sequence[str] = (sys.executable, "-P", "-m", "rtshcua.front.lsp.prover"),
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

    def ask(
        self, name: str, texts: Mapping[str, str], done: Callable[[Found], None], folders: tuple[str, ...] = ()
    ) -> None:
        """Check the program of `name`, whose imports may lead to `folders`; `done` receives the findings, or None if
        the check failed. A later job for the same name replaces one that still waits.
        """
        self._waiting[name] = ((name, dict(texts), folders), done)
        self._newer.set()
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._work())

    def forget(self, name: str) -> None:
        """Drop a waiting job for `name`."""
        self._waiting.pop(name, None)

    def end(self) -> None:
        """End the process."""
        if self._task is not None:
            self._task.cancel()
        self._kill()

    async def ended(self) -> None:
        """Wait until all ended processes are gone."""
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
                self._say(
                    f"the proofs of {job[0]} took too long and were stopped: save the file and run `rtshcua check`"
                )
                return None
            except (OSError, Broken) as error:
                self._kill()
                if left and job[0] not in self._waiting:
                    continue
                self._say(f"the proofs of {job[0]} failed: {error}")
                return None
        return None

    async def _answer(self, job: Job) -> Found:
        """The answer of the process. Raises Slow, Broken, OSError."""
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
        try:
            process.stdin.write(_message(job))
            await process.stdin.drain()
            length = int.from_bytes(await process.stdout.readexactly(LENGTH), "big")
            if length > LARGEST:
                raise Broken("the prover process gave an invalid answer")
            answer = await process.stdout.readexactly(length)
        except (OSError, asyncio.IncompleteReadError) as error:
            raise Broken("the prover process has ended") from error
        try:
            found = pickle.loads(answer)
        except Exception as error:  # an invalid pickle may raise anything
            raise Broken("the prover process gave an invalid answer") from error
        if found is not None and not (type(found) is tuple and all(isinstance(each, Diagnostic) for each in found)):
            raise Broken("the prover process gave an invalid answer")
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


if __name__ == "__main__":
    main(sys.argv[1])
