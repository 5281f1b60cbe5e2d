"""Keys: RFC 8032, one duty a key, and key files."""

import hashlib
import pickle
from base64 import b64encode

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.wire import key_file
from rtshcua.wire.key_file import MAX_KEY_FILE, KeyFileError, dump_signing_key, load_signing_key
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey, WrongDuty, key_id, verified
from rtshcua.wire.untrusted import Untrusted
from virtual.rows import rows
from virtual.sampling import each_once

SEED = bytes(range(32))
PASSPHRASE = b"correct horse"


@pytest.fixture(autouse=True, scope="module")
def _cheap_guesses():
    """Encrypted keys are many here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(key_file, "COST", key_file.COSTS[0])
        yield


# RFC 8032, section 7.1, tests 1 to 3: seed, public key, message, signature.
RFC_8032 = [
    (
        "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60",
        "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
        "",
        "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701cf9b46bd25bf5f0595bbe24"
        "655141438e7a100b",
    ),
    (
        "4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb",
        "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
        "72",
        "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aee"
        "b00d291612bb0c00",
    ),
    (
        "c5aa8df43f9f837bedb7442f31dcb7b166d38535076f094b85ce3a2e0b4458f7",
        "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025",
        "af82",
        "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac18ff9b538d16f290ae67f760984dc6594a7c15e9716ed28d"
        "c027beceea1ec40a",
    ),
]
L = 2**252 + 27742317777372353535851937790883648493


def signing_key(duty=Duty.POLICY, *, development=False):
    return SigningKey.from_seed(SEED, duty=duty, development=development)


@pytest.mark.parametrize(("seed", "public", "message", "signature"), RFC_8032)
def test_rfc_8032(seed, public, message, signature):
    key = SigningKey.from_seed(bytes.fromhex(seed), duty=Duty.LOG)
    assert key.public.hex() == public
    assert key.sign(bytes.fromhex(message), duty=Duty.LOG).hex() == signature
    assert key.verification().verify(bytes.fromhex(signature), bytes.fromhex(message))


def test_a_signature_has_one_form():
    key, message = signing_key(), b"message"
    signature = key.sign(message, duty=Duty.POLICY)
    malleated = signature[:32] + (int.from_bytes(signature[32:], "little") + L).to_bytes(32, "little")
    public = key.verification()
    assert public.verify(signature, message)
    assert not public.verify(malleated, message)
    assert not public.verify(signature[:-1], message)
    assert not public.verify(signature + b"\0", message)
    assert not public.verify(b"", message)
    assert not public.verify(signature, b"massage")


def test_a_key_is_named_by_duty_and_public_key():
    kid = signing_key().kid
    expected = hashlib.sha256(b"rtshcua/key\0" + b"rtshcua/duty/policy\0" + signing_key().public).digest()[:16]
    assert kid == expected == signing_key().verification().kid == key_id(Duty.POLICY, signing_key().public)
    assert len({key_id(duty, signing_key().public) for duty in Duty}) == len(Duty)


def test_verification_carries_what_the_key_is():
    public = signing_key(Duty.MISSION, development=True).verification(
        roles=("operator",), sources=("agent",), vehicles=("quad-07",), expires_us=5
    )
    assert public == VerificationKey(
        Duty.MISSION, signing_key().public, ("operator",), ("agent",), ("quad-07",), 5, development=True
    )


def test_invalid_verification_key_is_refused():
    with pytest.raises(ValueError, match="a public key is 32 bytes, not 31"):
        VerificationKey(Duty.POLICY, bytes(31))
    with pytest.raises(ValueError, match="`pilot` is not a source"):
        VerificationKey(Duty.MISSION, bytes([2] * 32), sources=("agent", "pilot"))


def test_small_order_key_is_refused():
    neutral, other_form = bytes([1]) + bytes(31), ((1 << 255) - 1).to_bytes(32, "little")
    for weak in (neutral, other_form):
        with pytest.raises(ValueError, match="in canonical form and not of small order"):
            VerificationKey(Duty.POLICY, weak)
        assert not verified(weak, weak + bytes(32), b"anything")
    assert not verified(signing_key().public, neutral + bytes(32), b"anything")


def test_secrets_are_never_shown():
    key = signing_key(development=True)
    assert repr(key) == str(key) == f"<policy signing key {key.kid.hex()} development>"
    assert repr(signing_key()) == f"<policy signing key {key.kid.hex()}>"
    assert SEED.hex() not in f"{key!r}{key}{key.__class__.__doc__}"
    with pytest.raises(TypeError):
        pickle.dumps(key)


PROTECTED = [(True, None), (True, PASSPHRASE), (False, PASSPHRASE)]


@pytest.mark.parametrize(("duty", "protected"), each_once(Duty, PROTECTED))
def test_key_files_come_back(duty, protected):
    development, passphrase = protected
    key = signing_key(duty, development=development)
    loaded = load_signing_key(dump_signing_key(key, passphrase=passphrase), duty=duty, passphrase=passphrase)
    assert (loaded.duty, loaded.development, loaded.public, loaded.kid) == (duty, development, key.public, key.kid)
    assert loaded.sign(b"x", duty=duty) == key.sign(b"x", duty=duty)


def test_a_development_key_file_is_stable():
    assert dump_signing_key(signing_key(development=True), passphrase=None) == (
        b"duty: policy\n"
        b"development: yes\n"
        b"-----BEGIN PRIVATE KEY-----\n"
        b"MC4CAQAwBQYDK2VwBCIEIAABAgMEBQYHCAkKCwwNDg8QERITFBUWFxgZGhscHR4f\n"
        b"-----END PRIVATE KEY-----\n"
    )


def test_a_passphrase_is_not_needed_for_what_is_not_encrypted():
    data = dump_signing_key(signing_key(development=True), passphrase=None)
    assert load_signing_key(data, duty=Duty.POLICY, passphrase=PASSPHRASE).kid == signing_key().kid


def test_an_encrypted_file_does_not_hold_the_seed():
    data = dump_signing_key(signing_key(), passphrase=PASSPHRASE)
    assert b"PRIVATE KEY" not in data
    assert b"AAECAwQFBgcICQoLDA0ODw" not in data
    assert SEED.hex().encode() not in data


@pytest.mark.parametrize("passphrase", [None, b""])
def test_only_development_keys_are_written_unencrypted(passphrase):
    with pytest.raises(KeyFileError) as refused:
        dump_signing_key(signing_key(), passphrase=passphrase)
    assert refused.value.slug == "unencrypted"


def refusal(data, *, duty=Duty.POLICY, passphrase=None):
    with pytest.raises(Untrusted) as refused:
        load_signing_key(data, duty=duty, passphrase=passphrase)
    return refused.value.slug


PLAIN = dump_signing_key(signing_key(development=True), passphrase=None)
#: as version 0.1.0 wrote it without scrypt
EARLIER = b"duty: policy\ndevelopment: no\n" + signing_key().private.private_bytes(
    serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.BestAvailableEncryption(PASSPHRASE)
)
SALT = bytes(range(32, 64))


def by_hand(cost: int = key_file.COSTS[0], duty: str = "policy", seed: bytes = SEED) -> bytes:
    """A sealed key file by the text of its format, with hashlib's scrypt."""
    head = f"duty: {duty}\ndevelopment: no\nscrypt: {cost} 8 1 {SALT.hex()}\n".encode()
    made = hashlib.scrypt(PASSPHRASE, salt=SALT, n=1 << cost, r=8, p=1, maxmem=1 << 30, dklen=32)
    return head + b"sealed: " + b64encode(ChaCha20Poly1305(made).encrypt(bytes(12), seed, head)) + b"\n"


SEALED = by_hand()


def test_a_sealed_key_by_hand():
    assert load_signing_key(SEALED, duty=Duty.POLICY, passphrase=PASSPHRASE).kid == signing_key().kid


def test_a_key_that_an_earlier_version_encrypted_is_read():
    assert refusal(EARLIER) == "passphrase-needed"
    assert refusal(EARLIER, passphrase=b"wrong") == "wrong-passphrase"
    assert load_signing_key(EARLIER, duty=Duty.POLICY, passphrase=PASSPHRASE).kid == signing_key().kid


COST = key_file.COST


def test_passphrase_guess_has_documented_cost(monkeypatch):
    """N is 2**17 in the file: 128 MiB per guess. Salts are random."""
    first = dump_signing_key(signing_key(), passphrase=PASSPHRASE)
    monkeypatch.setattr(key_file, "COST", COST)
    second = dump_signing_key(signing_key(), passphrase=PASSPHRASE)
    assert b"\nscrypt: 17 8 1 " in second
    assert first.split()[8] != second.split()[8]


@rows(
    ("old", "new", "slug"),
    [
        (b"scrypt: 14 8 1", b"scrypt: 13 8 1", "malformed"),  # cheaper than our own files
        (b"scrypt: 14 8 1", b"scrypt: 19 8 1", "malformed"),  # would take half a gigabyte
        (b"scrypt: 14 8 1", b"scrypt: 15 8 1", "wrong-passphrase"),
        (b"scrypt: 14 8 1", b"scrypt: 14 8 2", "malformed"),
        (b"development: no", b"development: yes", "wrong-passphrase"),
        (SALT.hex().encode(), bytes(32).hex().encode(), "wrong-passphrase"),
        (b"sealed: ", b"sealed:  ", "malformed"),
    ],
)
def test_sealed_key_with_changed_header_is_refused(old, new, slug):
    assert refusal(SEALED.replace(old, new), passphrase=PASSPHRASE) == slug


def test_a_sealed_key_is_for_its_duty_alone():
    assert refusal(SEALED, duty=Duty.MISSION, passphrase=PASSPHRASE) == "wrong-duty"
    relabelled = SEALED.replace(b"duty: policy", b"duty: mission")
    assert refusal(relabelled, duty=Duty.MISSION, passphrase=PASSPHRASE) == "wrong-passphrase"


def test_loading_refuses_the_wrong_duty():
    with pytest.raises(WrongDuty, match="the key is for `policy`, not for `mission`") as refused:
        load_signing_key(PLAIN, duty=Duty.MISSION, passphrase=None)
    assert (refused.value.slug, refused.value.has, refused.value.asked) == ("wrong-duty", Duty.POLICY, Duty.MISSION)


def test_loading_refuses_secrets_that_do_not_fit():
    assert refusal(SEALED) == "passphrase-needed"
    assert refusal(SEALED, passphrase=b"wrong") == "wrong-passphrase"
    assert refusal(PLAIN.replace(b"development: yes", b"development: no")) == "unencrypted"


@rows(
    "data",
    [
        b"",
        b"\xff" * 100,
        PLAIN + b"\n",
        b"\n" + PLAIN,
        PLAIN.replace(b"\n", b"\r\n"),
        PLAIN.replace(b"duty: policy\n", b""),
        PLAIN.replace(b"duty: policy", b"duty: pilot"),
        PLAIN.replace(b"duty: policy", b"duty:  policy"),
        PLAIN.replace(b"development: yes", b"development: maybe"),
        PLAIN.replace(b"END PRIVATE", b"END ENCRYPTED PRIVATE"),
        PLAIN.replace(b"MC4CAQ", b"MC4CAR"),
        PLAIN.replace(b"MC4CAQ", b"!!!!!!"),
        PLAIN + b"-" * MAX_KEY_FILE,
        b"duty: policy\ndevelopment: yes\n"
        + X25519PrivateKey.from_private_bytes(SEED).private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        ),
    ],
)
def test_damaged_files_are_malformed(data):
    assert refusal(data) == "malformed"


def test_relabelling_a_file_makes_another_key():
    relabelled = load_signing_key(PLAIN.replace(b"policy", b"mission"), duty=Duty.MISSION, passphrase=None)
    assert relabelled.public == signing_key().public
    assert relabelled.kid != signing_key().kid


@settings(max_examples=settings().max_examples // 2)
@given(st.integers(0, len(PLAIN) - 1), st.integers(0, 255))
def test_any_changed_byte_gives_a_refusal_or_another_key(at, byte):
    damaged = PLAIN[:at] + bytes([byte]) + PLAIN[at + 1 :]
    try:
        key = load_signing_key(damaged, duty=Duty.POLICY, passphrase=None)
    except Untrusted:
        return
    assert (key.kid == signing_key().kid) is (damaged == PLAIN)


def test_missing_memory_for_key_is_reported(monkeypatch):
    class Full:
        def __init__(self, **_):
            pass

        def derive(self, _):
            raise MemoryError

    monkeypatch.setattr(key_file, "Scrypt", Full)
    assert refusal(SEALED, passphrase=PASSPHRASE) == "memory"
