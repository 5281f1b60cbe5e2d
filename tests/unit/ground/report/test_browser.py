"""The page in a browser, if one is installed: it fits, it reports no errors, and it fetches nothing."""

from pathlib import Path

import pytest

from reference.browser import AXE, CHROMIUM, dumped, layout, opened, running
from rtshcua.front.cli.app import main
from rtshcua.ground.report.html_page import page
from rtshcua.ground.report.report_model import PolicyReport

WIDTHS = [390, 820, 1280]

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]


@pytest.mark.parametrize("width", WIDTHS)
def test_page_fits_and_labels_do_not_overlap(tmp_path: Path, everything: PolicyReport, width: int) -> None:
    measured = layout(tmp_path, page(everything), width)
    assert measured["scroll"] <= measured["inner"] == width
    assert measured["wide"] == []
    assert measured["thin"] == []
    assert measured["over"] == []


@pytest.mark.parametrize("width", WIDTHS)
def test_map_of_a_refused_mission_fits(tmp_path: Path, width: int) -> None:
    mission = """import "lib:policies/bridge_inspection.rts"
    mission past under bridge_inspection@7 on quad {
      proposed by agent openclaw for role operator
      phase departure { takeoff(altitude = 20 m) }
      phase inspection { goto(47.39700 N, 8.54640 E, altitude = 20 m)  goto(47.39760 N, 8.54900 E, altitude = 20 m) }
      phase recovery { return_home() }
    }"""
    (tmp_path / "past.rts").write_text(mission)
    main(["check", str(tmp_path / "past.rts"), "--map", str(tmp_path / "map.html")])
    made = (tmp_path / "map.html").read_text(encoding="utf-8")
    measured = layout(tmp_path, made, width)
    assert measured["scroll"] <= measured["inner"] == width
    assert (measured["wide"], measured["thin"], measured["over"]) == ([], [], [])
    assert "CONSOLE" not in dumped(tmp_path, made, width)[1]


def test_browser_reports_no_errors(tmp_path: Path, everything: PolicyReport) -> None:
    _, said = dumped(tmp_path, page(everything), 1200)
    assert "CONSOLE" not in said


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed")
def test_page_is_accessible(tmp_path: Path, everything: PolicyReport) -> None:
    file = tmp_path / "page.html"
    file.write_text(page(everything), encoding="utf-8")
    with running() as browser:
        for width in WIDTHS:
            for dark in (False, True):
                with opened(browser, file, width=width, dark=dark) as shown:
                    assert shown.axe() == []
