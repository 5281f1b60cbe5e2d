"""The service `approve`: the answer of a person to a step that requires a confirmation."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.flight_documents import WHOSE, bundle_in_flight, flight_id, prepare_missions
from rtshcua.app.signing_keys import person_key
from rtshcua.app.telling import prose
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.analysis.solve import may_match
from rtshcua.ground.drawing.drawn_site import planned_legs, way_of_step
from rtshcua.ground.drawing.flat_site import site_of, way_of
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


class DeskRequest(NamedTuple):
    """The bundle that flies or whose policy does, the flight's socket, who answers in which role (None: the only one
    that the policy asks), and for how long an answer is valid. `runs`: the folder below which the flight keeps its log.
    """

    bundle: Path
    replacements: Sequence[Path]
    to: Path
    runs: Path
    role: str | None
    seconds: int
    root: Path | None


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
    draft = draft_about(flying, about, role, flight)
    return draft._replace(document=dated(draft.document, now_us, request.seconds, granted=not request.refused))


def draft_about(flying: Bundle, about: Invocation, role: str, flight: bytes) -> ApprovalDraft:
    """Draft the answer to a step of a verified bundle; `dated` says what it is and when."""
    document = ApprovalDocument(
        flight=flight, mission=flying.mission_digest, invocation_id=about.invocation_id, binding=about.binding,
        vehicle=flying.policy.vehicle.identity, role=role, granted=0, issued_at_us=0, expires_at_us=0,
    )  # fmt: skip
    planned, spacing = path_planned_otherwise(flying.policy, about), other_spacing(flying.policy, about)
    return ApprovalDraft(document, flying, about, planned, spacing)


def dated(document: ApprovalDocument, now_us: int, seconds: int, *, granted: bool) -> ApprovalDocument:
    """The document as an approval or a refusal, valid for `seconds` from now."""
    return replace(document, granted=int(granted), issued_at_us=now_us, expires_at_us=now_us + seconds * 1_000_000)


def places_of_step(draft: ApprovalDraft) -> list[tuple[int, int]]:
    """The places of the step's way, from where it is planned to begin, in mm east and north of home."""
    site = site_of(draft.bundle.policy)
    way = way_of_step(way_of(draft.bundle.mission), draft.step.step, site)
    return [site.home if way.begin is None else way.begin[:2], *(leg.end[:2] for leg in planned_legs(way, site))]


def told_spacing(draft: ApprovalDraft) -> str:
    """The distance of the lines of a grid in words, if a camera determines it; else empty."""
    if draft.spacing is None:
        return ""
    return f"its grid has a line every {prose.length(draft.spacing)}, as the mission's signer chose for a camera"


def told_other_path(draft: ApprovalDraft) -> str:
    """How the path in the mission differs from the planner's, in words; empty if it does not."""
    if draft.planned is None:
        return ""
    return f"the path in the mission {told_differs(draft)} the planner's: {_other(draft.planned)}"


def told_differs(draft: ApprovalDraft) -> str:
    """How the path in the mission relates to the planner's, if that is another."""
    return "is not shown to be" if draft.planned is not None and not draft.planned.computable else "differs from"


def _other(planned: PlannedPath) -> str:
    if not planned.computable:
        return "a bundle does not carry the line of a corridor, so the planner cannot compute it again"
    if not planned.points:
        return "the planner finds none there"
    if planned.levels:
        return "it has the planner's places, but other heights or headings"
    apart = f"up to {prose.length(planned.apart)} from the mission's path"
    return f"the planner's path has {planned.points} points, is {prose.length(planned.length)} long, and lies {apart}"


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
