"""RADIO_STATUS without a signature: the worst of the last seconds, field by field."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.mavlink.radio import SPAN_US, UnsignedRadio
from rtshcua.mavlink.signing import SignedLink, SigningState

FIELDS = ("rssi", "remrssi", "txbuf", "noise", "remnoise", "rxerrors", "fixed")


def status(txbuf: int = 80, rssi: int = 200, noise: int = 20) -> Any:
    return mavlink.MAVLink_radio_status_message(rssi, rssi, txbuf, noise, noise, 0, 0)


def radio() -> UnsignedRadio:
    return UnsignedRadio(SignedLink(bytes(range(32)), SigningState(0, {}), 10**15, 0))


def test_radio_status_alone_needs_no_signature() -> None:
    codec, accepting = Codec(1, 68), radio()
    assert accepting.accept(codec.pack(status()), 0)
    assert not accepting.accept(codec.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3)), 0)
    rightly = SignedLink(bytes(range(32)), SigningState(0, {}), 10**15, 0)
    assert accepting.accept(rightly.sign(codec.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3)), 0), 0)
    badly_signed = SignedLink(bytes(32), SigningState(0, {}), 10**15, 0).sign(codec.pack(status()), 0)
    assert not accepting.accept(badly_signed, 0), "what claims a signature must have the right one"


def test_a_forged_good_report_hides_nothing() -> None:
    tempering = radio()
    for at_s, told, noise in ((0, 80, 20), (1, 15, 90), (2, 100, 0), (6, 100, 0)):
        message = status(told, noise=noise)
        tempering.temper(message, at_s * 1_000_000)
        assert message.txbuf == (80 if at_s == 0 else 15)
        assert message.noise == (20 if at_s == 0 else 90)


def test_unknown_radio_value_is_the_worst() -> None:
    tempering = radio()
    tempering.temper(status(rssi=255), 0)
    message = status(rssi=100)
    tempering.temper(message, 1)
    assert message.rssi == 255


def test_the_link_may_get_better_in_time() -> None:
    tempering = radio()
    tempering.temper(status(10), 0)
    message = status(90)
    tempering.temper(message, 2 * SPAN_US)
    assert message.txbuf == 90


@given(st.lists(st.tuples(st.integers(0, 4_000_000), st.integers(0, 100)), min_size=1, max_size=30))
def test_never_better_than_any_report_of_the_last_seconds(reports: list[tuple[int, int]]) -> None:
    tempering, now_us, told = radio(), 0, []
    for wait_us, txbuf in reports:
        now_us += wait_us
        told.append((now_us, txbuf))
        message = status(txbuf)
        tempering.temper(message, now_us)
        assert message.txbuf <= min(value for at_us, value in told if at_us > now_us - SPAN_US)
        assert message.txbuf >= min(value for at_us, value in told if at_us > now_us - 2 * SPAN_US)
