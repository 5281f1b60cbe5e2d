"""A browser, if one is installed: a page after its layout, and what the browser says of it."""

import json
import re
import shutil
import subprocess
from html import escape, unescape
from pathlib import Path
from typing import Any

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
