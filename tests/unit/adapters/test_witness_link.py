"""A log and its witnesses over real UDP: losses, strangers, restarts, and witnesses with another view."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest

from reference.witnessed import ORIGIN, PUBLIC, WITNESSES, Log, log_keys
from rtshcua.adapters import witness_link
from rtshcua.adapters.store.logs import anchors_path, read_anchors
from rtshcua.adapters.store.witness import FileWitness, WitnessStore
from rtshcua.adapters.witness_link import ANSWER, REQUEST, Anchor, WitnessClient, WitnessLink, WitnessTrouble
from rtshcua.codec.frames import Codec
from rtshcua.codec.tunnel import answer_name, messages, name_of
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Anchors
from rtshcua.evidence.witnessing.witness import CosignRequest, Declined, WitnessResponse
from rtshcua.wire.keys import SigningKey

HOST = "127.0.0.1"
PATIENCE_S = 20.0


class Served:
    """A witness in a thread, as `rtshcua witness --connect` is a process."""

    def __init__(self, state: Path, key: SigningKey = WITNESSES[0], port: int = 0) -> None:
        self.store = WitnessStore(state, key)
        self.asked: list[CosignRequest] = []
        self.witness = FileWitness(self.store, key, log_keys, lambda: 1_000)
        self.link = WitnessLink((HOST, port), self.consider)
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    @property
    def address(self) -> tuple[str, int]:
        return HOST, self.link.port

    def consider(self, request: CosignRequest) -> WitnessResponse | Declined:
        self.asked.append(request)
        return self.witness.consider(request)

    def run(self) -> None:
        while not self.over.is_set():
            self.link.serve(0.01)

    def close(self) -> None:
        if not self.over.is_set():
            self.over.set()
            self.thread.join()
            self.link.close()
            self.store.close()


class Lossy:
    """A relay between a client and a witness that loses, repeats and delays messages."""

    def __init__(self, to: tuple[str, int], loses: float) -> None:
        self.to, self.loses, self.chance = to, loses, Random(7)
        self.near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.near.bind((HOST, 0))
        self.far.bind((HOST, 0))
        self.client: tuple[str, int] | None = None
        self.over = threading.Event()
        self.threads = [threading.Thread(target=self.carry, args=way) for way in ((True,), (False,))]
        for link in (self.near, self.far):
            link.settimeout(0.05)
        for thread in self.threads:
            thread.start()

    @property
    def address(self) -> tuple[str, int]:
        return HOST, self.near.getsockname()[1]

    def carry(self, out: bool) -> None:
        held: list[bytes] = []
        while not self.over.is_set():
            try:
                data, sender = (self.near if out else self.far).recvfrom(65_535)
            except TimeoutError:
                continue
            if out:
                self.client = sender
            held += [data] * self.chance.choice([1, 1, 2])
            self.chance.shuffle(held)
            for each in held[: len(held) // 2 + 1]:
                if self.chance.random() >= self.loses and self.client is not None:
                    (self.far if out else self.near).sendto(each, self.to if out else self.client)
            del held[: len(held) // 2 + 1]

    def close(self) -> None:
        self.over.set()
        for thread in self.threads:
            thread.join()
        self.near.close()
        self.far.close()


class Writer:
    """A log that grows in a file."""

    def __init__(self, folder: Path, log: Log | None = None) -> None:
        self.log = Log() if log is None else log
        self.path = folder / "log.jsonl"
        self.path.write_bytes(b"".join(self.log.lines))
        self.written = len(self.log.lines)

    def write(self) -> None:
        with self.path.open("ab") as file:
            file.write(b"".join(self.log.lines[self.written :]))
        self.written = len(self.log.lines)

    def epoch(self, count: int = 3) -> None:
        self.log.effects(count)
        self.log.seal()
        self.write()

    def close(self) -> None:
        self.log.close()
        self.write()

    def client(self, *addresses: tuple[str, int], keys: frozenset[bytes] = frozenset(PUBLIC)) -> WitnessClient:
        return WitnessClient(addresses, self.path, lambda: self.written, keys)


@pytest.fixture(autouse=True)
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same, in less time."""
    monkeypatch.setattr(witness_link, "EVERY_S", 0.005)
    monkeypatch.setattr(witness_link, "AGAIN_S", 0.05)
    monkeypatch.setattr(witness_link, "LONGEST_S", 0.1)


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Served]]:
    started: list[Served] = []

    def serve(number: int = 0, **more: object) -> Served:
        started.append(Served(tmp_path / f"state-{number}", WITNESSES[number], **more))  # type: ignore[arg-type]
        return started[-1]

    yield serve
    for each in started:
        each.close()


@pytest.fixture
def writer(tmp_path: Path) -> Writer:
    return Writer(tmp_path)


def until(
    client: WitnessClient, wanted: Callable[[list[Anchor | WitnessTrouble]], bool]
) -> list[Anchor | WitnessTrouble]:
    found: list[Anchor | WitnessTrouble] = []
    until_s = time.monotonic() + PATIENCE_S
    while not wanted(found):
        assert time.monotonic() < until_s, found
        found += client.news()
        time.sleep(0.002)
    return found


def seen(size: int, key: SigningKey = WITNESSES[0]) -> Callable[[list[Anchor | WitnessTrouble]], bool]:
    """Whether a witness cosigned the checkpoint of this size."""

    def has(found: list[Anchor | WitnessTrouble]) -> bool:
        held = Anchors(ORIGIN, [key.public], 1)
        notes = [each.note for each in found if isinstance(each, Anchor)]
        assert not any(held.anchor(note) for note in notes)
        sizes = [int(note.split("\n")[1]) for note in notes]
        outcome = [w.size for w in held._seen.values()]
        assert not outcome or max(outcome) <= max(sizes)
        return size in outcome

    return has


def outcome(writer: Writer, notes: list[str], threshold: int) -> AnchoredExtent:
    held = Anchors(ORIGIN, PUBLIC, threshold)
    for note in writer.log.notes:
        held.checkpoint(note)
    for note in notes:
        assert held.anchor(note) is None
    found = held.finish(len(writer.log.lines))
    assert isinstance(found, AnchoredExtent)
    return found


def test_each_epoch_and_the_end(serve: Callable[..., Served], writer: Writer) -> None:
    client = writer.client(serve().address)
    found = until(client, seen(0))
    for size in (4, 8, 12):
        writer.epoch()
        found += until(client, seen(size))
    writer.close()
    assert client.finish(PATIENCE_S) == []
    assert anchors_path(writer.path).name == "log.anchors"
    notes = [each.note for each in found if isinstance(each, Anchor)] + read_anchors(writer.path)
    assert outcome(writer, notes, 1)[:2] == (14, 0)


def test_two_witnesses_over_a_bad_link(serve: Callable[..., Served], writer: Writer) -> None:
    relays = [Lossy(serve(number).address, 0.3) for number in (0, 1)]
    try:
        client = writer.client(*[relay.address for relay in relays])
        for _ in range(5):
            writer.epoch()
        found = until(client, lambda found: seen(20)(found) and seen(20, WITNESSES[1])(found))
        writer.close()
        assert client.finish(PATIENCE_S) == []
        notes = [each.note for each in found if isinstance(each, Anchor)] + read_anchors(writer.path)
        assert outcome(writer, notes, 2)[:2] == (22, 0)
    finally:
        for relay in relays:
            relay.close()


def test_a_witness_that_is_not_there_yet(serve: Callable[..., Served], writer: Writer, port: int) -> None:
    """It gets only the genesis until it answers, and then the checkpoints of all keys."""
    client = writer.client((HOST, port))
    for _ in range(70):
        writer.epoch(1)
    served = serve(port=port)
    until(client, seen(140))
    assert served.asked[0].chain == ()
    assert served.asked[0].note == writer.log.notes[0]
    assert max(len(request.chain) for request in served.asked) > 10
    assert client.finish(PATIENCE_S) == []


def test_client_handles_restarted_and_reset_witnesses(
    serve: Callable[..., Served], writer: Writer, tmp_path: Path
) -> None:
    first = serve()
    client = writer.client(first.address)
    writer.epoch()
    until(client, seen(4))
    port = first.link.port
    first.close()
    writer.epoch()
    second = serve(port=port)
    until(client, seen(8))
    second.close()
    for path in second.store.folder.glob("*.seen"):
        path.unlink()
    writer.epoch()
    third = serve(port=port)
    until(client, seen(12))
    assert third.asked[0].old == 8
    assert third.asked[-1].chain[0] == writer.log.notes[0] or third.asked[-2].old == 0
    assert client.finish(PATIENCE_S) == []


def test_a_run_that_comes_back_finds_out_where_the_witness_is(serve: Callable[..., Served], writer: Writer) -> None:
    served = serve()
    first = writer.client(served.address)
    writer.epoch()
    until(first, seen(4))
    assert first.finish(PATIENCE_S) == []
    writer.epoch()
    second = writer.client(served.address)
    until(second, seen(8))
    assert second.finish(PATIENCE_S) == []


def test_a_witness_that_saw_another_future(serve: Callable[..., Served], writer: Writer, tmp_path: Path) -> None:
    """Split view: the holder of the log key shows one future to the witness, and flies another."""
    served = serve()
    other = tmp_path / "other"
    other.mkdir()
    fork = Writer(other, writer.log.fork())
    theirs = fork.client(served.address)
    fork.epoch(5)
    until(theirs, seen(6))
    theirs.finish(PATIENCE_S)
    client = writer.client(served.address)
    writer.epoch(2)
    writer.epoch(4)
    found = until(client, lambda found: any(isinstance(each, WitnessTrouble) for each in found))
    (trouble,) = [each for each in found if isinstance(each, WitnessTrouble)]
    assert "saw another log" in trouble.text
    assert client.finish(PATIENCE_S) == []  # no more answers are expected
    assert not seen(3)(found)


def test_a_witness_that_the_root_does_not_name(serve: Callable[..., Served], writer: Writer) -> None:
    client = writer.client(serve(2).address, keys=frozenset(PUBLIC[:2]))
    found = until(client, bool)
    assert found == [WitnessTrouble(found[0].text)]  # type: ignore[union-attr]
    assert "is not in the trust root" in found[0].text  # type: ignore[union-attr]
    (late,) = client.finish(0)
    assert "did not cosign the end" in late.text
    assert not anchors_path(writer.path).exists()


def test_a_log_that_the_witness_does_not_know(tmp_path: Path, writer: Writer) -> None:
    link = WitnessLink((HOST, 0), lambda request: Declined(404, "nothing is known of \x1b[31m it"))
    over = threading.Event()
    thread = threading.Thread(target=lambda: [link.serve(0.01) for _ in iter(over.is_set, True)])
    thread.start()
    client = writer.client((HOST, link.port))
    try:
        (trouble,) = until(client, bool)
        assert trouble.text.endswith("refuses to cosign: nothing is known of  [31m it")  # type: ignore[union-attr]
    finally:
        over.set()
        thread.join()
        link.close()
        client.finish(0)


def test_only_what_is_on_the_disk_is_shown(serve: Callable[..., Served], writer: Writer) -> None:
    served = serve()
    synced = [1]
    client = WitnessClient([served.address], writer.path, lambda: synced[0], frozenset(PUBLIC))
    writer.epoch()
    writer.epoch()
    until(client, seen(0))
    synced[0] = 5
    until(client, seen(4))
    assert all(int(request.note.split("\n")[1]) <= 4 for request in served.asked)
    synced[0] = 9
    until(client, seen(8))
    assert client.finish(PATIENCE_S) == []


def test_half_a_line_is_left_alone(serve: Callable[..., Served], writer: Writer) -> None:
    """A line that was partly written is cut off and written again."""
    client = writer.client(serve().address)
    whole = writer.path.read_bytes()
    with writer.path.open("ab") as file:
        file.write(b'{"_prev":"half of')
    until(client, seen(0))
    writer.path.write_bytes(whole)
    writer.epoch()
    until(client, seen(4))
    assert client.finish(PATIENCE_S) == []


def test_strangers_are_not_heard(serve: Callable[..., Served], writer: Writer) -> None:
    """Junk, malformed requests and unrequested answers are ignored."""
    served = serve()
    codec = Codec(9, 9)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.settimeout(0.2)
        for data in (b"junk", b"old 0\n\na\n\nb", b"\xff" * 500):
            for kind, name in ((REQUEST, name_of(data)), (ANSWER, name_of(data)), (REQUEST, b"another!")):
                for message in messages(kind, name, data):
                    stranger.sendto(codec.pack(message), served.address)
            stranger.sendto(data, served.address)
        with pytest.raises(TimeoutError):
            stranger.recvfrom(1_000)
        client = writer.client(served.address)
        port = client._tunnel.port
        for message in messages(ANSWER, b"12345678", b"409\n5\n"):
            stranger.sendto(codec.pack(message), (HOST, port))
        until(client, seen(0))
        assert client.finish(PATIENCE_S) == []
    assert {request.note for request in served.asked} == set(writer.log.notes[:1]), "however often it was asked"


def test_malformed_witness_answers_are_ignored(writer: Writer) -> None:
    """An attacker on the link may answer anything; the client only repeats its request."""
    codec = Codec(255, 155)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as liar:
        liar.bind((HOST, 0))
        liar.settimeout(PATIENCE_S)
        client = writer.client(liar.getsockname())
        for answer in (b"x", b"200\n", b"200\nx\n", b"409\nx\n", b"409\n5\n"):
            data, sender = liar.recvfrom(65_535)
            chunks = [codec.parse(data)[0]]
            count = bytes(chunks[0].message.payload)[11]
            chunks += [codec.parse(liar.recvfrom(65_535)[0])[0] for _ in range(count - 1)]
            name = bytes(chunks[0].message.payload)[1:9]
            for message in messages(ANSWER, answer_name(name, answer), answer):
                liar.sendto(codec.pack(message), sender)
        until(
            client,
            lambda found: any("saw another log" in each.text for each in found if isinstance(each, WitnessTrouble)),
        )
        client.finish(0)


def test_unreachable_witness_is_polled_slowly(serve: Callable[..., Served], writer: Writer) -> None:
    first = serve()
    client = writer.client(first.address)
    writer.epoch()
    found = until(client, seen(4))
    port = first.link.port
    first.close()
    for _ in range(60):
        writer.epoch(1)
    codec, counts = Codec(255, 155), []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind((HOST, port))
        deaf.settimeout(PATIENCE_S)
        while len(counts) < 40:
            (frame,) = codec.parse(deaf.recvfrom(65_535)[0])
            counts.append(bytes(frame.message.payload)[11])
    assert max(counts[-20:]) <= 6
    serve(port=port)
    found += until(client, seen(124))
    writer.close()
    assert client.finish(PATIENCE_S) == []
    notes = [each.note for each in found if isinstance(each, Anchor)]
    assert len({note.split("\n")[1] for note in notes}) == len(notes), "nothing is recorded twice"


def test_finish_times_out(writer: Writer, port: int) -> None:
    client = writer.client((HOST, port))
    writer.close()
    began_s = time.monotonic()
    (trouble,) = client.finish(0.1)
    assert time.monotonic() - began_s < PATIENCE_S
    assert "did not cosign the end" in trouble.text


def test_anchors_that_cannot_be_kept(serve: Callable[..., Served], writer: Writer) -> None:
    anchors_path(writer.path).mkdir()
    client = writer.client(serve().address)
    writer.close()
    (trouble,) = client.finish(PATIENCE_S)
    assert "not stored" in trouble.text


def test_a_thread_that_dies_says_so(writer: Writer, port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    client = writer.client((HOST, port))
    monkeypatch.setattr(client, "_read", lambda: 1 // 0)
    (trouble,) = until(client, bool)
    assert "no longer asked" in trouble.text  # type: ignore[union-attr]
    client.finish(0)


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
