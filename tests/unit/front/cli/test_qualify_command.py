"""`rtshcua qualify` before any flight: consent, its scope, and the policy."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rtshcua import library
from rtshcua.adapters.qualification.sortie import BY_PILOT, SORTIES
from rtshcua.adapters.store.vehicle_records import keep_qualification
from rtshcua.app.fly import sorties as sorties_flown
from rtshcua.app.fly.sorties import plan_sorties
from rtshcua.front.cli.render.showing.qualification import told
from rtshcua.wire.keys import Duty
from rtshcua.wire.qualification import (
    CheckOutcome,
    Firmware,
    Qualification,
    QualificationCheck,
    parameters_digest,
    sign_qualification,
)
from virtual import case
from virtual.forked import Forked

SHORT = str(library.root() / "missions/short.rts")
LINK = ["--connect", "udpin:127.0.0.1:14550", "--vehicle", "quad-07"]


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        ([SHORT, *LINK], 2, "`qualify` requires consent"),
        ([SHORT, *LINK, "--sitl", "--pilot", "ada"], 2, "`--sitl` or `--pilot NAME`, not both"),
        ([SHORT, *LINK, "--pilot", " "], 2, "`qualify` requires consent"),
        ([SHORT, *LINK, "--sitl", "--takeover"], 2, "`--takeover` requires `--pilot`"),
        ([SHORT, *LINK, "--sitl", "--unsigned-radio"], 2, "`--unsigned-radio` requires `--signing-key`"),
        ([SHORT, *LINK, "--sitl", "--only", "loop"], 2, "unknown sortie `loop`"),
        ([SHORT, *LINK, "--pilot", "ada", "--only", "pause"], 2, "unknown sortie `pause`"),
        ([SHORT, *LINK, "--pilot", "ada", "--speed", "2"], 2, "`--speed` requires a simulated vehicle"),
        ([SHORT, "--connect", "serial:/dev/ttyAMA0:57600", *LINK[2:], "--sitl"], 2, "may be real"),
        ([SHORT, "--connect", "udpin:0.0.0.0:14550", *LINK[2:], "--sitl"], 2, "may be real"),
        ([SHORT, "--connect", "udpin:nowhere", "--vehicle", "quad-07", "--sitl"], 2, "--connect"),
        ([SHORT, *LINK[:2], "--vehicle", "quad-08", "--sitl"], 5, "the policy is for `quad-07`"),
        ([SHORT, *LINK[:2], "--vehicle", "quad-08", "--sitl"], 5, "`identity` of its policy's `vehicle`"),
        (["missing.rts", *LINK, "--sitl"], 3, "missing.rts"),
        ([SHORT, *LINK, "--sitl"], 4, "holds no keys"),
    ],
)  # fmt: skip
def test_invalid_qualification_does_not_fly(
    commands: Forked, own_world: None, words: list[str], code: int, says: str, tmp_path: Path
) -> None:
    done = commands.run(["qualify", *words], tmp_path, 60)
    assert done.code == code, done.err
    assert says in done.err
    assert "Traceback" not in done.err
    assert not (tmp_path / "runs").exists()


def test_a_policy_that_permits_no_leg_is_refused(commands: Forked, own_world: None, tmp_path: Path) -> None:
    """The sorties are proved like any mission, under the user's own policy."""
    policy = (library.root() / "policies/training_field.rts").read_text(encoding="utf-8")
    (tmp_path / "tight.rts").write_text(policy.replace("permit  goto", "forbid  goto"), encoding="utf-8")
    mission = (library.root() / "missions/short.rts").read_text(encoding="utf-8")
    (tmp_path / "short.rts").write_text(
        mission.replace("lib:policies/training_field.rts", "tight.rts"), encoding="utf-8"
    )
    done = commands.run(["qualify", "short.rts", *LINK, "--sitl"], tmp_path, 60)
    assert done.code == 5
    assert "permits none of the candidate legs" in done.err
    assert "E07" in done.err, "the findings on the first one are shown"


@pytest.mark.parametrize(
    ("words", "flown", "missing"),
    [
        ({"sitl": True, "takeover": False, "keyed": False}, list(SORTIES), set()),
        ({"sitl": True, "takeover": False, "keyed": True}, list(SORTIES[:2]), {"mode", "pause", "target"}),
        ({"sitl": False, "takeover": False, "keyed": True}, list(SORTIES[:2]), {"mode", "pause", "target"}),
        ({"sitl": False, "takeover": True, "keyed": False}, [*SORTIES[:2], BY_PILOT], {"pause", "target"}),
    ],
)
def test_real_vehicles_skip_the_simulated_takeover(words: Any, flown: Any, missing: set[str]) -> None:
    sorties, why = plan_sorties(**words)
    assert sorties == flown
    assert why.keys() == missing
    assert all(why.values())


def record(*checks: QualificationCheck) -> Qualification:
    firmware = Firmware("px4", 0x01100000, bytes(8))
    return Qualification("quad-07", firmware, (), parameters_digest(()), b"", "ada", "0", 0, 61_000_000, (), checks)


def test_table_lists_failed_checks_with_reasons() -> None:
    held = QualificationCheck("land/down", CheckOutcome.HELD, "lands", "0.1 m off", advice="")
    failed = QualificationCheck("stop/fly", CheckOutcome.FAILED, "within 9.7 m", "14.3 m", advice="declare `brakes`")
    left = QualificationCheck("takeover/mode", CheckOutcome.UNCHECKED, "it shows", "not asked for")
    lines = list(told(record(held, failed, left), None))
    assert lines[1:] == [
        "ok    land/down      0.1 m off",
        "FAIL  stop/fly       14.3 m",
        "                     expected: within 9.7 m",
        "                     help: declare `brakes`",
        "-     takeover/mode  not asked for",
        "NOT qualified: 1 hold, 1 do not, 1 not checked, in 61 s of flight",
        "not flown: climb, leg; `doctor` and `run` accept it after all sorties were flown",
    ]
    sorties = [QualificationCheck(f"sortie/{name}", CheckOutcome.HELD, "", "") for name in ("climb", "leg")]
    assert list(told(record(held, *sorties), None))[-1].startswith("qualified: 3 hold")
    *_, end, why = told(record(held, sorties[0]), None)
    assert end.startswith("partly qualified: 2 hold")
    assert why.startswith("not flown: leg; ")


def test_a_partial_record_replaces_no_whole_one(tmp_path: Path) -> None:
    held = QualificationCheck("land/down", CheckOutcome.HELD, "", "")
    sorties = [QualificationCheck(f"sortie/{name}", CheckOutcome.HELD, "", "") for name in ("climb", "leg")]
    trial: Any = SimpleNamespace(data=tmp_path, policy=SimpleNamespace(vehicle=SimpleNamespace(identity="quad-07")))
    assert not sorties_flown.Qualifying._was_whole(trial)
    for checks, whole in (([held, sorties[0]], False), ([held, *sorties], True)):
        keep_qualification(tmp_path, "quad-07", sign_qualification(record(*checks), case.KEYS[Duty.LOG]))
        assert sorties_flown.Qualifying._was_whole(trial) is whole
    keep_qualification(tmp_path, "quad-07", b"nonsense")
    assert not sorties_flown.Qualifying._was_whole(trial)


def test_a_record_is_shown_unverified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rtshcua.front.cli.commands.show import show

    failed = QualificationCheck("stop/fly", CheckOutcome.FAILED, "within 9.7 m", "14.3 m", advice="declare `brakes`")
    path = tmp_path / "vehicle-quad-07.cbor"
    path.write_bytes(sign_qualification(record(failed), case.KEYS[Duty.LOG]))
    assert show(path, as_json=False) == 0
    page = capsys.readouterr().out
    assert page.startswith("Qualification record of ")
    assert "FAIL  stop/fly  14.3 m" in page
    assert "pilot ada" in page
    assert show(path, as_json=True) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["kind"], said["verified"], said["checks"][0]["outcome"]) == ("qualification", False, "failed")
