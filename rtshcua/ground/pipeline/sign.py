"""The last step of a compilation: bind every invocation to its policy, and sign both parts."""

from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire import bundle
from rtshcua.wire.binding import bind
from rtshcua.wire.keys import SigningKey


def sign(policy: Policy, mission: Mission, *, policy_key: SigningKey, mission_key: SigningKey) -> bytes:
    """The bundle's bytes: the same for the same parts and keys.

    Raises `WrongDuty` for a key of another duty, `CborError` for a number that no wire form has.
    """
    payload = bundle.policy_payload(policy)
    bound = bind(mission, bundle.policy_digest(payload))
    return bundle.seal(payload, bundle.mission_payload(bound), policy_key=policy_key, mission_key=mission_key)
