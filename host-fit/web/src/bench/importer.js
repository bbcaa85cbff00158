// Files that people have: dropped, looked into, mapped, made into a data set.

import { button, el, place } from "./dom.js";
import { ask, attempt, complain, run } from "./server.js";

/**
 * @typedef {{name: string, dialect: string, variables: {name: string, unit: string | null, samples: number}[], skipped: [string, string][]}} Upload
 */

/** @type {Map<string, Upload>} */
const known = new Map();
/** Files that are to be in the data set. @type {Set<string>} */
const taken = new Set();

/** @param {FileList | File[]} files */
function upload(files) {
  void attempt(async () => {
    place("message").replaceChildren();
    for (const file of files) {
      try {
        const told = await ask(`/api/upload/${encodeURIComponent(file.name)}`, file);
        known.set(told.name, told);
        taken.add(told.name);
      } catch (error) {
        // The other files are none the worse for it.
        complain(error);
      }
    }
    draw();
  });
}

/** A choice of a variable, or of `none`. @param {string} name @param {string} label */
function choice(name, label, none = "by its name") {
  /** @type {Map<string, string>} */
  const variables = new Map();
  for (const file of taken) {
    for (const v of known.get(file)?.variables ?? []) {
      variables.set(v.name, `${v.name}${v.unit ? ` (${v.unit})` : ""}, ${v.samples}`);
    }
  }
  const before = /** @type {HTMLSelectElement | null} */ (document.querySelector(`#mapping [name="${name}"]`))?.value;
  const select = /** @type {HTMLSelectElement} */ (el("select", { name }, el("option", { value: "" }, none),
    ...[...variables].map(([value, text]) => el("option", { value }, text))));
  select.value = before ?? "";
  return el("label", {}, label, select);
}

/** @param {string} name @param {string} label */
const number = (name, label) => el("label", {}, label, el("input", { type: "number", step: "any", name }));

function draw() {
  const files = [...taken].map((name) => {
    const file = known.get(name);
    return el("li", {},
      el("strong", {}, name), ` ${file?.dialect ?? ""}: ${file?.variables.map((v) => v.name).join(", ") ?? ""} `,
      el("label", {}, el("input", { type: "checkbox", name: "validate", value: name.replace(/\.[^.]*$/, ""), form: "mapping" }), "validation record"),
      " ",
      button("leave out", () => { taken.delete(name); draw(); }, { "aria-label": `leave out ${name}` }));
  });
  if (taken.size === 0) {
    place("uploads").replaceChildren();
    return;
  }
  const form = el("form", { id: "mapping", class: "fields", onsubmit: submit },
    choice("t", "time"), choice("u", "command u"), choice("y", "output y"),
    choice("split-by", "new record where this changes", "one record per file"),
    number("u-threshold", "u is on above"), number("y-scale", "factor of y"), number("y-offset", "added to y"),
    number("period", "period (s), if no time"), number("fill-gaps", "fill gaps up to (s)"), number("hold-out-from", "validation from (s)"),
    el("label", {}, "title", el("input", { type: "text", name: "title" })),
    el("label", { class: "check" }, el("input", { type: "checkbox", name: "graded" }), "levels between off and on"),
    el("button", { type: "submit", class: "primary" }, "Import"));
  place("uploads").replaceChildren(el("ul", {}, ...files), form);
}

/** @param {SubmitEvent} event */
function submit(event) {
  event.preventDefault();
  const form = /** @type {HTMLFormElement} */ (event.currentTarget);
  const fields = new FormData(form);
  /** @type {Record<string, unknown>} */
  const options = {};
  for (const [name, value] of fields) {
    if (name !== "validate" && name !== "graded" && value !== "") options[name] = value;
  }
  if (fields.has("graded")) options.graded = true;
  const held = fields.getAll("validate");
  if (held.length > 0) options.validate = held;
  void run({ command: "import", files: [...taken], options });
}

/** Files of an earlier visit can be taken again. @param {string[]} uploads */
export function drawUploads(uploads) {
  const others = uploads.filter((name) => !known.has(name));
  if (others.length === 0) return;
  void Promise.all(others.map((name) => ask("/api/ask", { inspect: name }).then((told) => known.set(name, told)))).then(() => {
    others.forEach((name) => taken.add(name));
    draw();
  }, complain);
}

export function listen() {
  const drop = place("drop");
  place("files").addEventListener("change", (event) => {
    const input = /** @type {HTMLInputElement} */ (event.target);
    if (input.files) upload(input.files);
  });
  // A file that misses the field must not take the place of the page.
  for (const kind of ["dragover", "drop"]) document.addEventListener(kind, (event) => event.preventDefault());
  document.addEventListener("dragenter", () => {
    /** @type {HTMLDetailsElement} */ (place("import")).open = true;
    drop.classList.add("here");
  });
  document.addEventListener("drop", (event) => {
    drop.classList.remove("here");
    if (event.dataTransfer?.files.length) upload(event.dataTransfer.files);
  });
}
