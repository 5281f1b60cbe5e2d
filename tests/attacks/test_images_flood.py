"""A hostile sender under the vehicle's system makes up images, failures and counts, thousands a second, in a flight."""

from collections.abc import Sequence
from random import Random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from rtshcua.codec.frames import Codec
from rtshcua.evidence.report import LogVerdict
from virtual import case
from virtual.flight import Flight

MOST_A_SECOND, COMMAND_LONG = 20, 76


class Forger:
    """Adds forged reports of all cameras behind each frame of the vehicle."""

    def __init__(self) -> None:
        self._chance = Random(3)
        self._codecs = [Codec(1, component) for component in (1, *range(100, 106))]
        self.sent = 0

    def __call__(self, datagram: bytes) -> Sequence[bytes]:
        return [datagram, *(self._forged() for _ in range(20))]

    def _forged(self) -> bytes:
        chance, codec = self._chance, self._chance.choice(self._codecs)
        index = chance.choice((-1, 0, 1, 7, chance.randrange(50), chance.randrange(2**31)))
        utc = chance.choice((0, chance.randrange(2**50), 2**64 - 1))
        place = chance.randrange(-(2**31), 2**31), chance.randrange(-(2**31), 2**31)
        self.sent += 1
        return codec.pack(
            chance.choice(
                (
                    m.MAVLink_camera_image_captured_message(
                        chance.randrange(2**32), utc, chance.randrange(256), *place, *place,
                        [chance.uniform(-2, 2) for _ in range(4)], index, chance.choice((-1, 0, 1, 1, 5)),
                        chance.randbytes(chance.randrange(205)),
                    ),
                    m.MAVLink_camera_capture_status_message(
                        chance.randrange(2**32), 0, 0, 0, 0, 0, chance.choice((-1, 0, 5, 2**31 - 1))
                    ),
                    m.MAVLink_camera_feedback_message(
                        utc, 1, 0, index % 65_536, *place, *[chance.uniform(-1e38, 1e38) for _ in range(6)], 0, 0
                    ),
                    m.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3),
                    m.MAVLink_command_ack_message(512, chance.randrange(10), 0, 0, 1, 191),
                )
            )
        )  # fmt: skip


@pytest.mark.slow
def test_made_up_images_neither_disturb_a_flight_nor_fill_its_log() -> None:
    flying = Flight(case.seal(case.mission(case.low_steps())), case.simulated("px4"))
    flying.vehicle.hurt = forger = Forger()
    asked: list[bytes] = []

    def hear(_: int, frame: bytes) -> None:
        if frame[7] == COMMAND_LONG and frame[-3] in range(100, 106):  # the target is the last octet of the payload
            asked.append(frame)

    flying.vehicle.simulation.heard = hear
    flown = flying.fly()
    assert flown.ending == "completed"
    seconds = flown.vehicle.clock.elapsed_us / case.S
    assert forger.sent > 20_000
    assert 0 < len(flown.effects("image")) <= MOST_A_SECOND * seconds + 40
    assert sum(len(line) for line in flown.lines) < 10_000 * seconds + 400_000
    assert 0 < len(asked) < 8 * seconds, "5 for images, and for the numbers of images"
    assert any("left out" in each["detail"] for each in flown.effects("noted"))
    report = flown.audit().report
    assert report.verdict is LogVerdict.VERIFIED, report.failure
