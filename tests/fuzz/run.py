"""Coverage-guided fuzzing of one target, with atheris (libFuzzer): `python tests/fuzz/run.py TARGET [MINUTES]`.

A finding does not end the run: its input is kept in `build/fuzz/found/TARGET/`, one for each place in the code, with
the traceback beside it; the exit code is 1 when there is any. The corpus grows in `build/fuzz/corpus/TARGET/`.
"""

import json
import signal
import sys
import time
import traceback
from functools import lru_cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from random import Random

import atheris

TESTS = Path(__file__).resolve().parents[1]
BUILD = TESTS.parent / "build" / "fuzz"
#: CPU seconds for one input
LIMIT = 10

sys.path.insert(0, str(TESTS))
name, minutes = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 10.0

with atheris.instrument_imports(include=["rtshcua"]):
    from fuzz import corpus, dictionary
    from rtshcua.ground.language import load

    target = import_module(f"fuzz.targets.{name}")


class Slow(Exception):
    """An input took too long."""


def _slow(*_: object) -> None:
    raise Slow(f"over {LIMIT} s")


found = BUILD / "found" / name
executed = {"inputs": 0, "findings": 0, "slowest": 0.0}
begun = time.monotonic()


def _kept(data: bytes, error: BaseException) -> None:
    """Keep the input unless one with the same place in the code was."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "/rtshcua/" in frame.filename]
    frame = frames[-1] if frames else traceback.extract_tb(error.__traceback__)[-1]
    place = "slow" if isinstance(error, Slow) else f"{Path(frame.filename).stem}-{frame.lineno}"
    path = found / f"{type(error).__name__}-{place}"
    executed["findings"] += 1
    before = path.stat().st_size if path.exists() else None
    if before is None or len(data) < before:
        found.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        path.with_suffix(".txt").write_text("".join(traceback.format_exception(error)), errors="replace")
    if before is None:
        print(f"== FOUND {path}: {error!s:.300}", flush=True)


def one(data: bytes) -> None:
    started = time.process_time()
    signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT)
    try:
        target.one(data)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
        _kept(data, error)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    took = time.process_time() - started
    executed["inputs"] += 1
    if took > executed["slowest"] and took > 1:
        executed["slowest"] = round(took, 2)
        (BUILD / f"slowest-{name}").write_bytes(data)
    if executed["inputs"] % 100 == 0:
        told = {**executed, "seconds": round(time.monotonic() - begun), "cpu": round(time.process_time())}
        (BUILD / f"count-{name}.json").write_text(json.dumps(told) + "\n")


def mutated(data: bytes, size: int, seed: int) -> bytes:
    of = Random(seed)
    if of.random() < 0.6:
        changed = target.mutated(data, of)
        if len(changed) <= size and changed != data:
            return bytes(changed)
    return bytes(atheris.Mutate(data, size))


folder = BUILD / "corpus" / name
folder.mkdir(parents=True, exist_ok=True)
for seed in (*target.seeds(), *(path.read_bytes() for path in corpus.kept(name))):
    (folder / sha256(seed).hexdigest()[:20]).write_bytes(seed)
words = BUILD / "dictionary"
words.write_text(dictionary.dictionary())
plain = load.parse
remembered = lru_cache(128)(plain)
load.parse = lambda source: remembered(source) if source.file.startswith("lib/") else plain(source)
signal.signal(signal.SIGVTALRM, _slow)
atheris.Setup(
    [
        "fuzz", str(folder), f"-max_total_time={round(minutes * 60)}", f"-max_len={target.MAX_LENGTH}", "-timeout=300",
        "-rss_limit_mb=3000", f"-dict={words}", f"-artifact_prefix={BUILD}/{name}-", "-print_final_stats=1",
        "-len_control=0", "-verbosity=1", "-reload=0",
    ],
    one,
    custom_mutator=mutated,
)  # fmt: skip
atheris.Fuzz()
