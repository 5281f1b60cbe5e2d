"""Missions of clients: uploaded and checked, started, and reported as an autopilot reports its own."""

from collections.abc import Callable
from math import isnan
from typing import Final, TypeAlias

from rtshcua.ground.gateway.accepted import ITEM
from rtshcua.ground.gateway.client_frames import Received
from rtshcua.ground.gateway.client_proposal import AskedBy, ClientProposal
from rtshcua.ground.gateway.gateway_state import ConnectedClient, GatewayState
from rtshcua.ground.gateway.interface import ProposalChecked, ProposedStep, Withdraw
from rtshcua.ground.gateway.plan_transfer import MISSION_DENIED, PlanTransfer, RefusedPlan, UploadedPlan, read_plan
from rtshcua.ground.gateway.proposing import Proposing
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now

_GUIDED_ITEM: Final = 2  # `current` of a mission item that is flown to at once (ArduPilot)
#: what the vehicle itself reports of a mission
_REPORTS: Final = frozenset({layouts.MISSION_CURRENT, layouts.MISSION_ITEM_REACHED})
_Transfer: TypeAlias = Callable[[PlanTransfer, Received, int], None]
# MISSION_STATE
_NOT_STARTED, _ACTIVE, _PAUSED, _COMPLETE = 2, 3, 4, 5


class ClientMissions:
    """The missions of all clients of one gateway."""

    def __init__(self, state: GatewayState, proposing: Proposing) -> None:
        self._state = state
        self._proposing = proposing
        self._uploads: dict[int, ConnectedClient] = {}
        #: missions that are to be checked under a renewed policy, and those that are being checked, by proposal
        self._unchecked: set[str] = set()
        self._rechecks: dict[int, tuple[str, UploadedPlan]] = {}

    def renew(self, now_us: int) -> None:
        """Another policy is in force: stored missions are read again, and checked again under it."""
        for client in self._state.clients.values():
            client.transfer.translation = self._state.translation
        for client in dict.fromkeys(self._uploads.values()):
            client.transfer.checked("the policy was renewed: upload it again", now_us)
            self.forget(client)
        autopilot = self._state.settings.autopilot
        for name, plan in list(self._state.plans.items()):
            source = self._state.sources[name]
            read = read_plan(plan.items, self._state.translation, source.shadows, now_us, autopilot)
            if isinstance(read, RefusedPlan) and not read.for_now:
                self._withdraw(name, read.text, now_us)
                continue
            self._unchecked.add(name)
            if isinstance(read, RefusedPlan):
                continue  # its former steps stay, and are decided by the policy that is in force then
            self._state.plans[name] = read
            mission = source.mission
            source.mission = (mission[0], read) if mission is not None and mission[1] is plan else None

    def check_again(self) -> None:
        """Ask for the check of missions that were stored under an earlier policy."""
        for name in sorted(self._unchecked & self._state.plans.keys()):
            plan = self._state.plans[name]
            client = next((each.link.client for each in self._state.of(name)), 0)
            for number in [at for at, each in self._rechecks.items() if each[0] == name]:
                del self._rechecks[number]
                self._state.actions.append(Withdraw(number))
            self._rechecks[self._check(client, self._state.sources[name].role, plan)] = name, plan
        self._unchecked.clear()

    def _check(self, client: int, role: str, plan: UploadedPlan) -> int:
        return self._state.propose(client, role, self._from_ground(plan.steps)[0], fly=False)

    def checked(self, event: ProposalChecked, now_us: int) -> bool:
        """A mission was checked: store it, or withdraw one that is stored. Return whether it was one."""
        number, refusal, _, for_now = event
        upload = self._uploads.pop(number, None)
        if upload is not None:
            upload.transfer.checked(refusal, now_us)
            self.of_mission(upload, now_us)
            if refusal is None and upload.transfer.plan is not None:
                for item in upload.transfer.plan.items:
                    self._proposing.tell_yaw(upload, item, now_us)
            return True
        name, plan = self._rechecks.pop(number, ("", None))
        if plan is not None and refusal is not None and self._state.plans.get(name) is plan:
            if for_now:
                self._unchecked.add(name)
            else:
                self._withdraw(name, refusal, now_us)
        return plan is not None

    def forget(self, client: ConnectedClient) -> None:
        """A connection is gone, or uploads again: its upload is not checked any more."""
        for number in [at for at, each in self._uploads.items() if each is client]:
            del self._uploads[number]
            self._state.actions.append(Withdraw(number))

    def _withdraw(self, name: str, why: str, now_us: int) -> None:
        """Forget a mission that the policy does not permit any more, and tell its client once it is there."""
        del self._state.plans[name]
        source = self._state.sources[name]
        source.mission, source.withdrawn = None, f"mission withdrawn, the policy was renewed: {why}"
        for client in self._state.of(name)[:1]:
            self.of_mission(client, now_us)

    def item(self, client: ConnectedClient, message: Received, now: Now) -> None:
        """A mission item: of an upload, or flown to at once (`current` 2)."""
        now_us = now.monotonic_us
        if message.fields["current"] == _GUIDED_ITEM and client.transfer.plan_is_idle:
            command = message.fields["command"]
            row = self._state.translation.row(ITEM, command, message)
            if row is None:
                client.reject(f"item {command} has no mapping", command, now_us)
                result: int | None = UNSUPPORTED
            else:
                step = self._state.step(client.link, row, message, now)
                result = self._proposing.propose(client, message, step, command, now)
            if result is not None:
                client.transfer.answer_guided(message.sender, result)
            return
        plan = client.transfer.item(message, client.link.shadows, now_us)
        if plan is not None:
            self.forget(client)
            self._uploads[self._check(client.link.client, client.link.settings.role, plan)] = client

    def _from_ground(self, steps: tuple[ProposedStep, ...]) -> tuple[tuple[ProposedStep, ...], int]:
        """The steps of a mission, preceded on the ground by a take-off to the first height, as PX4 does; and the number
        of steps before its own.
        """
        first = self._state.translation.contract(steps[0].skill)
        if first is None or first.motion.kind == MotionKind.CLIMB or first.motion.altitude < 0 or not self._state.rests:
            return steps, 0
        takeoffs = self._state.translation.takeoffs_to(steps[0].values[first.motion.altitude])
        takeoff = next((each for each in takeoffs if each is not None), None)
        return (steps, 0) if takeoff is None else ((takeoff, *steps), 1)

    def start_whole(self, client: ConnectedClient, message: Received, command: int, now: Now) -> int | None:
        """MISSION_START: a part of a mission is refused, as ArduCopter does."""
        plan = client.transfer.plan
        first, last = message.number("param1"), message.number("param2")
        ends = (0, -1, 0 if plan is None else len(plan.items) - 1)
        if (first != 0 and not isnan(first)) or (last not in ends and not isnan(last)):
            client.reject("a part of a mission is refused: start the whole one", command, now.monotonic_us)
            return DENIED
        return self.start(client, message, command, now)

    def start(self, client: ConnectedClient, message: Received, command: int, now: Now) -> int | None:
        """Fly the client's mission, from the step that it did not finish."""
        plan, now_us = client.transfer.plan, now.monotonic_us
        if plan is None:
            client.reject("there is no mission to start", command, now_us)
            return TEMPORARILY_REJECTED
        before = 0
        mission = client.source.mission
        if mission is not None and mission[1] is plan and self._state.flight.stage == "flying":
            last = mission[0]
            if not last.ended:
                last.again(AskedBy(client.link, message.sender, command))
                return ACCEPTED if last.answered else None
            before = 0 if last.done >= len(last.item_of) else last.done + len(plan.steps) - len(last.item_of)
        steps, more = self._from_ground(plan.steps[max(before, 0) :])
        result = self._proposing.offer(client, steps, message, command, now)
        proposal = client.latest
        if result is None and proposal is not None and proposal.steps == steps:
            items = plan.item_of[max(before, 0) :]
            proposal.item_of = (*items[:1] * more, *items)
            client.source.mission, client.source.guided = (proposal, plan), False
        return result

    def jump(self, client: ConnectedClient, item: float, now_us: int) -> int:
        """DO_SET_MISSION_CURRENT, MISSION_SET_CURRENT: only back to the beginning, before the start."""
        if self._flies(client):
            client.reject("the mission flies: stop it first", enums.MAV_CMD_DO_SET_MISSION_CURRENT, now_us)
            return TEMPORARILY_REJECTED
        if item == 0 and client.transfer.plan is not None:
            client.source.mission = None
            return ACCEPTED
        client.reject("a mission starts at its first item", enums.MAV_CMD_DO_SET_MISSION_CURRENT, now_us)
        return DENIED

    @staticmethod
    def _flies(client: ConnectedClient) -> bool:
        mission = client.source.mission
        return mission is not None and mission[1] is client.transfer.plan and not mission[0].ended

    def set_current(self, client: ConnectedClient, message: Received, now: Now) -> None:
        """MISSION_SET_CURRENT, which MISSION_CURRENT answers."""
        self.jump(client, message.fields["seq"], now.monotonic_us)
        self.mission_current(client, always=True)

    def progress(self, proposal: ClientProposal) -> None:
        """A step of a client's mission began or ended: report items as an autopilot does."""
        done, items = proposal.done, proposal.item_of
        reached = bool(done) and (done == len(items) or items[done : done + 1] != items[done - 1 : done])
        for client in self._state.of(proposal.link.name):
            if client.source.mission is None or client.source.mission[0] is not proposal or not items:
                return
            if reached and proposal.flies == done - 1:
                client.link.send(layouts.MISSION_ITEM_REACHED, seq=items[done - 1])
            self.mission_current(client)

    def mission_current(self, client: ConnectedClient, *, always: bool = False) -> None:
        """Report the item and the state of a client's mission, if they changed."""
        plan = client.transfer.plan
        if plan is None:
            return
        (item, state), mission = (0, _NOT_STARTED), client.source.mission
        if mission is not None and mission[1] is plan:
            proposal = mission[0]
            items = proposal.item_of
            if items and proposal.done >= len(items):
                item, state = items[-1], _COMPLETE
            elif items:
                item = items[max(proposal.flies, proposal.done)]
                state = _PAUSED if proposal.ended else _ACTIVE
        if always or (item, state) != client.reported:
            client.reported = item, state
            total = len(plan.items)
            client.link.send(layouts.MISSION_CURRENT, seq=item, total=total, mission_state=state, mission_mode=1)

    def transferred(self, function: _Transfer, client: ConnectedClient, message: Received, now: Now) -> None:
        """A message that begins an upload, or clears."""
        now_us, plan = now.monotonic_us, client.transfer.plan
        if self._flies(client) and PlanTransfer.clears(message):
            client.transfer.refuse(message.sender, RefusedPlan(MISSION_DENIED, "it flies: stop it first"), now_us)
            return
        function(client.transfer, message, now_us)
        if client.transfer.plan is not plan:
            client.source.mission = None
        self.of_mission(client, now_us)

    def of_mission(self, client: ConnectedClient, now_us: int) -> None:
        """Withhold the vehicle's own reports of a mission from a client that has one here, or say why it has none."""
        has = client.transfer.plan is not None
        why, client.source.withdrawn = client.source.withdrawn, ""
        for each in self._state.of(client.link.name):
            if why:
                each.link.text(why, now_us)
                each.link.record("withdrawn", now_us, message="MISSION_COUNT", reason=why)
            each.shown.of_mission = _REPORTS if has else frozenset()
            each.shown.update(now_us)
