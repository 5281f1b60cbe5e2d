"""The relay's process, as its starter sees it (`rtshcua/adapters/gateway`)."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Final

from rtshcua.adapters.gateway.messages import LARGEST, ClientSetup, RelayKind, RelayMessage, decoded, encoded, withheld
from rtshcua.adapters.gateway.process import RelayError, RelayProcess
from rtshcua.app.gateway.configuration import ConfiguredClient
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal

#: how many datagrams of a socket are read before the other one has its turn
_MOST_AT_ONCE: Final = 256


class StartedRelay(RelayProcess):
    """The relay of configured clients. `vehicle` is the vehicle's address."""

    def __init__(self, vehicle: str, clients: Sequence[ConfiguredClient]) -> None:
        self.vehicle, self._clients = vehicle, tuple(clients)
        setups = [ClientSetup(each.name, each.address, each.pilot, each.peers, each.rate) for each in clients]
        super().__init__(vehicle, setups)

    @classmethod
    def start(cls, vehicle: str, clients: Sequence[ConfiguredClient]) -> "StartedRelay | Refusal":
        """Start a relay; the refusal if an address cannot be opened."""
        try:
            return cls(vehicle, clients)
        except RelayError as error:
            failure = error.failure
            if not error.of_address:
                return Refusal("relay", f"the relay of the gateway did not start: {failure.text}", "", ExitCode.FAULT)
            who = "the vehicle" if failure.client is None else f"client `{clients[failure.client].name}`"
            return Refusal("link", f"{who}: {failure.text}", failure.help, ExitCode.LINK)

    def messages(self) -> Iterator[RelayMessage]:
        """The messages that have arrived. Raises `ConnectionError` after the end of the relay."""
        for _ in range(_MOST_AT_ONCE):
            try:
                datagram = self.control.recv(LARGEST)
            except BlockingIOError:
                return
            if not datagram:
                raise ConnectionResetError("the relay ended")
            yield decoded(datagram)

    def frames(self) -> Iterator[bytes]:
        """The datagrams of the vehicle's frames that have arrived."""
        for _ in range(_MOST_AT_ONCE):
            try:
                datagram = self.telemetry.recv(LARGEST)
            except OSError:
                return
            if not datagram:
                return
            yield datagram

    def answer(self, client: int, frames: bytes) -> None:
        """Send frames to a client. If the relay is behind, they are lost, as on any link."""
        with suppress(OSError):
            self.control.send(encoded(RelayKind.ANSWER, client, frames))

    def withhold(self, client: int, system: int, numbers: frozenset[int]) -> None:
        """Set the messages of this system's autopilot that a client does not get."""
        with suppress(OSError):
            self.control.send(encoded(RelayKind.WITHHOLD, client, withheld(system, sorted(numbers))))

    def know_vehicle(self, system: int) -> None:
        """Say which system the vehicle is."""
        with suppress(OSError):
            self.control.send(encoded(RelayKind.VEHICLE, 0, bytes([system])))

    def again(self) -> "StartedRelay | Refusal":
        """A new relay in the place of this one, which ended."""
        self.close()
        return StartedRelay.start(self.vehicle, self._clients)
