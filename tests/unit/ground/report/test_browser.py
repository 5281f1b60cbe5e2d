"""The page in a browser, if one is installed: it fits, it reports no errors, and it fetches nothing."""

import json
import re
import shutil
import subprocess
from html import escape
from pathlib import Path

import pytest

from rtshcua.front.cli.app import main
from rtshcua.ground.report.html_page import page
from rtshcua.ground.report.report_model import PolicyReport

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
#: the least width of a window; a phone is emulated by a frame
NARROWEST = 500
WIDTHS = [390, 820, 1280]
#: a script that measures the drawings, in a copy of the page that permits it
PROBE = """
const box = each => each.getBoundingClientRect();
const wide = [...document.querySelectorAll('body *')].filter(each =>
  box(each).right > innerWidth + 1 && !each.closest('.wide, .map, .skip')).map(each => each.outerHTML.slice(0, 80));
const thin = [...document.querySelectorAll('p, li, td, th, caption, figcaption, h4')].filter(each =>
  box(each).width < 60 && box(each).height > 150).map(each => each.outerHTML.slice(0, 80));
const over = [];
for (const map of document.querySelectorAll('.map svg')) {
  const texts = [...map.querySelectorAll('text')].map(box);
  texts.forEach((one, n) => texts.slice(n + 1).forEach(two => {
    if (one.left < two.right - 1 && two.left < one.right - 1 && one.top < two.bottom - 3 && two.top < one.bottom - 3)
      over.push([one, two]);
  }));
}
const scroll = document.documentElement.scrollWidth;
parent.document.body.dataset.found = JSON.stringify({scroll, inner: innerWidth, wide, thin, over});
"""

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]


def dumped(tmp_path: Path, text: str, width: int) -> tuple[str, str]:
    """The page after layout, and the messages of the browser."""
    file = tmp_path / "page.html"
    if width < NARROWEST:
        text = f'<body><iframe srcdoc="{escape(text)}" style="width:{width}px;height:800px;border:0"></iframe></body>'
    file.write_text(text, encoding="utf-8")
    assert CHROMIUM is not None
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--window-size={max(width, NARROWEST)},900",
        "--enable-logging=stderr",
    ]
    done = subprocess.run(
        [CHROMIUM, *options, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", file.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    return done.stdout, done.stderr


@pytest.mark.parametrize("width", WIDTHS)
def test_page_fits_and_labels_do_not_overlap(tmp_path: Path, everything: PolicyReport, width: int) -> None:
    text = re.sub(r"<meta http-equiv.*?>", "", page(everything)).replace("</body>", f"<script>{PROBE}</script></body>")
    dom, _ = dumped(tmp_path, text, width)
    found = re.search(r'data-found="(.*?)"', dom)
    assert found is not None
    measured = json.loads(
        found[1].replace("&quot;", '"').replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
    )
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
    text = re.sub(r"<meta http-equiv.*?>", "", made).replace("</body>", f"<script>{PROBE}</script></body>")
    dom, _ = dumped(tmp_path, text, width)
    found = re.search(r'data-found="(.*?)"', dom)
    assert found is not None
    measured = json.loads(found[1].replace("&quot;", '"'))
    assert measured["scroll"] <= measured["inner"] == width
    assert (measured["wide"], measured["thin"], measured["over"]) == ([], [], [])
    assert "CONSOLE" not in dumped(tmp_path, made, width)[1]


def test_browser_reports_no_errors(tmp_path: Path, everything: PolicyReport) -> None:
    _, said = dumped(tmp_path, page(everything), 1200)
    assert "CONSOLE" not in said
