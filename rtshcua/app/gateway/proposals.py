"""Turn what clients ask for into signed documents: a bundle for the first steps of a session, replacements afterwards.

A worker thread compiles the new steps as a mission of their own, proved from where the vehicle is and with the charge
that it has. In flat form they are joined behind the steps that the flight has released already, which stay as they were
signed. So the time to compile does not grow with the session.
"""

import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Final, NamedTuple

from msgspec.structs import replace

from rtshcua.app.propose import Missions
from rtshcua.ground.gateway.interface import Event, ProposalAnswered, ProposalChecked, Propose, ProposedStep
from rtshcua.ground.prove.step_starts import MissionStart
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import Bundle, mission_payload, seal_under
from rtshcua.wire.cancellation import CancellationDocument, sign_cancellation
from rtshcua.wire.digest import BUNDLE, digest
from rtshcua.wire.document import MAX_DOCUMENT, DocumentError
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.replacement import MAX_REPLACEMENTS, sign_replacement
from rtshcua.wire.untrusted import Untrusted

#: the name of every session's mission, and of a phase in which any skill is valid
MISSION: Final = "session"
PHASE: Final = "session"
#: a step that is not admitted waits, and may be replaced
_ON_INADMISSIBLE: Final = "replan"
#: proposals that wait at the same time
_MOST_WAITING: Final = 16
#: how often a proposal is signed again because the flight released another step meanwhile
_MOST_AGAIN: Final = 3
#: replacements of a flight after which only what the contingency flies is taken: the flight accepts a few more
_MOST_REPLACED: Final = MAX_REPLACEMENTS - 16
#: the interpreter's switch interval while the worker compiles, in seconds: answers to clients do not wait for it
_SWITCH_S: Final = 0.000_1
#: validity of a cancellation, us
_CANCELS_US: Final = 600_000_000


class FlightMission(NamedTuple):
    """The mission in force: as compiled, and its digest as the flight reports it."""

    mission: Mission
    digest: bytes


class ProposalMoment(NamedTuple):
    """What a proposal depends on besides its steps: the time of issue (UTC, us), where the vehicle is (None: unknown),
    the flight's id, the mission in force (None before the first bundle), and how many of its steps were released.
    """

    issued_at_us: int
    start: MissionStart | None
    flight: bytes
    in_force: FlightMission | None
    released: int


class SignedProposal(NamedTuple):
    """A document to hand in, and the mission that is in force if the flight accepts it. `first`: the first new step."""

    number: int
    document: bytes
    mission: Mission
    first: int


class _Compiled(NamedTuple):
    """New steps, compiled as a mission of their own."""

    proposal: Propose
    mission: Mission


class PolicySigner(NamedTuple):
    """The agent's mission key, and the signed policy with its digest."""

    key: SigningKey
    envelope: bytes
    digest: bytes


class Refused(Exception):
    """A proposal that is not signed; the text is for the client. `for_now`: it may be accepted later."""

    def __init__(self, text: str, *, for_now: bool = False) -> None:
        super().__init__(text)
        self.for_now = for_now


class Proposals:
    """The proposals of one gateway, in their order: one is compiled at a time, and one is with the flight at a time."""

    def __init__(self, missions: Missions, signer: PolicySigner, wake: Any) -> None:
        self._missions = missions
        self._signer = signer
        self._wake = wake  # called by the worker when it is done
        policy = missions.policy
        self._safe = frozenset(policy.contracts[link.skill].name for link in policy.contingency)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="compile")
        self._switch_s = sys.getswitchinterval()
        self._waiting: list[Propose] = []
        self._running: tuple[Propose, Future[_Compiled]] | None = None
        self._stale = False  # what runs is not wanted any more
        self._compiled: _Compiled | None = None
        self._sent: SignedProposal | None = None
        self._again = 0
        self._replaced = 0  # the replacements that this flight has accepted

    def add(self, proposal: Propose) -> list[Event]:
        """Add a proposal; the refusal if there are too many."""
        safe = self._is_safe(proposal)
        if len(self._waiting) >= _MOST_WAITING * (2 if safe else 1):
            text = "too many commands at once; send them one after the other"
            return [ProposalChecked(proposal.number, text, for_now=True)]
        if safe:  # what stops, returns or lands waits for nothing that others ask for
            at = next((at for at, each in enumerate(self._waiting) if not self._is_safe(each)), len(self._waiting))
            self._waiting.insert(at, proposal)
        else:
            self._waiting.append(proposal)
        return []

    def _is_safe(self, proposal: Propose) -> bool:
        return proposal.fly and self._safe.issuperset(each.skill for each in proposal.steps)

    def advance(self, moment: ProposalMoment, *, ready: bool) -> tuple[list[Event], SignedProposal | None]:
        """Start and finish work. Return what the core is told, and the document that is handed in now. `ready`: the
        flight can take a document.
        """
        events: list[Event] = []
        self._begin(moment)
        if self._running is not None and self._running[1].done():
            events += self._finish()
            self._begin(moment)
        if self._compiled is None or self._sent is not None or not ready:
            return events, None
        compiled, self._compiled = self._compiled, None
        try:
            signed = self._signed(compiled, moment)
        except Refused as error:
            return [*events, ProposalChecked(compiled.proposal.number, str(error), for_now=error.for_now)], None
        self._sent, self._last = signed, compiled
        return [*events, ProposalChecked(signed.number, None, signed.first)], signed

    def answered(self, slug: str, text: str) -> tuple[list[Event], Mission | None]:
        """Take in the flight's answer to the document that was handed in. Return what the core is told, and the mission
        that is in force now if it was accepted.
        """
        sent, self._sent = self._sent, None
        if sent is None:
            return [], None
        if slug == "already-released" and self._again < _MOST_AGAIN and self._compiled is None:
            self._again += 1
            self._compiled = self._last
            return [], None
        self._again = 0
        self._replaced += slug == "accepted" and sent.first > 0
        return [ProposalAnswered(sent.number, slug, text)], sent.mission if slug == "accepted" else None

    def forget(self) -> list[Event]:
        """The flight ended: what was to be flown is refused, also what is being compiled. Checks of missions go on."""
        numbers = [each.number for each in self._waiting if each.fly]
        if self._running is not None and self._running[0].fly and not self._stale:
            self._stale = True
            numbers.append(self._running[0].number)
        if self._compiled is not None:
            numbers.append(self._compiled.proposal.number)
        self._waiting = [each for each in self._waiting if not each.fly]
        self._compiled, self._again, self._replaced = None, 0, 0
        events: list[Event] = [ProposalChecked(number, "the flight ended", for_now=True) for number in numbers]
        if self._sent is not None:
            events.append(ProposalAnswered(self._sent.number, "unreachable", "the flight ended"))
        self._sent = None
        return events

    def withdraw(self, number: int) -> None:
        """Forget a proposal that was not handed in yet."""
        self._waiting = [each for each in self._waiting if each.number != number]
        if self._running is not None and self._running[0].number == number:
            self._stale = True
        if self._compiled is not None and self._compiled.proposal.number == number:
            self._compiled = None

    @property
    def busy(self) -> bool:
        """Whether a proposal waits, is compiled, or is with the flight."""
        return bool(self._waiting or self._running or self._compiled or self._sent)

    def close(self) -> None:
        """End the worker."""
        self._worker.shutdown(cancel_futures=True)
        sys.setswitchinterval(self._switch_s)

    def cancellation(self, moment: ProposalMoment) -> bytes | None:
        """The document that ends the mission in force; None if there is none."""
        if moment.in_force is None:
            return None
        until_us = moment.issued_at_us + _CANCELS_US
        said = CancellationDocument(moment.flight, moment.in_force.digest, moment.issued_at_us, until_us)
        return sign_cancellation(said, self._signer.key)

    # ---------------------------------------------------------------- compiling

    def _begin(self, moment: ProposalMoment) -> None:
        """Give the next proposal to the worker."""
        if self._running is not None or self._compiled is not None or self._sent is not None or not self._waiting:
            return
        proposal = self._waiting.pop(0)
        before = None if moment.in_force is None or not proposal.fly else moment.in_force.mission
        sys.setswitchinterval(_SWITCH_S)
        future = self._worker.submit(self._compile, proposal, before, moment)
        future.add_done_callback(lambda _: self._wake())
        self._running, self._stale = (proposal, future), False

    def _finish(self) -> list[Event]:
        assert self._running is not None
        (proposal, future), self._running = self._running, None
        sys.setswitchinterval(self._switch_s)
        if self._stale:
            return []
        try:
            compiled = future.result()
        except Refused as error:
            return [ProposalChecked(proposal.number, str(error), for_now=error.for_now)]
        if not proposal.fly:
            return [ProposalChecked(proposal.number, None)]
        self._compiled = compiled
        return []

    def _compile(self, proposal: Propose, before: Mission | None, moment: ProposalMoment) -> _Compiled:
        """In the worker: compile the steps of a proposal. Raises `Refused`."""
        policy = self._missions.policy
        contracts = {each.name: each for each in policy.contracts}
        last = None if before is None else before.phases[-1]
        specification = {
            "format": "rtshcua/mission-spec",
            "version": 1,
            "name": MISSION,
            "policy": {"name": policy.name, "version": policy.version},
            "vehicle": self._missions.lowered.vehicle.name.text,
            "intent": "asked for by a MAVLink client of the gateway",
            "proposed_by": {"source": "agent", "name": f"client_{proposal.client}", "role": proposal.role},
            "phases": arranged(proposal.steps, contracts, last),
        }
        if moment.start is None:
            raise Refused("the vehicle does not report its position", for_now=True)
        answer = self._missions.check(specification, moment.issued_at_us, moment.start)
        if answer.mission is None:
            raise Refused(_why(answer.rejections[0]) if answer.rejections else "the compiler does not accept it")
        return _Compiled(proposal, answer.mission)

    # ---------------------------------------------------------------- signing

    def _signed(self, compiled: _Compiled, moment: ProposalMoment) -> SignedProposal:
        """Sign compiled steps for the flight as it is now. Raises `Refused`."""
        signer, number = self._signer, compiled.proposal.number
        try:
            if moment.in_force is None:
                mission = compiled.mission
                payload = mission_payload(bind(mission, signer.digest))
                document = seal_under(signer.envelope, payload, mission_key=signer.key)
                return SignedProposal(number, document, mission, 0)
            if self._replaced >= _MOST_REPLACED and not self._is_safe(compiled.proposal):
                raise Refused(f"this flight has taken {self._replaced} commands: land, and take off again")
            # a step that was released and then declined is kept too: the flight says so, and it is tried again
            kept = min(moment.released + self._again, len(moment.in_force.mission.invocations))
            mission = joined(moment.in_force.mission, kept, compiled.mission)
            document = sign_replacement(
                mission, over=self._bundle(moment.in_force), flight=moment.flight, kept=kept, key=signer.key
            )
        except (DocumentError, Untrusted) as error:
            raise Refused(str(error)) from None
        if len(document) > MAX_DOCUMENT:
            raise Refused(f"the mission is {len(document)} bytes; the limit is {MAX_DOCUMENT}")
        return SignedProposal(number, document, mission, kept)

    def _bundle(self, in_force: FlightMission) -> Bundle:
        key = self._signer.key.verification(vehicles=("*",))
        policy = self._missions.policy
        return Bundle(policy, in_force.mission, self._signer.digest, in_force.digest, digest(BUNDLE, b""), key, key)


def _why(rejection: Mapping[str, Any]) -> str:
    """Why a proposal was rejected, and the nearest accepted value if there is one, for a client without JSON."""
    message, nearest = str(rejection["message"]).replace("`", ""), rejection.get("nearest")
    return message if nearest is None else f"{message}; nearest accepted: {nearest}"


def arranged(steps: Sequence[ProposedStep], contracts: dict[str, Contract], last: str | None) -> list[dict[str, Any]]:
    """The phases of new steps, of which the first continues the phase `last` where its skill is valid in it. Library
    skills are valid in some phases only: a `takeoff` in `departure`.
    """
    phases: list[dict[str, Any]] = []
    current = last
    for step in steps:
        contract = contracts.get(step.skill)
        valid = () if contract is None else contract.phases
        name = current if current is not None and (not valid or current in valid) else valid[0] if valid else PHASE
        if not phases or name != current:
            phases.append({"name": name, "steps": []})
        current = name
        asked = {"skill": step.skill, "arguments": dict(step.arguments), "on_inadmissible": _ON_INADMISSIBLE}
        phases[-1]["steps"].append(asked)
    return phases


def joined(before: Mission, kept: int, new: Mission) -> Mission:
    """The mission of the first `kept` steps of one, which stay as they are, and all steps of another. Raises `Refused`
    if a phase that is over would begin again.
    """
    steps = before.invocations[:kept]
    phases = [*before.phases[: 1 + max((each.phase for each in steps), default=-1)]]
    for name in new.phases:
        if phases and name in phases[:-1]:
            raise Refused(f"the phase `{name}` of this flight is over")
        phases += [] if phases and name == phases[-1] else [name]
    added = (_moved(each, kept, phases, new.phases) for each in new.invocations)
    return replace(new, phases=tuple(phases), invocations=(*steps, *added))


def _moved(step: Invocation, by: int, phases: Sequence[str], own: Sequence[str]) -> Invocation:
    """A step, `by` steps later, in a mission with these phases."""
    valid = step.contract.phases
    bits = sum(1 << number for number, name in enumerate(phases) if not valid or name in valid)
    return replace(step, step=step.step + by, phase=phases.index(own[step.phase]), phases=bits)
