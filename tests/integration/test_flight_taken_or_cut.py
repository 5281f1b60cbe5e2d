"""Silences and takeovers over real UDP, in both flavours; in virtual time there are many more (`test_flight_silences`,
`test_takeovers`).
"""

from itertools import product
from typing import Any

import pytest

#: so slow that a busy machine's hold-ups stay below what counts as silence
SPEED = 3
FLAVOURS = ("px4", "ardupilot")


def moments(run: Any, event: str) -> list[int]:
    """When an effect was recorded, in us."""
    return [record["at_us"] for record in run.log() if record["type"] == "effect" and record["event"] == event]


def others_in_soak(tried: tuple[str, str], *others: str) -> list[Any]:
    """One (flavour, case) for `make test`; both flavours of it and of the other cases for soak."""
    every = product(FLAVOURS, (tried[1], *others))
    return [pytest.param(*each, marks=() if each == tried else pytest.mark.soak) for each in every]


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "way"), others_in_soak(("px4", "both"), "down", "up"))
def test_short_silence_does_not_end_the_flight(ground: Any, flavour: str, way: str) -> None:
    """What is only not heard of us is noted, and what is flown goes on; what is not heard is waited for."""
    direction = "" if way == "both" else f",way={way}"
    words = ("--flavour", flavour, "--fault", f"link-silence,at=14s,for=5s{direction}")
    run = ground.run(ground.bundle(), *words, speed=SPEED).end()
    assert run.code == 0, run.effects()
    assert run.dispatched() == ["takeoff", "goto", "return_home"]
    if way != "up":
        lost, back = moments(run, "link-lost")[0], moments(run, "link-back")[0]
        assert moments(run, "fresh"), "it was judged again on fresh state, and not before"
        assert all(not lost < at_us < back for at_us in moments(run, "dispatched"))


GOTO = "pilot-goto,at=14s,north=-30m,east=-30m,up=20m"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "fault"), others_in_soak(("ardupilot", GOTO), "pilot,at=14s,mode=position", "pilot-pause,at=14s")
)
def test_no_frame_is_sent_after_a_takeover(ground: Any, flavour: str, fault: str) -> None:
    if flavour == "ardupilot":
        fault = fault.replace("mode=position", "mode=loiter")
        if "pause" in fault:
            pytest.skip("ArduCopter has no pause of its own: a pilot takes LOITER")
    run = ground.run(ground.bundle(), "--flavour", flavour, "--fault", fault, speed=SPEED).end()
    assert run.code == 7, run.effects()
    (taken,) = moments(run, "taken-over")
    assert all(at_us < taken for at_us in moments(run, "dispatched"))
    assert [event for event in run.effects() if event != "boundary"][-1] == "stood-down"
