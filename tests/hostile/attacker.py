"""An attacker on the link without a key, who receives all frames and sends arbitrary ones."""

from collections.abc import Sequence
from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.mavlink.framing import FLAG_SIGNED, checksum, with_flags
from rtshcua.mavlink.signing import SignedLink, SigningState

MARKER = 0xFD
#: the messages that are most useful to forge
WANTED = ("HEARTBEAT", "GLOBAL_POSITION_INT", "COMMAND_ACK", "EXTENDED_SYS_STATE", "BATTERY_STATUS", "STATUSTEXT",
          "SYS_STATUS", "GPS_RAW_INT", "PARAM_VALUE", "MISSION_ACK", "MISSION_REQUEST_INT", "RADIO_STATUS",
          "COMMAND_LONG", "SETUP_SIGNING", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS")  # fmt: skip
NUMBERS = {of.msgname: number for number, of in mavlink.mavlink_map.items()}


class Attacker:
    """Makes datagrams; with `impersonate` also under the vehicle's own ids, unsigned or wrongly signed.

    Otherwise no RADIO_STATUS, because without a key a modem's is accepted under any ids.
    """

    def __init__(self, overheard: Sequence[bytes], seed: int, *, impersonate: bool) -> None:
        self._overheard = list(overheard)
        self._chance = Random(seed)
        self._impersonate = impersonate
        self._wrong = SignedLink(bytes(range(32)), SigningState(0, {}), 1_767_225_600_000_000, 0)
        self._ways = [self._garbage, self._markers, self._cut, self._spoofed, self._spoofed, self._several]
        if impersonate:
            self._ways += [self._replay, self._turned, self._unsigned, self._badly_signed, self._as_if_signed]
        believed = () if impersonate else ("RADIO_STATUS",)
        self._wanted = [name for name in WANTED if name not in believed]
        self._numbers = [number for name, number in NUMBERS.items() if name not in believed]

    def datagram(self) -> bytes:
        """Return the next datagram."""
        return self._chance.choice(self._ways)()

    def _garbage(self) -> bytes:
        return self._chance.randbytes(self._chance.randrange(300))

    def _markers(self) -> bytes:
        noise = bytearray(self._garbage())
        for _ in range(self._chance.randrange(6)):
            if noise:
                noise[self._chance.randrange(len(noise))] = MARKER
        return bytes(noise)

    def _cut(self) -> bytes:
        frame = self._pick()
        return frame[: self._chance.randrange(len(frame))]

    def _replay(self) -> bytes:
        return self._pick()

    def _turned(self) -> bytes:
        frame = bytearray(self._pick())
        for _ in range(self._chance.randrange(1, 4)):
            frame[self._chance.randrange(len(frame))] ^= 1 << self._chance.randrange(8)
        return bytes(frame)

    def _spoofed(self) -> bytes:
        system = self._chance.choice((0, 2, 3, 51, 254, 255))
        return self._frame(system, self._chance.choice((1, 1, 1, 0, 68, 191)))

    def _unsigned(self) -> bytes:
        return self._frame(1, self._chance.choice((1, 1, 68, 191)))

    def _badly_signed(self) -> bytes:
        return self._wrong.sign(self._unsigned(), self._chance.randrange(10**9))

    def _as_if_signed(self) -> bytes:
        return with_flags(self._unsigned(), FLAG_SIGNED) + self._chance.randbytes(13)

    def _several(self) -> bytes:
        return b"".join(self.datagram() for _ in range(self._chance.randrange(4)))

    def _frame(self, system: int, component: int) -> bytes:
        """A frame with a valid checksum, of any message, mostly of an important one."""
        chance = self._chance
        number = NUMBERS[chance.choice(self._wanted)] if chance.random() < 0.7 else chance.choice(self._numbers)
        of = mavlink.mavlink_map[number]
        payload = bytearray(chance.randbytes(chance.randrange(1, of.unpacker.size + 1)))
        if number == 0 and len(payload) > 5:
            payload[5] = chance.choice((3, 12))  # a known autopilot
        head = bytes([MARKER, len(payload), 0, 0, chance.randrange(256), system, component])
        frame = head + number.to_bytes(3, "little") + payload
        return frame + checksum(frame[1:] + bytes([of.crc_extra])).to_bytes(2, "little")

    def _pick(self) -> bytes:
        return self._chance.choice(self._overheard)
