// The workbench's page: what the server knows, drawn; what is pressed, sent to it.

import { Group } from "./group.js";
import { significant } from "./number.js";
import { button, el, inline, options, picture, place, table } from "./bench/dom.js";
import * as editor from "./bench/editor.js";
import * as importer from "./bench/importer.js";
import { grips } from "./bench/panes.js";
import { clear, left, progress, said, stage } from "./bench/progress.js";
import { ask, attempt, complain, ended, fileOf, run, token } from "./bench/server.js";

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

let wanted = "";
/** Steps begin and end while the state is on its way: the events know better. */
let events = 0;

/** @type {Promise<void> | null} */
let refreshing = null;
let again = false;

/** Asks for the state and draws it: one request at a time; whoever asks meanwhile gets the next one. */
function refresh() {
  again = true;
  refreshing ??= (async () => {
    try {
      while (again) {
        again = false;
        await refreshOnce();
      }
    } finally {
      refreshing = null;
    }
  })();
  return refreshing;
}

async function refreshOnce() {
  const before = events;
  const told = await ask("/api/state");
  if (before !== events && state) {
    told.work = state.work;
    again = true;
  }
  state = told;
  draw();
  await Promise.all([records(), figures()]);
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
        void attempt(() => Promise.all([records(), figures()]));
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
  const { model } = s;
  for (const id of ["match", "where", "steps", "law", "model"]) section(id, model !== null);
  if (!model) return;
  place("match").replaceChildren(
    ...(model.error ? [el("div", { class: "verdict warning" }, el("p", {}, model.error))] : []),
    picture(model.ladder_picture),
    el("h3", {}, "Every record"),
    table(model.columns, model.rows, (i) => i > 1),
    ...(s.models.length > 1 ? [
      el("h3", {}, "Every model, on the same records"),
      table(["model", "parameters", "FIT, %", "RMSE", "× noise"], s.models.map((m) => [
        `${m.id}. ${m.step}`,
        m.parameters === null ? "–" : String(m.parameters),
        ...[m.fit_percent, m.rmse, m.rmse && m.noise_rmse && m.rmse / m.noise_rmse].map((v) => (v === null ? "–" : significant(v, 3))),
      ]), (i) => i > 0),
    ] : []),
  );
  place("where").replaceChildren(
    ...model.where.map((sentence) => el("p", {}, ...inline(sentence))),
    picture(model.where_picture, { group: "g1" }),
  );
  const known = s.intervals ?? {};
  const interval = (/** @type {string} */ effect, /** @type {string} */ name) => known[`${effect}.${name}`] ?? known[`${effect} ${name}`] ?? known[name];
  const some = model.parameters.some(([effect, name]) => interval(effect, name));
  const value = (/** @type {string} */ number, /** @type {string} */ unit) => `${number}${unit ? ` ${unit}` : ""}`;
  place("model").replaceChildren(
    el("p", {}, model.describe),
    ...(model.parameters.length ? [table(["parameter of an effect", some ? "value (95 % interval)" : "value"],
      model.parameters.map(([effect, name, number, unit]) => {
        const p = interval(effect, name);
        return [`${effect}: ${name}`, `${value(number, unit)}${p ? ` (${significant(p.low, 3)}\u00a0…\u00a0${significant(p.high, 3)})` : ""}`];
      }), (i) => i > 0)] : []),
    ...(model.base.length ? [table(["coefficient", "value"],
      model.base.map(([name, lag, number, unit]) => [`${name}${lag ? ` (lag ${lag})` : ""}`, value(number, unit)]), (i) => i > 0)] : []),
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
const does = (s, text, request, attributes = {}) => button(text, () => (typeof request === "function" ? request() : run(request)), steps(s, attributes));

/** Attributes of a button that begins a step: it can be pressed while none runs, unless it is `off`. @param {State} s @param {Record<string, any>} attributes */
const steps = (s, { off = false, ...attributes }) => ({ ...attributes, "data-step": off ? "off" : "on", disabled: off || s.work !== null });

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
    does(s, "Add", { command: "extend", model, options: { effect: cells[0] } }, { "aria-label": `add ${cells[0]}`, off: has.includes(cells[0]) }),
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
  const { law } = s;
  section("loop", law !== null);
  if (!law) return;
  // The trials are many rows: they open when they are asked for, and stay as they are.
  const open = /** @type {HTMLDetailsElement | null} */ (document.querySelector("#law details"))?.open ?? false;
  place("law").replaceChildren(
    picture(law.picture),
    ...law.words.split("\n").map((line) => el("p", {}, ...inline(line))),
    ...(law.margin ? [picture(law.margin)] : []),
    el("details", { open }, el("summary", {}, `Every trial (${law.rows.length})`),
      el("p", { class: "caption" }, ...inline(law.caption)),
      table(law.columns, law.rows, (i) => i > 2)),
  );
}

/** @param {State} s */
function drawWork(s) {
  for (const b of document.querySelectorAll("#identify button, #design button, [data-step]")) {
    b.toggleAttribute("disabled", s.work !== null || b.getAttribute("data-step") === "off");
  }
  editor.enable(s);
  place("work").hidden = s.work === null;
  clear();
  if (!s.work) {
    seen = "";
    group?.search(null);
    return;
  }
  place("work-name").textContent = s.work.name;
  place("work-now").textContent = said(s.work);
  progress(s.work.best);
  left(s.work);
}

/** The models that are shown, the current one last: at most six. @param {State} s */
function shownModels(s) {
  const existing = s.models.map((m) => m.id);
  return [...[...beside].filter((id) => existing.includes(id) && id !== s.current), ...(s.current ? [s.current] : [])].slice(-6);
}

/** The figures that are drawn, and those that are asked for: models and data. */
let drawn = "";
let figuring = "";

/** Brings the figures of the models that are shown: largest error, residual tests, poles. */
async function figures() {
  if (!state) return;
  const models = shownModels(state);
  const key = JSON.stringify([models, state.data?.hash]);
  if (key === figuring) return;
  figuring = key;
  for (const id of ["stretch", "checks"]) {
    section(id, models.length > 0);
    if (key !== drawn) place(id).replaceChildren(el("p", { class: "muted" }, "Computing …"));
  }
  listPlots();
  /** @type {import("./bench/server.js").Figures} */
  let told = { stretch: [], checks: [], poles: [], pole_columns: [], poles_are: "" };
  try {
    if (models.length) told = await ask("/api/ask", { figures: models.join(",") });
  } catch (error) {
    if (figuring === key) figuring = "";
    throw error;
  }
  if (key !== figuring) return;
  drawn = key;
  const figure = (/** @type {import("./bench/server.js").Figure} */ f) => picture(f.picture, { caption: f.caption });
  section("stretch", told.stretch.length > 0);
  place("stretch").replaceChildren(...told.stretch.map(figure));
  // The first column is the model.
  const from = models.length > 1 ? 0 : 1;
  section("checks", told.checks.length > 0);
  place("checks").replaceChildren(
    ...told.checks.map(figure),
    ...(told.poles.length ? [el("div", {}, el("h3", {}, "Poles"), el("p", { class: "caption" }, told.poles_are),
      table(told.pole_columns.slice(from), told.poles.map((row) => row.slice(from)), (i) => i + from > 1))] : []),
  );
  listPlots();
}

/** Brings the curves of the current model, and of those beside it. */
async function records() {
  if (!state) return;
  if (!state.data) {
    section("records", false);
    return;
  }
  const models = shownModels(state);
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
  payload.colours = [...ids, Math.max(0, ...(state?.models ?? []).map((m) => m.id)) + 1].map(colour);
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

/** A step begins: the page shows it at once. @param {string} name */
function begins(name) {
  events++;
  if (!state) return;
  state.work = { name, now: "", best: [], budget: 0, elapsed_s: 0, stage_s: 0 };
  drawWork(state);
  place("right").scrollTop = 0;
}

/** A step has ended. @param {string | null} error */
function ends(error) {
  events++;
  const step = /^host-fit (\S+)/.exec(state?.work?.name ?? "")?.[1] ?? "";
  if (state) {
    state.work = null;
    drawWork(state);
  }
  ended();
  refresh().then(() => {
    if (error) complain(error);
    else document.getElementById(`${RESULT[step]}-section`)?.scrollIntoView();
  }, complain);
}

function listen() {
  const source = new EventSource(`/api/events?token=${token}`);
  source.onopen = () => {
    place("offline").hidden = true;
    void attempt(refresh);
  };
  source.onerror = () => (place("offline").hidden = false);
  source.onmessage = (message) => {
    const event = JSON.parse(message.data);
    const work = state?.work;
    if (event.kind === "begins") begins(event.name);
    else if (event.kind === "ends") ends(event.error);
    else if (event.kind === "warning") complain(event.words);
    else if ((event.kind === "now" || event.kind === "best") && !work) {
      // The page was opened during the step: the state that is on its way has all of it.
      if (!refreshing) void refresh().catch(complain);
    } else if (event.kind === "now" && work) {
      if (event.stage) stage(work);
      work.now = event.words;
      place("work-now").textContent = said(work);
      left(work);
    } else if (event.kind === "best" && work) {
      const last = work.best.at(-1);
      // Fewer evaluations or a higher value than before are another search's.
      if (last && (event.evaluations < last[0] || event.best > last[1])) stage(work);
      work.best.push([event.evaluations, event.best]);
      work.budget = event.budget;
      left(work);
      place("work-now").textContent = said(work);
      progress(work.best);
      void glimpse().catch(() => {});
    } else void refresh().catch(complain);
  };
  // The time goes on where a step says nothing.
  setInterval(() => {
    if (state?.work) left(state.work);
  }, 1000);
}

/** As in the style. */
const narrow = matchMedia("(max-width: 900px)");

/** The list of plots stays in view: in the middle pane, or above the only column. Headings keep clear of it. */
function keepPlots() {
  const plots = place("plots");
  const put = () => (narrow.matches ? place("panes").before(plots) : place("middle").prepend(plots));
  put();
  narrow.addEventListener("change", put);
  new ResizeObserver(() => place("middle").style.setProperty("--plots", `${plots.offsetHeight}px`)).observe(plots);
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
keepPlots();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => group?.restyle());
importer.listen();
editor.listen(refresh);
listen();
