// The workbench's page: what the server knows, drawn; what is pressed, sent to it.

import { Group } from "./group.js";
import { significant } from "./number.js";
import { button, el, options, picture, place, table } from "./bench/dom.js";
import * as editor from "./bench/editor.js";
import * as importer from "./bench/importer.js";
import { clear, progress } from "./bench/progress.js";
import { ask, attempt, complain, fileOf, run, token } from "./bench/server.js";

/**
 * @typedef {import("./bench/server.js").State} State
 * @typedef {import("./bench/server.js").Model} Model
 * @typedef {import("./bench/server.js").Candidate} Candidate
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
  drawDiagnosis(state);
  drawDiscovery(state);
  drawLaw(state);
  editor.drawOwn(state, refresh);
  place("log").replaceChildren(
    state.log.length ? el("pre", { tabindex: "0", "aria-label": "commands" }, state.log.join("\n")) : el("p", {}, "Nothing was done yet."),
  );
}

/** @param {string} id @param {boolean} there */
const section = (id, there) => (place(`${id}-section`).hidden = !there);

/** @param {State} s */
function drawData(s) {
  const { data } = s;
  document.title = `Workbench: ${data?.title ?? "no data yet"}`;
  place("title").textContent = data?.title ?? "Workbench";
  place("project").textContent = `project folder ${s.project}`;
  const importing = /** @type {HTMLDetailsElement} */ (place("import"));
  // Once there are models, another data set is another project.
  importing.hidden = s.models.length > 0;
  section("identify", data !== null);
  section("models", data !== null);
  section("own", s.current !== null);
  if (!importing.hidden) importer.drawUploads(s.uploads);
  if (!data) {
    importing.open = true;
    place("data").replaceChildren(el("p", {}, "No data set yet: import recordings."));
    return;
  }
  place("data").replaceChildren(
    el("p", {}, `${data.records.length} records at ${significant(1000 * data.period, 3)} ms: `,
      data.records.map((r) => `${r.name} (${r.use}, ${significant(r.samples * data.period, 3)}\u00a0s)`).join(", ")),
    ...(data.remarks.length ? [el("p", {}, "What the commands can tell:"), el("ul", {}, ...data.remarks.map((r) => el("li", {}, r)))] : [el("p", {}, "The commands can tell a model of this kind.")]),
  );
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
    under(null) ?? el("p", {}, "No model yet: identify one above."),
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
  for (const id of ["match", "where", "missing", "discovery", "law"]) section(id, model !== null);
  if (!model) return;
  place("match").replaceChildren(
    el("p", {}, model.describe),
    ...(model.error ? [el("div", { class: "verdict warning" }, el("p", {}, model.error))] : []),
    picture(model.ladder_picture),
    table(model.columns, model.rows, (i) => i > 1),
  );
  place("where").replaceChildren(
    ...model.where.map((sentence) => el("p", {}, sentence)),
    picture(model.where_picture, "g1"),
  );
}

/** @param {State} s @param {string} text @param {object} request @param {Record<string, any>=} attributes */
const does = (s, text, request, attributes = {}) => button(text, () => run(request), { disabled: s.work !== null, ...attributes });

/** An answer as a card: verdict, evidence, confidence, notes. @param {import("./bench/server.js").Answer} answer */
const verdict = ({ tone, verdict, evidence, confidence, notes }) =>
  el("div", { class: `verdict ${tone}` },
    el("p", { class: "headline" }, verdict),
    el("dl", {}, ...[["Evidence", evidence], ["Confidence", confidence]].flatMap(([name, text]) => (text ? [el("dt", {}, name), el("dd", {}, text)] : []))),
    ...(notes.length ? [el("details", {}, el("summary", {}, `${notes.length} note${notes.length === 1 ? "" : "s"}`), el("ul", {}, ...notes.map((note) => el("li", {}, note))))] : []));

/** @param {State} s */
function drawDiagnosis(s) {
  const { diagnosis: found, current: model } = s;
  if (model === null) return;
  const diagnose = does(s, found ? "Diagnose again" : "Diagnose", { command: "diagnose", model }, { id: "diagnose" });
  if (!found) {
    place("missing").replaceChildren(el("p", {}, "Every effect of the catalogue is refitted with everything else and judged on the validation records."), diagnose);
    return;
  }
  const parameters = (/** @type {Candidate} */ c) =>
    Object.entries(c.parameters).map(([name, p]) => `${name} ${significant(p.value, 3)}${p.unit === "-" ? "" : ` ${p.unit}`} (${significant(p.low, 3)} to ${significant(p.high, 3)})`).join("; ") +
    (c.confounded_with.length ? `; or ${c.confounded_with.join(", ")}` : "");
  const has = s.model?.effects ?? [];
  const missing = found.missing.filter((effect) => !has.includes(effect));
  const row = (/** @type {Candidate} */ c) => [
    c.effect,
    `${c.error_reduction_percent.toFixed(1).replace("-", "−")} %`,
    !c.refitted ? "–" : c.p_value < 0.001 ? "< 0.001" : significant(c.p_value, 2),
    found.outcomes[c.effect] ?? "",
    parameters(c),
    does(s, "Add", { command: "extend", model, options: { effect: c.effect } }, { "aria-label": `add ${c.effect}`, disabled: s.work !== null || has.includes(c.effect) }),
  ];
  place("missing").replaceChildren(
    verdict(found.answer),
    ...(missing.length ? [el("p", { class: "actions" }, does(s, `Add what is missing: ${missing.join(", ")}`, { command: "extend", model, options: { effect: missing } }, { class: "primary", id: "add-missing" }))] : []),
    ...(found.ranking.length ? [
      picture(found.picture),
      table(["effect", "error falls", "p", "outcome", "parameters (95 % interval)", ""], found.ranking.map(row), (i) => i === 1 || i === 2),
    ] : []),
    ...(found.experiment && found.experiment_picture ? [
      el("h3", {}, `Experiment that distinguishes ${found.experiment.effects.join(", ")}`),
      el("p", {}, found.experiment.description),
      picture(found.experiment_picture),
    ] : []),
    el("p", { class: "actions" }, diagnose,
      ...(found.experiment ? [el("a", { href: fileOf("experiment", model), download: "experiment.csv" }, "download experiment.csv")] : []),
      el("a", { href: fileOf("diagnosis", model), download: "diagnosis.html" }, "download diagnosis.html")),
  );
}

/** @param {State} s */
function drawDiscovery(s) {
  const { discovery: found, current: model } = s;
  if (model === null) return;
  const discover = does(s, found ? "Discover again" : "Discover", { command: "discover", model }, { id: "discover" });
  place("discovery").replaceChildren(
    ...(found ? [
      verdict(found.answer),
      ...found.terms.flatMap((term) => [
        el("h3", {}, term.title),
        picture(term.picture),
        el("p", {}, term.is_formula ? "As a formula: " : "No formula fits equally well; as a table: ", el("code", {}, term.formula)),
        el("p", {}, button("Open its effect file", () => editor.edit(term.file), { "aria-label": `Open its effect file: ${term.effect}` })),
      ]),
    ] : [el("p", {}, "Curves of every coordinate at every place are fitted with everything else; one is kept if the validation error falls significantly and by more than additional lags do.")]),
    el("p", { class: "actions" }, discover,
      ...(found ? [el("a", { href: fileOf("discovery", model), download: "discovery.html" }, "download discovery.html")] : [])),
  );
}

/** @param {State} s */
function drawLaw(s) {
  for (const b of document.querySelectorAll("#design button")) b.toggleAttribute("disabled", s.work !== null);
  place("law").replaceChildren(
    ...(s.law ? [el("pre", { tabindex: "0", "aria-label": "the law" }, s.law.words), ...(s.law.picture ? [picture(s.law.picture)] : [])] : []),
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
  group?.destroy();
  place("g1").replaceChildren();
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
    } else if (event.kind === "best" && state?.work) {
      const { best } = state.work;
      // Fewer evaluations than before are another search's.
      if (event.evaluations < (best.at(-1)?.[0] ?? 0)) best.length = 0;
      best.push([event.evaluations, event.best]);
      place("work-now").textContent = `${event.evaluations} evaluations, best ${significant(event.best)}`;
      progress(best);
      void glimpse().catch(() => {});
    } else if (event.kind === "warning") {
      complain(event.words);
    } else if (event.kind === "ends") {
      void refresh().then(() => event.error && complain(event.error), complain);
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
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => group?.restyle());
importer.listen();
editor.listen(refresh);
listen();
