"""Every margin and every kind of fault has a displayed name."""

from dataclasses import fields

from rtshcua.campaign.campaign_report import FAULTS, MARGINS, margin_told
from rtshcua.model.faults import KINDS
from rtshcua.virtual.judge import Margins


def test_every_margin_and_every_kind_of_fault_has_a_name() -> None:
    assert set(MARGINS) == {each.name for each in fields(Margins)}
    assert set(FAULTS) == {kind.__name__ for kind in KINDS.values()}
    assert set(FAULTS.values()) <= set(KINDS)
    assert FAULTS["PilotMode"] == "pilot-mode"
    assert FAULTS["GpsLoss"] == "gps-loss"
    assert (margin_told("fence_mm", 12_345), margin_told("stop_us", -250_000)) == ("12.3 m", "-0.25 s")
