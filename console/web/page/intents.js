// Intents and meetings on the map: where each member will be, what its autopilot flies on a lost link, where one that is silent may be,
// and who yields to whom.
import { state, span } from "/page.js";

export const LEGEND = "thin line: where it will be · wide: it gives way · dashed: on a lost link · circle: silent, where it may be";
const SILENT_US = 3e6, MOST_SILENT_US = 1800e6, LEFT_US = 60e6, MEETING_US = 15e6, MANY = 24;
const GROWS_M_S = 0.5, MOST_RADIUS_M = 25;

/** A colour for each member: hues far apart in the order of their names, legible on both grounds. */
function paints() {
  const units = Object.keys(state.rows("platforms")).sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
  const light = (hue) => (document.documentElement.dataset.theme === "dark" ? 68 : hue > 40 && hue < 195 ? 28 : 40);
  return Object.fromEntries(units.map((unit, i) => { const hue = (i * 137.5 + 285) % 360; return [unit, `hsl(${hue} 80% ${light(hue)}%)`]; }));
}

const metresApart = ([lat, lon], [lat2, lon2]) => { const k = (Math.PI / 180) * 6371008.8; return Math.hypot((lat2 - lat) * k, (lon2 - lon) * k * Math.cos((lat * Math.PI) / 180)); };

/** The place so far along a way, and what is left of the way. */
function along(from, legs, metres) {
  let at = from, left = metres;
  for (let i = 0; i < legs.length; i++) {
    const whole = metresApart(at, legs[i]);
    if (whole >= left) { const f = whole ? left / whole : 0; return [[at[0] + (legs[i][0] - at[0]) * f, at[1] + (legs[i][1] - at[1]) * f], legs.slice(i)]; }
    left -= whole; at = legs[i];
  }
  return [at, []];
}

const endings = { land: "lands", hover: "", open: "" };

export function drawIntents(view) {
  const c = view.c, platforms = state.rows("platforms"), rows = Object.entries(state.rows("intents"));
  const colours = paints(), isMany = rows.length > MANY, mpp = view.metresPerPixel();
  for (const [unit, row] of rows) {
    const platform = platforms[unit], heardUs = Math.max(row.valid_us, platform?.valid_us || 0), age = state.t - heardUs;
    if (age > (platform?.state === "left" ? LEFT_US : MOST_SILENT_US)) continue;
    const isSilent = age > SILENT_US, isChosen = state.selected === unit, paint = colours[unit] || view.paint.text;
    const from = platform?.at || row.at, alpha = state.selected === null || isChosen ? 1 : 0.35;
    c.strokeStyle = c.fillStyle = paint; c.lineJoin = "round";
    if (row.legs.length) {
      view.path([from, ...row.legs]);
      if (row.source === "manoeuvre") { c.lineWidth = 9; c.globalAlpha = 0.28 * alpha; c.stroke(); }
      c.lineWidth = isChosen ? 2.5 : 1.3; c.globalAlpha = 0.9 * alpha; c.stroke();
      const [x, y] = view.toScreen(row.legs[row.legs.length - 1]);
      c.beginPath(); c.arc(x, y, 3, 0, 7); c.fill();
    }
    if (row.failsafe.length && (!isMany || isChosen || isSilent)) {
      view.path([from, ...row.failsafe]);
      c.setLineDash([5, 5]); c.lineWidth = isSilent ? 2 : 1.2; c.globalAlpha = (isSilent ? 0.9 : 0.5) * alpha; c.stroke(); c.setLineDash([]);
    }
    c.globalAlpha = 1;
    if (row.source === "manoeuvre" && row.legs.length && state.rows("flights")[unit]?.commander !== "avoidance" && (!isMany || isChosen)) {
      const [x, y] = view.toScreen(from);
      if (view.layers.labels) view.text(x + 15, y + 26, `${unit} gives way, to ${row.legs[0][2].toFixed(0)} m`, paint, "600 12px system-ui");
    }
    if (isSilent) drawSilent(view, unit, row, from, age, paint, mpp);
  }
}

/** One that is not heard: where its last words have it by now, within a circle that grows, and how long it is silent. */
function drawSilent(view, unit, row, from, age, paint, mpp) {
  const c = view.c, seconds = age / 1e6, isOnFailsafe = row.failsafe.length > 0 && row.after_s !== null && seconds > row.after_s;
  const begun = isOnFailsafe ? along(from, row.legs, row.speed * row.after_s)[0] : from;
  const [at, ahead] = along(begun, isOnFailsafe ? row.failsafe : row.legs, row.speed * (isOnFailsafe ? seconds - row.after_s : seconds));
  const [x, y] = view.toScreen(at), r = Math.max(6, Math.min(MOST_RADIUS_M, row.radius + GROWS_M_S * seconds) / mpp);
  c.strokeStyle = c.fillStyle = paint; c.lineWidth = 2; c.setLineDash([3, 4]);
  view.path([from, begun, at]); c.stroke();
  c.beginPath(); c.arc(x, y, r, 0, 7); c.stroke(); c.setLineDash([]);
  c.globalAlpha = 0.15; c.fill(); c.globalAlpha = 1;
  const does = isOnFailsafe ? endings[row.failsafe_ending] : ahead.length ? "" : endings[row.ending];
  if (view.layers.labels) view.text(x + r + 5, y + 4, `${unit} silent ${span(age)}, ${row.altitude.toFixed(0)} m${does ? `, ${does}` : ""}`, view.paint.bad, "600 12px system-ui");
}

/** Pairs that meet: who yields, by their acts; and alarms that neither can avoid, with the seconds that are left. */
export function drawMeetings(view) {
  const c = view.c, platforms = state.rows("platforms"), intents = state.rows("intents"), colours = paints();
  const place = (unit) => platforms[unit]?.at || intents[unit]?.at, drawn = new Set();
  for (const [, alarm] of state.openAlarms()) {
    if (alarm.monitor !== "neither-can-avoid" || alarm.units.length !== 2) continue;
    const [one, other] = alarm.units.map(place), name = [...alarm.units].sort().join(" ");
    if (!one || !other || drawn.has(name)) continue;
    drawn.add(name);
    const left = (alarm.values.seconds ?? 0) - (state.t - (alarm.opened_us || state.t)) / 1e6;
    middle(view, one, other, `neither can avoid${left > 0 ? `: ${left.toFixed(0)} s` : ""}`, view.paint.bad);
  }
  for (const [name, row] of Object.entries(state.rows("meetings"))) {
    const isFlown = intents[row.yields]?.source === "manoeuvre";
    if (drawn.has(name) || (!isFlown && state.t - row.at_us > MEETING_US) || state.t < row.at_us - 1e6) continue;
    const from = place(row.yields), to = place(row.to);
    if (!from || !to) continue;
    c.strokeStyle = c.fillStyle = colours[row.yields] || view.paint.warn; c.lineWidth = 1.5; c.setLineDash([2, 4]);
    view.path([from, to]); c.stroke(); c.setLineDash([]);
    middle(view, from, to, row.because ? `${row.to} leaves it to ${row.yields}` : `${row.yields} yields to ${row.to}${row.agreed ? ", agreed" : ""}`, view.paint.text);
  }
}

function middle(view, one, other, words, paint) {
  if (!view.layers.labels) return;
  const [x, y] = view.toScreen([(one[0] + other[0]) / 2, (one[1] + other[1]) / 2]);
  view.text(x + 10, y + 18, words, paint, "600 12px system-ui");
}
