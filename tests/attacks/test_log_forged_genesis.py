"""Threat: the genesis, on which everything else rests, is forged: bundle, root, vehicle, mission, mode, format."""

from base64 import b64decode, b64encode

from reference.forgery import edit, expect, flight, other_flight, read, rewritten, signed
from virtual.rows import rows

LINES = flight()
GENESIS = read(LINES[0])


def begun(**fields: object) -> list[bytes]:
    return [edit(LINES[0], **fields), *LINES[1:]]


def flipped(field: str, at: int) -> str:
    data = bytearray(b64decode(GENESIS[field]))
    data[at] ^= 1
    return b64encode(bytes(data)).decode()


@rows(
    ("fields", "slug"),
    [
        ({"vehicle": "quad-08"}, "trust/bundle-wrong-vehicle"),
        ({"mission": "another"}, "genesis/mission"),
        ({"bundle": "AAAA"}, "trust/bundle-malformed"),
        ({"bundle": ""}, "trust/bundle-malformed"),
        ({"bundle": "no base64"}, "genesis/base64"),
        ({"root": GENESIS["root"].rstrip("=") + "\n"}, "genesis/base64"),
        ({"root": "AAAA"}, "trust/root-malformed"),
        ({"root": GENESIS["bundle"]}, "trust/root-malformed"),
    ],
)
def test_a_forged_field(fields: dict[str, object], slug: str) -> None:
    """Each is detected at once, even if the holder of the log key rewrote the rest; otherwise by the genesis'
    signature.
    """
    assert expect(signed(begun(**fields))) == (slug, 0)
    assert expect(begun(**fields)) == ("seal/key" if "vehicle" in fields else "seal/self", 0)


@rows(
    ("fields", "slug"),
    [
        ({"format": "rtshcua/diary"}, "genesis/format"),
        ({"version": 1}, "genesis/format"),
        ({"version": 2}, "genesis/format"),
        ({"version": 3}, "genesis/format"),
        ({"version": 5}, "genesis/format"),
        ({"boot": "00"}, "record/malformed"),
        ({"log_key": "00"}, "record/malformed"),
        ({"log_kid": "00" * 16}, "genesis/log-key"),
        ({"seq": 1}, "chain/sequence"),
        ({"_prev": "11" * 32}, "chain/broken"),
    ],
)
def test_a_field_that_no_genesis_has(fields: dict[str, object], slug: str) -> None:
    assert expect(begun(**fields)) == (slug, 0)


@rows("at", [0, 3, 30, 60, 200, 400, -70, -10, -1])
def test_flipped_bit_in_the_bundle_is_detected(at: int) -> None:
    assert expect(signed(begun(bundle=flipped("bundle", at))))[0].startswith("trust/bundle-")


@rows("at", [0, 3, 30, 60, 200, 400, -70, -10, -1])
def test_flipped_bit_in_the_root_is_detected(at: int) -> None:
    assert expect(signed(begun(root=flipped("root", at))))[0].startswith("trust/root-")


def test_the_bundle_of_another_mission() -> None:
    """The policy may be mixed as little as the mission: both are in the bundle."""
    bundle = read(other_flight()[0])["bundle"]
    assert expect(begun(bundle=bundle)) == ("seal/self", 0)
    assert expect(rewritten(begun(bundle=bundle))) == ("seal/self", 0)
    assert expect(signed(begun(bundle=bundle)))[0] == "decision/invocation"


def test_false_mode_none_is_detected() -> None:
    """With mode `none` no dispatch needs a permit, but each decision records the mode too."""
    assert expect(signed(begun(mode="none")))[0] == "decision/mode"


def test_a_trust_root_that_had_expired() -> None:
    later = 366 * 86_400_000_000 + 1
    moved = [edit(line, utc_us=read(line)["utc_us"] + later) for line in LINES]
    assert expect(signed(moved)) == ("trust/root-expired", 0)
