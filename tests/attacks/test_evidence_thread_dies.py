"""The evidence thread dies of an error that is not a disk error: this is reported, and later lines do not count as
stored.
"""

from pathlib import Path

from rtshcua.adapters.store.evidence_file import EvidenceFile, EvidenceWriter
from rtshcua.model.durability import WRITTEN


class Breaking(EvidenceFile):
    """A file that fails with an unexpected error."""

    def append(self, line: bytes, durability: int) -> None:
        if line == b"bad\n":
            raise ValueError("as no file should")
        super().append(line, durability)


def test_thread_death_is_reported_and_later_lines_are_not_kept(tmp_path: Path) -> None:
    writer = EvidenceWriter(Breaking(tmp_path / "log"))
    for line in (b"good\n", b"bad\n", b"lost\n"):
        writer.append(line, WRITTEN)
    writer.close()
    assert writer.trouble() == "as no file should"
    assert writer.kept < 2
    assert writer.waiting, "so the log does not count as whole"
