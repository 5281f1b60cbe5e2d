"""What all parts of the gateway share: its clients, the policy in force, the flight as its lines say, and proposals."""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

from rtshcua.ground.gateway.accepted import AcceptedCommand
from rtshcua.ground.gateway.client_frames import Received
from rtshcua.ground.gateway.client_link import ClientLink
from rtshcua.ground.gateway.client_proposal import ClientProposal
from rtshcua.ground.gateway.habits import ShownState
from rtshcua.ground.gateway.harmless_requests import HarmlessRequests
from rtshcua.ground.gateway.interface import Action, GatewaySettings, Propose, ProposedStep
from rtshcua.ground.gateway.plan_transfer import PlanTransfer, UploadedPlan
from rtshcua.ground.gateway.quick_decision import QuickDecision
from rtshcua.ground.gateway.translation import Translation, Untranslated, shadowed_parameters
from rtshcua.ground.gateway.vehicle_seen import VehicleSeen
from rtshcua.mavlink import enums
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now

#: the most decisions a second on commands of one client; those that stop, return or land are counted apart
MOST_DECISIONS: Final = 20
SECOND_US: Final = 1_000_000
#: the motions at whose end the vehicle stands on the ground
_DOWN: Final = (MotionKind.HOME, MotionKind.LAND)


@dataclass(slots=True)
class ClientSource:
    """What all connections of one configured client share, also later ones: its values of parameters that only give
    defaults, and the mission that it started last with the plan of that. Its stored plan is in `GatewayState.plans`.
    `withdrawn`: why its mission was withdrawn, until one of them is told.
    """

    role: str
    #: whether its setpoints are heeded: whether it is, as it sees it, in GUIDED or OFFBOARD
    guided: bool
    shadows: dict[str, float] = field(default_factory=dict)
    mission: tuple[ClientProposal, UploadedPlan] | None = None
    withdrawn: str = ""
    #: whether it knows that the yaw in its messages is not flown
    told_yaw: bool = False
    #: when its last commands were decided, us: those of other skills, and those of safe ones
    decided: tuple[deque[int], deque[int]] = field(
        default_factory=lambda: (deque(maxlen=MOST_DECISIONS), deque(maxlen=MOST_DECISIONS))
    )

    def may_decide(self, now_us: int, *, safe: bool = False) -> bool:
        """Whether one more command may be decided now. It is counted."""
        times = self.decided[safe]
        if len(times) == MOST_DECISIONS and now_us - times[0] < SECOND_US:
            return False
        times.append(now_us)
        return True


class ConnectedClient:
    """One connection of an ordinary client with everything that is kept about it."""

    def __init__(self, link: ClientLink, source: ClientSource, shown: ShownState, transfer: PlanTransfer) -> None:
        self.link = link
        self.source = source
        self.shown = shown
        self.transfer = transfer
        self.latest: ClientProposal | None = None
        #: the earliest time of the next proposal from a setpoint
        self.setpoint_us = 0
        #: its last command, what it was decided on, the result, and until when that is repeated
        self.refused: tuple[object, int, int] | None = None
        self.reported: tuple[int, int] | None = None  # the last MISSION_CURRENT: item and state

    def reject(self, text: str, command: int, now_us: int) -> None:
        """Tell and record why a command is refused."""
        self.link.text(text, now_us, text)
        self.link.record("refused", now_us, command=command, reason=text)


@dataclass(slots=True)
class FlightSeen:
    """The flight, as its lines say."""

    stage: str = ""  # "", "waiting", "flying"
    #: why the vehicle is not ready; whether the flight has said if it is
    unready: str | None = None
    judged: bool = False
    #: whether the vehicle was in the air during this flight
    flew: bool = False
    #: whether this flight was cancelled
    cancelled: bool = False
    #: the proposal whose step was dispatched last, and whether the flight flew something else after it that is no hold
    flown: ClientProposal | None = None
    displaced: bool = False


class GatewayState:
    """The state that the parts of one gateway share."""

    def __init__(self, settings: GatewaySettings) -> None:
        self.actions: list[Action] = []
        self.seen = VehicleSeen(settings.system)
        self.requests = HarmlessRequests(settings, self.seen, self.actions)
        self.clients: dict[int, ConnectedClient] = {}
        self.sources: dict[str, ClientSource] = {}
        self.plans: dict[str, UploadedPlan] = {}
        self.proposals: dict[int, ClientProposal] = {}
        self.flight = FlightSeen()
        self._number = 0
        self.under(settings)

    def under(self, settings: GatewaySettings) -> None:
        """Take what depends on the policy."""
        self.settings = settings
        self.translation = Translation(settings, self.seen)
        self.quick = QuickDecision(settings)
        self.shadowed = shadowed_parameters(settings.accepted)
        policy = settings.policy.policy
        skills = [policy.contracts[link.skill] for link in policy.contingency]
        #: the skills of the contingency in their order, and the links of it that hold
        self.safe = [each.name for each in skills]
        self.holding = {number for number, each in enumerate(skills) if each.motion.kind == MotionKind.HOLD}

    def propose(self, client: int, role: str, steps: tuple[ProposedStep, ...], *, fly: bool = True) -> int:
        """Have steps compiled, and flown or only checked; return the number of the proposal."""
        self._number += 1
        self.actions.append(Propose(self._number, client, role, steps, fly))
        return self._number

    def of(self, name: str) -> list[ConnectedClient]:
        """The connections of a client."""
        return [each for each in self.clients.values() if each.link.name == name]

    def connected(self, link: ClientLink) -> ClientLink | None:
        """A connection that is up, else another one of the same client."""
        if link.client in self.clients:
            return link
        return next((each.link for each in self.of(link.name)), None)

    @property
    def rests(self) -> bool:
        """Whether the vehicle is on the ground and no mission flies."""
        return self.flight.stage != "flying" and self.seen.on_ground

    @property
    def lands(self) -> bool:
        """Whether the vehicle lands, or has touched down and its flight is not over."""
        if self.seen.landed_state == enums.MAV_LANDED_STATE_LANDING:
            return True
        return self.flight.flew and self.seen.on_ground

    def climbs(self, skill: str) -> bool:
        """Whether a skill takes off."""
        contract = self.translation.contract(skill)
        return contract is not None and contract.motion.kind == MotionKind.CLIMB

    def is_safe(self, steps: tuple[ProposedStep, ...]) -> bool:
        """Whether all steps are of skills of the contingency, which stops, returns or lands."""
        return all(each.skill in self.safe for each in steps)

    def brings_down(self, proposal: ClientProposal) -> bool:
        """Whether what is left of a proposal only lands the vehicle."""
        contracts = (self.translation.contract(each.skill) for each in proposal.steps[max(proposal.done, 0) :])
        return all(each is not None and each.motion.kind in _DOWN for each in contracts) and not proposal.ended

    def step(self, link: ClientLink, row: AcceptedCommand, message: Received, now: Now) -> ProposedStep | Untranslated:
        """The step for a message of a client that matches a row; a parameter that is missing for it is requested."""
        step = self.translation.step(row, message, link.shadows, now.monotonic_us)
        if isinstance(step, Untranslated) and step.wanted:
            self.requests.want_parameter(link, step.wanted)
        return step
