"use strict";
// Map tiles behind the zones, only when the reader asks for them: the server of the tiles learns where the flight was.
(() => {
  const wanted = document.getElementById("tiles");
  const map = document.querySelector('svg[aria-labelledby^="map-title"]');
  const data = JSON.parse(document.getElementById("flight-data").textContent);
  const { scale, x0, y0, latitude, longitude, east, north } = data.map; // px per cm; degrees; cm per degree
  const radians = Math.PI / 180;
  const MOST = 64, SIZE = 256;
  const { width, height } = map.viewBox.baseVal;
  const at = (x, y) => [longitude + (x - x0) / scale / east, latitude + (y0 - y) / scale / north];
  const page = (lon, lat) => [x0 + (lon - longitude) * east * scale, y0 - (lat - latitude) * north * scale];
  // Web Mercator: the tile at a place, and the north-west corner of a tile
  const column = (lon, n) => (lon + 180) / 360 * n;
  const row = (lat, n) => (1 - Math.asinh(Math.tan(lat * radians)) / Math.PI) / 2 * n;
  const corner = (x, y, n) => [x / n * 360 - 180, Math.atan(Math.sinh(Math.PI * (1 - 2 * y / n))) / radians];
  const tiles = () => {
    const [[west, top], [right, bottom]] = [at(0, 0), at(width, height)];
    let z = Math.min(19, Math.max(0, Math.round(Math.log2(360 / (right - west) * width / SIZE))));
    for (; z >= 0; z -= 1) {
      const n = 2 ** z;
      const [x1, x2] = [column(west, n), column(right, n)].map(Math.floor);
      const [y1, y2] = [row(top, n), row(bottom, n)].map(Math.floor);
      if ((x2 - x1 + 1) * (y2 - y1 + 1) > MOST) continue;
      const found = [];
      for (let x = x1; x <= x2; x += 1) for (let y = y1; y <= y2; y += 1) found.push({ z, n, x, y });
      return found;
    }
    return [];
  };
  const drawn = () => {
    const group = document.createElementNS("http://www.w3.org/2000/svg", "g");
    group.setAttribute("class", "tiles");
    for (const { z, n, x, y } of tiles()) {
      const [left, top] = page(...corner(x, y, n)), [right, bottom] = page(...corner(x + 1, y + 1, n));
      const image = document.createElementNS("http://www.w3.org/2000/svg", "image");
      const address = wanted.dataset.tiles.replace("{z}", z).replace("{x}", ((x % n) + n) % n).replace("{y}", y);
      for (const [name, value] of Object.entries({ href: address, x: left, y: top, width: right - left, height: bottom - top, preserveAspectRatio: "none" }))
        image.setAttribute(name, value);
      group.append(image);
    }
    return group;
  };
  wanted.addEventListener("change", () => {
    map.querySelector(".tiles")?.remove();
    if (wanted.checked) map.querySelector(".sheet").after(drawn());
  });
})();
