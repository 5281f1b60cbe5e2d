"""A normal world that was taken over reaches for what is in the secure world (boundary/home/trustzone_m/attack.c)."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from struct import pack, unpack

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from boundary.both_boundaries import LOG_KEY, OWN_KEY
from boundary.secure_world import needs_emulator
from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT
from boundary.test_note import begins
from reference.world import START, VEHICLE, sealed
from rtshcua.adapters.boundary.home import BoundaryError
from rtshcua.adapters.boundary.trustzone_m import Images, SecureWorld, images
from rtshcua.onboard.enforcement.isolated import DIGEST, LOG, Caller

pytestmark = [needs_emulator, pytest.mark.clients]

READ, WRITE, JUMP, ASK = range(4)
NOTICED, LEAKED = 1, 2
K = 1 << 10
#: memories of the secure world, by both aliases: code and its RAM
MEMORIES = tuple((start, start + 0x20_0000) for start in (0, 0x1000_0000, 0x2800_0000, 0x3800_0000))
KEYS = (0x2800_0000, 0x3800_0000)
UART0 = 0x4020_0000

Attack = Callable[[int, Sequence[int]], list[int]]


@pytest.fixture
def world(tmp_path: Path) -> Iterator[SecureWorld]:
    built = images()
    assert built is not None
    taken_over = Images(built.secure, built.normal.with_name("attack.elf"))
    home = SecureWorld(
        SIGNED_ROOT, PIN, VEHICLE, tmp_path, own_seed=OWN_KEY, log_seed=LOG_KEY, paced=True, programs=taken_over
    )
    try:
        yield home
    finally:
        home.close()


@pytest.fixture
def attack(world: SecureWorld) -> Attack:
    def run(kind: int, addresses: Sequence[int]) -> list[int]:
        found: list[int] = []
        for at in range(0, len(addresses), 8_000):
            some = addresses[at : at + 8_000]
            code, answer = world._ask(b"A", pack(f"<I{len(some)}I", kind, *some), 60)
            assert code == b"d"
            found += unpack(f"<{len(some)}I", answer)
        return found

    return run


def pages_of_peripherals() -> list[int]:
    """Every page in which SSE-200 and the FPGA image have something, by both aliases, but the one that is let out."""
    starts = (0x4000_0000, 0x4008_0000, 0x4010_0000, 0x4020_0000, 0x4800_0000, 0x4802_0000)
    pages = [start + page * 4 * K for start in starts for page in range(32)]
    pages += [start | 0x1000_0000 for start in pages]
    return [each for each in pages if each != UART0]


def test_memory_of_the_normal_world_is_in_reach(world: SecureWorld, attack: Attack) -> None:
    assert set(attack(READ, range(0x2820_0000, 0x2840_0000, K))) <= {0, LEAKED}
    assert attack(READ, [0x0020_0000]) == [LEAKED]
    assert world.violations() == 0


@pytest.mark.parametrize("kind", [READ, WRITE])
def test_every_block_of_secure_memory_is_out_of_reach(kind: int, world: SecureWorld, attack: Attack) -> None:
    blocks = [at for low, high in MEMORIES for at in range(low, high, K)]
    found = attack(kind, blocks)
    assert len(found) == 8_192
    assert set(found) == {NOTICED}
    assert world.violations() == len(found)


@pytest.mark.parametrize("kind", [READ, WRITE])
def test_every_word_of_the_keys_is_out_of_reach(kind: int, attack: Attack) -> None:
    words = [start + at for start in KEYS for at in range(0, K, 4)]
    assert set(attack(kind, words)) == {NOTICED}


@pytest.mark.parametrize("kind", [READ, WRITE])
def test_every_secure_peripheral_is_out_of_reach(kind: int, attack: Attack) -> None:
    assert set(attack(kind, pages_of_peripherals())) == {NOTICED}


def test_no_secure_code_is_entered_but_by_the_gateway(attack: Attack) -> None:
    assert set(attack(JUMP, [0x1000_0000 + at for at in range(0x100, 0x1_9000, 0x100)])) == {NOTICED}


def test_the_gateway_takes_no_pointer_to_what_is_not_the_callers(world: SecureWorld, attack: Attack) -> None:
    inside = [start + at for start in (0x2800_0000, 0x3800_0000) for at in range(0, 0x20_0000, 4 * K)]
    edges = [0x281F_F000, 0x283F_F001, 0x283F_FFFC, 0x8000_0001, 0xFFFF_FFF0, 0xFFFF_0000, 0, 0x100F_F000, 0x5000_0000]
    assert set(attack(ASK, inside + edges)) == {0}
    assert world.violations() == 0
    assert world.call(bytes([DIGEST]))[:1] == b"\0"


def test_nothing_is_answered_after_a_violation(world: SecureWorld, attack: Attack) -> None:
    assert world.call(bytes([DIGEST]))[:1] == b"\0"
    assert attack(READ, [KEYS[1]]) == [NOTICED]
    assert world.call(bytes([DIGEST])) == b""


def started_late(folder: Path, monkeypatch: pytest.MonkeyPatch, *on_time: bool) -> SecureWorld:
    """A world of which one start after the other was on time or not."""
    starts = iter(on_time)
    monkeypatch.setattr(SecureWorld, "_is_on_time", lambda _: next(starts))
    return SecureWorld(SIGNED_ROOT, PIN, VEHICLE, folder, own_seed=OWN_KEY, log_seed=LOG_KEY)


def test_a_world_whose_clock_lags_is_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(started_late(tmp_path, monkeypatch, False, True)) as home:
        assert home.call(bytes([DIGEST]))[:1] == b"\0"
        assert home.violations() == 0


def test_a_world_whose_clock_always_lags_does_not_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = sorted(Path("/proc/self/fd").iterdir())
    with pytest.raises(BoundaryError, match="took too long to start, 3 times") as found:
        started_late(tmp_path, monkeypatch, False, False, False)
    assert found.value.slug == "not-begun"
    assert sorted(Path("/proc/self/fd").iterdir()) == files
    with closing(started_late(tmp_path, monkeypatch, True)) as home:
        assert home.call(bytes([DIGEST]))[:1] == b"\0"


def test_a_setup_is_gone_once_it_was_read(tmp_path: Path, attack: Attack, world: SecureWorld) -> None:
    assert set(attack(READ, range(0x3818_0000, 0x3818_2000, 4))) == {NOTICED}
    files = [path.read_bytes() for path in tmp_path.rglob("*") if path.is_file() and not path.name.endswith("device")]
    assert files
    assert not any(key in data for data in files for key in (OWN_KEY, LOG_KEY))
    command = Path(f"/proc/{world.pid}/cmdline").read_bytes()
    assert not any(key in command or key.hex().encode() in command for key in (OWN_KEY, LOG_KEY))
    assert os.getpgid(world.pid) == world.pid


def test_interrupted_call_is_not_replaced_by_another(world: SecureWorld) -> None:
    """An interrupt of the normal world calls again, with another text, while the log's key signs the first one."""
    caller = Caller(world.call, part=world.part, most_ahead=world.most_ahead)
    assert world.log_public is not None
    key, interrupts = Ed25519PublicKey.from_public_bytes(world.log_public), 0
    for delay_us in (200, 300, 400, 600, 800, 900, 1_200, 1_500, 2_000):
        flight = caller.load(sealed(), START)
        assert isinstance(flight, bytes), flight
        text = begins(flight).encode()
        assert world._ask(b"o", bytes([LOG]) + b"another text".ljust(len(text), b"!"), 5)[0] == b"d"
        code, answer = world._ask(b"L", pack("<I", 20 * delay_us) + bytes([LOG]) + text, 5)
        assert (code, answer[:1]) == (b"d", b"\0")
        key.verify(answer[1:], text)  # raises InvalidSignature
        interrupts += unpack("<II", world._ask(b"F", b"", 5)[1])[0]
    assert interrupts > 0


@pytest.mark.parametrize("left", [b"", bytes(6_223)])
def test_emptied_or_cut_state_is_damage(left: bytes, tmp_path: Path) -> None:
    begin = partial(SecureWorld, SIGNED_ROOT, PIN, VEHICLE, tmp_path, log_seed=LOG_KEY, paced=True, programs=images())
    begin().close()
    (kept,) = tmp_path.rglob("*.trustzone-m")
    kept.write_bytes(left)
    with pytest.raises(BoundaryError) as refused:
        begin()
    assert refused.value.slug == "damaged"
    kept.unlink()
    with pytest.raises(BoundaryError) as refused:
        begin()
    assert refused.value.slug == "damaged"


def test_no_key_is_left_in_an_open_file_of_the_emulator(world: SecureWorld) -> None:
    setups = [file for file in Path(f"/proc/{world.pid}/fd").iterdir() if "memfd:setup" in str(file.readlink())]
    assert setups
    assert [file.read_bytes() for file in setups] == [b""] * len(setups)
