"""Public development keys and their trust root, for virtual flights only.

No vehicle pins this root. The root and each key are marked as development keys.
"""

from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from typing import Final

from msgspec.structs import replace

from rtshcua.ground.pipeline import sign
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.virtual.flight import LATER_US
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.trust import HUMAN, TrustRoot

#: the number of people in each role
_PEOPLE: Final = 2
_LIFETIME_US: Final = 10 * 366 * 86_400 * 1_000_000


@cache
def keys() -> Mapping[Duty, SigningKey]:
    """Return one key for each duty except approvals; the same in each process."""
    return {
        duty: SigningKey.from_seed(bytes([number]) * 32, duty=duty, development=True)
        for number, duty in enumerate(Duty)
        if duty is not Duty.APPROVAL
    }


@cache
def approvers(roles: tuple[str, ...]) -> Mapping[str, tuple[SigningKey, ...]]:
    """Return the approval keys of the people of each role; the same in each process."""
    return {
        role: tuple(
            SigningKey.from_seed(sha256(f"{role} {n}".encode()).digest(), duty=Duty.APPROVAL, development=True)
            for n in range(_PEOPLE)
        )
        for role in roles
    }


@cache
def root(issued_at_us: int, roles: tuple[str, ...]) -> bytes:
    """Return a signed trust root, valid from a UTC time, that allows the keys any role, policy and vehicle, and names
    the people of `roles`.
    """
    made = keys()
    people = tuple(
        key.verification(roles=(role,), sources=(HUMAN,), vehicles=(ANY,), person=f"person-{number}-{n}")
        for number, (role, each) in enumerate(approvers(roles).items())
        for n, key in enumerate(each)
    )
    signed = TrustRoot(
        version=1,
        development=True,
        issued_at_us=issued_at_us,
        expires_at_us=issued_at_us + _LIFETIME_US,
        keys=tuple(
            key.verification(
                roles=(ANY,) if duty is Duty.MISSION else (),
                sources=("agent", "operator") if duty is Duty.MISSION else (),
                vehicles=() if duty is Duty.ROOT else (ANY,),
                policies=(ANY,) if duty is Duty.MISSION else (),
            )
            for duty, key in made.items()
        )
        + people,
    )
    return signed.sign(made[Duty.ROOT])


def flies_at(mission: Mission, utc_us: int) -> Mission:
    """Return the mission with an issue time such that it flies at this UTC time."""
    issued_us = utc_us - LATER_US
    steps = tuple(replace(step, issued_at_us=issued_us) for step in mission.invocations)
    return replace(mission, issued_at_us=issued_us, invocations=steps)


def seal(policy: Policy, mission: Mission) -> bytes:
    """Return the bundle, signed with the development keys."""
    return sign.sign(policy, mission, policy_key=keys()[Duty.POLICY], mission_key=keys()[Duty.MISSION])
