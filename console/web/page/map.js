// The map: Web Mercator on a canvas, north up; tiles where there are some, a grid in metres everywhere.
import { $, el, state, select, figure, canAct } from "/page.js";
import { LEGEND, drawIntents, drawMeetings } from "/intents.js";

const EARTH_M = 40075016.686;
const OPEN = { routes: true, intents: true, fences: true, trails: true, pairs: true, views: true, objects: true, salient: true, areas: true, labels: true, tiles: true };
const NAMES = { trails: "trails", routes: "routes and manoeuvres", intents: "intents and meetings", fences: "geofences", pairs: "close pairs", views: "fields of view", objects: "objects", salient: "saliency", areas: "areas", labels: "names", tiles: "tiles" };
const AHEAD_S = 4, AIRCRAFT_S = 30, OLD_US = 15e6;

const mercator = ([latitude, longitude]) => {
  const sine = Math.sin((Math.max(-85, Math.min(85, latitude)) * Math.PI) / 180);
  return [longitude / 360 + 0.5, 0.5 - Math.log((1 + sine) / (1 - sine)) / (4 * Math.PI)];
};
const degrees = (x, y) => [(Math.atan(Math.sinh(Math.PI * (1 - 2 * y))) * 180) / Math.PI, (x - 0.5) * 360];

export class MapView {
  constructor() {
    this.canvas = $("map");
    this.c = this.canvas.getContext("2d");
    this.centre = [0.5, 0.5]; this.scale = 2 ** 9; this.isMoved = false; this.fitted = 0; this.layers = { ...OPEN };
    this.tiles = new Map(); this.picking = null; this.isWaiting = false; this.frames = 0;
    new ResizeObserver(() => this.changed()).observe($("map-box"));
    $("zoom-in").onclick = () => this.zoom(1);
    $("zoom-out").onclick = () => this.zoom(-1);
    $("fit").onclick = () => this.fit();
    $("layers").onclick = () => this.toggleLayers();
    $("layer-list").append(...Object.entries(NAMES).map(([name, words]) => el("label", {},
      el("input", { type: "checkbox", checked: OPEN[name], on: { change: (event) => { this.layers[name] = event.target.checked; this.changed(); } } }), words)), el("p", { cls: "legend", text: LEGEND }));
    this.listen();
  }

  listen() {
    const canvas = this.canvas;
    const fingers = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, [event.offsetX, event.offsetY]); moved = 0; });
    canvas.addEventListener("pointermove", (event) => {
      this.showCursor(event.offsetX, event.offsetY);
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = [event.offsetX, event.offsetY];
      if (fingers.size === 1) {
        moved += Math.abs(now[0] - before[0]) + Math.abs(now[1] - before[1]);
        if (moved > 4) { this.isMoved = true; this.centre[0] -= (now[0] - before[0]) / this.scale; this.centre[1] -= (now[1] - before[1]) / this.scale; }
      } else {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        const ratio = Math.hypot(now[0] - other[0], now[1] - other[1]) / Math.max(1, Math.hypot(before[0] - other[0], before[1] - other[1]));
        this.zoomAt(other[0], other[1], ratio); moved = 99;
      }
      fingers.set(event.pointerId, now);
      this.changed();
    });
    const end = (event) => {
      if (fingers.delete(event.pointerId) && moved <= 4 && event.type === "pointerup") this.clicked(event.offsetX, event.offsetY);
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoomAt(event.offsetX, event.offsetY, Math.exp(-event.deltaY / 400)); }, { passive: false });
  }

  // -- moving -----------------------------------------------------------------------------------------------------

  size() { return [this.canvas.clientWidth, this.canvas.clientHeight]; }
  toScreen(at) { const [x, y] = mercator(at); const [w, h] = this.size(); return [(x - this.centre[0]) * this.scale + w / 2, (y - this.centre[1]) * this.scale + h / 2]; }
  toDegrees(px, py) { const [w, h] = this.size(); return degrees(this.centre[0] + (px - w / 2) / this.scale, this.centre[1] + (py - h / 2) / this.scale); }
  metresPerPixel() { const [latitude] = degrees(...this.centre); return (EARTH_M * Math.cos((latitude * Math.PI) / 180)) / this.scale; }
  zoom(step) { const [w, h] = this.size(); this.zoomAt(w / 2, h / 2, step > 0 ? 1.5 : 1 / 1.5); }
  zoomAt(px, py, ratio) {
    this.isMoved = true;
    const [w, h] = this.size();
    const scale = Math.min(2 ** 34, Math.max(2 ** 9, this.scale * ratio));
    this.centre[0] += (px - w / 2) * (1 / this.scale - 1 / scale);
    this.centre[1] += (py - h / 2) * (1 / this.scale - 1 / scale);
    this.scale = scale; this.changed();
  }
  pan(dx, dy) { this.isMoved = true; this.centre[0] += (dx * 80) / this.scale; this.centre[1] += (dy * 80) / this.scale; this.changed(); }
  /** Until a user moves the map, it shows all platforms that have been there in the first seconds. */
  fitOnce() {
    const count = Object.values(state.rows("platforms")).filter((row) => row.at).length;
    this.fittedUntil ||= count ? performance.now() + 4000 : 0;
    if (count && !this.isMoved && (count !== this.fitted || state.about.live === false && !this.fitted) && performance.now() < this.fittedUntil) { this.fitted = count; this.fit(); }
  }
  fit() {
    const rows = Object.values(state.rows("platforms"));
    const places = [...rows.map((row) => row.at), ...Object.values(state.rows("objects")).map((row) => row.at)].filter(Boolean).map(mercator);
    const [w, h] = this.size();
    if (!places.length || !w) return false;
    const xs = places.map(([x]) => x), ys = places.map(([, y]) => y);
    const [left, right, top, low] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    this.centre = [(left + right) / 2, (top + low) / 2];
    const least = 160 / (EARTH_M * Math.cos((degrees(...this.centre)[0] * Math.PI) / 180));
    this.scale = Math.min((w * 0.72) / Math.max(right - left, least), (h * 0.66) / Math.max(low - top, least));
    this.changed();
    return rows.filter((row) => row.at).length === rows.length;
  }
  bringIntoView(unit) {
    const row = state.rows("platforms")[unit];
    if (!row || !row.at) return;
    const [x, y] = this.toScreen(row.at), [w, h] = this.size();
    if (x < 40 || y < 40 || x > w - 40 || y > h - 40) { this.centre = mercator(row.at); this.changed(); }
  }
  toggleLayers() { const list = $("layer-list"); list.hidden = !list.hidden; $("layers").setAttribute("aria-expanded", String(!list.hidden)); if (!list.hidden) list.querySelector("input").focus(); }
  pick(hint, done) { this.picking = done; $("hint").textContent = hint; $("hint").hidden = false; this.canvas.focus(); }
  unpick() { const was = this.picking !== null; this.picking = null; $("hint").hidden = true; return was; }
  clicked(px, py) {
    if (this.picking) { const done = this.picking; this.unpick(); done(...this.toDegrees(px, py)); return; }
    let nearest = null, least = 26;
    for (const [unit, row] of Object.entries(state.rows("platforms"))) {
      if (!row.at) continue;
      const [x, y] = this.toScreen(row.at), apart = Math.hypot(x - px, y - py);
      if (apart < least) { least = apart; nearest = unit; }
    }
    select(nearest);
  }
  showCursor(px, py) {
    const [latitude, longitude] = this.toDegrees(px, py);
    const base = this.base();
    const metres = base ? `  ${this.apart(base, [latitude, longitude]).map((m, i) => `${i ? "N" : "E"} ${m.toFixed(0)} m`).join("  ")}` : "";
    $("cursor").textContent = `${latitude.toFixed(5)}°  ${longitude.toFixed(5)}°${metres}`;
  }
  /** Where the grid counts from: what is the origin of metres, else the first platform's place when it was seen first. */
  base() { return state.about.origin || (this.first ||= Object.values(state.rows("platforms")).find((row) => row.at)?.at); }
  apart(from, to) { const k = Math.PI / 180 * 6371008.8; return [(to[1] - from[1]) * k * Math.cos((from[0] * Math.PI) / 180), (to[0] - from[0]) * k]; }

  // -- drawing ----------------------------------------------------------------------------------------------------

  restyle() {
    const style = getComputedStyle(document.documentElement);
    this.paint = Object.fromEntries(["ground", "raised", "sunk", "line", "text", "dim", "accent", "good", "bad", "warn"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    this.changed();
  }
  changed() { if (!this.isWaiting) { this.isWaiting = true; requestAnimationFrame(() => { this.isWaiting = false; this.draw(); }); } }

  draw() {
    const [w, h] = this.size(), ratio = Math.min(2, devicePixelRatio || 1), c = this.c;
    if (!w || !this.paint) return;
    if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(h * ratio)) { this.canvas.width = Math.round(w * ratio); this.canvas.height = Math.round(h * ratio); }
    this.frames += 1;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = this.paint.sunk; c.fillRect(0, 0, w, h);
    const on = this.layers;
    if (on.tiles && state.about.tiles) this.drawTiles(w, h);
    this.drawGrid(w, h);
    if (on.areas) this.drawAreas();
    if (on.fences) this.drawFences();
    if (on.views) this.drawViews();
    if (on.salient) this.drawSalient();
    if (on.trails) this.drawTrails();
    if (on.intents) drawIntents(this);
    if (on.routes) this.drawTargets();
    if (on.objects) this.drawObjects();
    if (on.pairs) this.drawPairs();
    this.drawAlarms();
    if (on.intents) drawMeetings(this);
    this.drawPlatforms();
    this.drawScale(w, h);
  }

  drawTiles(w, h) {
    const z = Math.max(0, Math.min(19, Math.round(Math.log2(this.scale / 256))));
    const n = 2 ** z, side = this.scale / n;
    const left = Math.floor((this.centre[0] - w / 2 / this.scale) * n), right = Math.floor((this.centre[0] + w / 2 / this.scale) * n);
    const top = Math.floor((this.centre[1] - h / 2 / this.scale) * n), low = Math.floor((this.centre[1] + h / 2 / this.scale) * n);
    for (let x = left; x <= right; x++) for (let y = Math.max(0, top); y <= Math.min(n - 1, low); y++) {
      const image = this.tile(z, ((x % n) + n) % n, y);
      if (image) this.c.drawImage(image, (x / n - this.centre[0]) * this.scale + w / 2, (y / n - this.centre[1]) * this.scale + h / 2, side + 0.5, side + 0.5);
    }
  }
  tile(z, x, y) {
    const key = `${z}/${x}/${y}`;
    let known = this.tiles.get(key);
    if (!known) {
      known = { image: new Image(), isThere: false };
      known.image.onload = () => { known.isThere = true; this.changed(); };
      known.image.src = `/tiles/${key}.png`;
      this.tiles.set(key, known);
      if (this.tiles.size > 400) this.tiles.delete(this.tiles.keys().next().value);
    }
    return known.isThere ? known.image : null;
  }

  drawGrid(w, h) {
    const base = this.base(), c = this.c, mpp = this.metresPerPixel();
    if (!base) return;
    const rough = mpp * 90, power = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].map((f) => f * power).find((f) => f >= rough);
    const [x0, y0] = this.toScreen(base), side = step / mpp;
    c.lineWidth = 1; c.strokeStyle = this.paint.line; c.fillStyle = this.paint.dim; c.font = "11px system-ui"; c.globalAlpha = state.about.tiles && this.layers.tiles ? 0.5 : 1;
    c.beginPath();
    const metres = (m) => (Math.abs(m) >= 10000 ? `${m / 1000} km` : `${m} m`);
    for (let i = Math.ceil(-x0 / side); x0 + i * side < w; i++) { const x = Math.round(x0 + i * side) + 0.5; c.moveTo(x, 0); c.lineTo(x, h); }
    for (let i = Math.ceil(-y0 / side); y0 + i * side < h; i++) { const y = Math.round(y0 + i * side) + 0.5; c.moveTo(0, y); c.lineTo(w, y); }
    c.stroke();
    for (let i = Math.ceil(-x0 / side); x0 + i * side < w - 60; i++) if (x0 + i * side > 40) c.fillText(metres(Math.round(i * step)), x0 + i * side + 4, 13);
    for (let i = Math.ceil(-y0 / side); y0 + i * side < h - 40; i++) if (y0 + i * side > 30) c.fillText(metres(Math.round(-i * step)), 5, y0 + i * side - 4);
    c.globalAlpha = 1;
  }

  path(places, close = false) { const c = this.c; c.beginPath(); places.forEach((at, i) => { const [x, y] = this.toScreen(at); i ? c.lineTo(x, y) : c.moveTo(x, y); }); if (close) c.closePath(); }

  drawAreas() {
    const c = this.c;
    for (const [unit, row] of Object.entries(state.rows("areas"))) {
      for (const ring of String(row.border).split(";")) {
        const places = ring.split(",").map((pair) => pair.trim().split(/\s+/).map(Number)).filter((pair) => pair.length === 2 && pair.every(Number.isFinite));
        if (places.length < 3) continue;
        this.path(places, true);
        c.setLineDash([7, 5]); c.lineWidth = 1.5; c.strokeStyle = this.paint.accent; c.stroke(); c.setLineDash([]);
        c.globalAlpha = 0.06; c.fillStyle = this.paint.accent; c.fill(); c.globalAlpha = 1;
      }
      if (row.at) this.note(row.at, `area of ${unit}`, this.paint.dim);
    }
  }
  drawViews() {
    const c = this.c;
    for (const row of Object.values(state.rows("views"))) {
      if (!row.ring || row.ring.includes(null)) continue;
      this.path(row.ring, true);
      c.globalAlpha = 0.1; c.fillStyle = this.paint.warn; c.fill(); c.globalAlpha = 0.7; c.lineWidth = 1; c.strokeStyle = this.paint.warn; c.stroke(); c.globalAlpha = 1;
    }
  }
  drawSalient() {
    const c = this.c, mpp = this.metresPerPixel();
    for (const row of Object.values(state.rows("salient"))) {
      if (!row.at) continue;
      const [x, y] = this.toScreen(row.at), r = Math.max(7, (2 * Math.sqrt(Math.max(row.xx_m2 ?? 9, row.yy_m2 ?? 9))) / mpp);
      c.beginPath(); c.arc(x, y, r, 0, 7); c.globalAlpha = 0.25; c.fillStyle = "#cc79a7"; c.fill(); c.globalAlpha = 1; c.strokeStyle = "#cc79a7"; c.lineWidth = 2; c.stroke();
      this.note(row.at, row.label === "camera-attention" ? `${row.unit} looks: ${row.because || row.symbol}` : row.symbol, this.paint.text, r);
    }
  }
  drawTrails() {
    const c = this.c;
    c.lineWidth = 2; c.strokeStyle = this.paint.accent; c.lineJoin = "round";
    for (const [unit, trail] of Object.entries(state.trails)) {
      const row = state.rows("platforms")[unit];
      if (trail.length < 2 && !(row && row.at)) continue;
      c.globalAlpha = state.selected === null || state.selected === unit ? 0.45 : 0.2;
      this.path(row && row.at ? [...trail, row.at] : trail); c.stroke();
    }
    c.globalAlpha = 1;
  }
  /** Fences are alike for many platforms: each is drawn once, with those that it holds for. */
  drawFences() {
    const c = this.c, drawn = new Map(), mpp = this.metresPerPixel();
    for (const [unit, row] of Object.entries(state.rows("flights"))) for (const fence of row.fences) {
      const key = JSON.stringify([fence.name, fence.centre, fence.radius, fence.corners]);
      drawn.set(key, [fence, [...(drawn.get(key)?.[1] || []), unit]]);
    }
    for (const [fence, units] of drawn.values()) {
      const isOwn = fence.name === "limits", isChosen = state.selected !== null && units.includes(state.selected);
      const heights = [fence.lowest, fence.highest].every((m) => m !== null) ? `, ${fence.lowest.toFixed(0)} to ${fence.highest.toFixed(0)} m above home` : fence.highest !== null ? `, up to ${fence.highest.toFixed(0)} m` : "";
      const words = `${isOwn ? "range" : `fence ${fence.name}`} of ${units.length > 3 ? `${units.length} platforms` : units.join(", ")}${heights}`;
      c.strokeStyle = this.paint.bad; c.lineWidth = isChosen ? 2 : 1.2; c.setLineDash(isOwn ? [10, 6] : [14, 4, 3, 4]); c.globalAlpha = isChosen || !isOwn ? 0.9 : 0.45;
      if (fence.corners.length > 2) { this.path(fence.corners, true); c.stroke(); c.globalAlpha = 1; c.setLineDash([]); this.note(fence.corners[0], words, this.paint.bad); }
      else if (fence.centre && fence.radius !== null) {
        const [x, y] = this.toScreen(fence.centre), r = fence.radius / mpp;
        if (r > 4 && r < 1e5) { c.beginPath(); c.arc(x, y, r, 0, 7); c.stroke(); }
        c.globalAlpha = 1; c.setLineDash([]);
        if (r < 1e5 && (isChosen || !isOwn)) { const [w] = this.size(); this.text(Math.max(50, Math.min(w - 330, x - 60)), Math.max(30, y - r + 16), words, this.paint.bad, "12px system-ui"); }
      }
      c.setLineDash([]); c.globalAlpha = 1;
    }
  }
  drawTargets() {
    const c = this.c, platforms = state.rows("platforms"), flights = state.rows("flights");
    for (const [unit, row] of Object.entries(flights)) {
      const from = platforms[unit];
      if (!from || !from.at) continue;
      const isChosen = state.selected === unit, followed = row.doing?.startsWith("follows ") ? shownObjects().find((each) => each.symbol === row.doing.slice(8)) : null;
      const ahead = followed ? [followed.at] : row.ahead;
      if (!ahead.length) continue;
      c.globalAlpha = state.selected === null || isChosen ? 1 : 0.35;
      c.setLineDash([3, 6]); c.lineWidth = isChosen ? 2.5 : 1.5; c.strokeStyle = c.fillStyle = this.paint.good;
      this.path([from.at, ...ahead], false); c.stroke(); c.setLineDash([]);
      ahead.forEach((at, i) => { const [x, y] = this.toScreen(at); c.beginPath(); c.arc(x, y, i ? 3.5 : 7, 0, 7); c.stroke(); if (i) c.fill(); });
      c.globalAlpha = 1;
      const words = followed ? `${unit} ${row.doing}` : row.commander === "route" ? "" : `${unit} to ${figure(row.altitude, " m", 0)}`;
      if (words) this.note(ahead[0], words, this.paint.good, 10);
      if (row.commander === "avoidance") { const [x, y] = this.toScreen(from.at); this.text(x + 15, y + 26, `gives way, to ${figure(row.altitude, " m", 0)}`, this.paint.good, "600 12px system-ui"); }
    }
    for (const row of Object.values(state.rows("targets"))) {
      const from = platforms[row.unit];
      if (row.kind === "goto" && row.at && from && from.at && !flights[row.unit]) {
        const [x, y] = this.toScreen(row.at);
        this.path([from.at, row.at]);
        c.setLineDash([3, 6]); c.lineWidth = 2; c.strokeStyle = this.paint.good; c.stroke(); c.setLineDash([]);
        c.beginPath(); c.arc(x, y, 8, 0, 7); c.moveTo(x - 12, y); c.lineTo(x + 12, y); c.moveTo(x, y - 12); c.lineTo(x, y + 12); c.stroke();
        this.note(row.at, `${row.unit} to ${figure(row.at[2], " m", 0)}`, this.paint.good, 12);
      } else if (row.kind === "avoid" && !this.layers.intents && from && from.at && state.t - row.at_us < 15e6 && flights[row.unit]?.commander !== "avoidance") {
        const [x, y] = this.toScreen(from.at);
        this.text(x + 15, y + 26, row.by !== row.unit ? "agrees" : row.because ? "leaves it to the other" : "makes room", this.paint.good, "600 12px system-ui");
      }
    }
  }
  drawObjects() {
    const c = this.c, mpp = this.metresPerPixel();
    for (const row of shownObjects()) {
      if (row.label === "traffic") { if (state.t - row.valid_us < OLD_US) this.drawAircraft(row); continue; }
      const [x, y] = this.toScreen(row.at), certain = row.existence ?? 1;
      c.globalAlpha = 0.35 + 0.65 * Math.min(1, certain);
      c.strokeStyle = this.paint.text; c.fillStyle = OBJECT_PAINT[row.colour] || "#e69f00"; c.lineWidth = 1.5;
      const r = 5.5;
      c.beginPath(); c.moveTo(x, y - r); c.lineTo(x + r, y); c.lineTo(x, y + r); c.lineTo(x - r, y); c.closePath();
      if (row.by === "" ) { c.setLineDash([2, 2]); c.stroke(); c.setLineDash([]); } else { c.fill(); c.stroke(); }
      if (row.sd_m > 0 && row.sd_m / mpp > 7) { c.globalAlpha = 0.5; c.lineWidth = 1; c.beginPath(); c.arc(x, y, (2 * row.sd_m) / mpp, 0, 7); c.stroke(); }
      if (row.vx_m_s !== undefined && Math.hypot(row.vx_m_s, row.vy_m_s) > 0.5) {
        c.globalAlpha = 0.8; c.lineWidth = 1.5; c.setLineDash([4, 3]); c.beginPath(); c.moveTo(x, y); c.lineTo(x + (row.vx_m_s * AHEAD_S) / mpp, y - (row.vy_m_s * AHEAD_S) / mpp); c.stroke(); c.setLineDash([]);
      }
      for (const [, at, weight] of row.others && row.others.length > 1 ? row.others : []) {
        if (!at) continue;
        const [ox, oy] = this.toScreen(at);
        c.globalAlpha = 0.7; c.lineWidth = 1; c.setLineDash([2, 3]); c.beginPath(); c.moveTo(x, y); c.lineTo(ox, oy); c.stroke(); c.beginPath(); c.arc(ox, oy, 4 + 5 * weight, 0, 7); c.stroke(); c.setLineDash([]);
        if (mpp < 0.8) this.note(at, `${Math.round(weight * 100)} %`, this.paint.dim, 4);
      }
      c.globalAlpha = 1;
      if (this.layers.labels && mpp < 0.8) this.note(row.at, `${row.name}${row.types && row.types.includes(",") ? ` ${row.types}` : row.type ? ` ${row.type}` : ""}${row.existence !== undefined ? ` ${Math.round(row.existence * 100)} %` : ""}`, this.paint.dim, 7);
    }
  }
  /** An aircraft that is no member: where it is, within what, where it is in half a minute, and how high. */
  drawAircraft(row) {
    const c = this.c, mpp = this.metresPerPixel(), [x, y] = this.toScreen(row.at), r = 8;
    c.strokeStyle = c.fillStyle = this.paint.bad; c.lineWidth = 2; c.globalAlpha = 1;
    c.beginPath(); c.moveTo(x - r, y - r); c.lineTo(x + r, y + r); c.moveTo(x + r, y - r); c.lineTo(x - r, y + r); c.stroke();
    if (row.sd_m / mpp > r) { c.globalAlpha = 0.5; c.lineWidth = 1; c.beginPath(); c.arc(x, y, row.sd_m / mpp, 0, 7); c.stroke(); }
    if (row.vx_m_s !== undefined && row.vy_m_s !== undefined) {
      c.globalAlpha = 0.8; c.lineWidth = 1.5; c.setLineDash([8, 5]); c.beginPath(); c.moveTo(x, y); c.lineTo(x + (row.vx_m_s * AIRCRAFT_S) / mpp, y - (row.vy_m_s * AIRCRAFT_S) / mpp); c.stroke(); c.setLineDash([]);
    }
    c.globalAlpha = 1;
    this.note(row.at, `${row.callsign || row.symbol} ${row.kind || ""} ${figure(row.altitude_m, " m", 0)}`, this.paint.bad, 7);
  }
  drawPairs() {
    const c = this.c, platforms = state.rows("platforms");
    for (const row of Object.values(state.rows("pairs"))) {
      const [one, other] = row.units.map((unit) => platforms[unit] && platforms[unit].at);
      if (!one || !other) continue;
      this.path([one, other]);
      c.lineWidth = 1.5; c.strokeStyle = this.paint.warn; c.setLineDash([5, 4]); c.stroke(); c.setLineDash([]);
      this.side([(one[0] + other[0]) / 2, (one[1] + other[1]) / 2], `${row.apart.toFixed(0)} m${row.above === null ? "" : ` ↕ ${row.above.toFixed(0)} m`}`, this.paint.warn);
    }
  }
  drawAlarms() {
    const c = this.c, platforms = state.rows("platforms"), others = Object.fromEntries(shownObjects().map((row) => [row.symbol, row]));
    for (const [, alarm] of state.openAlarms()) {
      const places = alarm.units.map((unit) => (platforms[unit] || others[unit])?.at).filter(Boolean);
      if (places.length > 1) { this.path(places); c.lineWidth = 4; c.strokeStyle = this.paint.bad; c.globalAlpha = 0.75; c.stroke(); c.globalAlpha = 1; }
      for (const at of places) { const [x, y] = this.toScreen(at); c.beginPath(); c.arc(x, y, 21, 0, 7); c.lineWidth = 3; c.strokeStyle = this.paint.bad; c.stroke(); }
    }
  }
  drawPlatforms() {
    const c = this.c, rows = Object.entries(state.rows("platforms")), isMany = rows.length > 24;
    for (const [unit, row] of rows) {
      if (!row.at) continue;
      const [x, y] = this.toScreen(row.at), isChosen = unit === state.selected;
      const isOld = row.state !== "alive" || state.t - row.valid_us > 3e6, turn = row.heading ?? row.course;
      c.save(); c.translate(x, y);
      if (isChosen) { c.beginPath(); c.arc(0, 0, 25, 0, 7); c.lineWidth = 2; c.strokeStyle = this.paint.accent; c.setLineDash([6, 4]); c.stroke(); c.setLineDash([]); }
      if (row.speed > 0.5 && row.course !== undefined) {
        const reach = Math.min(90, (row.speed * AHEAD_S) / this.metresPerPixel()), a = (row.course * Math.PI) / 180;
        c.beginPath(); c.moveTo(0, 0); c.lineTo(Math.sin(a) * reach, -Math.cos(a) * reach); c.lineWidth = 1.5; c.strokeStyle = this.paint.text; c.globalAlpha = 0.6; c.stroke(); c.globalAlpha = 1;
      }
      c.fillStyle = isOld ? this.paint.dim : this.paint.accent; c.strokeStyle = this.paint.raised; c.lineWidth = 2;
      c.beginPath();
      if (turn === undefined) c.arc(0, 0, 8, 0, 7);
      else { c.rotate((turn * Math.PI) / 180); c.moveTo(0, -14); c.lineTo(9.5, 10); c.lineTo(0, 5); c.lineTo(-9.5, 10); c.closePath(); }
      c.fill(); c.stroke(); c.restore();
      if (!this.layers.labels) continue;
      const low = row.battery !== undefined && row.battery !== null && row.battery < 0.2;
      const said = [row.altitude === undefined ? null : figure(row.altitude, " m", 0), low ? `▼ ${Math.round(row.battery * 100)} %` : null, isOld ? `old ${row.state === "alive" ? "" : row.state}` : null].filter(Boolean).join("  ");
      this.text(x + 15, y - 3, unit, this.paint.text, "600 13px system-ui");
      if (!isMany || isChosen) this.text(x + 15, y + 11, said, low || isOld ? this.paint.bad : this.paint.dim, "11.5px system-ui");
    }
  }
  note(at, words, paint, lift = 0) { if (this.layers.labels) { const [x, y] = this.toScreen(at); this.text(x + 6, y - 6 - lift, words, paint, "12px system-ui"); } }
  side(at, words, paint) { if (this.layers.labels) { const [x, y] = this.toScreen(at); this.c.font = "12px system-ui"; this.text(x - 8 - this.c.measureText(words).width, y + 4, words, paint, "12px system-ui"); } }
  text(x, y, words, paint, font) {
    const c = this.c;
    c.font = font; c.lineWidth = 3; c.lineJoin = "round"; c.strokeStyle = this.paint.sunk; c.globalAlpha = 0.85; c.strokeText(words, x, y); c.globalAlpha = 1; c.fillStyle = paint; c.fillText(words, x, y);
  }
  drawScale(w, h) {
    const c = this.c, mpp = this.metresPerPixel(), rough = mpp * 110, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5].map((f) => f * power).filter((f) => f <= rough).pop(), long = step / mpp, x = w - 20 - long, y = h - 36;
    c.lineWidth = 2; c.strokeStyle = this.paint.text; c.beginPath(); c.moveTo(x, y - 5); c.lineTo(x, y); c.lineTo(x + long, y); c.lineTo(x + long, y - 5); c.stroke();
    this.text(x + 4, y - 7, step >= 1000 ? `${step / 1000} km` : `${step} m`, this.paint.text, "12px system-ui");
    this.text(20, 40, "N", this.paint.text, "700 13px system-ui");
    c.beginPath(); c.moveTo(25, 46); c.lineTo(30, 62); c.lineTo(25, 58); c.lineTo(20, 62); c.closePath(); c.fillStyle = this.paint.text; c.fill();
  }
}

const OBJECT_PAINT = { red: "#d55e00", blue: "#0072b2", green: "#009e73", yellow: "#f0e442", white: "#ffffff", black: "#222222", grey: "#888888", gray: "#888888", silver: "#bbbbbb" };

/** The objects as they are shown, one identity each: names that platforms share stand before those of one platform. */
export function shownObjects() {
  const found = new Map();
  for (const row of Object.values(state.rows("objects"))) {
    if (!row.at) continue;
    const isShared = row.label === "global-objects" || row.label === "traffic", name = isShared ? row.symbol : row.identity || `${row.unit}:${row.symbol}`;
    const before = found.get(name);
    if (!before || (isShared && before.label !== row.label) || (before.label === row.label && row.valid_us > before.valid_us)) found.set(name, { ...row, name });
  }
  return [...found.values()];
}
