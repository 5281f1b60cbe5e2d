"""The binding (paper symbol `B`): one digest over an invocation and everything that it depends on.

The published binding leaves out `pre`, `sc`, `f_b` and `ev`, so that these could be weakened unnoticed. This one
covers every field of the invocation including its whole contract, and its context: the policy by digest and
version, the vehicle, and the mission.
"""

from typing import Final

import msgspec

from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.struct import Flat
from rtshcua.wire import cbor
from rtshcua.wire.builtins import builtins_of
from rtshcua.wire.digest import BINDING, Domain, digest

#: length of an invocation's id in bytes
ID_BYTES: Final = 16

_INVOCATION: Final = Domain(b"rtshcua/invocation")


def bind(mission: Mission, policy_digest: bytes, *, after: bytes = b"") -> Mission:
    """The mission under the policy of that digest, every invocation with its id and its binding.

    An id depends on the whole mission, its time of issue and the step, so equal inputs give equal ids, and no
    other mission or time of issue repeats them. `after` names the mission that this one replaces, if any; a
    replacement has other ids than the same mission on its own.
    """
    mission = msgspec.structs.replace(mission, policy_digest=policy_digest)
    identified = [
        msgspec.structs.replace(each, invocation_id=name, binding=b"")
        for each, name in zip(mission.invocations, _ids(mission, after), strict=True)
    ]
    bound = tuple(msgspec.structs.replace(each, binding=binding_of(mission, each)) for each in identified)
    return msgspec.structs.replace(mission, invocations=bound)


def binding_of(mission: Mission, invocation: Invocation) -> bytes:
    """The binding of an invocation of this mission: 32 bytes."""
    around = [
        mission.policy_digest,
        mission.policy,
        mission.policy_version,
        mission.vehicle,
        mission.name,
        mission.issued_at_us,
        list(mission.phases),
    ]
    own = builtins_of(msgspec.structs.replace(invocation, binding=b""))
    return digest(BINDING, cbor.encode([around, own]))


def first_misnamed(mission: Mission, *, after: bytes = b"") -> int | None:
    """The index of the first invocation whose id differs from the one that `bind` computes, or None.

    Because ids are computed, an id that was used for something else cannot be chosen again.
    """
    for index, (invocation, name) in enumerate(zip(mission.invocations, _ids(mission, after), strict=True)):
        if invocation.invocation_id != name:
            return index
    return None


def first_unbound(mission: Mission) -> int | None:
    """The index of the first invocation whose binding differs from the computed one, or None."""
    for index, invocation in enumerate(mission.invocations):
        if invocation.binding != binding_of(mission, invocation):
            return index
    return None


def _ids(mission: Mission, after: bytes) -> list[bytes]:
    """The ids of a mission's steps, computed from the mission without its ids and bindings."""
    blank = tuple(msgspec.structs.replace(each, invocation_id=b"", binding=b"") for each in mission.invocations)
    root = digest(_INVOCATION, _encoded(msgspec.structs.replace(mission, invocations=blank)) + after)
    return [digest(_INVOCATION, cbor.encode([root, each.step]))[:ID_BYTES] for each in blank]


def _encoded(part: Flat) -> bytes:
    return cbor.encode(builtins_of(part))
