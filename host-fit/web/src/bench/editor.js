// An effect of the user's own: written, checked while it is written, kept, added.

import { button, el, place } from "./dom.js";
import { ask, attempt, run } from "./server.js";

const EXAMPLE = `name = "my-effect"
place = "jet"
summary = "What it does, in one line."
expression = "jet * (1.0 - gain * y)"

[[parameter]]
name = "gain"
unit = "-"
low = -2.0
high = 2.0
starts = [0.2, -0.2]
`;

/** @typedef {{name?: string, summary?: string, error?: string, line?: number | null, column?: number | null}} Told */

/** @type {number | null} */
let model = null;
const area = () => /** @type {HTMLTextAreaElement} */ (place("own-text"));

/** Checks the text, and shows a fault below its place. @returns {Promise<string | null>} the effect's name */
async function check() {
  const text = area().value;
  /** @type {Told} */
  const told = await ask("/api/ask", { check: text });
  // An answer to what has been written over since is none.
  if (text !== area().value) return null;
  const target = place("own-told");
  area().setAttribute("aria-invalid", String(told.error !== undefined));
  if (told.error === undefined) {
    target.replaceChildren(el("p", {}, `In order: ${told.name}, ${told.summary}`));
    return told.name ?? null;
  }
  const line = told.line ? text.split("\n")[told.line - 1] ?? "" : "";
  const pointer = told.line ? el("pre", { tabindex: "0", "aria-label": "the mistake" }, `${line}\n${" ".repeat((told.column ?? 1) - 1)}^ line ${told.line}, column ${told.column}`) : null;
  target.replaceChildren(el("div", { class: "verdict warning" }, pointer ?? "", el("p", {}, told.error)));
  return null;
}

/** The cursor goes to the fault. */
async function keep() {
  await check();
  /** @type {Told} */
  const told = await ask("/api/ask", { check: area().value });
  if (told.error !== undefined) {
    const lines = area().value.split("\n");
    const before = lines.slice(0, (told.line ?? 1) - 1).join("\n").length + ((told.line ?? 1) > 1 ? 1 : 0);
    const at = before + (told.column ?? 1) - 1;
    area().focus();
    area().setSelectionRange(at, at + 1);
    throw new Error(told.error);
  }
  return (await ask("/api/ask", { keep: area().value })).name;
}

/** Puts a text into the editor. @param {string} text */
export function edit(text) {
  area().value = text;
  void attempt(check);
  area().scrollIntoView({ block: "center" });
  area().focus();
}

/** @param {import("./server.js").State} s @param {() => Promise<void>} refresh */
export function drawOwn(s, refresh) {
  model = s.current;
  if (area().value === "") area().value = EXAMPLE;
  place("own-list").replaceChildren(
    ...s.own.flatMap((own) => [
      button(`edit ${own.name}`, () => edit(own.text)),
      button("forget", () => attempt(async () => { await ask("/api/ask", { forget: own.name }); await refresh(); }), { "aria-label": `forget ${own.name}` }),
    ]),
  );
  enable(s);
}

/** @param {import("./server.js").State} s */
export function enable(s) {
  for (const name of ["own-keep", "own-add"]) place(name).toggleAttribute("disabled", s.work !== null || (name === "own-add" && model === null));
}

/** @param {() => Promise<void>} refresh */
export function listen(refresh) {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let later;
  area().addEventListener("input", () => {
    clearTimeout(later);
    later = setTimeout(() => void check().catch(() => {}), 300);
  });
  place("own-keep").addEventListener("click", () => attempt(async () => { await keep(); await refresh(); }));
  place("own-add").addEventListener("click", () => attempt(async () => {
    const effect = await keep();
    await run({ command: "extend", model, options: { effect } });
  }));
}
