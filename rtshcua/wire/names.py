"""The formats: name, integer version and media type of every artefact, in one place."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Artefact:
    """A format. Any change that an older reader would misread raises `version`. `items` is the limit of CBOR items,
    beyond which the data is refused; 0 if only the size is limited.
    """

    name: str
    version: int
    suffix: str = "+cbor"
    items: int = 0

    @property
    def content_type(self) -> str:
        """Media type, as in the protected header of an envelope (RFC 9052, section 3.1, label 3)."""
        return f"application/vnd.{self.name.replace('/', '.')}{self.suffix}"


#: limits of CBOR items for an artefact of a fixed form, and for one with lists
FEW: Final = 64
MANY: Final = 1 << 16

#: the place that says which revision reads earlier versions
COMPATIBILITY: Final = "docs/compatibility.md"

ROOT: Final = Artefact("rtshcua/root", 2, items=MANY)  # 2: with policies of mission keys, persons of approval keys
POLICY: Final = Artefact("rtshcua/policy", 8)  # 8: commands to payload
MISSION: Final = Artefact("rtshcua/mission", 1)
BUNDLE: Final = Artefact("rtshcua/bundle", 1, items=FEW)
APPROVAL: Final = Artefact("rtshcua/approval", 2, items=FEW)  # 2: names mission and flight
RECALL: Final = Artefact("rtshcua/recall", 2, items=FEW)  # 2: names the flight
REPLACEMENT: Final = Artefact("rtshcua/replacement", 2)  # 2: names the flight
CANCELLATION: Final = Artefact("rtshcua/cancellation", 1, items=FEW)
QUALIFICATION: Final = Artefact("rtshcua/qualification", 1, items=MANY)
AUTOPILOT_BINDING: Final = Artefact("rtshcua/autopilot-binding", 1, items=1 << 12)
RECEIPT: Final = Artefact("rtshcua/receipt", 2, items=FEW)  # 2: with the boundary's digest
STATEMENT: Final = Artefact("rtshcua/statement", 2, items=FEW)
LOG: Final = Artefact("rtshcua/log", 4, "")  # JSON lines (RFC 8785), without a registered suffix; 4: `received_us`
PROOF: Final = Artefact("rtshcua/proof", 1, items=MANY)  # the material of a proof of a log
REQUEST: Final = Artefact("rtshcua/request", 2)  # 2: with temporal monitors
RESPONSE: Final = Artefact("rtshcua/response", 2)  # 2: with the boundary's digest
PERMIT: Final = Artefact("rtshcua/permit", 1)
DIAGNOSTICS: Final = Artefact("rtshcua/diagnostics", 1, "+json")
MISSION_SPEC: Final = Artefact("rtshcua/mission-spec", 1, "+json")
