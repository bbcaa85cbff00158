// The workbench's page: what the server knows, drawn; what is pressed, sent to it.

import uPlot from "uplot";
import { Group } from "./group.js";
import { significant, ticks } from "./number.js";
import { saveButtons } from "./save.js";

/**
 * @typedef {{id: number, parent: number | null, step: string, command: string, rmse: number | null, noise_rmse: number | null, fit_percent: number | null}} Model
 * @typedef {{effect: string, error_reduction_percent: number, p_value: number, significant: boolean, parameters: Record<string, {value: number, unit: string, low: number, high: number}>, confounded_with: string[]}} Candidate
 * @typedef {{headline: string, meaning: string, missing: string[], ranking: Candidate[], picture: string}} Diagnosis
 * @typedef {object} State
 * @property {{title: string, path: string, hash: string, period: number, records: {name: string, use: string, samples: number}[], remarks: string[]}} data
 * @property {string} project
 * @property {number | null} current
 * @property {Model[]} models
 * @property {string[]} log
 * @property {{describe: string, columns: string[], rows: string[][], where: string[], where_picture: string, ladder_picture: string, error: string | null} | null} model
 * @property {Diagnosis | null} diagnosis
 * @property {{name: string, now: string, searches: [number, number][][]} | null} work
 */

const token = new URLSearchParams(location.search).get("token") ?? "";

/** @param {string} path @param {unknown=} body @returns {Promise<any>} */
async function ask(path, body) {
  const response = await fetch(path, {
    method: body === undefined ? "GET" : "POST",
    headers: { "x-token": token, "content-type": "application/json" },
    body: body === undefined ? undefined : JSON.stringify(body),
  });
  const text = await response.text();
  if (response.ok) return JSON.parse(text);
  let why = text;
  try {
    why = JSON.parse(text).error;
  } catch {
    // Not of the bench: the text says it.
  }
  throw new Error(why);
}

/**
 * An element with attributes, listeners (`onclick`) and children.
 * @param {string} tag @param {Record<string, any>=} attributes @param {...(Node | string | null | undefined)} children
 */
function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, String(value));
  }
  element.append(...children.filter((c) => c !== null && c !== undefined));
  return element;
}

/** @param {string} id */
const place = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** A picture of the server, which escapes what is the user's. @param {string} svg @param {string=} group */
function picture(svg, group) {
  const figure = el("figure", group ? { "data-group": group } : {});
  figure.innerHTML = svg;
  saveButtons([figure]);
  return figure;
}

/** @type {State | null} */
let state = null;
/** Models that are shown beside the current one. @type {Set<number>} */
const beside = new Set();
/** @type {Group | null} */
let group = null;
let shown = "";

/** @param {unknown} error */
function complain(error) {
  place("message").replaceChildren(
    el("div", { class: "verdict warning", role: "alert" }, el("p", {}, error instanceof Error ? error.message : String(error))),
  );
}

/** @param {() => Promise<unknown>} does */
async function attempt(does) {
  place("message").replaceChildren();
  try {
    await does();
  } catch (error) {
    complain(error);
  }
}

const run = (/** @type {object} */ request) => attempt(() => ask("/api/run", request));

async function refresh() {
  state = await ask("/api/state");
  draw();
  await records();
}

function draw() {
  if (!state) return;
  drawData(state);
  drawWork(state);
  drawModels(state);
  drawModel(state);
  drawDiagnosis(state);
  place("log").replaceChildren(
    state.log.length ? el("pre", { tabindex: "0", "aria-label": "commands" }, state.log.join("\n")) : el("p", {}, "Nothing was done yet."),
  );
}

/** @param {State} s */
function drawData(s) {
  document.title = `Workbench: ${s.data.title}`;
  place("title").textContent = s.data.title;
  place("project").textContent = `project folder ${s.project}`;
  place("data").replaceChildren(
    el("p", {}, `${s.data.records.length} records at ${significant(1000 * s.data.period, 3)} ms: `,
      s.data.records.map((r) => `${r.name} (${r.use}, ${significant(r.samples * s.data.period, 3)} s)`).join(", ")),
    ...(s.data.remarks.length ? [el("ul", {}, ...s.data.remarks.map((r) => el("li", {}, r)))] : []),
  );
}

/** @param {State} s */
function drawModels(s) {
  const under = (/** @type {number | null} */ parent) => {
    const children = s.models.filter((m) => m.parent === parent);
    return children.length ? el("ul", { class: "tree" }, ...children.map(branch)) : null;
  };
  /** @param {Model} m @returns {HTMLElement} */
  const branch = (m) => {
    const current = m.id === s.current;
    return el("li", {},
      el("button", { type: "button", class: current ? "model current" : "model", "aria-pressed": current, onclick: () => attempt(() => ask("/api/select", { model: m.id })) },
        `${m.id}. ${m.step}`),
      " ",
      el("span", { class: "muted" }, m.rmse === null ? "diverges" : `RMSE ${significant(m.rmse, 3)}${m.noise_rmse ? ` (${significant(m.rmse / m.noise_rmse, 3)} × noise)` : ""}`),
      " ",
      current ? null : el("label", {}, el("input", { type: "checkbox", checked: beside.has(m.id), onchange: () => {
        if (!beside.delete(m.id)) beside.add(m.id);
        void attempt(records);
      } }), "show beside"),
      under(m.id));
  };
  const current = s.models.find((m) => m.id === s.current);
  place("models").replaceChildren(
    under(null) ?? el("p", {}, "No model yet: identify one above."),
    ...(current ? [el("p", { class: "actions" },
      el("button", { type: "button", disabled: current.parent === null, onclick: () => attempt(() => ask("/api/select", { model: current.parent })) }, "Undo"),
      ...[["model", "model.toml"], ["constants", "identified.rs"], ["report", "report.html"]].map(([kind, name]) =>
        el("a", { href: `/api/file/${kind}/${current.id}?token=${token}`, download: name }, `download ${name}`)))] : []),
  );
}

/** @param {State} s */
function drawModel(s) {
  const { model } = s;
  const sections = ["match", "where", "records", "missing"].map((id) => place(`${id}-section`));
  sections.forEach((section) => (section.hidden = !model));
  if (!model) return;
  place("match").replaceChildren(
    el("p", {}, model.describe),
    ...(model.error ? [el("div", { class: "verdict warning" }, el("p", {}, model.error))] : []),
    picture(model.ladder_picture),
    el("div", { class: "table" }, el("table", {},
      el("thead", {}, el("tr", {}, ...model.columns.map((c, i) => el("th", { scope: "col", class: i > 1 ? "n" : "" }, c)))),
      el("tbody", {}, ...model.rows.map((row) => el("tr", {}, ...row.map((cell, i) => el("td", { class: i > 1 ? "n" : "" }, cell))))))),
  );
  place("where").replaceChildren(
    ...model.where.map((sentence) => el("p", {}, sentence)),
    picture(model.where_picture, "g1"),
  );
}

/** @param {State} s */
function drawDiagnosis(s) {
  const found = s.diagnosis;
  const model = s.current;
  const button = el("button", { type: "button", id: "diagnose", disabled: s.work !== null, onclick: () => run({ action: "diagnose", model }) }, "Diagnose");
  if (!found) {
    place("missing").replaceChildren(el("p", {}, "Every effect of the catalogue is refitted with everything else and judged on the held-out records."), button);
    return;
  }
  const row = (/** @type {Candidate} */ c) =>
    el("tr", {},
      el("td", {}, c.effect),
      el("td", { class: "n" }, `${significant(c.error_reduction_percent, 3)} %`),
      el("td", { class: "n" }, significant(c.p_value, 2)),
      el("td", {}, c.significant ? "yes" : "no"),
      el("td", {}, Object.entries(c.parameters).map(([name, p]) => `${name} ${significant(p.value, 3)} ${p.unit} (${significant(p.low, 3)} to ${significant(p.high, 3)})`).join("; ")),
      el("td", {}, el("button", { type: "button", disabled: s.work !== null, "aria-label": `add ${c.effect}`, onclick: () => run({ action: "extend", model, effect: c.effect }) }, "Add")));
  place("missing").replaceChildren(
    el("div", { class: "verdict finding" }, el("p", { class: "headline" }, found.headline), el("p", {}, found.meaning)),
    ...(found.ranking.length ? [
      picture(found.picture),
      el("div", { class: "table" }, el("table", {},
        el("thead", {}, el("tr", {}, ...["effect", "error falls", "p", "counts", "parameters (95 % interval)", ""].map((c, i) => el("th", { scope: "col", class: i === 1 || i === 2 ? "n" : "" }, c)))),
        el("tbody", {}, ...found.ranking.map(row)))),
    ] : []),
    button,
  );
}

/** @type {uPlot | null} */
let curve = null;

/** @param {State} s */
function drawWork(s) {
  const busy = s.work !== null;
  for (const button of document.querySelectorAll("#identify button")) button.toggleAttribute("disabled", busy);
  place("work").hidden = !busy;
  curve?.destroy();
  curve = null;
  if (!s.work) return;
  place("work-name").textContent = s.work.name;
  place("work-now").textContent = s.work.now;
  progress(s.work.searches);
}

/** The best so far over the evaluations: one line for each search, one behind the other. @param {[number, number][][]} searches */
function progress(searches) {
  if (searches.flat().length < 2) return;
  const style = getComputedStyle(document.documentElement);
  const colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour("--ink"), grid: { stroke: colour("--grid") }, ticks: { stroke: colour("--axis") } };
  /** @type {(number | null)[][]} */
  const data = [[], []];
  let before = 0;
  for (const search of searches) {
    for (const [evaluations, best] of search ?? []) {
      data[0].push(before + evaluations);
      data[1].push(best);
    }
    before = Number(data[0].at(-1) ?? 0) + 1;
    // A gap: the next search starts from its own guess.
    data[0].push(before);
    data[1].push(null);
  }
  if (curve) return curve.setData(/** @type {uPlot.AlignedData} */ (data));
  const values = (/** @type {uPlot} */ _u, /** @type {number[]} */ splits) => ticks(splits, splits.length > 1 ? splits[1] - splits[0] : 1);
  curve = new uPlot(
    {
      width: Math.min(620, place("work").clientWidth || 620),
      height: 180,
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false } },
      axes: [{ ...axis, values, label: "evaluations" }, { ...axis, values, label: "best so far", size: 70 }],
      series: [{}, { stroke: colour("--s0"), width: 2, points: { show: false } }],
    },
    /** @type {uPlot.AlignedData} */ (data),
    place("curve"),
  );
}

/** Brings the curves of the current model, and of those beside it. */
async function records() {
  if (!state) return;
  const existing = state.models.map((m) => m.id);
  const models = [...[...beside].filter((id) => existing.includes(id) && id !== state?.current), ...(state.current ? [state.current] : [])].slice(-6);
  const key = JSON.stringify([models, state.current]);
  const where = state.model !== null;
  if (key === shown && group && where) {
    // The bars were drawn anew.
    group.rebind();
    return;
  }
  const payload = await ask(`/api/records?models=${models.join(",")}`);
  shown = key;
  const target = place("g1");
  group?.destroy();
  target.replaceChildren();
  place("records-section").hidden = false;
  group = new Group(target, payload);
  Object.assign(globalThis, { hostFit: { groups: [group] } });
}

function listen() {
  const events = new EventSource(`/api/events?token=${token}`);
  events.onopen = () => {
    place("offline").hidden = true;
    void attempt(refresh);
  };
  events.onerror = () => (place("offline").hidden = false);
  events.onmessage = (message) => {
    const event = JSON.parse(message.data);
    if (event.kind === "now" && state?.work) {
      state.work.now = event.words;
      place("work-now").textContent = event.words;
    } else if (event.kind === "best" && state?.work) {
      (state.work.searches[event.search] ??= []).push([event.evaluations, event.best]);
      place("work-now").textContent = `${event.evaluations} evaluations, best ${significant(event.best)}`;
      progress(state.work.searches);
    } else if (event.kind === "warning") {
      complain(event.words);
    } else if (event.kind === "ends") {
      void refresh().then(() => event.error && complain(event.error), complain);
    } else {
      void refresh().catch(complain);
    }
  };
}

const form = /** @type {HTMLFormElement} */ (place("identify"));
form.addEventListener("submit", (event) => {
  event.preventDefault();
  const fields = new FormData(form);
  const number = (/** @type {string} */ name) => {
    const text = String(fields.get(name) ?? "");
    return text === "" ? null : Number(text);
  };
  void run({
    action: "identify",
    delay: fields.get("delay") || null,
    n1: number("n1"),
    n2: number("n2"),
    max_lag: number("max_lag"),
    evaluations: number("evaluations"),
    seed: number("seed") ?? 0,
  });
});
place("cancel").addEventListener("click", () => attempt(() => ask("/api/cancel", {})));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => group?.restyle());
listen();
