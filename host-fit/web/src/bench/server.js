// What the page asks of the server.

/**
 * @typedef {{id: number, parent: number | null, step: string, command: string, rmse: number | null, noise_rmse: number | null, fit_percent: number | null}} Model
 * @typedef {{effect: string, error_reduction_percent: number, p_value: number, significant: boolean, refitted: boolean, parameters: Record<string, {value: number, unit: string, low: number, high: number}>, confounded_with: string[]}} Candidate
 * @typedef {{tone: string, verdict: string, evidence: string, confidence: string, next: string, notes: string[]}} Answer
 * @typedef {{answer: Answer, outcomes: Record<string, string>, missing: string[], ranking: Candidate[], picture: string, experiment: {description: string, separation_sigmas: number, effects: string[]} | null, experiment_picture: string | null}} Diagnosis
 * @typedef {{effect: string, title: string, formula: string, is_formula: boolean, picture: string, file: string}} Term
 * @typedef {object} State
 * @property {{title: string, path: string, hash: string, period: number, records: {name: string, use: string, samples: number}[], remarks: string[]} | null} data
 * @property {string} project
 * @property {number | null} current
 * @property {Model[]} models
 * @property {string[]} log
 * @property {string[]} uploads
 * @property {{name: string, text: string}[]} own
 * @property {{describe: string, effects: string[], columns: string[], rows: string[][], where: string[], where_picture: string, ladder_picture: string, error: string | null} | null} model
 * @property {Diagnosis | null} diagnosis
 * @property {{answer: Answer, terms: Term[]} | null} discovery
 * @property {{words: string, picture: string | null} | null} law
 * @property {{name: string, now: string, best: [number, number][]} | null} work
 */

import { el, place } from "./dom.js";

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

/** @param {unknown} error */
export function complain(error) {
  if (error instanceof Gone) return;
  const told = el("div", { class: "verdict warning", role: "alert" },
    el("button", { type: "button", class: "close", "aria-label": "close this message", onclick: () => told.remove() }, "×"),
    el("p", {}, error instanceof Error ? error.message : String(error)));
  place("message").append(told);
}

/** Does something that may be refused. @param {() => Promise<unknown>} does */
export async function attempt(does) {
  place("message").replaceChildren();
  try {
    await does();
  } catch (error) {
    complain(error);
  }
}

/** Begins a piece of work: a command with its options. @param {object} request */
export const run = (request) => attempt(() => ask("/api/run", request));
