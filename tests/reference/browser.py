"""A browser, if one is installed: a page after its layout, and what the browser says of it.

`dumped` and `layout` start a browser for one look at a page. `running` keeps one in which `opened` opens pages that a
test works with.
"""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape, unescape
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
#: the least width of a window; a phone is emulated by a frame
NARROWEST = 500
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


def layout(tmp_path: Path, text: str, width: int) -> dict[str, Any]:
    """What `PROBE` measures on a page of this width."""
    text = re.sub(r"<meta http-equiv.*?>", "", text).replace("</body>", f"<script>{PROBE}</script></body>")
    found = re.search(r'data-found="(.*?)"', dumped(tmp_path, text, width)[0])
    assert found is not None
    measured: dict[str, Any] = json.loads(unescape(found[1]))
    return measured


#: axe-core, as `.make/clients` installs it
AXE = Path(__file__).parents[2] / "build/npm/node_modules/axe-core/axe.min.js"
#: the success criteria of WCAG 2.2, level A and AA
_LEVELS = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22a", "wcag22aa")


@contextmanager
def running() -> Iterator[Browser]:
    """The installed browser, without a window."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


@dataclass
class OpenPage:
    """A page in the browser: `page` to work with, its warnings and errors, and the addresses that it requested."""

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def axe(self) -> list[str]:
        """The violations of WCAG 2.2, level A and AA, each with the element."""
        self.page.evaluate(AXE.read_text(encoding="utf-8"))
        options = {"runOnly": {"type": "tag", "values": _LEVELS}}
        found = self.page.evaluate("options => axe.run(document, options)", options)
        return [f"{each['id']}: {node['html']}" for each in found["violations"] for node in each["nodes"]]


@contextmanager
def opened(
    browser: Browser, file: Path, *, width: int = 1280, dark: bool = False, before: str = ""
) -> Iterator[OpenPage]:
    """A page from a file, in a window of this width, of a reader who prefers light or dark. The script `before` runs
    before those of the page.
    """
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light", reduced_motion="reduce"
    )
    context.add_init_script(before)
    page = context.new_page()
    found = OpenPage(page)
    page.on("console", lambda said: found.errors.append(said.text) if said.type in ("warning", "error") else None)
    page.on("pageerror", lambda error: found.errors.append(str(error)))
    page.on("request", lambda request: found.requests.append(request.url))
    page.goto(file.as_uri())
    yield found
    context.close()
