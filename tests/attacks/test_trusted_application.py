"""Root of the guest's Linux was taken over, and reaches for the trusted application (boundary/home/optee/attack.c); and
the host damages or puts back its storage.
"""

import os
import re
import shutil
import socket
import subprocess
from contextlib import closing
from pathlib import Path

import pytest

from boundary.sessions_in_c_and_python import PIN, SIGNED_ROOT
from boundary.trusted_application import needs_optee
from reference.world import VEHICLE
from rtshcua.adapters.boundary.home import BoundaryError, kept_file
from rtshcua.adapters.boundary.optee import _BUILT, TrustedApplication, machine

pytestmark = [needs_optee, pytest.mark.soak]

BUSY, BAD_PARAMETERS, BAD_STATE = "ffff000d", "ffff0006", "ffff0007"


def begun(folder: Path) -> TrustedApplication:
    return TrustedApplication(SIGNED_ROOT, PIN, VEHICLE, folder, paced=True)


def storage(folder: Path) -> Path:
    return kept_file(folder, VEHICLE).with_suffix(".optee")


@pytest.fixture(scope="module")
def attack(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What root of the guest's Linux achieved, by attempt."""
    runs = machine(_BUILT / "attack")
    assert runs is not None
    image = tmp_path_factory.mktemp("attack") / "storage.img"
    shutil.copy(runs.folder / "storage.img", image)
    disk, (ours, theirs) = os.open(image, os.O_RDWR), socket.socketpair()
    with ours, theirs:
        words = runs.words(disk, theirs.fileno())
        emulator = subprocess.Popen(words, pass_fds=[disk, theirs.fileno()], stdin=subprocess.DEVNULL)
        theirs.close()
        os.close(disk)
        ours.settimeout(300)
        said = b""
        try:
            while not said.endswith(b"end\n"):
                more = ours.recv(4_096)
                assert more, said
                said += more
        finally:
            emulator.kill()
            emulator.wait()
    return dict(line.split(": ", 1) for line in said.decode().splitlines()[:-1])


def test_a_second_session_is_refused(attack: dict[str, str]) -> None:
    assert attack["second session"] == BUSY


def test_malformed_and_untimely_commands_are_refused(attack: dict[str, str]) -> None:
    for name in ("call before the setup", "look before the setup", "setup of no size", "a second setup"):
        assert attack[name] == BAD_STATE, name
    for name in ("more than there is", "memory that is too small", "other parameters"):
        assert attack[name] == BAD_PARAMETERS, name
    assert attack["call after a refused setup"] == "00000000 b"


@pytest.mark.parametrize(
    ("name", "pages"), [("flash of the firmware", 256), ("secure UART", 1), ("secure GPIO", 1), ("secure RAM", 4_096)]
)
def test_every_page_of_the_secure_world_is_out_of_reach(name: str, pages: int, attack: dict[str, str]) -> None:
    assert attack[name] == f"{pages} pages, {2 * pages} faults, 0 not mapped, 0 READ, 0 WRITTEN"


def test_a_device_of_the_normal_world_is_in_reach(attack: dict[str, str]) -> None:
    assert " 1 READ" in attack["device of the normal world"]


def test_what_is_kept_outlives_the_machine(tmp_path: Path) -> None:
    with closing(begun(tmp_path)) as first:
        assert first.counter == 0
    with closing(begun(tmp_path)) as second:
        assert second.counter > 0


def test_damaged_storage_is_noticed(tmp_path: Path) -> None:
    """Of any file of secure storage, `dirf.db` and numbers: nothing begins, now or later."""
    begun(tmp_path).close()
    image = storage(tmp_path)
    subprocess.run(["/usr/sbin/e2fsck", "-fy", image], capture_output=True, check=False)  # replays the journal
    whole = image.read_bytes()
    entries = [line.split("/") for line in of_image(image, "ls -p /").splitlines()]
    names = [entry[5] for entry in entries if len(entry) > 5 and re.fullmatch(r"dirf\.db|[0-9a-f]+", entry[5])]
    assert len(names) > 1
    slugs = set()
    for name in names:
        octets = bytearray(whole)
        for block in map(int, of_image(image, f"blocks /{name}").split()):
            at = block * 1_024
            octets[at : at + 1_024] = bytes(each ^ 1 for each in octets[at : at + 1_024])
        image.write_bytes(octets)
        for _ in range(2):
            with pytest.raises(BoundaryError) as raised:
                begun(tmp_path).close()
        slugs.add(raised.value.slug)
        image.write_bytes(whole)
    assert slugs == {"damaged", "not-begun"}, "the object that is kept, and what OP-TEE needs to find it"
    begun(tmp_path).close()


def of_image(image: Path, what: str) -> str:
    words = ["/usr/sbin/debugfs", "-R", what, str(image)]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


def test_an_old_image_that_is_put_back_is_accepted(tmp_path: Path) -> None:
    """No monotonic counter: the documented limit of this home."""
    begun(tmp_path).close()
    old = storage(tmp_path).read_bytes()
    with closing(begun(tmp_path)) as second:
        newer = second.counter
    storage(tmp_path).write_bytes(old)
    with closing(begun(tmp_path)) as third:
        assert third.counter == newer


def test_another_run_has_the_vehicle(tmp_path: Path) -> None:
    with closing(begun(tmp_path)):
        with pytest.raises(BoundaryError) as raised:
            begun(tmp_path)
        assert raised.value.slug == "in-use"
