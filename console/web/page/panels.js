// Beside the map: what there is in words and figures, a tab each; only the tab that is open is drawn.
import { $, ask, cancelTask, canAct, chooseTask, clockText, delegate, el, figure, select, span, state, steer } from "/page.js";
import { drawBand, drawGraph, drawSequence, drawTimeline } from "/charts.js";

export const TABS = [["fleet", "Fleet"], ["alarms", "Alarms"], ["monitors", "Monitors"], ["tasks", "Tasks"], ["acts", "Acts"], ["streams", "Streams"], ["events", "Events"]];
const DRAW_MS = 250;
const SHOWS = { ok: ["✓", "good"], alarm: ["⚠", "bad"], unknown: ["?", "warn"], idle: ["·", ""] };
const HISTORY_US = 120e6;

/** Have a container show these items: what has the same signature stays as it is, so that nothing moves under a pointer. */
function keyed(box, items) {
  const there = new Map([...box.children].map((child) => [child.dataset.key, child]));
  let place = box.firstChild;
  for (const [key, signature, make] of items) {
    let child = there.get(key);
    if (!child || child.dataset.signature !== signature) {
      const made = make();
      made.dataset.key = key; made.dataset.signature = signature;
      if (child) { if (place === child) place = child.nextSibling; child.remove(); }
      child = made;
    }
    there.delete(key);
    if (child !== place) box.insertBefore(child, place);
    else place = place.nextSibling;
  }
  for (const child of there.values()) child.remove();
}

const empty = (words) => [["empty", words, () => el("p", { cls: "empty", text: words })]];
const mark = ([sign, kind]) => el("span", { cls: `mark ${kind}`, text: sign, "aria-hidden": "true" });

export class Panels {
  constructor() {
    this.tab = "fleet"; this.isWaiting = false; this.drawnAt = 0; this.withUs = false;
    $("tabs").append(...TABS.map(([name, words], at) => el("button", { role: "tab", id: `tab-${name}`, "aria-controls": "panel", title: String(at + 1), on: { click: () => this.show(name) } },
      words, el("span", { cls: "count", id: `count-${name}`, hidden: true }))));
    this.show("fleet");
  }

  show(name) {
    this.tab = name;
    for (const [each] of TABS) $(`tab-${each}`).setAttribute("aria-selected", String(each === name));
    $("panel").replaceChildren(); $("panel").scrollTop = 0;
    this.draw();
  }

  changed(changed) {
    if (changed && (changed.alarms || changed.missions)) { this.draw(); return; }
    if (this.isWaiting) return;
    this.isWaiting = true;
    setTimeout(() => { this.isWaiting = false; this.draw(); }, Math.max(0, this.drawnAt + DRAW_MS - performance.now()));
  }

  /** Keep how far apart the platforms of each monitor were, or the margin of its formula, for its curve. */
  remember() {
    const now = state.t, platforms = state.rows("platforms");
    for (const [name, row] of Object.entries(state.rows("monitors"))) {
      const [one, other] = row.units.map((unit) => platforms[unit] && platforms[unit].at);
      const isPair = one && other && row.units.length === 2;
      if (!isPair && (row.margin === null || row.margin === undefined)) continue;
      let kept = state.history.get(name);
      if (!kept) state.history.set(name, (kept = []));
      if (kept.length && now - kept[kept.length - 1][0] < 400e3) continue;
      const k = 111195, apart = !isPair ? row.margin : Math.hypot((one[0] - other[0]) * k, (one[1] - other[1]) * k * Math.cos((one[0] * Math.PI) / 180));
      kept.push([now, apart]);
      while (kept.length && kept[0][0] < now - HISTORY_US) kept.shift();
    }
  }

  draw() {
    this.drawnAt = performance.now();
    this.count("alarms", state.openAlarms().length, "");
    this.count("tasks", state.questions().length, "ask");
    this[this.tab]($("panel"));
  }

  count(name, number, kind) {
    const shown = $(`count-${name}`);
    shown.hidden = !number; shown.className = `count ${kind}`;
    if (shown.textContent !== String(number)) shown.textContent = number;
  }

  // -- tabs -------------------------------------------------------------------------------------------------------

  fleet(box) {
    const rows = Object.entries(state.rows("platforms"));
    if (!rows.length) return keyed(box, empty(state.about.trouble || "No platform is there yet."));
    keyed(box, rows.sort(([a], [b]) => a.localeCompare(b, undefined, { numeric: true })).map(([unit, row]) => {
      const age = row.valid_us ? Math.max(0, state.t - row.valid_us) : null, isOld = age === null || age > 3e6;
      const link = row.state !== "alive" ? [row.state || "", "bad"] : isOld ? [age === null ? "no position" : `old: ${span(age)}`, "warn"] : [age < 1e6 ? "now" : span(age), "good"];
      const battery = row.battery ?? null;
      if (link[1] === "good" && battery !== null && battery < 0.2) link[1] = "bad";
      else if (link[1] === "good" && row.conditions && row.conditions.length) link[1] = "warn";
      const figures = [link, row.altitude?.toFixed(0), row.speed?.toFixed(0), battery?.toFixed(2), row.conditions, row.load, state.selected === unit];
      return [unit, JSON.stringify(figures), () => {
        const bar = el("div", { cls: `bar${battery !== null && battery < 0.2 ? " low" : ""}`, title: "battery" }, el("i"));
        bar.firstChild.style.width = `${Math.round((battery ?? 0) * 100)}%`;
        const kind = link[1] === "good" ? "good" : link[1];
        return el("div", { cls: `card clicks ${kind === "good" ? "good" : kind}${state.selected === unit ? " chosen" : ""}`, tabindex: 0, role: "button", on: { click: () => select(unit), keydown: (event) => { if (event.key === "Enter") select(unit); } } },
          el("div", { cls: "fleet" }, mark(kind === "good" ? ["●", "good"] : ["▲", kind]), el("strong", { text: unit }),
            el("span", { cls: "figure", text: figure(row.altitude, " m", 0) }), el("span", { cls: "figure", text: figure(row.speed, " m/s", 0) }),
            el("span", {}, battery === null ? "" : bar, el("small", { cls: "dim", text: battery === null ? "" : `${Math.round(battery * 100)} %` })), el("span", { cls: "figure", text: link[0] })),
          row.load > 0.05 ? el("div", { cls: "small dim", text: `on the line: ${row.load.toFixed(1)} kg` }) : null,
          ...(row.conditions || []).map((text) => el("div", { cls: "small warn-text", text: `▲ ${text}` })));
      }];
    }));
  }

  alarms(box) {
    const rows = Object.entries(state.rows("alarms")).sort(([, a], [, b]) => (b.event === "opened") - (a.event === "opened") || (b.opened_us ?? b.closed_us) - (a.opened_us ?? a.closed_us));
    if (!rows.length) return keyed(box, empty("No alarm so far. Alarms are raised by monitors: delegate monitor-proximity."));
    keyed(box, rows.map(([name, row]) => [name, JSON.stringify([row.event, row.closed_us]), () => {
      const isOpen = row.event === "opened";
      const lasted = row.opened_us && row.closed_us ? `, ${span(row.closed_us - row.opened_us)}` : "";
      const values = Object.entries(row.values || {}).map(([what, value]) => `${what} = ${typeof value !== "number" ? value : /^(cpa_time|time_to_violation)/.test(what) ? span(value) : Number(value.toPrecision(4))}`);
      return el("article", { cls: `card clicks ${isOpen ? "bad" : "over"}`, "data-alarm": name, on: { click: () => select(row.units[0] ?? null) } },
        el("div", { cls: "head" }, mark(isOpen ? SHOWS.alarm : ["○", ""]), el("strong", { text: row.monitor }), el("span", { text: row.units.join(" – ") }),
          el("span", { cls: "right", text: isOpen ? `open since ${clockText(row.opened_us)}` : `${row.event} ${clockText(row.closed_us)}${lasted}` })),
        ...(row.because || []).map((text) => el("div", { cls: "small", text })),
        values.length ? el("div", { cls: "small dim", text: values.join("   ") }) : null,
        el("div", { cls: "small dim", text: `raised by ${row.by}` }));
    }]));
  }

  monitors(box) {
    const order = { alarm: 0, unknown: 1, ok: 2, idle: 3 };
    const rows = Object.entries(state.rows("monitors")).sort(([a, x], [b, y]) => (order[x.shows] ?? 9) - (order[y.shows] ?? 9) || a.localeCompare(b, undefined, { numeric: true }));
    if (!rows.length) return keyed(box, empty("No monitor is there. A task monitor-proximity sets some up."));
    keyed(box, rows.slice(0, 80).map(([name, row]) => [name, JSON.stringify([row.shows, row.verdict, row.which, row.margin]), () =>
      el("article", { cls: `card ${SHOWS[row.shows]?.[1] ?? ""}` },
        el("div", { cls: "head" }, mark(SHOWS[row.shows] ?? ["·", ""]), el("strong", { text: row.monitor }), el("span", { text: row.units.join(" – ") }), el("span", { cls: "right", text: `${row.shows ?? ""} · ${row.verdict ?? ""} · by ${row.by}` })),
        row.margin === null || row.margin === undefined ? null : el("div", { cls: "small dim", text: `margin ${Number(row.margin.toPrecision(4))}${row.margin < 0 ? ", violated" : ""}` }),
        row.which && row.which.length ? el("div", { cls: "small", text: `lacks ${row.which.join(", ")}` }) : null,
        el("canvas", { cls: "band", role: "img", "aria-label": `what ${row.monitor} showed in the last two minutes` }))]));
    for (const card of box.querySelectorAll("[data-key]")) {
      const row = state.rows("monitors")[card.dataset.key], band = card.querySelector("canvas");
      if (row && band && isSeen(card, box)) drawBand(band, row, state.history.get(card.dataset.key) || [], state.t, HISTORY_US);
    }
  }

  tasks(box) {
    const items = [];
    if (canAct()) items.push(["+", "", () => el("div", { cls: "row" }, el("button", { cls: "main", text: "Delegate …", id: "delegate", on: { click: () => chooseTask(state.selected) } }),
      el("button", { text: "Watch proximity", id: "proximity", on: { click: () => delegate("monitor-proximity", state.selected ?? Object.keys(state.rows("platforms"))[0] ?? "", {}) } }))]);
    for (const [name, row] of Object.entries(state.rows("missions"))) items.push([`m ${name}`, JSON.stringify([row, canAct()]), () => this.mission(row)]);
    const tasks = Object.entries(state.rows("tasks")).sort(([, a], [, b]) => (a.state === "ended") - (b.state === "ended") || (b.since_us ?? 0) - (a.since_us ?? 0));
    for (const [name, row] of tasks) items.push([`t ${name}`, JSON.stringify([row, canAct()]), () => this.task(name, row)]);
    keyed(box, items.length > (canAct() ? 1 : 0) ? items : [...items, ...empty("No task is delegated.")]);
  }

  task(name, row) {
    const isOver = row.state === "ended";
    return el("article", { cls: `card ${isOver ? "over" : "good"}`, "data-task": name },
      el("div", { cls: "head" }, el("strong", { text: row.task }), el("span", { text: `on ${row.unit}` }), el("span", { cls: "right", text: row.state })),
      el("div", { cls: "small dim", text: `${row.delegator ? `for ${row.delegator.replace(/^.*@/, "")}, ` : ""}since ${clockText(row.since_us)}${row.monitors && row.monitors.length ? `, ${row.monitors.join(", ")}` : ""}` }),
      el("div", { cls: "mono dim", text: name }),
      canAct() && !isOver ? el("div", { cls: "buttons" }, el("button", { cls: "danger cancel", text: "Cancel", on: { click: () => cancelTask(name, row) } })) : null);
  }

  mission(row) {
    const question = row.question;
    const control = (how) => ask(`${how} mission ${row.mission}?`, { do: "mission", unit: row.by, mission: row.mission, how }, `dyknow mission ${how} ${row.mission}`, how === "abort" ? "danger" : "main");
    const answer = (option) => ask(question.text, { do: "answer", unit: row.by, mission: row.mission, number: question.number, answer: option }, `dyknow mission answer ${row.mission} ${option}`);
    return el("article", { cls: `card ${question ? "ask" : "good"}` },
      el("div", { cls: "head" }, el("strong", { text: `mission ${row.mission}` }), el("span", { cls: "right", text: row.phase })),
      el("div", { cls: "small dim", text: `led by ${row.by}, since ${clockText(row.since_us)}${row.why ? `: ${row.why}` : ""}` }),
      question ? el("p", { text: question.text }) : null,
      question ? el("div", { cls: "buttons" }, ...question.options.map((option) => el("button", { cls: option === question.default ? "main" : "", text: option, disabled: !canAct(), on: { click: () => answer(option) } }))) : null,
      question ? el("div", { cls: "small dim", text: `without an answer until ${clockText(question.until_us)}: ${question.default}` }) : null,
      row.actions.length ? el("ol", { cls: "actions" }, ...row.actions.map((text) => el("li", { text }))) : null,
      canAct() ? el("div", { cls: "buttons" }, el("button", { text: "Suspend", on: { click: () => control("suspend") } }), el("button", { text: "Resume", on: { click: () => control("resume") } }), el("button", { cls: "danger", text: "Abort", on: { click: () => control("abort") } })) : null);
  }

  acts(box) {
    if (!box.querySelector("canvas")) {
      const toggle = el("input", { type: "checkbox", checked: this.withUs, on: { change: (event) => { this.withUs = event.target.checked; this.draw(); } } });
      box.replaceChildren(el("div", { cls: "row" }, el("label", { cls: "small" }, toggle, " with what this page asks")), el("canvas", { cls: "chart", id: "sequence", role: "img", "aria-label": "Speech acts, the newest first" }), el("div", { id: "act", cls: "mono" }), el("p", { cls: "empty", text: "No speech act so far." }));
    }
    const us = state.about.unit, isOurs = (row) => row.from === us || row.to === us;
    const wanted = (row) => this.withUs || !isOurs(row) || /^(request|cancel|agree|refuse|failure)$/.test(row.what) && row.head !== "create-multicast" && !row.isQuiet;
    const seen = new Set(), rows = [];
    for (const [name, row] of Object.entries(state.rows("acts")).reverse()) {
      const key = `${row.from} ${row.to} ${row.act}`;
      if (!wanted(row) || seen.has(key)) continue;
      seen.add(key); rows.push([name, row]);
      if (rows.length >= 60) break;
    }
    box.querySelector(".empty").hidden = rows.length > 0;
    drawSequence(box.querySelector("canvas"), rows, (row) => { $("act").textContent = row ? `${clockText(row.at_us, 1)}  ${row.outcome}\n${row.act}` : ""; });
  }

  streams(box) {
    if (!box.querySelector("canvas")) box.replaceChildren(el("canvas", { cls: "chart", id: "graph", role: "img", "aria-label": "Who receives streams of whom" }), el("div", { id: "stream-table" }));
    const links = Object.values(state.rows("links"));
    drawGraph(box.querySelector("canvas"), Object.keys(state.rows("platforms")), links, Object.values(state.rows("streams")).filter((row) => row.rate));
    const rows = Object.entries(state.rows("streams")).sort(([a], [b]) => a.localeCompare(b, undefined, { numeric: true }));
    const byStream = new Map();
    for (const link of links) { const key = `${link.from} ${link.label}`; byStream.set(key, [...(byStream.get(key) || []), link]); }
    const lines = rows.slice(0, 400).map(([name, row]) => {
      const taken = byStream.get(name) || [], lost = taken.reduce((sum, link) => sum + (link.lost || 0), 0), missing = taken.reduce((sum, link) => sum + (link.missing || 0), 0);
      const age = row.valid_us ? Math.max(0, state.t - row.valid_us) : null, isOld = age !== null && row.period_us && age > 10 * row.period_us + 2e6;
      const rates = [...taken.map((link) => link.rate), row.rate].filter((rate) => rate !== null && rate !== undefined);
      const delays = [row.delay_us, ...taken.map((link) => link.delay_us)].filter((us) => us !== undefined && us !== null), slowest = delays.length ? Math.max(...delays) : undefined;
      return el("tr", { cls: lost || isOld ? "bad" : missing ? "warn" : "" }, el("td", { text: row.unit }), el("td", { text: row.label }), el("td", { cls: "n", text: `${rates.length ? Number(Math.min(...rates).toPrecision(2)) : "–"}${row.period_us ? ` / ${Number((1e6 / row.period_us).toPrecision(2))}` : ""}` }),
        el("td", { cls: "n", text: age === null ? "" : span(age) }), el("td", { cls: "n", text: slowest === undefined ? "" : span(slowest) }), el("td", { text: [...new Set(taken.map((link) => link.to))].join(" ") }), el("td", { cls: "n", text: missing || lost ? `${missing} / ${lost}` : "" }));
    });
    const table = el("table", {}, el("tr", {}, ...["of", "label", "Hz", "age", "delay", "to", "gaps"].map((words, at) => el("th", { cls: at > 1 && at !== 5 ? "n" : "", text: words }))), ...lines);
    if (performance.now() - (this.tableAt || 0) > 900 || !$("stream-table").firstChild) { this.tableAt = performance.now(); $("stream-table").replaceChildren(table); }
  }

  events(box) {
    const rows = Object.entries(state.rows("events")).reverse();
    if (!rows.length) return keyed(box, empty("Nothing has happened yet."));
    const signs = { info: ["·", ""], warning: ["▲", "warn"], bad: ["⚠", "bad"] };
    keyed(box, rows.map(([name, row]) => [name, "", () => el("div", { cls: "event" }, el("span", { cls: "dim", text: clockText(row.at_us) }), mark(signs[row.level] || signs.info), el("span", { text: row.text }))]));
  }

  drawMarks() { drawTimeline($("marks"), Object.values(state.rows("alarms")), state.about); }
}

function isSeen(card, box) { const a = card.getBoundingClientRect(), b = box.getBoundingClientRect(); return a.bottom > b.top && a.top < b.bottom; }
