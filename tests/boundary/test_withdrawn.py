"""Withdrawn permits, by hand: both boundaries release the id of a step of which nothing was sent, and nothing else."""

import ctypes
from collections.abc import Callable
from typing import Any

import pytest

from boundary.both_boundaries import Shadow, begin, library
from reference import world
from reference.flat_case import S
from reference.world import ROOT, ROOT_KEY, SESSION_KEY, START, VEHICLE, allowed, answer_to, request_for, sealed_again
from rtshcua.adapters.vehicle import messages
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.modes import Px4Mode
from rtshcua.model.decision import Decision
from rtshcua.onboard.enforcement.frames import OURS
from rtshcua.onboard.enforcement.isolated import DIGEST, DISPATCH, PREPARE, STAND_IN, WITHDRAW
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command
from rtshcua.wire.boundary_chain import Tag, following, refused, unprepared
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK
from virtual.rows import rows

AT = START.monotonic_us
ARMS, LANDS = messages.arm(1), messages.set_mode(1, Px4Mode.LAND)


def octets(message: Any, component: int = OURS) -> bytes:
    return Codec(1, component).pack(message)


@pytest.fixture
def both(boundary: ctypes.CDLL) -> Callable[[], Loaded]:
    """A flight under both boundaries, of a PX4."""
    shadow = Shadow(boundary)
    shadow.know(ROOT, ROOT.sign(ROOT_KEY), ROOT_KEY.verification().public)

    def made() -> Loaded:
        loaded = shadow.load(
            sealed_again(world.loaded()), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE,
            session_key=SESSION_KEY, flight=bytes(16), peer_is_own_simulator=True,
        )  # fmt: skip
        assert isinstance(loaded, Loaded), loaded
        beat = Codec(1, 1).pack(_heartbeat())
        loaded.executor.frames.observe(beat)
        return loaded

    return made


def _heartbeat() -> Any:
    beat = messages.heartbeat()
    beat.type, beat.autopilot = 2, 12
    return beat


class Script:
    """Interprets the words of a line as actions on the permits of steps."""

    def __init__(self, of: Loaded) -> None:
        self.of = of
        self.permits: dict[str, bytes] = {}
        self.said = ""

    def run(self, line: str) -> "Script":
        for word in line.split():
            what, _, name = word.partition(":")
            getattr(self, "_" + what)(name)
        return self

    def _allow(self, name: str) -> None:
        self.permits[name] = allowed(self.of, step=int(name[0]))

    def _send(self, name: str) -> None:
        self.of.executor.dispatch(self.permits[name], AT)

    def _link(self, name: str) -> None:
        self.of.executor.stand_in(self.permits[name], CONTINGENCY_LINK, 0, AT)

    def _chain(self, name: str) -> None:
        self.of.executor.stand_in(self.permits[name], FALLBACK_LINK, 0, AT)

    def _arms(self, _: str) -> None:
        assert isinstance(self.of.executor.frames.seal(octets(ARMS), AT), bytes)

    def _blocked(self, _: str) -> None:
        assert not isinstance(self.of.executor.frames.seal(octets(LANDS), AT), bytes)

    def _late(self, _: str) -> None:
        assert not isinstance(self.of.executor.frames.seal(octets(ARMS), AT + 60 * S), bytes)

    def _ended(self, _: str) -> None:
        self.of.executor.ended()

    def _landed(self, _: str) -> None:
        self.of.executor.landed()

    def _withdraw(self, name: str) -> None:
        self.said = self.of.executor.withdraw(self.permits[name], AT).slug

    def again(self, step: int) -> str:
        """The answer to a request for a step."""
        answer = answer_to(self.of, request_for(self.of, step=step))
        return str(answer.reason) if isinstance(answer, Decision) else answer.name


UNSENT, SENT, AGAIN, REPLAYED = "permit/unsent", "permit/sent", "admitted", "freshness/replayed"


@rows(
    ("line", "said", "step", "reason"),
    [
        ("allow:0 send:0 ended withdraw:0", UNSENT, 0, AGAIN),
        ("allow:0 send:0 withdraw:0", UNSENT, 0, AGAIN),
        ("allow:0 send:0 late ended withdraw:0", UNSENT, 0, AGAIN),  # the gate refused its frame as late
        ("allow:0 send:0 blocked withdraw:0", UNSENT, 0, AGAIN),  # and a permit of another step
        ("allow:0 withdraw:0", UNSENT, 0, AGAIN),  # it was never dispatched
        ("allow:0 send:0 landed withdraw:0", UNSENT, 0, AGAIN),
        ("allow:0 send:0 ended allow:1 send:1 ended withdraw:1", UNSENT, 1, AGAIN),
        # a frame left
        ("allow:0 send:0 arms withdraw:0", SENT, 0, REPLAYED),
        ("allow:0 send:0 arms ended withdraw:0", SENT, 0, REPLAYED),
        ("allow:0 send:0 arms landed withdraw:0", SENT, 0, REPLAYED),
        # a link flew under it, with or without a sent frame
        ("allow:0 send:0 link:0 withdraw:0", SENT, 0, REPLAYED),
        ("allow:0 send:0 chain:0 ended withdraw:0", SENT, 0, REPLAYED),
        # another step followed, or its turn is over
        ("allow:0 send:0 ended allow:1 withdraw:0", SENT, 0, REPLAYED),
        ("allow:0 send:0 ended allow:1 send:1 withdraw:0", SENT, 0, REPLAYED),
        # once for each permit, and none that was given up is good for anything
        ("allow:0 send:0 withdraw:0 withdraw:0", SENT, 0, AGAIN),
        ("allow:0 send:0 withdraw:0 allow:0b send:0 blocked withdraw:0", SENT, 0, REPLAYED),
        ("allow:0 send:0 withdraw:0 allow:0b send:0b arms ended withdraw:0b", SENT, 0, REPLAYED),
        ("allow:0 send:0 withdraw:0 allow:0b send:0b ended withdraw:0b", UNSENT, 0, AGAIN),
        ("allow:0 withdraw:0 send:0 blocked withdraw:0", SENT, 0, AGAIN),
    ],
)
def test_when_the_id_of_a_step_is_given_back(
    both: Callable[[], Loaded], line: str, said: str, step: int, reason: str
) -> None:
    script = Script(both())
    assert (script.run(line).said, script.again(step)) == (said, reason)


def test_withdrawn_permit_covers_no_links(both: Callable[[], Loaded]) -> None:
    of = both()
    script = Script(of).run("allow:0 send:0 withdraw:0")
    for kind in (FALLBACK_LINK, CONTINGENCY_LINK):
        assert getattr(of.executor.stand_in(script.permits["0"], kind, 0, AT), "slug", "") == "permit/lapsed"
    script.run("allow:0b send:0b arms ended allow:1 send:1 ended withdraw:1")
    for kind in (FALLBACK_LINK, CONTINGENCY_LINK):
        assert getattr(of.executor.stand_in(script.permits["1"], kind, 0, AT), "slug", "") == "permit/lapsed"
    assert isinstance(of.executor.stand_in(script.permits["0b"], FALLBACK_LINK, 0, AT), Command), "as before"


def test_link_permit_cannot_be_withdrawn(both: Callable[[], Loaded]) -> None:
    of = both()
    hold = allowed(of, kind=CONTINGENCY_LINK, step=-1, link=0)
    assert of.executor.withdraw(hold, AT).slug == SENT
    forged = hold[:-1] + bytes([hold[-1] ^ 1])
    assert of.executor.withdraw(forged, AT).slug == "permit/forged"


@pytest.mark.parametrize("kind", [DISPATCH, STAND_IN, WITHDRAW, PREPARE])
def test_permit_at_other_time_is_reported_as_refused(boundary: ctypes.CDLL, kind: int) -> None:
    """An honest process that stalled records it, and the boundary's statement agrees."""
    clock = [AT]
    caller = begin(
        boundary, ROOT.sign(ROOT_KEY), ROOT_KEY.verification().public, VEHICLE, SESSION_KEY, START,
        own_us=lambda: clock[0],
    )  # fmt: skip
    of = load(
        sealed_again(world.loaded()), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.PROCESS,
        session_key=SESSION_KEY, flight=bytes(16), peer_is_own_simulator=True, caller=caller,
    )  # fmt: skip
    assert isinstance(of, Loaded), of
    permit = allowed(of)
    clock[0] += 3 * S
    call = library(boundary, lambda: clock[0])
    before = call(bytes([DIGEST]))[1:]
    rest = bytes([CONTINGENCY_LINK, 0]) if kind == STAND_IN else b""
    assert call(bytes([kind]) + AT.to_bytes(8) + rest + permit) == b"\1time-apart"
    told = (Tag.REFUSED, refused("time-apart", AT)) if kind != PREPARE else (Tag.UNPREPARED, unprepared("time-apart"))
    assert call(bytes([DIGEST]))[1:] == following(before, *told)
