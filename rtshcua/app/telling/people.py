"""Who the people of a log are: the trust root in its first record names the person of each approval key.

Nothing is verified here: whether the root is to be trusted, and whether a person signed, `verify-log --audit` says.
"""

from base64 import b64decode
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

from rtshcua.evidence.records import Genesis
from rtshcua.wire import cose
from rtshcua.wire.trust import MAX_ROOT, TrustRoot
from rtshcua.wire.untrusted import Untrusted


@dataclass(frozen=True, slots=True)
class People:
    """The persons of a trust root: by the name of their key (16 octets), and by the number that decisions have."""

    by_key: Mapping[bytes, str] = field(default_factory=dict)
    by_number: Mapping[int, str] = field(default_factory=dict)

    @classmethod
    def of(cls, genesis: Genesis) -> Self:
        """Those of the root in a log; nobody where that makes no sense."""
        try:
            root = TrustRoot.decode(cose.unverified(b64decode(genesis.root), limit=MAX_ROOT).payload)
        except (Untrusted, ValueError):
            return cls()
        named = [key for key in root.keys if key.person]
        return cls({key.kid: key.person for key in named}, {root.person(key): key.person for key in named})

    def signer(self, kid: bytes) -> str:
        """Whose key it is, in words: the person, if it is one's, and the key."""
        person = self.by_key.get(kid)
        return f"key {kid.hex()}" if person is None else f"{person}, key {kid.hex()}"


NOBODY = People()
