// What the page asks of the server.

/**
 * @typedef {{id: number, parent: number | null, step: string, command: string, rmse: number | null, noise_rmse: number | null, fit_percent: number | null, parameters: number | null}} Model
 * @typedef {{effect: string, error_reduction_percent: number, p_value: number, significant: boolean, refitted: boolean, parameters: Record<string, {value: number, unit: string, low: number, high: number}>, confounded_with: string[]}} Candidate
 * @typedef {{tone: string, verdict: string, evidence: string, confidence: string, next: string, notes: string[]}} Answer
 * @typedef {{answer: Answer, rows: string[][], missing: string[], ranking: Candidate[], picture: string, experiment: {description: string, separation_sigmas: number, effects: string[]} | null, experiment_picture: string | null}} Diagnosis
 * @typedef {{picture: string, caption: string}} Figure
 * @typedef {{stretch: Figure[], checks: Figure[], poles: string[][], pole_columns: string[], poles_are: string}} Figures
 * @typedef {{effect: string, title: string, formula: string, is_formula: boolean, picture: string, file: string}} Term
 * @typedef {object} State
 * @property {{title: string, path: string, hash: string, period: number, records: {name: string, use: string, samples: number}[], remarks: string[]} | null} data
 * @property {string} project
 * @property {number | null} current
 * @property {Model[]} models
 * @property {string[]} log
 * @property {string[]} uploads
 * @property {{name: string, text: string}[]} own
 * @property {{describe: string, effects: string[], columns: string[], rows: string[][], where: string[], where_picture: string, ladder_picture: string, error: string | null, parameters: string[][], base: string[][]} | null} model
 * @property {{answer: Answer} | null} made
 * @property {Record<string, {value: number, unit: string, low: number, high: number}> | null} intervals
 * @property {Diagnosis | null} diagnosis
 * @property {{answer: Answer, terms: Term[]} | null} discovery
 * @property {{answer: Answer, words: string, picture: string, margin: string | null, columns: string[], rows: string[][], caption: string} | null} law
 * @property {{name: string, now: string, best: [number, number][], budget: number, elapsed_s: number, stage_s: number} | null} work
 */

import { el, inline, place } from "./dom.js";

export const token = new URLSearchParams(location.search).get("token") ?? "";

/** The server does not answer: the page says so in a place of its own. */
class Gone extends Error {}

/** @param {string} path @param {unknown=} body JSON, or a file @returns {Promise<any>} */
export async function ask(path, body) {
  const request = {
    method: body === undefined ? "GET" : "POST",
    headers: { "x-token": token, ...(body instanceof Blob ? {} : { "content-type": "application/json" }) },
    body: body === undefined || body instanceof Blob ? body : JSON.stringify(body),
  };
  const response = await fetch(path, request).catch(() => {
    place("offline").hidden = false;
    throw new Gone();
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

/** The address of a file of a model. @param {string} kind @param {number} model */
export const fileOf = (kind, model) => `/api/file/${kind}/${model}?token=${token}`;

/** A message in the words of the form instead of the command's options; fields that it names are marked. @param {string} text */
function worded(text) {
  return text.replace(/'?--([a-z][a-z0-9-]*)(?: <[^>]*>)?'?/g, (option, name) => {
    const field = document.querySelector(`form.fields [name="${name}"]`);
    const parts = [...(field?.closest("label")?.childNodes ?? [])].filter((node) => node.nodeType === Node.TEXT_NODE);
    const words = parts.map((node) => node.textContent).join(" ").trim();
    if (!field || !words) return option;
    // The first one named is wrong; others are remedies.
    if (document.querySelector("form [aria-invalid=true]") === null) {
      field.setAttribute("aria-invalid", "true");
      if (field instanceof HTMLElement) field.focus();
    }
    return `“${words}”`;
  });
}

/** @param {unknown} error */
export function complain(error) {
  if (error instanceof Gone) return;
  const why = error instanceof Error ? error.message : String(error);
  const told = el("div", { class: `verdict warning${/^a task is running/.test(why) ? " busy" : ""}`, role: "alert" },
    el("button", { type: "button", class: "close", "aria-label": "close this message", onclick: () => told.remove() }, "×"),
    el("p", {}, ...inline(worded(why))));
  place("message").append(told);
}

/** Messages that a step is running no longer hold. */
export function ended() {
  for (const told of document.querySelectorAll("#message .busy")) told.remove();
}

/** Does something that may be refused. @param {() => Promise<unknown>} does */
export async function attempt(does) {
  place("message").replaceChildren();
  for (const field of document.querySelectorAll("form [aria-invalid]")) field.removeAttribute("aria-invalid");
  try {
    await does();
  } catch (error) {
    complain(error);
  }
}

/** Begins a piece of work: a command with its options. @param {object} request */
export const run = (request) => attempt(() => ask("/api/run", request));
