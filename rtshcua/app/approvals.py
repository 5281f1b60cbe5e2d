"""The service `approve`: the answer of a person to a step that requires a confirmation."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.flight_documents import WHOSE, bundle_in_flight, flight_id, prepare_missions
from rtshcua.app.signing_keys import person_key
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.analysis.solve import may_match
from rtshcua.ground.lower.signed_paths import PlannedPath, other_spacing, path_planned_otherwise
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.step_number import index_of, number_of
from rtshcua.wire.approval import ApprovalDocument, confirms, sign_approval
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.untrusted import Untrusted


class ApprovalRequest(NamedTuple):
    """The step of a bundle that is approved or refused, in which role, for how long, and for which flight."""

    bundle: Path
    step: int
    role: str | None
    refused: bool
    seconds: int
    replacements: Sequence[Path]
    to: Path | None
    root: Path | None
    flight: str | None


class ApprovalDraft(NamedTuple):
    """An answer before it is signed, the verified bundle and its step; `planned` is the planner's path where the
    mission has another, `spacing` the distance in mm of the lines of a grid that a camera determines.
    """

    document: ApprovalDocument
    bundle: Bundle
    step: Invocation
    planned: PlannedPath | None
    spacing: int | None


class ApprovalSigner(NamedTuple):
    """The person who signs, or the file of the key; whether they agree to what they were shown, and how the key is
    opened.
    """

    person: str | None
    key: Path | None
    agrees: Callable[[], bool]
    unlock: Callable[[KeyStore], SigningKey]


def draft_approval(request: ApprovalRequest) -> ApprovalDraft | Refusal:
    """Verify the bundle, and draft the answer to its step. Raises OSError."""
    try:
        return _draft(request, time.time_ns() // 1000)
    except Untrusted as error:
        return untrusted(error)


def _draft(request: ApprovalRequest, now_us: int) -> ApprovalDraft | Refusal:
    step, role = request.step, request.role
    flying = bundle_in_flight(request.bundle, request.replacements, request.root, now_us, stops=request.refused)
    # a refusal describes the step too, which requires a valid mission
    (ready,) = prepare_missions(flying.policy, [flying.mission])
    steps = flying.mission.invocations
    if step > len(steps):
        return Refusal("usage", f"the mission has no step {step}", f"accepted: 1 to {len(steps)}")
    about = steps[index_of(step)]
    roles = _roles(ready[index_of(step)])
    if role is None and len(roles) == 1:
        role = roles[0]
    if role is None or role not in roles:
        return _not_asked(ready[index_of(step)], role, roles)
    flight = flight_id(request.flight, request.to)
    if flight is None:
        return Refusal("usage", "the flight of the answer is unknown", WHOSE)
    document = ApprovalDocument(
        flight=flight, mission=flying.mission_digest, invocation_id=about.invocation_id, binding=about.binding,
        vehicle=flying.policy.vehicle.identity, role=role, granted=int(not request.refused), issued_at_us=now_us,
        expires_at_us=now_us + request.seconds * 1_000_000,
    )  # fmt: skip
    planned, spacing = path_planned_otherwise(flying.policy, about), other_spacing(flying.policy, about)
    return ApprovalDraft(document, flying, about, planned, spacing)


def sign_draft(draft: ApprovalDraft, signer: ApprovalSigner) -> bytes | Refusal:
    """Sign an answer, if the person agrees. Raises OSError."""
    store = KeyStore(data_folder())
    try:
        if signer.key is None:
            person_key(store, signer.person, draft.document.role)  # fail before the prompt if the key may not sign
        if not signer.agrees():
            return Refusal("not-signed", "nothing was signed", "", ExitCode.REFUSED)
        return sign_approval(draft.document, signer.unlock(store))
    except Untrusted as error:
        return untrusted(error)


def _roles(of: PreparedInvocation) -> list[str]:
    """Return the roles of the `confirm` rules whose conditions can hold for the step's arguments."""
    policy = of.policy.policy
    return [
        name
        for number, name in enumerate(policy.roles)
        if any(may_match(of, rule) for rule in confirms(policy, of.invocation, number))
    ]


def _not_asked(of: PreparedInvocation, role: str | None, asked: list[str]) -> Refusal:
    policy, step = of.policy.policy, number_of(of.invocation.step)
    if not asked:
        rules = {rule for number in range(len(policy.roles)) for rule in confirms(policy, of.invocation, number)}
        help = ""
        if rules:
            text = " and ".join(f"`{policy.rules[each].text}`" for each in sorted(rules))
            help = f"{text} cannot hold for the step's arguments"
        return Refusal("usage", f"no `confirm` rule of the policy applies to step {step}", help)
    names = ", ".join(f"`{name}`" for name in asked)
    what = (
        f"several roles must confirm step {step}"
        if role is None
        else f"step {step} requires no confirmation by `{role}`"
    )
    return Refusal("usage", what, f"accepted: --role {names}")
