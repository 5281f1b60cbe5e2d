"""A campaign's folder: what was asked for, the results as they come, the report, and the failures as scenarios.

- `campaign.json`: what must be the same when it goes on
- `results.jsonl`: a line a flight, on the disk before the next is asked about
- `report.html`, `report.json`: made anew whenever it stops
- `failures/SLUG.rts`: the smallest flight that fails so, as a scenario
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
    """What makes a campaign the same one: a flight of this number is drawn and flown alike wherever all of it is equal.

    `bundle` is the SHA-256 of what is flown, `kinds` those of faults that are drawn, `version` that of this program,
    `approved` whether whoever is asked for an approval gives it.
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
    """The folder, which is made if it is missing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.report = path / "report.html"

    def identity(self) -> CampaignIdentity | Refusal | None:
        """What was begun here; None: nothing yet."""
        if self.path.exists() and not self.path.is_dir():
            return Refusal("usage", f"`{self.path}` is no folder", "`-o` names a campaign's folder")
        kept = read_if_there(self.path / "campaign.json", _LARGEST)
        if kept is None:
            return None
        try:
            return msgspec.json.decode(kept, type=CampaignIdentity)
        except msgspec.MsgspecError:
            return Refusal("malformed", f"`{self.path / 'campaign.json'}` is not what a campaign left", _ANOTHER)

    def begin(self, identity: CampaignIdentity) -> None:
        """Begin a campaign. Raises OSError; FileExistsError where one was begun meanwhile."""
        make_folder(self.path)
        write_new(self.path / "campaign.json", msgspec.json.format(msgspec.json.encode(identity)) + b"\n")

    def past(self) -> dict[int, CampaignResult]:
        """What was flown so far. A last line that was torn is ended, so that the next result has a line of its own."""
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
        """Keep a result, on the disk."""
        append(self.path / "results.jsonl", result_line(result))

    def tell(self, summary: CampaignSummary) -> None:
        """Write the report, over an earlier one."""
        replace(self.path / "report.json", msgspec.json.format(msgspec.json.encode(as_json(summary))) + b"\n")
        replace(self.report, report_page(summary).encode())

    def scenario(self, slug: str) -> Path:
        """Where the smallest flight that fails so is kept."""
        return self.path / "failures" / f"{slug}.rts"

    def save(self, slug: str, text: str) -> None:
        """Keep it."""
        make_folder(self.path / "failures")
        replace(self.scenario(slug), text.encode())


_ANOTHER: Final = "give another folder with `-o`, or take this one away"
