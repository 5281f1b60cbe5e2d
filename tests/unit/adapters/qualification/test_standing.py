"""The comparison of a vehicle with its qualification record, the requests for its identity, and the record's file."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua.adapters.doctor.identity import WHOLE, IdentityQuestions, as_octets, standing, those_that_matter
from rtshcua.adapters.qualification.sortie import SORTIES
from rtshcua.adapters.store.vehicle_records import keep_qualification, kept_qualification, qualification_path
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.wire.qualification import CheckOutcome, Firmware, Qualification, QualificationCheck, parameters_digest

PARAMETERS = (("GF_ACTION", as_octets(2)), ("RTL_RETURN_ALT", as_octets(30)))
VERSION = Firmware("px4", 0x01100000, bytes(8))
FLOWN = tuple(QualificationCheck(f"sortie/{name}", CheckOutcome.HELD, "", "") for name in ("climb", "leg"))
HELD = QualificationCheck("stop/fly", CheckOutcome.HELD, "", "")
LEFT = QualificationCheck("takeover/mode", CheckOutcome.UNCHECKED, "", "")
FAILED = QualificationCheck("fence/on", CheckOutcome.FAILED, "", "")
RECORD = Qualification(
    "quad-07", VERSION, PARAMETERS, parameters_digest(PARAMETERS), bytes(32), "ada", "0.1",
    1_767_225_600_000_000, 0, (), (*FLOWN, HELD, LEFT),
)  # fmt: skip


def test_unchanged_vehicle_is_qualified() -> None:
    stands = standing(RECORD, VERSION, dict(PARAMETERS))
    assert stands == (True, "qualified on 2026-01-01 for px4 1.16.0: 3 checks hold, 1 was not made")


def test_partly_flown_vehicle_is_partly_qualified() -> None:
    assert [each.name for each in SORTIES if each.takeover is None] == list(WHOLE)
    stands = standing(replace(RECORD, checks=(FLOWN[0], HELD, LEFT)), VERSION, dict(PARAMETERS))
    assert stands == (False, "this vehicle is only partly qualified: not flown: leg (`--only`)")


def test_a_simulation_qualifies_no_vehicle() -> None:
    """With one identity for both, the real vehicle would fly with the simulated vehicle's record."""
    stands = standing(replace(RECORD, pilot=""), VERSION, dict(PARAMETERS))
    assert stands == (False, "this vehicle was qualified in simulation only, on 2026-01-01")


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (None, "is on record"),
        ("unknown key", "its record cannot be trusted: unknown key"),
        (replace(RECORD, checks=(HELD, FAILED)), "1 check did not hold: fence/on"),
        (replace(RECORD, checks=(LEFT,)), "nothing was checked"),
    ],
)
def test_failed_or_missing_record_does_not_qualify(record: Any, says: str) -> None:
    stands = standing(record, VERSION, dict(PARAMETERS))
    assert not stands.qualified
    assert stands.text.startswith("this vehicle is not qualified: ")
    assert says in stands.text


@pytest.mark.parametrize(
    ("firmware", "parameters", "says"),
    [
        (
            replace(VERSION, version=0x01110000),
            PARAMETERS,
            "has changed since: its firmware is px4 1.17.0, and was px4 1.16.0",
        ),
        (VERSION, (("GF_ACTION", as_octets(0)), PARAMETERS[1]), "has changed since: parameters `GF_ACTION`"),
        (None, PARAMETERS, "the vehicle does not report its version now"),
        (VERSION, PARAMETERS[:1], "1 of its parameters are not reported now"),
    ],
)
def test_changed_or_silent_vehicle_is_not_qualified(firmware: Any, parameters: Any, says: str) -> None:
    stands = standing(RECORD, firmware, dict(parameters))
    assert not stands.qualified
    assert says in stands.text


def test_parameters_switched_by_runs_do_not_matter() -> None:
    from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT

    values = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 7.0, "FENCE_RADIUS": 150.0, "UNHEARD_OF": 1.0}
    assert those_that_matter(ARDUPILOT, values) == {"FENCE_RADIUS": as_octets(150)}


def test_identity_is_requested_until_it_is_reported() -> None:
    questions = IdentityQuestions(PX4, names=["GF_ACTION"])
    asked = [message.get_type() for message in questions.due(1, 1_000_000)]
    assert asked == ["PARAM_REQUEST_READ", "COMMAND_LONG"]
    assert questions.due(1, 1_100_000) == []
    questions.take("PARAM_VALUE", SimpleNamespace(param_id="GF_ACTION", param_value=2.0, param_type=9))
    assert not questions.told
    questions.take("AUTOPILOT_VERSION", SimpleNamespace(flight_sw_version=1, flight_custom_version=[0] * 8))
    assert questions.told
    assert questions.parameters == {"GF_ACTION": as_octets(2)}
    assert questions.due(1, 9_000_000) == []
    silent = IdentityQuestions(PX4, names=[])
    asks = [len(silent.due(1, second * 1_000_000)) for second in range(1, 12)]
    assert sum(asks) == 6, "one that does not tell its version is not asked for ever"


def test_last_qualification_record_of_a_vehicle_is_kept(tmp_path: Path) -> None:
    assert kept_qualification(tmp_path, "quad/07") is None
    keep_qualification(tmp_path, "quad/07", b"one")
    path = keep_qualification(tmp_path, "quad/07", b"two")
    assert path == qualification_path(tmp_path, "quad/07")
    assert path.parent == tmp_path / "qualifications"
    assert kept_qualification(tmp_path, "quad/07") == b"two"
    assert kept_qualification(tmp_path, "quad-07") is None
