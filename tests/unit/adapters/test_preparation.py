"""Setting and restoring parameters, also when the vehicle, its owner or the disk interferes."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from rtshcua.codec.frames import Codec
from rtshcua.mavlink.parameters import bits_of
from rtshcua.onboard.enforcement.executor import LATE
from rtshcua.onboard.enforcement.preparation import Owed
from rtshcua.onboard.ports import Ending, Event
from virtual.flight import Flight
from virtual.shipped import shipped, simulated

HAD = {"FENCE_ALT_MAX": 15.0}


def bits(value: float) -> int:
    found = bits_of(value)
    assert found is not None
    return found


def flight(settings: dict[str, float], owed: dict[str, Owed] | None = None, flavour: str = "ardupilot") -> Flight:
    had = tuple(HAD.items()) if flavour == "ardupilot" else ()
    configured = {name: bits(value) for name, value in settings.items()}
    return Flight(shipped("short"), simulated(flavour, parameters=had), settings=configured, owed=owed)


def has(of: Flight, name: str = "FENCE_ALT_MAX") -> float:
    value: float = of.vehicle.simulation._autopilot.parameters.value(name)
    return value


def writes(of: Flight) -> list[Any]:
    """The parameters set from now on, except the switches of the fence."""
    found: list[Any] = []

    def watch(frame: bytes) -> bool:
        messages = [each.message for each in Codec(0, 0).parse(frame) if each.name == "PARAM_SET"]
        found.extend(each for each in messages if each.param_id not in ("FENCE_ENABLE", "FENCE_TYPE"))
        return False

    of.vehicle.lose = watch
    return found


def test_no_parameters_are_accessed_without_configuration() -> None:
    one = flight({}, flavour="px4")
    sent = writes(one)
    assert one.prepare() is None
    assert one.clock.elapsed_us == 0
    assert sent == []


def test_parameter_with_wanted_value_is_not_written() -> None:
    owed: dict[str, Owed] = {}
    one = flight(HAD, owed)
    sent = writes(one)
    assert one.prepare() is None
    assert (sent, owed) == ([], {})


def test_unknown_parameter_refuses_the_mission() -> None:
    one = flight({"GF_ACTION": 3.0, "FENCE_ALT_MAX": 80.0})
    sent = writes(one)
    flown = one.fly()
    assert flown.ending is Ending.REFUSED
    assert sent == []
    (said,) = flown.effects("not-prepared")
    assert said["detail"] == "the vehicle does not report `GF_ACTION`, which is to be set"


def test_a_vehicle_that_keeps_its_own_value_refuses_the_mission(monkeypatch: pytest.MonkeyPatch) -> None:
    owed: dict[str, Owed] = {}
    one = flight({"FENCE_ALT_MAX": 80.0}, owed)
    parameters = one.vehicle.simulation._autopilot.parameters
    monkeypatch.setattr(parameters, "write", lambda name, raw, kind: parameters.read(name, -1))
    flown = one.fly()
    assert flown.ending is Ending.REFUSED
    (said,) = flown.effects("not-prepared")
    assert said["detail"] == "not set as it was to be: FENCE_ALT_MAX is 15"
    assert owed == {}, "it is what it was"


def test_parameter_changed_by_others_is_not_restored() -> None:
    owed: dict[str, Owed] = {}
    one = flight({"FENCE_ALT_MAX": 80.0}, owed)

    def each(of: Flight) -> Sequence[Event]:
        if of.vehicle.simulation.truth().up_mm > 5_000:
            of.vehicle.simulation._autopilot.parameters.own("FENCE_ALT_MAX", 60.0)
        return ()

    flown = one.fly(each)
    assert flown.ending is Ending.COMPLETED
    (said,) = flown.effects("not-restored")
    assert "which was set to 80, but is 60 now" in said["detail"]
    assert has(one) == 60.0
    assert owed == {}


@pytest.mark.parametrize(("found", "says"), [(15.0, []), (30.0, ["somebody else"])], ids=["as before", "by others"])
def test_owed_parameter_with_another_value_is_dropped(found: float, says: list[str]) -> None:
    owed = {"FENCE_ALT_MAX": Owed(bits(15.0), bits(80.0))}
    one = flight({}, owed)
    one.vehicle.simulation._autopilot.parameters.own("FENCE_ALT_MAX", found)
    sent = writes(one)
    assert one.prepare() is None
    assert (sent, owed, has(one)) == ([], {}, found)
    told = [line for line in one.sink.lines if b'"not-restored"' in line]
    assert [each in str(line) for each, line in zip(says, told, strict=True)] == [True] * len(says)


def test_owed_parameter_is_restored_to_its_first_value() -> None:
    owed = {"FENCE_ALT_MAX": Owed(bits(15.0), bits(60.0))}
    one = flight({"FENCE_ALT_MAX": 80.0}, owed)
    one.vehicle.simulation._autopilot.parameters.own("FENCE_ALT_MAX", 60.0)
    assert one.prepare() is None
    assert (has(one), owed) == (80.0, {"FENCE_ALT_MAX": Owed(bits(15.0), bits(80.0))})
    assert one.preparations.end(lambda: one._pass(lambda _: ())) is None
    assert (has(one), owed) == (15.0, {})
    flown = one.close(Ending.REFUSED)
    assert [each["detail"] for each in flown.effects("preparation")] == [
        "restore FENCE_ALT_MAX from 60 to 15", "set FENCE_ALT_MAX from 15 to 80", "restore FENCE_ALT_MAX from 80 to 15",
    ]  # fmt: skip
    assert flown.audit().report.failure is None


def test_parameter_that_cannot_be_restored_first_is_not_set(monkeypatch: pytest.MonkeyPatch) -> None:
    owed = {"FENCE_ALT_MAX": Owed(bits(15.0), bits(60.0))}
    one = flight({"FENCE_ALT_MAX": 80.0}, owed)
    parameters = one.vehicle.simulation._autopilot.parameters
    parameters.own("FENCE_ALT_MAX", 60.0)
    monkeypatch.setattr(parameters, "write", lambda name, raw, kind: parameters.read(name, -1))
    flown = one.fly()
    assert flown.ending is Ending.REFUSED
    assert "`FENCE_ALT_MAX` could not be restored first" in [each["detail"] for each in flown.effects("not-prepared")]
    assert (has(one), owed) == (60.0, {"FENCE_ALT_MAX": Owed(bits(15.0), bits(60.0))})
    assert flown.audit().report.failure is None


def test_other_owed_parameters_are_restored_first() -> None:
    owed = {"FENCE_RADIUS": Owed(bits(300.0), bits(400.0))}
    one = flight({"FENCE_ALT_MAX": 80.0}, owed)
    one.vehicle.simulation._autopilot.parameters.own("FENCE_RADIUS", 400.0)
    assert one.prepare() is None
    assert has(one, "FENCE_RADIUS") == 300.0
    assert owed == {"FENCE_ALT_MAX": Owed(bits(15.0), bits(80.0))}


@pytest.mark.parametrize("what", ["the log", "what is owed"])
def test_unrecorded_parameters_are_not_set(what: str) -> None:
    one = flight({"FENCE_ALT_MAX": 80.0})
    sent = writes(one)

    def fails(*_: object) -> None:
        raise OSError(28, "no space left on device")

    setattr(one.preparations, "_record" if what == "the log" else "_keep_owed", fails)
    assert one.prepare() is Ending.REFUSED
    assert sent == []
    assert has(one) == 15.0


def test_damaged_restore_record_prevents_parameter_writes() -> None:
    one = flight({"FENCE_ALT_MAX": 80.0})
    sent = writes(one)
    one.preparations._trouble = "it is damaged"
    assert one.preparations.begin(lambda: one._pass(lambda _: ())) == "it is damaged"
    assert sent == []


def test_parameters_are_not_written_unless_the_vehicle_is_landed() -> None:
    one = flight({"FENCE_ALT_MAX": 80.0})
    sent = writes(one)
    one.vehicle.hurt = lambda datagram: [
        datagram for each in Codec(0, 0).parse(datagram) if each.name != "EXTENDED_SYS_STATE"
    ]
    assert one.prepare() is Ending.REFUSED
    assert sent == []


def test_value_adapted_by_vehicle_is_restored(monkeypatch: pytest.MonkeyPatch) -> None:
    owed: dict[str, Owed] = {}
    one = flight({"FENCE_ALT_MAX": 80.5}, owed)
    parameters = one.vehicle.simulation._autopilot.parameters
    write = parameters.write
    monkeypatch.setattr(parameters, "write", lambda name, raw, kind: write(name, float(round(raw)), kind))
    flown = one.fly()
    assert flown.ending is Ending.REFUSED
    assert (has(one), owed) == (15.0, {})
    assert flown.effects("not-restored") == []
    (said,) = flown.effects("not-prepared")
    assert said["detail"] == "not set as it was to be: FENCE_ALT_MAX is 80"
    assert flown.audit().report.failure is None


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_a_value_that_the_parameter_cannot_keep_is_not_written(flavour: str) -> None:
    name, value = ("FENCE_ALT_MAX", 80.5) if flavour == "ardupilot" else ("GF_MAX_HOR_DIST", 300.0)
    one = flight({name: value}, flavour=flavour)
    table = one.vehicle.simulation._autopilot.parameters._table
    table[name] = replace(table[name], type=1)
    sent = writes(one)
    flown = one.fly()
    assert flown.ending is Ending.REFUSED
    (said,) = flown.effects("not-prepared")
    assert f"cannot hold {name} {value:g}" in said["detail"]
    assert sent == []


def test_parameter_of_changed_type_is_not_set() -> None:
    one = flight({"GF_MAX_HOR_DIST": 300.0}, flavour="px4")
    one.preparations._keep_owed = lambda _: one.vehicle.driver.settings._types.update(GF_MAX_HOR_DIST=1)
    sent = writes(one)
    flown = one.fly()
    assert flown.ending is Ending.REFUSED
    (said,) = flown.effects("not-prepared")
    assert said["detail"].startswith("not set as it was to be: GF_MAX_HOR_DIST is ")
    assert sent == []


def test_a_permit_that_is_refused_is_recorded_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    one = flight({"FENCE_ALT_MAX": 80.0})
    monkeypatch.setattr(one.loaded.executor, "prepare", lambda sealed, now_us: LATE)
    flown = one.fly()
    (said,) = flown.effects("not-prepared")
    assert said["detail"] == f"not set as it was to be ({LATE.slug})"


def test_aborted_preparation_requests_no_more_parameters() -> None:
    one = flight({"FENCE_ALT_MAX": 80.0})

    def turn() -> bool:
        return one._pass(lambda _: ()) and not one.vehicle.driver.settings.outstanding

    assert one.preparations.begin(turn) is None
    assert not one.vehicle.driver.settings.outstanding
