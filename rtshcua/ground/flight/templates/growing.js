"use strict";
// Fetches the page again while the flight lasts, and shows what is new.
(() => {
  const EVERY_MS = 2000;
  let tag = null;
  const opened = () => new Set([...document.querySelectorAll("details[open][id]")].map(each => each.id));
  const show = text => {
    const fresh = new DOMParser().parseFromString(text, "text/html");
    const before = opened();
    const slider = document.getElementById("cursor");
    const following = Number(slider.value) >= Number(slider.max) - 1000;
    const at = slider.value, focus = document.activeElement?.id;
    for (const part of ["header", "main", "#flight-data"]) {
      const now = document.querySelector(part), then = fresh.querySelector(part);
      if (now && then) now.replaceWith(document.adoptNode(then));
    }
    document.title = fresh.title;
    for (const each of before) document.getElementById(each)?.setAttribute("open", "");
    dispatchEvent(new CustomEvent("flight", { detail: following ? null : at }));
    document.getElementById(focus)?.focus({ preventScroll: true });
    return fresh.querySelector(".said.growing") !== null;
  };
  const lost = text => {
    const note = document.getElementById("growing-note");
    if (note) note.textContent = text;
  };
  const poll = async () => {
    let growing = true;
    try {
      const found = await fetch(location.pathname, { headers: tag ? { "If-None-Match": tag } : {}, cache: "no-store" });
      if (found.status === 200) {
        growing = show(await found.text());
        tag = found.headers.get("ETag");
      } else if (found.status !== 304) throw new Error(String(found.status));
      if (!growing) { location.reload(); return; }
    } catch {
      lost("The connection to `rtshcua watch` is lost; this is what was known until then.");
    }
    setTimeout(poll, EVERY_MS);
  };
  setTimeout(poll, EVERY_MS);
})();
