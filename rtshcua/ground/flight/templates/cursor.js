"use strict";
// One cursor over the map, the heights, the timeline and the signals.
(() => {
  const GAP_MS = 5000; // after a longer silence a place is not known any more
  const begin = at => {
    const data = JSON.parse(document.getElementById("flight-data").textContent);
    const slider = document.getElementById("cursor");
    const told = document.getElementById("cursor-told");
    const NS = "http://www.w3.org/2000/svg";
    const summed = deltas => { let sum = 0; return deltas.map(each => (sum += each)); };
    const track = data.track && { t: summed(data.track.t), x: summed(data.track.x), y: summed(data.track.y), up: summed(data.track.up) };
    const signals = data.signals.map(each => ({ ...each, t: summed(each.t) }));
    const put = (parent, name, kind) => {
      const made = document.createElementNS(NS, name);
      made.setAttribute("class", kind);
      parent.append(made);
      return made;
    };
    // each chart with the places of its first and its last time on the page, and these times
    const charts = [...document.querySelectorAll("svg.timed")].map(svg => {
      const [left, right, from, to] = svg.dataset.span.split(" ").map(Number);
      return { svg, left, right, from, to };
    });
    const lines = charts.map(chart => put(chart.svg, "path", "time-line"));
    const map = data.map && document.querySelector('svg[aria-labelledby^="map-title"]');
    const here = map && track && put(map, "circle", "here");
    // the index of the last time that is not after t; -1 if there is none
    const last = (times, t) => {
      let low = -1, high = times.length - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (times[middle] <= t) low = middle; else high = middle - 1;
      }
      return low;
    };
    const clock = ms => {
      if (ms < 0) return `-${clock(-ms)}`;
      const tenths = Math.floor(ms / 100), s = Math.floor(tenths / 10);
      const rest = `${String(s % 60).padStart(2, "0")}.${tenths % 10}`;
      return s >= 3600 ? `${Math.floor(s / 3600)}:${String(Math.floor(s / 60) % 60).padStart(2, "0")}:${rest}` : `${Math.floor(s / 60)}:${rest}`;
    };
    const show = ms => {
      charts.forEach(({ svg, left, right, from, to }, n) => {
        const share = Math.min(Math.max((ms - from) / (to - from), 0), 1);
        lines[n].setAttribute("d", `M${(left + share * (right - left)).toFixed(1)} 8V${svg.viewBox.baseVal.height - 22}`);
      });
      const words = [clock(ms)];
      if (track) {
        const at = last(track.t, ms);
        const known = at >= 0 && ms - track.t[at] <= GAP_MS;
        here?.setAttribute("visibility", known ? "visible" : "hidden");
        if (known) {
          if (here) {
            here.setAttribute("r", 6);
            here.setAttribute("cx", data.map.x0 + track.x[at] * data.map.scale);
            here.setAttribute("cy", data.map.y0 - track.y[at] * data.map.scale);
          }
          const up = track.up[at] / 10;
          words.push(`${up.toFixed(1)} m above home` + (data.home === null ? "" : ` (${(up + data.home / 10).toFixed(1)} m above sea)`));
        }
      }
      for (const each of signals) {
        const at = last(each.t, ms);
        const value = at < 0 || ms - each.t[at] > each.gap ? null : each.v[at];
        words.push(`${each.name} ${value === null ? "unknown" : each.labels[value] ?? `${value / each.divide} ${each.unit}`.trim()}`);
      }
      told.textContent = words.join(" \u00b7 ");
      slider.setAttribute("aria-valuetext", words.slice(0, 2).join(", "));
    };
    const move = ({ svg, left, right, from, to }, event) => {
      const box = svg.getBoundingClientRect();
      const x = (event.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
      slider.value = from + Math.min(Math.max((x - left) / (right - left), 0), 1) * (to - from);
      show(Number(slider.value));
    };
    charts.forEach(chart => {
      chart.svg.addEventListener("pointermove", event => move(chart, event));
      chart.svg.addEventListener("pointerdown", event => move(chart, event));
    });
    slider.addEventListener("input", () => show(Number(slider.value)));
    document.getElementById("cursor-bar").hidden = false;
    slider.value = at ?? track?.t[0] ?? Math.min(...signals.map(each => each.t[0] ?? 0));
    show(Number(slider.value));
  };
  const newest = () => document.getElementById("cursor").max;
  begin(document.getElementById("growing-note") ? newest() : null);
  // the page grew: `detail` is where the cursor was, null if it follows the flight
  addEventListener("flight", event => begin(event.detail ?? newest()));
  // a link to a record opens what it is in
  const open = () => {
    const at = location.hash && document.getElementById(location.hash.slice(1));
    for (let each = at; each; each = each.parentElement) if (each.tagName === "DETAILS") each.open = true;
    if (at) at.scrollIntoView({ block: "center" });
  };
  addEventListener("hashchange", open);
  // paper has nothing to open: each decision is printed in full
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = [...document.querySelectorAll("details.decision:not([open])")];
    for (const each of closed) each.open = true;
  });
  addEventListener("afterprint", () => { for (const each of closed) each.open = false; });
  open();
})();
