"""`rtshcua run --witness`: the flight's log is shown to witnesses while it is written; what they cosign is recorded."""

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
    """Where witnesses are. Raises AddressError."""
    return tuple(address.parse(text, (LinkCarrier.UDP_OUT,)) for text in texts)


def find_witnesses(witnesses: Sequence[Address], keys: frozenset[bytes]) -> "FlightWitnesses | Refusal":
    """The witnesses of a flight. `keys` are the public keys that the trust root names for witnesses of its vehicle."""
    if witnesses and not keys:
        text = "the trust root names no witness of this vehicle: nothing that one says could be recorded"
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
    """The witnesses of one flight; none at all is the usual number. The flight never waits for them."""

    def __init__(self, peers: Sequence[tuple[str, int]], keys: frozenset[bytes]) -> None:
        self._keys = keys
        self._client: WitnessClient | None = None
        self._peers = peers

    def begin(self, log: Path, synced: Callable[[], int]) -> None:
        """Show them a log that has begun; `synced` is how many of its lines are on the disk. Raises OSError."""
        if self._peers:
            self._client = WitnessClient([*self._peers], log, synced, self._keys)

    def events(self, now_us: int) -> list[Event]:
        """What came from them."""
        if self._client is None:
            return []
        news = self._client.news()
        return [Anchored(now_us, each.note) if isinstance(each, Anchor) else Noted(now_us, each.text) for each in news]

    def finish(self, note: Callable[[str], None], *, closed: bool) -> None:
        """The log is over; for the end of one that was closed they are waited for, some seconds at most."""
        client, self._client = self._client, None
        if client is not None:
            for each in client.finish() if closed else client.finish(0):
                note(each.text)
