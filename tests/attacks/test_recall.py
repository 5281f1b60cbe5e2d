"""Threats to recalls: forged, of another mission or vehicle, replayed on a later flight, or overridden afterwards."""

import json
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from reference.documents import MIN, approval, hand, low, presented, recall, replacement
from reference.flat_case import ISSUED, MISSION, S
from reference.forgery import edit, expect, signed
from reference.world import (
    APPROVAL_KEY,
    LOG_KEY,
    ROOT,
    ROOT_KEY,
    START,
    VEHICLE,
    Run,
    allowed,
    answer_to,
    assert_audited,
    loaded,
    renewed,
    request_for,
)
from rtshcua.model.flat.mission import Mission
from rtshcua.onboard.enforcement.executor import MISSION_OVER
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Command, Ending, LinkBack, LinkLost, Presented
from rtshcua.wire import cose, names
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.response import Status
from virtual.rows import rows

OF = low()
STRANGER = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.APPROVAL, development=True)


def fresh() -> Loaded:
    return renewed(OF)


def entitled(**fields: object) -> Loaded:
    """The mission in a world where the supervisor's key may speak for something else."""
    rest = [key for key in ROOT.keys if key.duty is not Duty.APPROVAL]
    usual: dict[str, object] = {"roles": ("supervisor",), "sources": ("operator",), "vehicles": (VEHICLE,)}
    root = replace(ROOT, keys=(*rest, APPROVAL_KEY.verification(**(usual | fields))))  # type: ignore[arg-type]
    return renewed(OF, root)


@pytest.mark.parametrize("skill", ["takeoff", "goto"])
def test_in_the_air_the_contingency_flies(skill: str) -> None:
    """Its first link is a hold, the second the return; the step's own chain is not used."""
    run = Run(fresh()).until_flies(skill)
    run.tick()
    if skill == "takeoff":
        run.until_flies("goto")
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.ending is Ending.RECALLED
    kinds = [record["kind"] for record in run.records if record.get("event") == "dispatched"]
    assert kinds == [0, 0, 2, 2], run.flown
    assert_audited(run)


def test_recall_on_the_ground_prevents_the_takeoff() -> None:
    run = Run(fresh(), ready=False)
    assert not run.runtime.used_up
    assert hand(run, recall(run.loaded)) == "accepted"
    assert run.ending is Ending.RECALLED
    assert run.flown == []
    assert run.runtime.used_up, "what an operator called back does not fly later"


def test_return_under_way_continues() -> None:
    run = Run(loaded()).until_flies("return_home")
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.flown[-1] == "return_home"
    assert run.flown.count("return_home") == 1
    assert run.ending is Ending.RECALLED


def test_flying_chain_continues_and_run_ends_recalled() -> None:
    run = Run(fresh()).until_flies("goto")
    run.vehicle.fails.add("goto")
    run.until_flies("hover")
    before = len(run.flown)
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    assert run.flown[before:] == ["return_home"]
    assert run.ending is Ending.RECALLED
    assert_audited(run)


def test_document_waits_while_link_is_lost() -> None:
    run = Run(fresh()).until_flies("goto")
    run.tick(LinkLost(0))
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.tick(LinkBack(0))
    run.until_over()
    assert run.ending is Ending.RECALLED


def test_no_step_is_decided_or_sent_afterwards() -> None:
    """This includes a compromised runtime that ignores the recall."""
    of = fresh()
    permit = allowed(of)
    assert presented(of, recall(of)).accepted
    assert of.executor.dispatch(permit, START.monotonic_us) is MISSION_OVER
    assert answer_to(of, request_for(of, step=1)) is Status.NOT_CURRENT
    home = allowed(of, 2, -1, 1)
    assert isinstance(of.executor.dispatch(home, START.monotonic_us), Command)


def test_no_document_revives_a_recalled_mission() -> None:
    of = fresh()
    documents = (recall(of), approval(of), replacement(of))
    assert presented(of, documents[0]).accepted
    assert [presented(of, each).slug for each in documents] == ["recalled"] * 3


def test_approvals_and_replacements_are_refused_during_a_fallback() -> None:
    run = Run(fresh()).until_flies("goto")
    run.vehicle.fails.add("goto")
    run.until_flies("hover")
    assert hand(run, approval(run.loaded)) == "falling-back"
    assert hand(run, replacement(run.loaded)) == "falling-back"
    assert hand(run, b"\xd2nonsense") == "falling-back"
    run.until_over()
    assert run.ending is Ending.ABORTED


def test_flipped_bit_is_refused() -> None:
    of = fresh()
    document = recall(of)
    for at in range(len(document)):
        changed = bytearray(document)
        changed[at] ^= 1 << at % 8
        assert not presented(of, bytes(changed)).accepted
    allowed(of)


def test_unknown_key_is_refused() -> None:
    assert presented(fresh(), recall(OF, key=STRANGER)).slug == "unknown-key"


@pytest.mark.parametrize("kind", [names.APPROVAL, names.REPLACEMENT])
def test_document_is_refused_as_another_kind(kind: names.Artefact) -> None:
    payload = cose.unverified(recall(OF)).payload
    disguised = cose.sign1(payload, key=APPROVAL_KEY, duty=Duty.APPROVAL, content_type=kind.content_type)
    assert presented(fresh(), disguised).slug in ("unknown-format", "wrong-duty")


@pytest.mark.parametrize(
    ("fields", "slug"),
    [
        ({"sources": ("agent",)}, "wrong-source"),
        ({"vehicles": ("quad-08",)}, "wrong-vehicle"),
        ({"expires_us": START.utc_us}, "key-expired"),
        ({"roles": ()}, "accepted"),
        ({"vehicles": (ANY,)}, "accepted"),
    ],
)
def test_a_key_that_the_root_does_not_let_recall(fields: dict[str, object], slug: str) -> None:
    of = entitled(**fields)
    assert presented(of, recall(of)).slug == slug


POLICY_DIGEST = OF.bundle.policy_digest
YEAR = 365 * 24 * 60 * MIN


def issued(mission_us: int, steps_us: int) -> Mission:
    """The mission and its steps with this time of issue."""
    steps = tuple(replace(each, issued_at_us=steps_us) for each in MISSION.invocations)
    return replace(MISSION, issued_at_us=mission_us, invocations=steps)


@rows(
    ("changed", "slug"),
    [
        ({"vehicle": "quad-08"}, "wrong-vehicle"),
        ({"mission": bytes(32)}, "other-mission"),
        ({"mission": b""}, "malformed"),
        ({"policy": POLICY_DIGEST}, "malformed"),
        ({"flight": b"", "mission": b"", "policy": bytes(32)}, "other-policy"),
        ({"flight": b"", "mission": b"", "policy": POLICY_DIGEST}, "accepted"),
        ({"flight": b"", "mission": b"", "policy": POLICY_DIGEST, "issued_at_us": ISSUED - 1}, "before-mission"),
        ({"flight": b"", "mission": b"", "policy": POLICY_DIGEST, "issued_at_us": ISSUED}, "accepted"),
        ({"issued_at_us": START.utc_us + START.utc_error_us + 1}, "issued-in-future"),
        ({"expires_at_us": START.utc_us + START.utc_error_us}, "expired"),
        ({"expires_at_us": START.utc_us + 61 * MIN}, "too-long-lived"),
    ],
)
def test_inconsistent_content_is_refused(changed: dict[str, object], slug: str) -> None:
    of = fresh()
    assert presented(of, recall(of, **changed)).slug == slug


def test_recall_of_earlier_flight_is_refused() -> None:
    earlier = recall(OF)
    again = loaded(mission=issued(ISSUED + S, ISSUED + S))
    assert presented(again, earlier).slug == "other-mission"
    under_policy = recall(OF, flight=b"", mission=b"", policy=POLICY_DIGEST, issued_at_us=ISSUED)
    assert presented(again, under_policy).slug == "before-mission"


def test_postdated_mission_is_recalled() -> None:
    """An agent chooses the fields of its mission: the steps are of today, the claimed issue is next year."""
    of = loaded(mission=issued(ISSUED + YEAR, ISSUED))
    under_policy = recall(OF, flight=b"", mission=b"", policy=POLICY_DIGEST)
    allowed(of)
    assert presented(of, under_policy).accepted


def test_recall_reaches_replaced_mission() -> None:
    of = fresh()
    first = recall(of)
    assert presented(of, replacement(of)).accepted
    assert presented(of, first).accepted
    of = fresh()
    assert presented(of, replacement(of)).accepted
    assert presented(of, recall(of)).accepted


def recalled() -> tuple[Run, list[bytes]]:
    run = Run(fresh()).until_flies("goto")
    hand(run, recall(run.loaded, now=run.clock.now()))
    run.until_over()
    return run, [*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]


def number_of(lines: list[bytes], which: Callable[[dict[str, object]], bool]) -> int:
    return next(n for n, line in enumerate(lines) if which(json.loads(line)))


def test_log_with_step_sent_afterwards_fails() -> None:
    _, lines = recalled()
    begun = number_of(lines, lambda record: record.get("event") == "dispatched" and record["kind"] == 2)
    forged = [*lines[:begun], edit(lines[begun], kind=0, step=1, link=-1), *lines[begun + 1 :]]
    assert expect(signed(forged, LOG_KEY), ROOT_KEY.public) == ("dispatch/recalled", begun)


def test_log_with_step_decided_afterwards_fails() -> None:
    run = Run(fresh())
    of = run.loaded
    hand(run, replacement(of, kept=2))
    lines = [*run.lines]
    early = Run(renewed(OF), ready=False)
    early.tick(Presented(0, recall(OF)))
    recall_line = next(line for line in early.lines if json.loads(line).get("event") == "recall")
    first = number_of(lines, lambda record: record["type"] == "decision")
    record = json.loads(lines[first])
    slipped = edit(recall_line, at_us=record["at_us"], utc_us=record["utc_us"])
    close = run.recorder.close(run.clock.now(), ending="completed", tlog=None)
    forged = signed([*lines[:first], slipped, *lines[first:], close], LOG_KEY)
    assert expect(forged, ROOT_KEY.public) == ("decision/recalled", first + 1)
