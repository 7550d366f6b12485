// Small drawings: what a monitor showed, who said what to whom, who streams to whom, when alarms were open.
import { clockText, span, state } from "/page.js";

function prepared(canvas, height) {
  const w = canvas.clientWidth || 300, h = height ?? canvas.clientHeight, ratio = Math.min(2, devicePixelRatio || 1);
  if (height) canvas.style.height = `${height}px`;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) { canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio); }
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, w, h);
  return [c, w, h];
}
let known = null, knownTheme = "";
function paint() {
  const theme = document.documentElement.dataset.theme;
  if (theme !== knownTheme) {
    const style = getComputedStyle(document.documentElement);
    known = Object.fromEntries(["line", "text", "dim", "accent", "good", "bad", "warn", "raised", "sunk"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    knownTheme = theme;
  }
  return known;
}

/** What a monitor showed over time, and the distance of its pair or the margin of its formula, with where it is violated. */
export function drawBand(canvas, row, curve, now, spanUs) {
  const [c, w, h] = prepared(canvas), p = paint(), x = (us) => w - ((now - us) / spanUs) * w;
  const changes = row.history && row.history.length ? row.history : [[now - spanUs, row.shows]];
  changes.forEach(([from, shows], at) => {
    const until = at + 1 < changes.length ? changes[at + 1][0] : now, left = Math.max(0, x(from));
    if (until < now - spanUs) return;
    c.fillStyle = { ok: p.good, alarm: p.bad, unknown: p.warn }[shows] || p.line;
    c.globalAlpha = shows === "ok" ? 0.16 : 0.4;
    c.fillRect(left, 0, x(until) - left, h);
    if (shows === "alarm" || shows === "unknown") { c.globalAlpha = 1; c.fillRect(left, h - 4, x(until) - left, 4); }
  });
  c.globalAlpha = 1;
  if (curve.length < 2) return;
  const isPair = row.units.length === 2, values = curve.map(([, measure]) => measure);
  const most = isPair ? Math.max(30, ...values) * 1.1 : Math.max(...values, 0) || 1, least = isPair ? 0 : Math.min(...values, 0), wide = Math.max(most - least, 1e-9);
  const y = (measure) => h - 4 - ((measure - least) / wide) * (h - 8), limit = isPair ? 15 : 0, newest = values[values.length - 1];
  c.setLineDash([4, 4]); c.strokeStyle = p.bad; c.lineWidth = 1; c.beginPath(); c.moveTo(0, y(limit)); c.lineTo(w, y(limit)); c.stroke(); c.setLineDash([]);
  c.beginPath(); curve.forEach(([us, measure], at) => (at ? c.lineTo(x(us), y(measure)) : c.moveTo(x(us), y(measure)))); c.strokeStyle = p.text; c.lineWidth = 1.5; c.stroke();
  c.fillStyle = p.text; c.font = "11px system-ui"; c.fillText(isPair ? `apart ${newest.toFixed(0)} m; dashed 15 m` : `margin ${Number(newest.toPrecision(3))}; dashed: violated below`, 6, 13);
}

const SAID = { request: "accent", "request-when": "accent", propose: "accent", cfp: "accent", agree: "good", inform: "dim", refuse: "bad", failure: "bad", "not-understood": "bad", cancel: "warn", subscribe: "dim", "query-ref": "dim" };
const LANE = 22;

/** A sequence chart, the newest on top: a lane for each member, an arrow for each act. */
export function drawSequence(canvas, rows, choose) {
  const members = [...new Set(rows.flatMap(([, row]) => [row.from, row.to]))].sort((a, b) => a.localeCompare(b, undefined, { numeric: true })).slice(0, 12);
  const [c, w] = prepared(canvas, 34 + rows.length * LANE), p = paint(), left = 66, wide = (w - left - 26) / Math.max(1, members.length - 1);
  const x = (name) => left + (members.length === 1 ? (w - left) / 2 : members.indexOf(name) * wide);
  c.font = "600 12px system-ui"; c.textAlign = "center";
  for (const name of members) { c.fillStyle = p.text; c.fillText(name.length > 9 ? `${name.slice(0, 8)}…` : name, x(name), 14); c.strokeStyle = p.line; c.beginPath(); c.moveTo(x(name), 22); c.lineTo(x(name), 34 + rows.length * LANE); c.stroke(); }
  rows.forEach(([, row], at) => {
    const y = 40 + at * LANE, from = x(row.from), to = x(row.to), colour = p[SAID[row.what]] || p.text;
    c.font = "11px system-ui"; c.textAlign = "left"; c.fillStyle = p.dim; c.fillText(clockText(row.at_us), 0, y + 4);
    if (!members.includes(row.from) || !members.includes(row.to)) return;
    const isGood = row.outcome === "sent" || row.outcome === "accepted", way = Math.sign(to - from) || 1;
    c.strokeStyle = c.fillStyle = isGood ? colour : p.bad; c.lineWidth = 1.6; c.setLineDash(isGood ? [] : [4, 3]);
    c.beginPath(); c.moveTo(from, y + 3); c.lineTo(to, y + 3); c.stroke(); c.setLineDash([]);
    c.beginPath(); c.moveTo(to, y + 3); c.lineTo(to - 7 * way, y - 1); c.lineTo(to - 7 * way, y + 7); c.closePath(); c.fill();
    const words = `${row.what}${row.head ? ` ${row.head}` : ""}`, half = c.measureText(words).width / 2, middle = Math.max(left - 8 + half, Math.min(w - half - 2, (from + to) / 2));
    c.textAlign = "center"; c.lineWidth = 3; c.strokeStyle = p.raised; c.strokeText(words, middle, y); c.fillStyle = p.text; c.fillText(words, middle, y);
  });
  canvas.onclick = (event) => { const found = rows[Math.floor((event.offsetY - 30) / LANE)]; choose(found ? found[1] : null); };
}

/** Members on a circle; an arrow is all streams of one that another receives: how many, how many samples a second, the longest delay; of many members only at the one that is selected. */
export function drawGraph(canvas, units, links, taken) {
  const all = new Map();
  const add = (from, to, rate, lost, delay) => { const key = `${from}\n${to}`, sum = all.get(key) || [0, 0, 0, 0]; all.set(key, [sum[0] + 1, sum[1] + (rate || 0), sum[2] + (lost || 0), Math.max(sum[3], delay || 0)]); };
  for (const link of links) add(link.from, link.to, link.rate, (link.lost || 0) + (link.missing || 0), link.delay_us);
  for (const row of taken) add(row.unit, "page", row.rate, 0, row.delay_us);
  const members = [...new Set([...units, ...[...all.keys()].flatMap((key) => key.split("\n"))])].slice(0, 60);
  const [c, w, h] = prepared(canvas, 300), p = paint(), r = Math.min(w, h) / 2 - 34;
  const place = new Map(members.map((name, at) => { const a = (at / members.length) * 2 * Math.PI - Math.PI / 2; return [name, [w / 2 + Math.cos(a) * r * Math.min(1.5, w / h), h / 2 + Math.sin(a) * r]]; }));
  for (const [key, [count, rate, lost, delay]] of all) {
    const [from, to] = key.split("\n").map((name) => place.get(name));
    if (!from || !to || from === to) continue;
    const dx = to[0] - from[0], dy = to[1] - from[1], long = Math.hypot(dx, dy) || 1, nx = -dy / long, ny = dx / long, bow = 14;
    const start = [from[0] + (dx / long) * 18, from[1] + (dy / long) * 18], end = [to[0] - (dx / long) * 18, to[1] - (dy / long) * 18], middle = [(from[0] + to[0]) / 2 + nx * bow * 1.6, (from[1] + to[1]) / 2 + ny * bow * 1.6];
    c.strokeStyle = c.fillStyle = lost ? p.bad : p.accent; c.lineWidth = Math.min(5, 0.8 + Math.sqrt(rate) / 3); c.globalAlpha = key.endsWith("\npage") ? 0.35 : 0.8; c.setLineDash(lost ? [6, 4] : []);
    c.beginPath(); c.moveTo(...start); c.quadraticCurveTo(...middle, ...end); c.stroke(); c.setLineDash([]);
    const a = Math.atan2(end[1] - middle[1], end[0] - middle[0]);
    c.beginPath(); c.moveTo(...end); c.lineTo(end[0] - 9 * Math.cos(a - 0.4), end[1] - 9 * Math.sin(a - 0.4)); c.lineTo(end[0] - 9 * Math.cos(a + 0.4), end[1] - 9 * Math.sin(a + 0.4)); c.closePath(); c.fill(); c.globalAlpha = 1;
    if ((members.length <= 5 || key.split("\n").includes(state.selected)) && !key.endsWith("\npage")) { c.font = "11px system-ui"; c.textAlign = "center"; c.fillStyle = lost ? p.bad : p.dim; c.fillText(`${count} · ${rate.toFixed(0)} Hz · ${span(delay)}${lost ? ` · −${lost}` : ""}`, middle[0], middle[1] + 4); }
  }
  for (const [name, [x, y]] of place) {
    c.beginPath(); c.arc(x, y, 15, 0, 7); c.fillStyle = p.raised; c.fill(); c.lineWidth = 2; c.strokeStyle = name === "page" ? p.dim : p.accent; c.stroke();
    c.font = "600 12px system-ui"; c.textAlign = "center"; c.fillStyle = p.text; c.fillText(name.length > 5 ? `${name.slice(0, 4)}…` : name, x, y + 4);
  }
}

/** Where alarms were open in the recording as far as it is shown. */
export function drawTimeline(canvas, alarms, about) {
  const [c, w, h] = prepared(canvas), p = paint(), whole = about.last_us - about.first_us || 1, x = (us) => ((us - about.first_us) / whole) * w;
  for (const alarm of about.marks || []) { c.fillStyle = p.bad; c.globalAlpha = 0.5; c.fillRect(x(alarm[0]), h - 9, Math.max(2, x(alarm[1] ?? about.last_us) - x(alarm[0])), 5); }
  c.globalAlpha = 1;
}
