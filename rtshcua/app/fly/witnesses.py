"""`rtshcua run --witness`: send checkpoints of the flight's log to witnesses, and record their cosignatures."""

import socket
from collections.abc import Callable, Sequence
from pathlib import Path

from rtshcua.adapters.vehicle import address
from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.witness_link import Anchor, WitnessClient
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.ports import Anchored, Event, Noted


def addresses(texts: Sequence[str]) -> tuple[Address, ...]:
    """Parse the addresses of witnesses. Raises AddressError."""
    return tuple(address.parse(text, (LinkCarrier.UDP_OUT,)) for text in texts)


def find_witnesses(witnesses: Sequence[Address], keys: frozenset[bytes]) -> "FlightWitnesses | Refusal":
    """The witnesses of a flight. `keys` are the public keys that the trust root names for witnesses of its vehicle."""
    if witnesses and not keys:
        text = "the trust root names no witness for this vehicle, so no cosignature could be recorded"
        return Refusal("no-witness", text, "`rtshcua keys init --witnesses 1` names one", ExitCode.UNTRUSTED)
    peers = []
    for each in witnesses:
        try:
            peers.append((socket.gethostbyname(each.host), each.port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            return Refusal("witness-address", f"`{each}`: {reason}", "", ExitCode.LINK)
    return FlightWitnesses(peers, keys)


class FlightWitnesses:
    """The witnesses of one flight, possibly none. The flight never waits for them."""

    def __init__(self, peers: Sequence[tuple[str, int]], keys: frozenset[bytes]) -> None:
        self._keys = keys
        self._client: WitnessClient | None = None
        self._peers = peers

    def begin(self, log: Path, synced: Callable[[], int]) -> None:
        """Start to send checkpoints of `log`; `synced` counts its lines on the disk. Raises OSError."""
        if self._peers:
            self._client = WitnessClient([*self._peers], log, synced, self._keys)

    def events(self, now_us: int) -> list[Event]:
        """The cosignatures and notes received from witnesses."""
        if self._client is None:
            return []
        news = self._client.news()
        return [Anchored(now_us, each.note) if isinstance(each, Anchor) else Noted(now_us, each.text) for each in news]

    def finish(self, note: Callable[[str], None], *, closed: bool) -> None:
        """Stop. If the log was `closed`, first wait a few seconds for cosignatures of its last checkpoint."""
        client, self._client = self._client, None
        if client is not None:
            for each in client.finish() if closed else client.finish(0):
                note(each.text)
