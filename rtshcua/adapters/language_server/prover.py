"""The process in which whole checks run: parse, check, lower, prove, lint, for one source after the other.

`python -P -m rtshcua.adapters.language_server.prover LIBRARY` reads jobs from its standard input and writes what was
found to its standard output, each as its length in eight bytes and a pickle. Both ends are ours: nothing that comes
from a workspace is ever unpickled. `-P` keeps the folder that it was started in off the module path.
"""

import logging
import os
import pickle
import sys
from pathlib import Path
from typing import BinaryIO

from rtshcua.adapters.files.project import Project, Projects
from rtshcua.adapters.language_server.disk import desk
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.ground.compiler.program import examine_program
from rtshcua.ground.editor.desk import Desk, View
from rtshcua.ground.lint.lint import lint
from rtshcua.ground.lint.sift import sift
from rtshcua.ground.project.settings import Ignored
from rtshcua.mavlink import dialect

LENGTH = 8  # bytes, in front of each message

log = logging.getLogger("rtshcua.lsp")


Job = tuple[str, dict[str, str]]
"""The name of a source, and the texts that are open in the editor. Plain, so that it is the same on both ends."""


def main(library: str) -> None:
    """Works until its input ends."""
    incoming, outgoing = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints must not reach the messages
    os.nice(5)  # a keystroke that is answered meanwhile goes first
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING)
    known = desk(library)
    while (job := _take(incoming)) is not None:
        try:
            found: tuple[Diagnostic, ...] | None = examined(known, job)
        except Exception:
            log.exception("the check of %s failed", job[0])
            found = None
        data = pickle.dumps(found)
        outgoing.write(len(data).to_bytes(LENGTH, "big") + data)
        outgoing.flush()


def examined(known: Desk, job: Job) -> tuple[Diagnostic, ...]:
    """Everything that `rtshcua lint` finds in a program, for its first file the habits too."""
    asked, texts = job
    for name in [each for each in known.open if each not in texts]:
        known.close(name)
    for name, text in texts.items():
        known.put(name, text)
    known.forget()
    view = known.view(asked)
    checked = examine_program(view.program, dialect.load())
    found = checked.diagnostics
    failed = has_errors(found)
    if not failed:
        found += lint(view.program, {asked}, checked.grounds)
    untold = {asked} if failed else ()
    return sift(found, view.program.sources, {asked}, _configured(view), untold).found


def _configured(view: View) -> dict[str, tuple[Ignored, ...]]:
    """What the project's configuration ignores in the first file."""
    project = Projects().of(Path(view.name))
    if not isinstance(project, Project):
        return {}
    ignored = project.settings.lint.ignored
    mine = (one for one in ignored if one.pattern is None or project.means(one.pattern, Path(view.name)))
    return {view.name: tuple(mine)}


def _take(incoming: BinaryIO) -> Job | None:
    head = incoming.read(LENGTH)
    if len(head) < LENGTH:
        return None
    data = incoming.read(int.from_bytes(head, "big"))
    job: Job = pickle.loads(data)
    return job


if __name__ == "__main__":
    main(sys.argv[1])
