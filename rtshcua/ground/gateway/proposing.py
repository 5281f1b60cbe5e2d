"""Proposals of clients: which steps are taken, held for the next flight, refused or withdrawn, and how each ends.

What a client asked for and what did not begin is withdrawn when it disarms, stops, returns, lands or dies, when another
one stops or lands the vehicle, and when a pilot is in control. What the flight has already cannot be taken back: it is
cancelled, and nobody is told meanwhile that the vehicle is safe.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from rtshcua.ground.gateway.client_frames import Received
from rtshcua.ground.gateway.client_link import NOTICE, ClientLink
from rtshcua.ground.gateway.client_proposal import AGAIN_US, PATIENCE_US, AskedBy, ClientProposal
from rtshcua.ground.gateway.control import Control
from rtshcua.ground.gateway.gateway_state import MOST_DECISIONS, ConnectedClient, FlightSeen, GatewayState
from rtshcua.ground.gateway.interface import Cancel, ProposalChecked, ProposedStep, Withdraw
from rtshcua.ground.gateway.quick_decision import QuickRefusal
from rtshcua.ground.gateway.translation import Untranslated
from rtshcua.mavlink import layouts
from rtshcua.mavlink.command_results import ACCEPTED, CANCELLED, DENIED, IN_PROGRESS, TEMPORARILY_REJECTED
from rtshcua.model.flat.situation import Now
from rtshcua.wire.request import CONTINGENCY_LINK, STEP

#: the least interval of proposals that come from setpoints of one client, us
SETPOINT_US: Final = 500_000
#: how long a command waits for a flight that is not ready yet, us
HELD_US: Final = 10_000_000
_ITEMS: Final = (layouts.MISSION_ITEM_INT, layouts.MISSION_ITEM)
_NO_FLIGHT: Final = "no flight is ready yet"
_YAW: Final = "yaw is not flown: the autopilot turns the vehicle"
_PILOT: Final = "the pilot is in control"
_LANDS: Final = "the vehicle is still landing"
#: the most proposals of one client that are neither taken nor refused
MOST_OPEN: Final = 4
_TOO_MANY_WAIT: Final = f"too many commands wait: at most {MOST_OPEN} at once"
_TOO_MANY: Final = f"too many commands: at most {MOST_DECISIONS} a second are decided"
#: the flight's answers to a document that a later one may not get
_FOR_NOW: Final = frozenset({"busy", "already-released", "superseded", "not-flying", "falling-back"})


#: handles a message of a client
Handler: TypeAlias = Callable[[ConnectedClient, Received, Now], None]


@dataclass(slots=True)
class _Held:
    """A command that waits for a flight, until when, and when its client was last told that it is in progress."""

    client: ConnectedClient
    message: Received
    command: int
    until_us: int
    told_us: int


class Proposing:
    """The proposals of all clients of one gateway. `again` handles a command that has waited for a flight."""

    def __init__(self, state: GatewayState, control: Control, again: Handler) -> None:
        self._state, self._control, self._again = state, control, again
        self._held: list[_Held] = []
        #: whether a command may wait for a flight: not one that has waited
        self.holds = True

    def propose(
        self, client: ConnectedClient, message: Received, step: ProposedStep | Untranslated, command: int, now: Now
    ) -> int | None:
        """Propose one step; the result for the client, None if the answer comes later."""
        if isinstance(step, Untranslated):
            now_us = now.monotonic_us
            client.link.text(step.text, now_us, step.text if command < 0 else "")
            client.link.record("refused", now_us, command=command, reason=step.text)
            return step.result
        return self.offer(client, (step,), message, command, now)

    def offer(
        self, client: ConnectedClient, steps: tuple[ProposedStep, ...], message: Received, command: int, now: Now
    ) -> int | None:
        """Propose steps; the result for the client, None if the answer comes later."""
        now_us, latest, safe = now.monotonic_us, client.latest, self._state.is_safe(steps)
        if safe:
            self._withdraw_waiting(f"{client.link.name} asks for {steps[0].skill}", now_us, client.link.name)
        asked = AskedBy(client.link, message.sender, command, message.message in _ITEMS)
        if latest is not None and latest.steps == steps and self._stands(latest):
            latest.again(asked)
            return ACCEPTED if latest.answered else None
        own = (each for each in self._state.proposals.values() if each.link is client.link)
        waiting = sum(not (each.taken or each.ended) for each in own)
        if command < 0 and waiting:
            return None  # it comes again
        if not client.source.may_decide(now_us, safe=safe):
            client.link.text(_TOO_MANY, now_us, _TOO_MANY)
            client.link.record("refused", now_us, skill=steps[0].skill, reason=_TOO_MANY)
            return TEMPORARILY_REJECTED
        refusal = self._refusal(client, steps, now)
        if refusal is not None:
            return self._refuse(client, refusal, message, command, now_us)
        if waiting >= MOST_OPEN:
            client.link.text(_TOO_MANY_WAIT, now_us, _TOO_MANY_WAIT)
            client.link.record("refused", now_us, skill=steps[0].skill, reason=_TOO_MANY_WAIT)
            return TEMPORARILY_REJECTED
        self._add(client, steps, asked, now_us)
        self.tell_yaw(client, message, now_us)
        return None

    def tell_yaw(self, client: ConnectedClient, message: Received, now_us: int) -> None:
        """Tell a client, once, that the yaw in its message is not flown."""
        if not client.source.told_yaw and self._state.translation.drops_yaw(message):
            client.source.told_yaw = True
            client.link.text(_YAW, now_us, severity=NOTICE)

    def _add(self, client: ConnectedClient, steps: tuple[ProposedStep, ...], asked: AskedBy, now_us: int) -> None:
        """Propose steps. After those that stop, return or land the vehicle nothing follows from before."""
        link = client.link
        if self._state.is_safe(steps):
            self._withdraw_waiting(f"{link.name} asks for {steps[0].skill}", now_us)
            client.source.guided = False
        if asked.command < 0:
            client.setpoint_us = now_us + SETPOINT_US
        borrows = self._control.outranked(client, now_us) is not None
        number = self._state.propose(link.client, link.settings.role, steps)
        client.latest = ClientProposal(number, link, [asked], steps, now_us, borrows=borrows)
        self._state.proposals[number] = client.latest

    def _refusal(self, client: ConnectedClient, steps: tuple[ProposedStep, ...], now: Now) -> QuickRefusal | None:
        """Why the first step is certainly refused by the policy, or the steps cannot be taken now."""
        step = steps[0]
        if self._state.climbs(step.skill) and self._state.lands:
            return QuickRefusal(TEMPORARILY_REJECTED, _LANDS, step.skill, _LANDS)
        refusal = self._state.quick.refusal(step, client.link.settings.role, now)
        hindrance = None if refusal is not None else self._hindrance(client, steps, now.monotonic_us)
        if hindrance is None:
            return refusal
        return QuickRefusal(TEMPORARILY_REJECTED, hindrance, step.skill, hindrance)

    def _refuse(
        self, client: ConnectedClient, refusal: QuickRefusal, message: Received, command: int, now_us: int
    ) -> int | None:
        """Tell and record a refusal, and return its result; None if the command waits instead."""
        if refusal.reason == _NO_FLIGHT and self._hold(client, message, command, now_us):
            return None
        if refusal.skill in self._state.safe:
            self.take_back(f"{client.link.name} asks for {refusal.skill}", now_us, client.link.name)
        client.link.text(refusal.text, now_us, f"{refusal.skill} {refusal.reason}" if command < 0 else "")
        client.link.record("refused", now_us, skill=refusal.skill, reason=refusal.reason, answer=refusal.text)
        return refusal.result

    def _hold(self, client: ConnectedClient, message: Received, command: int, now_us: int) -> bool:
        """Whether a command waits for the next flight, which is ready some seconds after a landing."""
        if command < 0 or not self.holds or message.message in _ITEMS:
            return False
        own = [each for each in self._held if each.client is client]
        same = next((each for each in own if (each.command, each.message.sender) == (command, message.sender)), None)
        if same is not None:  # sent again, or changed: the last one counts, and waits no longer for it
            same.message, same.told_us = message, now_us
        elif len(own) < MOST_OPEN:
            self._held.append(_Held(client, message, command, now_us + HELD_US, now_us))
        else:
            return False
        client.link.ack(message.sender, command, IN_PROGRESS)
        return True

    def forget(self, client: ConnectedClient) -> None:
        """A connection is gone, and what waited for it."""
        self._held = [each for each in self._held if each.client is not client]

    def take_held(self, now: Now) -> None:
        """Take the commands that waited for a flight, now that there is one, or refuse them after too long."""
        flight, now_us = self._state.flight, now.monotonic_us
        ready = flight.stage == "flying" or (flight.stage == "waiting" and flight.judged)
        self._held = [each for each in self._held if not each.client.link.is_dead]
        due = [each for each in self._held if ready or now_us >= each.until_us]
        self._held = [each for each in self._held if each not in due]
        self.holds = False
        try:
            for each in due:
                self._again(each.client, each.message, now)
        finally:
            self.holds = True
        for each in self._held:
            if now_us - each.told_us >= AGAIN_US:
                each.told_us = now_us
                each.client.link.ack(each.message.sender, each.command, IN_PROGRESS)

    def cannot_take_off(self, client: ConnectedClient, now: Now) -> tuple[int, str] | None:
        """Why no take-off of this client could follow an arming now, whatever its height, and the MAV_RESULT."""
        if self._state.lands:
            return TEMPORARILY_REJECTED, _LANDS
        if self._state.seen.armed:
            return None
        if self._control.pilots.in_control:
            return TEMPORARILY_REJECTED, _PILOT
        flight = self._state.flight
        if flight.stage == "waiting" and flight.unready is not None:
            return TEMPORARILY_REJECTED, flight.unready
        if not client.source.may_decide(now.monotonic_us):
            return TEMPORARILY_REJECTED, _TOO_MANY
        refusals: list[QuickRefusal] = []
        for step in self._state.translation.takeoffs_to():
            refusal = None if step is None else self._state.quick.refusal(step, client.link.settings.role, now)
            if refusal is None or refusal.by_argument:
                return None
            refusals.append(refusal)
        least = min(refusals, key=lambda each: each.result, default=None)
        return None if least is None else (least.result, least.words)

    def takes_off(self) -> tuple[int, str] | None:
        """What may take off although a client disarms or lands on the ground, and the MAV_RESULT."""
        for each in self._state.proposals.values():
            if each.withdrawn and not each.ended:
                return TEMPORARILY_REJECTED, f"the flight of {each.steps[0].skill} is being cancelled: ask again"
            if not each.ended and not self._state.brings_down(each):
                return TEMPORARILY_REJECTED, f"{each.steps[0].skill} is under way: land"
        if self._held:
            return TEMPORARILY_REJECTED, f"{self._held[0].client.link.name} waits to take off"
        return None

    def _stands(self, proposal: ClientProposal) -> bool:
        """Whether a proposal still says what the vehicle does: it is under way, or nothing was flown after it."""
        flight = self._state.flight
        stands = flight.stage == "flying" and flight.flown is proposal and proposal.done > 0 and not flight.displaced
        return not proposal.ended or stands

    def _hindrance(self, client: ConnectedClient, steps: tuple[ProposedStep, ...], now_us: int) -> str | None:
        """Why steps cannot be taken now, although the policy may permit them."""
        if self._control.pilots.in_control:
            return _PILOT
        rival = self._control.outranked(client, now_us)
        if rival is not None and not all(self._control.is_safer(each.skill) for each in steps):
            return f"{rival.name} is in control"
        flight, on_ground = self._state.flight, self._state.seen.on_ground
        if flight.stage == "flying" and (flight.flown is not None or not on_ground):
            return None
        if not on_ground:
            return "the vehicle flies under another control"
        if not self._state.climbs(steps[0].skill):
            return "the vehicle is on the ground: take off first"
        return _NO_FLIGHT if flight.stage == "" else flight.unready

    def take_back(self, why: str, now_us: int, name: str = "") -> None:
        """Withdraw what clients, or one of them, asked for and what did not begin yet. A flight that has such a step
        already is cancelled: on the ground it ends, in the air its contingency flies.
        """
        self._withdraw_waiting(why, now_us, name, safe_too=not name)
        for each in self._pending(name, safe_too=not name):
            each.withdrawn = why
        self._cancel_withdrawn(now_us)

    def _withdraw_waiting(self, why: str, now_us: int, name: str = "", *, safe_too: bool = False) -> None:
        """Withdraw what waits for a flight, or was not handed in to it yet, of all clients or of one of them."""
        held = [one for one in self._held if name in ("", one.client.link.name)]
        self._withdraw(held, self._pending(name, safe_too=safe_too), why, now_us)

    def _withdraw(self, held: list[_Held], pending: list[ClientProposal], why: str, now_us: int) -> None:
        """Withdraw what waits for a flight, and of the proposals those that were not handed in to it yet."""
        for one in held:
            self._held.remove(one)
            one.client.link.ack(one.message.sender, one.command, CANCELLED)
        for each in pending:
            if each.first < 0:
                self._state.actions.append(Withdraw(each.number))
                each.refuse(CANCELLED, f"{each.steps[0].skill} withdrawn: {why}", now_us)

    def tick(self, now_us: int) -> None:
        """Tell clients what is in progress, and withdraw what the worker does not answer. What the flight has may still
        fly: that is in progress until the flight answers, or ends.
        """
        for each in list(self._state.proposals.values()):
            if each.first < 0 and not each.ended and now_us - each.began_us > PATIENCE_US:
                self._state.actions.append(Withdraw(each.number))
                text = f"{each.steps[0].skill} rejected: nothing answered in time"
                each.refuse(TEMPORARILY_REJECTED, text, now_us)
            else:
                each.tick(now_us)

    def cancel(self, client: ConnectedClient, command: int, now_us: int) -> None:
        """COMMAND_CANCEL: withdraw what a client asked for by this command and what did not begin yet, which answers
        that command. One that was answered before is over, and is not cancelled.
        """
        name, why = client.link.name, f"{client.link.name} cancels the command"
        held = [each for each in self._held if each.command == command and each.client.link.name == name]
        pending = [
            each
            for each in self._pending(name, safe_too=True)
            if not each.answered and any(asked.command == command for asked in each.asked_by)
        ]
        if not held and not pending:
            text = f"command {command} is not in progress: stop, return or land"
            client.link.text(text, now_us, text, NOTICE)
            client.link.record("absorbed", now_us, message=layouts.COMMAND_CANCEL, command=command)
            return
        client.link.record("withdrawn", now_us, command=command)
        self._withdraw(held, pending, why, now_us)
        for each in pending:
            each.withdrawn = each.withdrawn or ("" if each.ended else why)
        self._cancel_withdrawn(now_us)
        self.tidy(now_us)

    def _pending(self, name: str, *, safe_too: bool) -> list[ClientProposal]:
        """The proposals of which no step was dispatched, of all clients or of one of them; those that only stop, return
        or land are left out.
        """
        return [
            each
            for each in self._state.proposals.values()
            if not each.ended
            and each.flies < 0
            and name in ("", each.link.name)
            and (safe_too or not self._state.is_safe(each.steps))
        ]

    def _cancel(self, link: ClientLink, why: str, now_us: int) -> None:
        """Cancel the flight, once: its contingency flies, or on the ground it ends."""
        self._state.flight.cancelled = True
        self._state.actions.append(Cancel(link.client, why))
        for other in self._state.clients.values():
            if other.link is not link:
                other.link.text(f"{why}: the flight is cancelled", now_us, severity=NOTICE)

    def _cancel_withdrawn(self, now_us: int) -> None:
        """Cancel the flight, once it can be, that has a step which is not wanted any more."""
        of = next((each for each in self._state.proposals.values() if each.withdrawn and not each.ended), None)
        if of is not None and self._state.flight.stage == "flying" and not self._state.flight.cancelled:
            self._cancel(of.link, of.withdrawn, now_us)

    def checked(self, event: ProposalChecked, now_us: int) -> None:
        """The worker signed a proposal, or refused it."""
        number, refusal, first, for_now = event
        proposal = self._state.proposals.get(number)
        if proposal is None:
            return
        if refusal is not None:
            result = TEMPORARILY_REJECTED if for_now else DENIED
            proposal.refuse(result, f"{proposal.steps[0].skill} refused: {refusal}", now_us)
        else:
            proposal.first = first
        self.tidy(now_us)

    def answered(self, number: int, slug: str, text: str, now_us: int) -> None:
        """The flight took a proposal, or did not."""
        proposal = self._state.proposals.get(number)
        if proposal is None:
            return
        if slug == "accepted":
            proposal.taken = True
            for each in self._state.proposals.values():
                if each is not proposal and each.number < number:
                    each.keep_before(proposal.first)
        else:
            words = f"{proposal.steps[0].skill} refused: {slug}" + (f": {text}" if text else "")
            proposal.refuse(TEMPORARILY_REJECTED if slug in _FOR_NOW else DENIED, words, now_us)
        self.tidy(now_us)

    def tidy(self, now_us: int) -> None:
        """Forget proposals that ended; who was in control last is kept."""
        self._control.holder(now_us)
        for number in [number for number, each in self._state.proposals.items() if each.ended]:
            del self._state.proposals[number]

    def hear(self, line: Mapping[str, Any], now_us: int) -> list[ClientProposal]:
        """A line of the flight. Return the proposals of which a step began or ended."""
        flight = self._state.flight
        match line.get("type"):
            case "hello":
                self._state.flight = FlightSeen()
            case "waiting":
                flight.stage = "waiting"
            case "vehicle":
                unready = line.get("unready")
                flight.unready = None if line.get("ready") else str(unready or "the vehicle is not ready")
                flight.judged = True
                if flight.unready is not None:
                    for each in self._state.proposals.values():
                        each.wait_for(flight.unready, now_us)
            case "mission":
                flight.stage = "flying"
                self._cancel_withdrawn(now_us)
            case "decision" | "effect":
                return self._step_line(line, now_us)
            case "close":
                self.ended(str(line.get("ending", "")), now_us)
        return []

    def _step_line(self, line: Mapping[str, Any], now_us: int) -> list[ClientProposal]:
        flight, moved = self._state.flight, list[ClientProposal]()
        if line.get("event") == "taken-over":
            for client in self._state.clients.values():
                client.link.text("the pilot took over: the flight of your steps ended", now_us, "taken over")
        kind, link = line.get("kind", STEP), line.get("link", -1)
        if line.get("event") == "dispatched" and kind != STEP:
            flight.displaced |= kind != CONTINGENCY_LINK or link not in self._state.holding
        for proposal in list(self._state.proposals.values()):
            flies, done = proposal.flies, proposal.done
            if not proposal.line(line, now_us):
                continue
            if proposal.flies != flies:
                flight.flown, flight.displaced = proposal, False
            if (proposal.flies, proposal.done) != (flies, done):
                moved.append(proposal)
        self.tidy(now_us)
        return moved

    def ended(self, ending: str, now_us: int) -> None:
        """The flight ended: so did every proposal."""
        if self._state.flight.stage:
            for proposal in self._state.proposals.values():
                words = f"{proposal.steps[0].skill} ended with the flight" + (f": {ending}" if ending else "")
                proposal.refuse(TEMPORARILY_REJECTED, words, now_us)
        self._state.flight = FlightSeen(unready=self._state.flight.unready, judged=self._state.flight.judged)
        self._state.proposals.clear()
        self._control.forget()

    def die(self, client: ConnectedClient, now_us: int) -> None:
        """A client is silent: nothing begins any more that it asked for, but to stop, return or land, unless another
        connection of it lives.
        """
        name = client.link.name
        client.link.is_dead = True
        client.link.record("dead", now_us)
        if all(each.link.is_dead for each in self._state.of(name)):
            self.end_without_client(now_us)
            self.take_back(f"{name} is silent", now_us, name)

    def end_without_client(self, now_us: int) -> None:
        """Cancel the mission, once, so that the contingency flies, where the client is dead whose step flies, or waits,
        or flew last while no other client beats. A step that brings the vehicle down goes on.
        """
        if self._state.flight.stage != "flying" or self._state.flight.cancelled:
            return
        of = self._control.responsible()
        if of is None or not of.link.is_dead or (of.ended and self._control.anybody_beats(now_us)):
            return
        self._cancel(of.link, f"{of.link.name} is silent", now_us)
