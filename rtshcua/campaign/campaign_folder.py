"""A campaign's folder: its settings, results, report, and failures as scenarios.

- `campaign.json`: the settings that must be equal to continue the campaign
- `results.jsonl`: one line per flight, written to disk at once
- `report.html`, `report.json`: rewritten whenever the campaign stops
- `failures/SLUG.rts`: the smallest flight with this failure, as a scenario
"""

from pathlib import Path
from typing import Final

import msgspec

from rtshcua.adapters.store.reading import open_regular, read_if_there
from rtshcua.adapters.store.writing import append, make_folder, replace, write_new
from rtshcua.campaign.campaign_report import CampaignSummary, as_json, report_page
from rtshcua.campaign.rounds import CampaignResult, read_results, result_line
from rtshcua.diagnostics.refusal import Refusal

_LARGEST: Final = 1 << 16


class CampaignIdentity(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The settings that identify a campaign: with equal settings, flight N is drawn and flown alike.

    `bundle` is the SHA-256 of the bundle, `kinds` the kinds of faults, `version` that of this program, `approved`
    whether requested approvals are given.
    """

    mission: str
    issued_at_us: int
    bundle: str
    seed: int
    flavours: tuple[str, ...]
    kinds: tuple[str, ...]
    version: str
    approved: bool = False


class CampaignFolder:
    """A campaign's folder, created if it is missing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.report = path / "report.html"

    def identity(self) -> CampaignIdentity | Refusal | None:
        """Return the settings of the campaign in this folder; None if it is empty."""
        if self.path.exists() and not self.path.is_dir():
            return Refusal("usage", f"`{self.path}` is not a folder", "`-o` expects a campaign's folder")
        kept = read_if_there(self.path / "campaign.json", _LARGEST)
        if kept is None:
            return None
        try:
            return msgspec.json.decode(kept, type=CampaignIdentity)
        except msgspec.MsgspecError:
            return Refusal("malformed", f"`{self.path / 'campaign.json'}` is malformed", _ANOTHER)

    def begin(self, identity: CampaignIdentity) -> None:
        """Begin a campaign. Raise OSError; FileExistsError if another process began one meanwhile."""
        make_folder(self.path)
        write_new(self.path / "campaign.json", msgspec.json.format(msgspec.json.encode(identity)) + b"\n")

    def past(self) -> dict[int, CampaignResult]:
        """Return the results so far, by number. A truncated last line is terminated, so that the next result has its
        own.
        """
        path = self.path / "results.jsonl"
        try:
            with open_regular(path) as file:
                lines = file.readlines()
        except FileNotFoundError:
            return {}
        if lines and not lines[-1].endswith(b"\n"):
            append(path, b"\n")
        return read_results(lines)

    def keep(self, result: CampaignResult) -> None:
        """Store a result on disk."""
        append(self.path / "results.jsonl", result_line(result))

    def tell(self, summary: CampaignSummary) -> None:
        """Write the report, replacing an earlier one."""
        replace(self.path / "report.json", msgspec.json.format(msgspec.json.encode(as_json(summary))) + b"\n")
        replace(self.report, report_page(summary).encode())

    def scenario(self, slug: str) -> Path:
        """Return the path of the smallest scenario with this failure."""
        return self.path / "failures" / f"{slug}.rts"

    def save(self, slug: str, text: str) -> None:
        """Store the smallest scenario with this failure."""
        make_folder(self.path / "failures")
        replace(self.scenario(slug), text.encode())


_ANOTHER: Final = "name another folder with `-o`, or delete this one"
