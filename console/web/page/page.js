// The page: what the server sends becomes the state, which the map and the panels draw; what users confirm is posted.
import { MapView } from "/map.js";
import { Panels, TABS } from "/panels.js";

export const $ = (id) => document.getElementById(id);
const CHANNEL_MS = 1500;

export const state = {
  t: 0, about: {}, sections: {}, trails: {}, history: new Map(), selected: null, isLinked: false,
  rows(section) { return this.sections[section] || {}; },
  openAlarms() { return Object.entries(this.rows("alarms")).filter(([, a]) => a.event === "opened"); },
  unknown() { return Object.values(this.rows("monitors")).filter((m) => m.shows === "unknown"); },
  questions() { return Object.values(this.rows("missions")).filter((m) => m.question); },
};

export function el(tag, given = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(given)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "on") for (const [event, heard] of Object.entries(value)) made.addEventListener(event, heard);
    else if (name === "text") made.textContent = value;
    else made.setAttribute(name === "cls" ? "class" : name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

export const clockText = (us, parts = 0) => (us ? new Date(us / 1000).toISOString().slice(11, parts ? 21 : 19) : "");
export function span(us) {
  const s = us / 1e6;
  if (s < 0.0945) return `${Math.max(0, Math.round(s * 1000))} ms`;
  if (s < 0.95) return `${Math.round(s * 10) * 100} ms`;
  if (s < 99) return `${s.toFixed(s < 10 ? 1 : 0)} s`;
  return s < 5400 ? `${Math.round(s / 60)} min` : `${(s / 3600).toFixed(1)} h`;
}

// -- what comes ---------------------------------------------------------------------------------------------------

function applyChanges(changed) {
  for (const [section, rows] of Object.entries(changed)) {
    const there = (state.sections[section] ||= {});
    for (const [name, row] of Object.entries(rows)) {
      if (row === null) delete there[name];
      else there[name] = row;
    }
  }
}

function extendTrails(rows) {
  for (const [unit, row] of Object.entries(rows || {})) {
    if (!row || !row.at) continue;
    const trail = (state.trails[unit] ||= []);
    const last = trail[trail.length - 1];
    if (!last || Math.abs(last[0] - row.at[0]) + Math.abs(last[1] - row.at[1]) > 4e-6) trail.push(row.at);
    if (trail.length > 600) trail.splice(0, 100);
  }
}

function take(message) {
  state.t = message.t;
  if (message.about) { state.about = message.about; showAbout(); }
  if (message.whole) {
    state.sections = message.whole; state.trails = message.trails; state.history = new Map(Object.entries(message.curves)); map.fitOnce();
  } else if (message.changed) {
    applyChanges(message.changed); extendTrails(message.changed.platforms); map.fitOnce();
  }
  if (message.whole || message.changed) { panels.remember(); showChips(message.changed); map.changed(); panels.changed(message.changed); }
  showClock();
}

let socket = null;
let heardAt = 0;
function open() {
  socket = new WebSocket(`ws://${location.host}/live`);
  socket.onmessage = (event) => { heardAt = performance.now(); link(true); take(JSON.parse(event.data)); };
  socket.onclose = (event) => {
    link(false);
    if (event.code === 4401 || (event.code === 1006 && !heardAt)) checkSession();
    setTimeout(open, CHANNEL_MS);
  };
}

export function steer(wish) { if (socket && socket.readyState === 1) socket.send(JSON.stringify(wish)); }

function link(isUp) {
  if (state.isLinked !== isUp || isUp) {
    state.isLinked = isUp;
    const about = state.about;
    const said = !isUp ? ["no server", "bad"] : about.live === false ? ["recording", "warn"] : about.trouble === "looking for platforms" ? [about.trouble, "warn"] : about.trouble ? ["no platform", "bad"] : ["live", "good"];
    const pill = $("link");
    if (pill.textContent !== said[0]) { pill.textContent = said[0]; pill.className = `pill ${said[1]}`; }
    pill.title = about.trouble || "";
  }
}

async function post(path, body) {
  const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
  const said = answer.status === 204 ? {} : await answer.json().catch(() => ({ why: `the server answers ${answer.status}` }));
  if (!answer.ok) throw new Error(said.why);
  return said;
}

async function checkSession() {
  const token = location.hash.slice(1);
  if (token) {
    try {
      await post("/session", { token });
      history.replaceState(null, "", "/");
    } catch (error) { toast(error.message, true); return; }
  }
}

// -- what users do ------------------------------------------------------------------------------------------------

export function toast(text, isBad = false) {
  const shown = el("div", { cls: `toast${isBad ? " bad" : ""}`, text });
  $("toasts").append(shown);
  setTimeout(() => shown.remove(), isBad ? 9000 : 4500);
}

export function dialog(title, parts, confirm, done, kind = "main") {
  const form = $("dialog-form");
  const box = $("dialog");
  const back = el("button", { type: "button", text: confirm ? "Back" : "Close", on: { click: () => box.close() } });
  const go = confirm && el("button", { type: "submit", cls: kind, id: "confirm", text: confirm });
  form.replaceChildren(el("h2", { text: title }), ...parts, el("div", { cls: "buttons" }, back, go || null));
  form.onsubmit = (event) => { event.preventDefault(); box.close(); done && done(new FormData(form)); };
  box.showModal();
  (form.querySelector("input, select") || go || back).focus();
}

/** Ask once, then send; what is sent stands in the question, word for word. */
export function ask(question, act, words, kind = "main") {
  dialog(question, [el("p", { cls: "dim small", text: "One speech act, which stays in the message log of the platform:" }), el("p", { cls: "mono", text: words })], "Send", async () => {
    try { toast((await post("/act", act)).said || "done"); } catch (error) { toast(error.message, true); }
  }, kind);
}

export const canAct = () => state.about.acts === true;

export function delegate(task, to, values) {
  const given = Object.entries(values).map(([name, value]) => ` ${name}=${value}`).join("");
  ask(`${task}${to ? `, platform ${to}` : ""}?`, { do: "delegate", task, to: to || null, with: values }, `dyknow delegate ${task}${given}${to ? ` --to ${to}` : ""}`);
}

export function chooseTask(to) {
  const units = Object.keys(state.rows("platforms"));
  const tasks = state.about.tasks || [];
  const parts = [
    el("label", {}, "Task", el("select", { name: "task" }, ...tasks.map((name) => el("option", { value: name, text: name, selected: name === "monitor-proximity" })))),
    el("label", {}, "Platform", el("select", { name: "to" }, ...units.map((name) => el("option", { value: name, text: name, selected: name === to })))),
    el("label", {}, "Values, as key=value", el("input", { name: "with", placeholder: "profile=proximity sample-period=1s", autocomplete: "off" })),
  ];
  dialog("Delegate", parts, "Continue", (form) => {
    const pairs = String(form.get("with")).split(/\s+/).filter(Boolean).map((pair) => { const at = pair.indexOf("="); return at < 0 ? [pair, ""] : [pair.slice(0, at), pair.slice(at + 1)]; });
    delegate(String(form.get("task")), String(form.get("to")), Object.fromEntries(pairs));
  });
}

export function cancelTask(name, row) { ask(`End ${row.task} of platform ${row.unit}?`, { do: "cancel", conversation: name }, `dyknow cancel ${name}`, "danger"); }
export function hold(unit) { delegate("hold", unit, {}); }
export function goto(unit) {
  const row = state.rows("platforms")[unit];
  if (!row || !canAct()) return;
  map.pick(`Click where platform ${unit} is to fly; Esc: nowhere`, (latitude, longitude) => {
    const altitude = el("input", { name: "altitude", type: "number", step: "1", value: Math.round(row.altitude ?? 0) });
    dialog(`Where platform ${unit} flies`, [
      el("p", { text: `${latitude.toFixed(6)}°, ${longitude.toFixed(6)}°` }),
      el("label", {}, "Altitude above mean sea level, m", altitude),
    ], "Continue", (form) => delegate("goto", unit, { latitude_deg: latitude.toFixed(7), longitude_deg: longitude.toFixed(7), altitude_m: String(form.get("altitude")) }));
  });
}

export function select(unit) {
  state.selected = unit;
  showSelected(); map.changed(); panels.changed();
  if (unit !== null) map.bringIntoView(unit);
}

function next(step) {
  const units = Object.keys(state.rows("platforms"));
  if (units.length) select(units[(units.indexOf(state.selected) + step + units.length) % units.length]);
}

// -- what is shown around -----------------------------------------------------------------------------------------

function showAbout() {
  const about = state.about;
  $("federation").textContent = about.live === false ? about.file : `federation ${about.federation ?? ""}`;
  document.title = `dyknow ${about.federation ?? ""}`;
  $("player").hidden = about.live !== false;
  if (about.live === false) {
    $("play").textContent = about.playing ? "❚❚" : "▶";
    $("slider").max = Math.max(1, Math.round((about.last_us - about.first_us) / 1e5));
    $("end").textContent = about.loaded ? clockText(about.last_us) : "reading …";
    panels.drawMarks();
  }
  document.body.dataset.acts = String(canAct());
}

function showClock() {
  $("clock").textContent = `${clockText(state.t)} UTC`;
  if (state.about.live === false) {
    $("at").textContent = clockText(state.t, 1);
    if (document.activeElement !== $("slider") || state.about.playing) $("slider").value = Math.round((state.t - state.about.first_us) / 1e5);
  }
}

function chip(id, text, kind, isShown = true) {
  const shown = $(id);
  if (shown.textContent !== text) shown.textContent = text;
  const cls = `chip ${kind}`;
  if (shown.className !== cls) shown.className = cls;
  shown.hidden = !isShown;
}

function showChips(changed) {
  const platforms = Object.values(state.rows("platforms"));
  const alive = platforms.filter((p) => p.state === "alive").length;
  chip("chip-fleet", alive === platforms.length ? `${alive} platform${alive === 1 ? "" : "s"}` : `${alive} of ${platforms.length} platforms`, alive === platforms.length ? "" : "warn");
  const open = state.openAlarms();
  chip("chip-alarms", open.length ? `⚠ ${open.length} alarm${open.length === 1 ? "" : "s"}` : "no alarm", open.length ? "bad" : "");
  const unknown = state.unknown().length;
  chip("chip-unknown", `? ${unknown} unknown`, "warn", unknown > 0);
  const asked = state.questions().length;
  chip("chip-asked", `${asked} question${asked === 1 ? "" : "s"}`, "ask", asked > 0);
  if (!changed || changed.platforms || changed.streams || changed.flights || changed.intents) showSelected();
  if (!changed || changed.objects || changed.salient) {
    const homeless = ["objects", "salient"].flatMap((section) => Object.values(state.rows(section))).filter((row) => !row.at).length;
    $("notice").hidden = !homeless;
    if (homeless) $("notice").textContent = `${homeless} object${homeless === 1 ? " is" : "s are"} not on the map: no platform says from where their metres count; start dyknow web with --origin LAT,LON`;
  }
}

let selectedShown = null;
function showSelected() {
  const box = $("selected");
  const row = state.selected === null ? null : state.rows("platforms")[state.selected];
  box.hidden = !row;
  if (!row) { selectedShown = null; return; }
  const unit = state.selected;
  if (selectedShown !== unit) {
    selectedShown = unit;
    const close = el("button", { title: "No platform (Esc)", text: "✕", on: { click: () => select(null) } });
    const buttons = canAct() ? el("div", { cls: "buttons" },
      el("button", { text: "Go to …", title: "G", on: { click: () => goto(unit) } }),
      el("button", { text: "Hold", title: "H", on: { click: () => hold(unit) } }),
      el("button", { text: "Delegate …", title: "D", on: { click: () => chooseTask(unit) } })) : null;
    box.replaceChildren(el("h2", {}, el("span", { id: "selected-name" }), el("span", { id: "selected-state", cls: "pill" }), close), el("dl", { cls: "facts", id: "facts" }), ...(buttons ? [buttons] : []));
  }
  $("selected-name").textContent = `Platform ${unit}`;
  const pill = $("selected-state");
  pill.textContent = row.state ?? ""; pill.className = `pill ${row.state === "alive" ? "good" : "bad"}`;
  const doing = state.rows("flights")[unit]?.doing;
  const facts = [
    ["altitude", figure(row.altitude, " m", 0)], ["height", figure(row.height, " m", 0)], ["speed", figure(row.speed, " m/s", 1)],
    ["course", figure(row.course, "°", 0)], ["climb", figure(row.climb, " m/s", 1)], ["battery", row.battery == null ? "–" : `${Math.round(row.battery * 100)} %`],
    ["position", row.at ? `${row.at[0].toFixed(5)}°` : "–"], ["", row.at ? `${row.at[1].toFixed(5)}°` : ""], ["its age", row.valid_us ? span(Math.max(0, state.t - row.valid_us)) : "–"],
  ];
  const shown = facts.map(([name, value]) => el("div", {}, el("dt", { text: name || "\u00a0" }), el("dd", { text: value })));
  if (doing) shown.push(el("div", { cls: "wide" }, el("dt", { text: "doing" }), el("dd", { text: doing })));
  const intent = state.rows("intents")[unit];
  if (intent) shown.push(el("div", { cls: "wide" }, el("dt", { text: "intent" }), el("dd", { text: `${intent.source}, right of way: ${intent.rank}${intent.after_s === null ? "" : `; ${span(intent.after_s * 1e6)} without link: ${intent.failsafe.length ? "flies away and " : ""}${intent.failsafe_ending}`}` })));
  if (row.conditions && row.conditions.length) shown.push(el("div", { cls: "wide" }, el("dt", { text: "conditions" }), el("dd", { text: row.conditions.join("; ") })));
  $("facts").replaceChildren(...shown);
}

export const figure = (value, unit, digits) => (value === null || value === undefined ? "–" : `${value.toFixed(digits)}${unit}`);

function help() {
  const keys = [["1 … 7", "fleet, alarms, monitors, tasks, acts, streams, events"], ["N P", "next, previous platform"], ["arrows + −", "move the map, zoom"], ["F", "all platforms"], ["L", "what the map shows"],
    ["G H D", "go to, hold, delegate, for the platform that is selected"], ["Space , .", "recording: play or stop, a second back, forth"], ["T", "light or dark"], ["Esc", "back"]];
  dialog("Keys", [el("div", { cls: "keys" }, ...keys.flatMap(([key, what]) => [el("kbd", { text: key }), el("span", { text: what })]))], null, null);
}

function theme(name) {
  const chosen = name || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  document.documentElement.dataset.theme = chosen;
  map.restyle(); panels.changed();
}

function onKey(event) {
  if ($("dialog").open || event.ctrlKey || event.metaKey || event.altKey || /INPUT|SELECT/.test(event.target.tagName) && event.target.id !== "slider") return;
  const unit = state.selected;
  const at = Number(event.key);
  const does = {
    n: () => next(1), p: () => next(-1), f: () => map.fit(), t: toggleTheme, "?": help, l: () => map.toggleLayers(), "+": () => map.zoom(1), "=": () => map.zoom(1), "-": () => map.zoom(-1),
    g: () => unit !== null && goto(unit), h: () => unit !== null && canAct() && hold(unit), d: () => canAct() && chooseTask(unit),
    Escape: () => map.unpick() || select(null), " ": () => play(), ",": () => seek(-1e6), ".": () => seek(1e6),
    ArrowUp: () => map.pan(0, -1), ArrowDown: () => map.pan(0, 1), ArrowLeft: () => map.pan(-1, 0), ArrowRight: () => map.pan(1, 0),
  }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  const isOnButton = event.target.tagName === "BUTTON" && (event.key === " " || event.key === "Enter");
  const isInPanel = event.key.startsWith("Arrow") && $("panel").contains(event.target) || (event.target.id === "slider" && event.key.startsWith("Arrow"));
  if (at >= 1 && at <= TABS.length) { panels.show(TABS[at - 1][0]); event.preventDefault(); }
  else if (does && !isOnButton && !isInPanel) { event.preventDefault(); does(); }
}

function play() { if (state.about.live === false) steer({ play: !state.about.playing }), (state.about.playing = !state.about.playing), showAbout(); }
function seek(by) { if (state.about.live === false) steer({ at_us: Math.round(state.t + by) }); }
function toggleTheme() {
  const name = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  try { localStorage.setItem("theme", name); } catch { /* it is only not kept */ }
  theme(name);
}

const map = new MapView();
const panels = new Panels();
let kept = null;
try { kept = localStorage.getItem("theme"); } catch { kept = null; }
theme(kept);
$("theme").onclick = toggleTheme;
$("help").onclick = help;
$("play").onclick = play;
$("speed").onchange = (event) => { steer({ speed: Number(event.target.value) }); event.target.blur(); };
$("slider").oninput = (event) => steer({ at_us: state.about.first_us + Number(event.target.value) * 1e5 });
for (const button of document.querySelectorAll("[data-tab]")) button.onclick = () => panels.show(button.dataset.tab);
document.addEventListener("keydown", onKey);
setInterval(() => { if (heardAt && performance.now() - heardAt > 3000) { link(false); map.changed(); } }, 1000);
await checkSession();
open();
