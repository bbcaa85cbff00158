// A search at work: the best so far over the evaluations.

import uPlot from "uplot";
import { significant } from "../number.js";
import { place } from "./dom.js";

/** @type {uPlot | null} */
let curve = null;
/** When the piece of work and its present stage began, by this page's clock, ms. */
let began = 0;
let staged = 0;
let worked = "";

/** @typedef {NonNullable<import("./server.js").State["work"]>} Work */

/** Another stage of the work: without results, and with a time of its own. @param {Work} work */
export function stage(work) {
  work.best.length = 0;
  work.budget = 0;
  staged = performance.now();
  clearCurve();
}

/** What is done, in words. @param {Work} work */
export function said({ now, best }) {
  const last = best.at(-1);
  if (!last) return now;
  return `${now}${now ? ": " : ""}${last[0]} evaluation${last[0] === 1 ? "" : "s"}, best error norm ε = ${significant(last[1])} (unit of y)`;
}

export function clear() {
  began = 0;
  clearCurve();
}

function clearCurve() {
  curve?.destroy();
  curve = null;
}

/** @param {[number, number][]} best */
export function progress(best) {
  if (best.length < 2) return clearCurve();
  const data = /** @type {uPlot.AlignedData} */ ([best.map((b) => b[0]), best.map((b) => b[1])]);
  if (curve) return curve.setData(data);
  const style = getComputedStyle(document.documentElement);
  const colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour("--ink"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--axis"), width: 1 } };
  const values = (/** @type {uPlot} */ _u, /** @type {(number | null)[]} */ splits) => splits.map((v) => (v === null ? "" : significant(v, 3)));
  curve = new uPlot(
    {
      width: Math.max(200, (place("work").clientWidth || 360) - 28),
      height: 150,
      legend: { show: false },
      cursor: { show: false },
      // The first guesses are far worse than the last.
      scales: { x: { time: false }, y: { distr: 3 } },
      axes: [{ ...axis, label: "evaluations", incrs: [1, 2, 5].flatMap((n) => [n, 10 * n, 100 * n, 1e3 * n, 1e4 * n, 1e5 * n]).sort((a, b) => a - b) }, { ...axis, values, label: "best ε (y)", size: 70 }],
      series: [{}, { stroke: colour("--s0"), width: 2, points: { show: false } }],
    },
    data,
    place("curve"),
  );
}

/** Says which share of the stage is done and how long the rest may take: of a search by its evaluations, of other work where
 * it counts itself.
 * @param {Work} work */
export function left(work) {
  const now = performance.now();
  if (worked !== work.name || began === 0) {
    [worked, began, staged] = [work.name, now - 1000 * work.elapsed_s, now - 1000 * work.stage_s];
  }
  const counted = /(\d+) of (\d+)/.exec(work.now);
  const [done, all] = counted ? [Number(counted[1]), Number(counted[2])] : [work.best.at(-1)?.[0] ?? 0, work.budget ?? 0];
  const bar = /** @type {HTMLProgressElement} */ (place("work-share"));
  const share = all > 0 ? Math.min(1, done / all) : 0;
  if (share > 0) bar.value = share;
  else bar.removeAttribute("value");
  const elapsed = (now - began) / 1000;
  const rest = share > 0 ? ((now - staged) / 1000) * (1 / share - 1) : 0;
  const time = (/** @type {number} */ s) => (s < 90 ? `${Math.ceil(s)} s` : `${Math.ceil(s / 60)} min`);
  place("work-left").textContent = share > 0 ? `${time(elapsed)} so far; ${Math.round(100 * share)} % of this stage, at most ${time(rest)} of it left` : `${time(elapsed)} so far`;
}
