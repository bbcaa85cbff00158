// The workbench's page: what the server knows, drawn; what is pressed, sent to it.

import { Group } from "./group.js";
import { significant } from "./number.js";
import { button, el, inline, options, picture, place, table } from "./bench/dom.js";
import * as editor from "./bench/editor.js";
import * as importer from "./bench/importer.js";
import { grips } from "./bench/panes.js";
import { clear, left, progress } from "./bench/progress.js";
import { ask, attempt, complain, fileOf, run, token } from "./bench/server.js";

/**
 * @typedef {import("./bench/server.js").State} State
 * @typedef {import("./bench/server.js").Model} Model
 */

/** @type {State | null} */
let state = null;
/** Models that are shown beside the current one: kept in the address. @type {Set<number>} */
const beside = new Set(/beside=([\d,]+)/.exec(location.hash)?.[1].split(",").map(Number));
/** @type {Group | null} */
let group = null;
let shown = "";

/** Answers may come out of turn: the one that was asked for last counts. */
let turn = 0;
let wanted = "";

async function refresh() {
  const mine = ++turn;
  const told = await ask("/api/state");
  if (mine !== turn) return;
  state = told;
  draw();
  await records();
}

function draw() {
  if (!state) return;
  drawData(state);
  drawWork(state);
  drawModels(state);
  drawModel(state);
  drawSteps(state);
  drawDiagnosis(state);
  drawDiscovery(state);
  drawLaw(state);
  drawAnswers(state);
  editor.drawOwn(state, refresh);
  place("log").replaceChildren(
    state.log.length ? el("pre", { tabindex: "0", "aria-label": "commands" }, state.log.join("\n")) : el("p", {}, "Nothing was done yet."),
  );
}

/** @param {string} id @param {boolean} there */
const section = (id, there) => (place(`${id}-section`).hidden = !there);

/** Whether there were data when the page was drawn last. */
let had = false;

/** @param {State} s */
function drawData(s) {
  const { data } = s;
  document.title = `Workbench: ${data?.title ?? "no data yet"}`;
  place("title").textContent = data?.title ?? "Workbench";
  place("project").textContent = `project folder ${s.project}`;
  const importing = /** @type {HTMLDetailsElement} */ (place("import"));
  place("import-note").hidden = s.models.length === 0;
  section("identify", data !== null);
  section("models", data !== null);
  section("own", s.current !== null);
  importer.drawUploads(s.uploads);
  const bundled = () => does(s, "Try the bundled recordings", () => attempt(async () => { await ask("/api/ask", { bundled: "" }); await refresh(); }), { id: "bundled" });
  place("hint").hidden = data !== null;
  if (data && !had && s.uploads.length === 0) importing.open = false;
  had = data !== null;
  if (!data) {
    importing.open = true;
    place("data").replaceChildren(el("p", {}, "No data set yet: import recordings."), el("p", {}, bundled(), " A simulated ramp with a hidden effect, eight records."));
    return;
  }
  place("data").replaceChildren(
    el("p", {}, `${data.records.length} records at ${significant(1000 * data.period, 3)} ms`),
    validation(s, data),
    ...(data.remarks.length ? [el("p", {}, "Excitation of the commands:"), el("ul", {}, ...data.remarks.map((r) => el("li", {}, r)))] : [el("p", {}, "The commands excite the plant enough for a model of this kind.")]),
  );
}

/** The records, with the choice of those that validate. @param {State} s @param {NonNullable<State["data"]>} data */
function validation(s, data) {
  const boxes = data.records.map((r) => /** @type {HTMLInputElement} */ (el("input", { type: "checkbox", value: r.name, checked: r.use === "validate", onchange: () => changed() })));
  const choose = does(s, "Use this choice", () => attempt(async () => {
    await ask("/api/ask", { validate: boxes.filter((box) => box.checked).map((box) => box.value).join("\n") });
    await refresh();
  }), { id: "choose" });
  const note = el("span", { class: "muted" }, s.models.length ? "The models move into the folder earlier-1: their validation errors were computed on other records." : "");
  const chosen = el("p", { hidden: true }, choose, " ", note);
  const changed = () => (chosen.hidden = boxes.every((box, i) => box.checked === (data.records[i].use === "validate")));
  return el("fieldset", { class: "records" }, el("legend", {}, "validation records"),
    ...boxes.map((box, i) => el("label", {}, box, `${data.records[i].name} (${significant(data.records[i].samples * data.period, 3)}\u00a0s)`)), chosen);
}

/** @param {Model} m */
const error = (m) => (m.rmse === null ? "diverges" : `RMSE ${significant(m.rmse, 3)}${m.noise_rmse ? ` (${significant(m.rmse / m.noise_rmse, 3)} × noise)` : ""}`);

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
      el("i", { class: `swatch s${colour(m.id)}`, "aria-hidden": "true" }), " ",
      button(`${m.id}. ${m.step}`, () => attempt(() => ask("/api/select", { model: m.id })), { class: current ? "model current" : "model", "aria-pressed": current ? "true" : "false" }),
      " ", el("span", { class: "muted" }, error(m)), " ",
      current ? null : el("label", {}, el("input", { type: "checkbox", checked: beside.has(m.id), onchange: () => {
        if (!beside.delete(m.id)) beside.add(m.id);
        address();
        void attempt(records);
      } }), "show beside"),
      under(m.id));
  };
  const current = s.models.find((m) => m.id === s.current);
  const files = [["model", "model.toml"], ["constants", "identified.rs"], ["report", "report.html"], ...(s.law?.picture ? [["loop", "loop.csv"]] : [])];
  place("models").replaceChildren(
    under(null) ?? el("p", {}, "No model yet: identify one below."),
    ...(current ? [el("p", { class: "actions" },
      button("Undo", () => attempt(() => ask("/api/select", { model: current.parent })), { disabled: current.parent === null }),
      ...files.map(([kind, name]) => el("a", { href: fileOf(kind, current.id), download: name }, `download ${name}`)))] : []),
  );
}

/** Which models are beside goes into the address, so that a view can be sent. */
function address() {
  const words = location.hash.replace(/^#/, "").split("&").filter((word) => word !== "" && !word.startsWith("beside="));
  if (beside.size) words.push(`beside=${[...beside].join(",")}`);
  history.replaceState(history.state, "", words.length ? `#${words.join("&")}` : location.pathname + location.search);
}

/** @param {State} s */
function drawModel(s) {
  const { model, made } = s;
  for (const id of ["stretch", "match", "where", "checks", "steps", "law", "model"]) section(id, model !== null);
  if (!model) return;
  const figure = (/** @type {import("./bench/server.js").Figure} */ f) => picture(f.picture, { caption: f.caption });
  section("stretch", model.stretch.length > 0);
  place("stretch").replaceChildren(...model.stretch.map(figure));
  place("match").replaceChildren(
    ...(model.error ? [el("div", { class: "verdict warning" }, el("p", {}, model.error))] : []),
    picture(model.ladder_picture),
    el("h3", {}, "Every record"),
    table(model.columns, model.rows, (i) => i > 1),
    ...(s.models.length > 1 ? [
      el("h3", {}, "Every model, on the same records"),
      table(["model", "FIT, %", "RMSE", "× noise"], s.models.map((m) => [
        `${m.id}. ${m.step}`,
        ...[m.fit_percent, m.rmse, m.rmse && m.noise_rmse && m.rmse / m.noise_rmse].map((v) => (v === null ? "–" : significant(v, 3))),
      ]), (i) => i > 0),
    ] : []),
  );
  place("where").replaceChildren(
    ...model.where.map((sentence) => el("p", {}, ...inline(sentence))),
    picture(model.where_picture, { group: "g1" }),
  );
  section("checks", model.checks.length > 0);
  place("checks").replaceChildren(
    ...model.checks.map(figure),
    ...(model.poles.length ? [el("div", {}, el("h3", {}, "Poles"), el("p", { class: "caption" }, model.poles_are),
      table(model.pole_columns.slice(1), model.poles.map((row) => row.slice(1)), (i) => i > 0))] : []),
  );
  const interval = (/** @type {string} */ effect, /** @type {string} */ name) => {
    const known = made?.parameters ?? {};
    const p = known[name] ?? known[`${effect}.${name}`] ?? known[`${effect} ${name}`];
    return p ? `${significant(p.low, 3)} … ${significant(p.high, 3)}` : "";
  };
  place("model").replaceChildren(
    el("p", {}, model.describe),
    ...(model.parameters.length ? [table(["parameter", "value", "95 % interval"],
      model.parameters.map(([effect, name, value, unit]) => [`${effect}: ${name}`, `${value}${unit ? ` ${unit}` : ""}`, interval(effect, name)]), (i) => i > 0)] : []),
  );
}

/** A colour stays with a model. @param {number} id */
const colour = (id) => (id - 1) % 6;

/** The steps that start from the current model. @param {State} s */
function drawSteps(s) {
  const { current: model } = s;
  if (model === null) return;
  place("steps").replaceChildren(
    does(s, s.diagnosis ? "Diagnose again" : "Diagnose", { command: "diagnose", model }, { id: "diagnose", class: s.diagnosis ? "" : "primary" }),
    does(s, s.discovery ? "Discover again" : "Discover", { command: "discover", model }, { id: "discover" }),
    el("p", { class: "muted" }, "Diagnose refits every effect of the catalogue. Discover looks for a term outside the catalogue."),
  );
}

/** What is known: the newest answer first. @param {State} s */
function drawAnswers(s) {
  const { made, diagnosis, discovery, law } = s;
  const cards = [law?.answer, discovery?.answer, diagnosis?.answer, made?.answer].filter((a) => a !== undefined && a !== null);
  section("answer", cards.length > 0);
  place("answer").replaceChildren(...cards.map(verdict));
  listPlots();
}

/** The plots that there are, as links above them. */
function listPlots() {
  const plots = [...document.querySelectorAll("#middle > section:not([hidden])")];
  place("plots").hidden = plots.length < 2;
  place("plots").replaceChildren(el("ul", {}, ...plots.map((plot) =>
    el("li", {}, el("a", { href: `#${plot.id}`, onclick: (/** @type {Event} */ event) => { event.preventDefault(); plot.scrollIntoView(); } }, plot.querySelector("h2")?.textContent ?? "")))));
}

/** Where the result of a step is. */
const RESULT = /** @type {Record<string, string>} */ ({ identify: "stretch", diagnose: "missing", discover: "discovery", extend: "stretch", design: "loop", import: "records" });

/** @param {State} s @param {string} text @param {object | (() => unknown)} request @param {Record<string, any>=} attributes */
const does = (s, text, request, attributes = {}) => button(text, () => (typeof request === "function" ? request() : run(request)), { disabled: s.work !== null, ...attributes });

/** An answer as a card: verdict, evidence, confidence, notes. @param {import("./bench/server.js").Answer} answer */
const verdict = ({ tone, verdict, evidence, confidence, notes }) =>
  el("div", { class: `verdict ${tone}` },
    el("p", { class: "headline" }, verdict),
    el("dl", {}, ...[["Evidence", evidence], ["Confidence", confidence]].flatMap(([name, text]) => (text ? [el("dt", {}, name), el("dd", {}, ...inline(text))] : []))),
    ...(notes.length ? [el("details", {}, el("summary", {}, `${notes.length} note${notes.length === 1 ? "" : "s"}`), el("ul", {}, ...notes.map((note) => el("li", {}, ...inline(note)))))] : []));

/** @param {State} s */
function drawDiagnosis(s) {
  const { diagnosis: found, current: model } = s;
  section("missing", found !== null);
  if (model === null || !found) return;
  const has = s.model?.effects ?? [];
  const missing = found.missing.filter((effect) => !has.includes(effect));
  const row = (/** @type {string[]} */ cells) => [
    ...cells,
    does(s, "Add", { command: "extend", model, options: { effect: cells[0] } }, { "aria-label": `add ${cells[0]}`, disabled: s.work !== null || has.includes(cells[0]) }),
  ];
  place("missing").replaceChildren(
    ...(missing.length ? [el("p", { class: "actions" }, does(s, `Add what is missing: ${missing.join(", ")}`, { command: "extend", model, options: { effect: missing } }, { class: "primary", id: "add-missing" }))] : []),
    ...(found.ranking.length ? [
      picture(found.picture),
      table(["effect", "outcome", "error falls", "nats", "p", "parameters (95 % interval)", ""], found.rows.map(row), (i) => i >= 2 && i <= 4),
    ] : []),
    ...(found.experiment && found.experiment_picture ? [
      el("h3", {}, `Experiment that distinguishes ${found.experiment.effects.join(", ")}`),
      el("p", {}, found.experiment.description),
      picture(found.experiment_picture),
    ] : []),
    el("p", { class: "actions" },
      ...(found.experiment ? [el("a", { href: fileOf("experiment", model), download: "experiment.csv" }, "download experiment.csv")] : []),
      el("a", { href: fileOf("diagnosis", model), download: "diagnosis.html" }, "download diagnosis.html")),
  );
}

/** @param {State} s */
function drawDiscovery(s) {
  const { discovery: found, current: model } = s;
  section("discovery", found !== null);
  if (model === null || !found) return;
  // The model with the terms stands in the tree: whoever wants it goes there.
  const heir = s.models.find((m) => m.parent === model && found.terms.length > 0 && m.step === `+ ${found.terms.map((t) => t.effect).join(" + ")}`);
  place("discovery").replaceChildren(
      ...(heir ? [el("p", { class: "actions" }, button(`Go to model ${heir.id}`, () => attempt(() => ask("/api/select", { model: heir.id })), { class: "primary", id: "go-on" }),
        el("span", { class: "muted" }, `validation error ${error(heir)}`))] : [el("p", {}, found.answer.verdict)]),
      ...found.terms.flatMap((term) => [
        el("h3", {}, term.title),
        picture(term.picture),
        el("p", {}, term.is_formula ? "As a formula: " : "No formula fits equally well; as a table: ", el("code", {}, term.formula)),
        el("p", {}, button("Open its effect file", () => editor.edit(term.file), { "aria-label": `Open its effect file: ${term.effect}` })),
      ]),
    el("p", { class: "actions" }, el("a", { href: fileOf("discovery", model), download: "discovery.html" }, "download discovery.html")),
  );
}

/** @param {State} s */
function drawLaw(s) {
  for (const b of document.querySelectorAll("#design button")) b.toggleAttribute("disabled", s.work !== null);
  const { law } = s;
  section("loop", law !== null);
  if (!law) return;
  place("law").replaceChildren(
    picture(law.picture),
    ...law.words.split("\n").map((line) => el("p", {}, ...inline(line))),
    ...(law.margin ? [picture(law.margin)] : []),
    el("h3", {}, "Every trial"),
    el("p", { class: "caption" }, ...inline(law.caption)),
    table(law.columns, law.rows, (i) => i > 2),
  );
}

/** @param {State} s */
function drawWork(s) {
  for (const b of document.querySelectorAll("#identify button")) b.toggleAttribute("disabled", s.work !== null);
  place("work").hidden = s.work === null;
  clear();
  if (!s.work) {
    seen = "";
    group?.search(null);
    return;
  }
  place("work-name").textContent = s.work.name;
  place("work-now").textContent = s.work.now;
  progress(s.work.best);
  left(s.work);
}

/** Brings the curves of the current model, and of those beside it. */
async function records() {
  if (!state) return;
  if (!state.data) {
    section("records", false);
    return;
  }
  const existing = state.models.map((m) => m.id);
  const models = [...[...beside].filter((id) => existing.includes(id) && id !== state?.current), ...(state.current ? [state.current] : [])].slice(-6);
  const key = JSON.stringify([models, state.data.hash]);
  wanted = key;
  if (key === shown && group) {
    // The bars were drawn anew.
    group.rebind();
    return;
  }
  const payload = await ask(`/api/records?models=${models.join(",")}`);
  if (key !== wanted) return;
  shown = key;
  section("records", true);
  listPlots();
  group?.destroy();
  place("g1").replaceChildren();
  // Names begin with the model's number; of a search, the next one's.
  const ids = payload.runs.map((/** @type {string} */ name) => Number.parseInt(name, 10));
  payload.colours = [...ids, Math.max(0, ...existing) + 1].map(colour);
  // A few pulses at first, not a solid block of them.
  const longest = Math.max(...payload.records.map((/** @type {{n: number, period: number}} */ r) => r.n * r.period));
  payload.view ??= [0, Math.min(longest, 2000 * state.data.period)];
  group = new Group(place("g1"), payload);
  Object.assign(globalThis, { hostFit: { groups: [group] } });
}

/** What the search has found so far, over the records: asked for while it runs, at most once a second. */
let seen = "";
let asking = false;
async function glimpse() {
  if (asking) return;
  asking = true;
  try {
    const best = await ask("/api/ask", { best: seen });
    if (best.runs && state?.work) {
      seen = String(best.evaluations);
      group?.search(best.runs);
    }
    await new Promise((later) => setTimeout(later, 1000));
  } finally {
    asking = false;
  }
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
      left(state.work);
    } else if (event.kind === "best" && state?.work) {
      const { best } = state.work;
      // Fewer evaluations than before are another search's.
      if (event.evaluations < (best.at(-1)?.[0] ?? 0)) best.length = 0;
      best.push([event.evaluations, event.best]);
      state.work.budget = event.budget;
      left(state.work);
      place("work-now").textContent = `${event.evaluations} evaluations, best ${significant(event.best)}`;
      progress(best);
      void glimpse().catch(() => {});
    } else if (event.kind === "warning") {
      complain(event.words);
    } else if (event.kind === "ends") {
      const step = /^host-fit (\S+)/.exec(state?.work?.name ?? "")?.[1] ?? "";
      void refresh().then(() => {
        if (event.error) complain(event.error);
        else document.getElementById(`${RESULT[step]}-section`)?.scrollIntoView();
      }, complain);
    } else {
      void refresh().catch(complain);
    }
  };
}

for (const [id, command] of [["identify", "identify"], ["design", "design"]]) {
  const form = /** @type {HTMLFormElement} */ (place(id));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const model = command === "design" ? { model: state?.current } : {};
    void run({ command, ...model, options: options(form) });
  });
}
place("cancel").addEventListener("click", () => attempt(() => ask("/api/cancel", {})));
grips();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => group?.restyle());
importer.listen();
editor.listen(refresh);
listen();
