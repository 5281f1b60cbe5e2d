"""The boundary's process and the one in Python give the same answers to random requests: in the soak a million
requests, among documents, dispatches, links by standing permits and links that are signed ahead, frames, reports,
parameters that are set and put back, statements and logs, over several starts of the process and several bundles.
"""

import json
from collections import Counter
from functools import cache
from hashlib import sha256
from pathlib import Path

import pytest

from boundary import sessions_in_c_and_python as c_and_python
from boundary.both_boundaries import Differs
from boundary.sessions_in_c_and_python import ask_both, decided
from rtshcua.adapters.boundary.process import program

CHECKOUT = Path(__file__).resolve().parents[2]
CHUNKS, CHUNK = 100, 10_000


@pytest.mark.claim("A4", drawn="from seeds")
@pytest.mark.claim("A2", drawn="from seeds")
def test_both_answer_the_same(tmp_path: Path) -> None:
    counts = ask_both(0, 1_000, tmp_path)
    assert decided(counts) >= 1_000
    wanted = {
        *("requests ALLOW", "requests DENY", "requests DEFER", "requests FALLBACK", "dispatches", "refused permits"),
        *("documents accepted", "documents refused", "frames", "refused frames", "believed", "statements", "logs"),
        *("bundles", "bundles opened again", "bundles refused", "sessions", "ended", "killed"),
        *("settings", "refused settings", "preparations", "restorations", "refused preparations", "parameters set"),
        *("withdrawals permit/unsent", "withdrawals permit/sent", "withdrawals permit/forged"),
        *("ahead", "ahead permit/forged", "ahead permit/lapsed", "ahead permit/backwards", "ahead frame/not-covered"),
    }
    assert wanted <= counts.keys(), wanted - counts.keys()


@pytest.mark.soak
def test_both_stop_signing_ahead_at_the_same_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sign a link ahead repeatedly, until it is refused."""
    monkeypatch.setattr(c_and_python, "FLOODS", 1)
    assert {"floods", "ahead frame/too-many-ahead"} <= ask_both(0, 600, tmp_path).keys()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("where", "changed"),
    [
        ("onboard.enforcement.executor._HOMEWARD", ()),
        ("onboard.enforcement.preparation.VALID_US", 1),
        ("mavlink.signing.LEAD", 3_000_001),
        ("wire.boundary_chain.START", bytes(31) + b"\1"),
        ("adapters.store.opened_missions.FileReplayStore.give_back", lambda *_: None),
    ],
)
def test_an_answer_that_differs_is_noticed(
    where: str, changed: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"rtshcua.{where}", changed)
    with pytest.raises(Differs):
        ask_both(0, 1_000, tmp_path)


@cache
def answers_done() -> Path:
    """The file that records the finished comparisons of this program and this Python version."""
    built = program()
    assert built is not None
    digest = sha256(built.read_bytes())
    for each in sorted(path for top in ("rtshcua", "tests/boundary") for path in (CHECKOUT / top).rglob("*.py")):
        digest.update(each.read_bytes())
    folder = CHECKOUT / "build" / "soak-together" / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.mark.claim("A4", drawn="from seeds")
@pytest.mark.claim("A2", drawn="from seeds")
@pytest.mark.soak
@pytest.mark.parametrize("chunk", range(1, CHUNKS + 1))
def test_both_answer_a_million_requests_the_same(chunk: int, tmp_path: Path) -> None:
    """Requests that were compared before are skipped: the test resumes where it stopped."""
    done = answers_done() / f"{chunk}.json"
    if not done.exists():
        counts = ask_both(chunk * CHUNK, CHUNK, tmp_path)
        done.with_suffix(".part").write_text(json.dumps(counts))
        done.with_suffix(".part").replace(done)
    assert decided(Counter(json.loads(done.read_text()))) >= CHUNK
