"""The proving process, replaced by ones that die, hang, or give malformed answers: it is restarted, or the failure is
reported, without an endless wait.
"""

import asyncio
import pickle
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.diagnostics.codes import REGISTRY
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.front.lsp.prover import LARGEST, LENGTH, Found, Proving

FOUND = (Diagnostic(REGISTRY["E0201"], "wrong", None),)
#: the process: counts its starts in the folder it is given, then does what the test says for each job
PROCESS = """
import os, pickle, sys, time
folder = sys.argv[1]
starts = len(os.listdir(folder))
open(os.path.join(folder, str(starts)), "w").close()
def answer(data): sys.stdout.buffer.write(len(data).to_bytes(8, "big") + data); sys.stdout.flush()
def take(): pickle.loads(sys.stdin.buffer.read(int.from_bytes(sys.stdin.buffer.read(8), "big")))
RIGHT = %r
%s
"""
RIGHT = "\nwhile True:\n  take(); answer(RIGHT)"


def asked(tmp_path: Path, does: str, *names: str, longest: float = 30) -> tuple[list[Found], list[str], int]:
    """The results for `names` in turn, the messages, and the number of started processes."""
    said: list[str] = []

    async def asking() -> list[Found]:
        command = (sys.executable, "-S", "-c", PROCESS % (pickle.dumps(FOUND), does))
        proving = Proving(str(tmp_path), said.append, command=command, patience=longest, longest=longest)
        found: list[Found] = []
        try:
            for name in names:
                one = asyncio.get_running_loop().create_future()
                done: Callable[[Found], None] = one.set_result
                proving.ask(name, {name: "x" * 300_000}, done)  # more than a pipe holds
                found.append(await asyncio.wait_for(one, 60))
                proving._patience = proving._longest = 60  # long enough for a slow machine
        finally:
            proving.end()
            await proving.ended()
        return found

    assert LENGTH == 8
    return asyncio.run(asking()), said, len(list(tmp_path.iterdir()))


def test_answers_come(tmp_path: Path) -> None:
    assert asked(tmp_path, RIGHT, "a", "b") == ([FOUND, FOUND], [], 1)


@pytest.mark.parametrize(
    "fault",
    [
        "sys.exit(3)",
        "take(); sys.exit(0)",
        "take(); os.kill(os.getpid(), 9)",
        "take(); answer(b'no pickle')",
        "take(); answer(pickle.dumps('no findings'))",
        "take(); answer(pickle.dumps((1, 2)))",
        f"take(); sys.stdout.buffer.write(({LARGEST} + 1).to_bytes(8, 'big')); sys.stdout.flush(); time.sleep(99)",
        "take(); sys.stdout.buffer.write(b'ab'); sys.stdout.flush(); sys.exit(1)",
    ],
)
def test_a_process_that_fails_once_is_replaced(tmp_path: Path, fault: str) -> None:
    assert asked(tmp_path, f"if not starts:\n  {fault}{RIGHT}", "a") == ([FOUND], [], 2)


def test_failing_prover_is_reported_and_tried_again(tmp_path: Path) -> None:
    found, said, starts = asked(tmp_path, f"if starts < 2:\n  sys.exit(1){RIGHT}", "a", "b")
    assert found == [None, FOUND]
    assert said == ["the proofs of a failed: the prover process has ended"]
    assert starts == 3


@pytest.mark.parametrize("hangs", ["time.sleep(99)", "take(); time.sleep(99)"])
def test_hanging_prover_is_killed(tmp_path: Path, hangs: str) -> None:
    """This includes one that does not read its request."""
    found, said, starts = asked(tmp_path, f"if not starts:\n  {hangs}{RIGHT}", "a", "b", longest=0.5)
    assert found == [None, FOUND]
    assert [each[: each.index(":")] for each in said] == ["the proofs of a took too long and were stopped"]
    assert starts == 2


def test_missing_prover_process_is_reported(tmp_path: Path) -> None:
    said: list[str] = []

    async def asking() -> Found:
        proving = Proving("x", said.append, command=(str(tmp_path / "none"),))
        one = asyncio.get_running_loop().create_future()
        proving.ask("a", {}, one.set_result)
        found: Found = await asyncio.wait_for(one, 60)
        return found

    assert asyncio.run(asking()) is None
    assert len(said) == 1
