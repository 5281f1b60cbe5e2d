"""The last stage of a compilation: binds every invocation to the policy, and signs both parts."""

from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire import bundle
from rtshcua.wire.binding import bind
from rtshcua.wire.keys import SigningKey


def sign(policy: Policy, mission: Mission, *, policy_key: SigningKey, mission_key: SigningKey) -> bytes:
    """Return the bytes of the bundle. The same parts and keys give the same bytes.

    Raises `WrongDuty` for a key of another duty, `CborError` for a number that the wire format cannot hold.
    """
    payload = bundle.policy_payload(policy)
    bound = bind(mission, bundle.policy_digest(payload))
    return bundle.seal(payload, bundle.mission_payload(bound), policy_key=policy_key, mission_key=mission_key)
