// A search at work: the best so far over the evaluations.

import uPlot from "uplot";
import { significant } from "../number.js";
import { place } from "./dom.js";

/** @type {uPlot | null} */
let curve = null;

export function clear() {
  curve?.destroy();
  curve = null;
}

/** @param {[number, number][]} best */
export function progress(best) {
  if (best.length < 2) return clear();
  const data = /** @type {uPlot.AlignedData} */ ([best.map((b) => b[0]), best.map((b) => b[1])]);
  if (curve) return curve.setData(data);
  const style = getComputedStyle(document.documentElement);
  const colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour("--ink"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--axis"), width: 1 } };
  const values = (/** @type {uPlot} */ _u, /** @type {(number | null)[]} */ splits) => splits.map((v) => (v === null ? "" : significant(v, 3)));
  curve = new uPlot(
    {
      width: Math.max(200, (place("work").clientWidth || 430) - 30),
      height: 150,
      legend: { show: false },
      cursor: { show: false },
      // The first guesses are far worse than the last.
      scales: { x: { time: false }, y: { distr: 3 } },
      axes: [{ ...axis, label: "evaluations", incrs: [1, 2, 5].flatMap((n) => [n, 10 * n, 100 * n, 1e3 * n, 1e4 * n, 1e5 * n]).sort((a, b) => a - b) }, { ...axis, values, label: "best so far", size: 70 }],
      series: [{}, { stroke: colour("--s0"), width: 2, points: { show: false } }],
    },
    data,
    place("curve"),
  );
}
