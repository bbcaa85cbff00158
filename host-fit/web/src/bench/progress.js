// A search at work: the best so far over the evaluations.

import uPlot from "uplot";
import { ticks } from "../number.js";
import { place } from "./dom.js";

/** @type {uPlot | null} */
let curve = null;

export function clear() {
  curve?.destroy();
  curve = null;
}

/** One line for each search, one behind the other. @param {[number, number][][]} searches */
export function progress(searches) {
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
