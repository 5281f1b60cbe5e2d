"""`qualify` in virtual time: correct vehicles pass each check, and each wrong one fails its check."""

from collections.abc import Callable
from functools import cache

import pytest

from rtshcua.adapters.qualification.sortie import BY_PILOT, SILENCES_US, SORTIES, QualifyingDriver
from rtshcua.model.faults import FlightMode, PilotMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command, Event
from rtshcua.virtual.vehicle import SECOND, VirtualVehicle
from rtshcua.wire.qualification import CheckOutcome, QualificationCheck
from virtual import wrong_vehicles as wrong
from virtual.qualifying import Qualifying

FLAVOURS = ("px4", "ardupilot")
NAMED = {each.name: each for each in SORTIES}
#: no longer than this in the air, in seconds
MOST_S = 300


@cache
def right(flavour: str) -> tuple[Qualifying, dict[str, QualificationCheck]]:
    """The whole of it, once for all that is asked of it."""
    flown = Qualifying(flavour)
    return flown, {each.slug: each for each in flown.fly()}


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_correct_vehicle_passes_every_check(flavour: str) -> None:
    _, checks = right(flavour)
    failed = {
        slug: each for slug, each in checks.items() if each.outcome in (CheckOutcome.FAILED, CheckOutcome.UNCHECKED)
    }
    assert not failed
    assert len(checks) >= 28


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_qualification_takes_less_than_five_minutes_of_flight(flavour: str) -> None:
    flown, _ = right(flavour)
    assert sum(each.airborne_us for each in flown.observed.sorties) < MOST_S * SECOND
    # nor does it stand about: from the first heartbeat to the last landing
    assert flown.elapsed_us < MOST_S * SECOND


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_each_sortie_is_a_flight_with_a_log_that_verifies(flavour: str) -> None:
    """What moved the vehicle was permitted and recorded: the audit decides each record again."""
    flown, _ = right(flavour)
    assert len(flown.flights) == len(SORTIES)
    for flight in flown.flights:
        assert flight.audit().report.failure is None


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_qualification_measures_the_flight(flavour: str) -> None:
    """The figures are the simulated vehicle's own: it flies at 5 m/s, returns at 30 m, and is silenced thrice."""
    flown, checks = right(flavour)
    assert checks["return/height"].found == pytest.approx(30_000, abs=500)
    assert checks["return/across"].found == pytest.approx(29_500, abs=600)
    assert checks["fly/speed"].found == pytest.approx(4_800, abs=300)
    leg = flown.observed.sortie("leg")
    assert leg is not None
    assert [each.for_us for each in leg.silences] == list(SILENCES_US)
    assert [each.lost_us is None for each in leg.silences] == [True, False, False]


WRONG: tuple[tuple[Callable[[VirtualVehicle], None], str, str, str], ...] = (
    (wrong.hold_that_does_not_stop, "px4", "leg", "stop/fly"),
    (wrong.hold_that_does_not_stop, "ardupilot", "climb", "stop/climb"),
    (wrong.hold_that_drifts, "px4", "climb", "hold/climb"),
    (wrong.late_heartbeat, "px4", "mode", "takeover/mode"),
    (wrong.seldom_heartbeat, "ardupilot", "climb", "heartbeat/asked"),
    (wrong.fence_switched_off, "ardupilot", "climb", "fence/on"),
    (wrong.fence_that_keeps_other_items, "px4", "climb", "fence/read-back"),
    (wrong.silent_mode_change, "ardupilot", "mode", "takeover/mode"),
    (wrong.target_never_told, "px4", "pause", "takeover/pause"),
    (wrong.target_never_told, "ardupilot", "target", "takeover/target"),
    (wrong.slow_climb, "px4", "climb", "climb/speed"),
    (wrong.fast_leg, "ardupilot", "leg", "fly/speed"),
    (wrong.return_that_does_not_move, "px4", "leg", "return/home"),
    (wrong.return_that_does_not_climb, "ardupilot", "leg", "return/across"),
    (wrong.landing_that_does_not_descend, "ardupilot", "climb", "land/down"),
    (wrong.answers_that_never_come, "ardupilot", "climb", "answers/come"),
    (wrong.answers_that_come_late, "px4", "climb", "answers/late"),
    (wrong.stream_at_a_third, "px4", "climb", "streams/delivered"),
    (wrong.returns_when_we_are_silent, "px4", "leg", "silence/3s"),
    (wrong.silent_version, "px4", "climb", "firmware/told"),
)
#: noticed by the same check as on the other autopilot
AGAIN = (
    (wrong.hold_that_does_not_stop, "ardupilot", "leg", "stop/fly"),
    (wrong.silent_mode_change, "px4", "mode", "takeover/mode"),
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("habit", "flavour", "sortie", "slug"),
    [*WRONG, *(pytest.param(*each, marks=pytest.mark.soak) for each in AGAIN)],
    ids=lambda each: getattr(each, "__name__", each),
)
def test_wrong_vehicle_fails_its_check(
    habit: Callable[[VirtualVehicle], None], flavour: str, sortie: str, slug: str
) -> None:
    flown = Qualifying(flavour, habit)
    checks = {each.slug: each for each in flown.fly([NAMED[sortie]])}
    assert checks[slug].outcome == CheckOutcome.FAILED, checks[slug]
    assert right(flavour)[1][slug].outcome == CheckOutcome.HELD
    assert flown.observed.sorties[0].down, "whatever is wrong with it, it was brought down"


def test_ineffective_fence_fails_its_check() -> None:
    checks = {each.slug: each for each in Qualifying("px4", parameters=(("GF_ACTION", 0),)).fly([NAMED["climb"]])}
    assert checks["fence/on"].outcome == CheckOutcome.FAILED
    assert "set `GF_ACTION` to 2" in checks["fence/on"].advice


def test_failed_sortie_ends_the_qualification() -> None:
    flown = Qualifying("px4", wrong.landing_that_does_not_descend)
    checks = {each.slug: each for each in flown.fly(SORTIES)}
    assert [each.name for each in flown.observed.sorties] == ["climb"]
    assert checks["return/home"].outcome == CheckOutcome.UNCHECKED
    assert "sortie `climb` did not go as planned" in checks["return/home"].measured


def lands(vehicle: VirtualVehicle, text: str) -> None:
    """A pilot who does as asked, after a moment."""
    assert text.startswith("PILOT: take over now")
    vehicle.simulation.inject(PilotMode(vehicle.clock.elapsed_us + 2 * SECOND, FlightMode.LAND))


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_pilot_of_a_real_vehicle_is_asked_to_take_over(flavour: str) -> None:
    flown = Qualifying(flavour, pilot=lands)
    checks = {each.slug: each for each in flown.fly([BY_PILOT])}
    assert checks["takeover/mode"].outcome == CheckOutcome.HELD
    assert checks["takeover/mode"].measured.endswith("the delay is not known")
    assert checks["takeover/pause"].outcome == CheckOutcome.UNCHECKED
    assert flown.observed.sorties[0].down


@pytest.mark.slow
def test_missing_takeover_is_reported_and_returns_home() -> None:
    flown = Qualifying("px4", pilot=lambda vehicle, text: None)
    checks = {each.slug: each for each in flown.fly([BY_PILOT])}
    assert checks["takeover/mode"].outcome == CheckOutcome.FAILED
    assert checks["takeover/mode"].measured == "not detected"
    assert flown.observed.sorties[0].ending == "completed"


def test_unrequested_takeover_ends_the_qualification() -> None:
    """A pilot's abort, at whatever stage: it stands down, and no other sortie is flown."""

    def taken(vehicle: VirtualVehicle) -> None:
        vehicle.simulation.inject(PilotMode(12 * SECOND, FlightMode.LAND))

    flown = Qualifying("px4", taken)
    flown.fly(SORTIES)
    assert [(each.name, each.ending) for each in flown.observed.sorties] == [("climb", "stood-down")]


@pytest.mark.slow
def test_fallback_ends_a_test_silence() -> None:
    """A silence is a test; a fallback is not to wait for it."""
    begun: list[int] = []

    def lands(vehicle: VirtualVehicle) -> None:
        driver = vehicle.driver
        assert isinstance(driver, QualifyingDriver)
        tick = driver.tick

        def interfering(now_us: int) -> tuple[list[Event], list[bytes]]:
            silences = driver.found.silences
            if silences and not begun and now_us - silences[0].began_us > SECOND // 2:
                begun.append(now_us)
                events, frames = driver.begin(Command(99, "emergency_land", MotionKind.LAND, (), (), 0, 0), now_us)
                assert silences[0].for_us == now_us - silences[0].began_us
                return events, frames
            return tick(now_us)

        driver.tick = interfering  # type: ignore[method-assign]

    flown = Qualifying("px4", lands)
    flown.fly([NAMED["leg"]])
    assert begun
