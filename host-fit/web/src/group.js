// The records of one data set with the models on them: a tool bar, one chart a record, and the bars that stand for samples.

import { Bars } from "./bars.js";
import { Chart } from "./chart.js";
import { colourOf, floats, unpack } from "./data.js";
import { significant } from "./number.js";
import { svgOf } from "./save.js";
import { View } from "./view.js";

/** Width of a chart that is printed, pixels. */
const PAPER = 960;

export class Group {
  /** @param {HTMLElement} element @param {import("./data.js").Payload} payload */
  constructor(element, payload) {
    this.element = element;
    this.payload = payload;
    const longest = Math.max(...payload.records.map((r) => r.n * r.period));
    const finest = Math.max(...payload.records.map((r) => 8 * r.period));
    this.view = new View(element.id, longest, finest, payload.off?.map((i) => `run${i}`), payload.view);
    element.append(this.toolbar());
    this.charts = payload.records.map((packed, index) => {
      const chart = new Chart(unpack(packed), index, payload, this.view);
      chart.onread = (time) => this.read(chart, time);
      element.append(chart.element);
      return chart;
    });
    this.bars = new Bars(element.id, payload, this.view);
    this.view.listeners.push((what) => this.changed(what));
    // Charts out of sight wait until they are looked at.
    const watch = new IntersectionObserver(
      (entries) => {
        for (const entry of entries) {
          const chart = this.charts.find((c) => c.element === entry.target);
          if (chart) chart.seen(entry.isIntersecting);
        }
      },
      { rootMargin: "150px" },
    );
    this.charts.forEach((chart) => watch.observe(chart.element));
    this.watch = watch;
    this.keys = (/** @type {KeyboardEvent} */ event) => this.key(event);
    element.addEventListener("keydown", this.keys);
    this.changed("range");
  }

  toolbar() {
    const bar = document.createElement("div");
    bar.className = "tools";
    bar.setAttribute("role", "toolbar");
    bar.setAttribute("aria-label", "What the records show");
    const button = (/** @type {string} */ sign, /** @type {string} */ name, /** @type {() => void} */ does) => {
      const b = document.createElement("button");
      b.type = "button";
      b.textContent = sign;
      b.title = name;
      b.setAttribute("aria-label", name);
      b.addEventListener("click", does);
      return b;
    };
    const moves = document.createElement("span");
    moves.append(
      button("◀", "earlier (Page Up)", () => this.view.pan(-0.5)),
      button("▶", "later (Page Down)", () => this.view.pan(0.5)),
      button("+", "zoom in (+)", () => this.view.zoom(0.5)),
      button("−", "zoom out (−)", () => this.view.zoom(2)),
      button("whole record", "whole record (Home)", () => this.view.whole()),
    );
    this.stretch = document.createElement("output");
    this.stretch.className = "stretch";
    const switches = document.createElement("span");
    switches.className = "switches";
    const names = [
      ["measured", "measured", "measured"],
      ...(this.payload.records.some((r) => r.sd || r.low) ? [["scatter", "scatter", "scatter"]] : []),
      ...this.payload.runs.map((name, i) => [`run${i}`, name, `run s${colourOf(this.payload, i)}`]),
      ...(this.payload.runs.length > 0 ? [["residuals", "y − model", "residuals"]] : []),
    ];
    switches.append(...names.map(([key, name, kind]) => this.toggle(key, name, kind)));
    this.switches = switches;
    this.clear = button("clear the marked samples", "clear the marked samples (Escape)", () => this.view.light(null));
    this.clear.hidden = true;
    bar.append(moves, this.stretch, switches, this.clear);
    return bar;
  }

  /** A box that shows a curve or hides it. @param {string} key @param {string} name @param {string} kind */
  toggle(key, name, kind) {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = !this.view.off.has(key);
    box.addEventListener("change", () => this.view.turn(key, box.checked));
    const swatch = document.createElement("i");
    swatch.className = `swatch ${kind}`;
    label.append(box, swatch, name);
    return label;
  }

  /** The run of what a search has found so far, per record; none once it is over. @param {string[] | null} runs */
  search(runs) {
    if (!runs) this.searching?.remove();
    else if (!this.searching?.isConnected) {
      this.searching = this.toggle("search", "best so far", `run s${colourOf(this.payload, this.payload.runs.length)}`);
      this.switches?.append(this.searching);
    }
    this.charts.forEach((chart, i) => chart.searched(runs && runs[i] ? floats(runs[i]) : null));
  }

  /** @param {"range" | "off" | "lit"} what */
  changed(what) {
    const { view } = this;
    if (this.stretch) this.stretch.textContent = `${significant(view.from)} to ${significant(view.to)} s of each record`;
    if (this.clear) this.clear.hidden = !view.lit;
    this.charts?.forEach((chart) => chart.changed(what));
  }

  /** The same time is read in every record. @param {Chart} chart @param {number | null} time */
  read(chart, time) {
    for (const other of this.charts) {
      if (other !== chart) other.cursor(time);
    }
    this.bars.mark(time === null ? null : { record: chart.index, sample: chart.sampleAt(time) });
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey || event.target instanceof HTMLInputElement) return;
    const { view } = this;
    const chart = this.charts.find((c) => c.element.contains(document.activeElement));
    const column = (view.to - view.from) / 400;
    /** @type {Record<string, () => void>} */
    const keys = {
      "+": () => view.zoom(0.5, chart?.time ?? undefined),
      "=": () => view.zoom(0.5, chart?.time ?? undefined),
      "-": () => view.zoom(2, chart?.time ?? undefined),
      PageUp: () => view.pan(-0.5),
      PageDown: () => view.pan(0.5),
      Home: () => view.whole(),
      Escape: () => view.light(null),
    };
    if (chart) {
      keys.ArrowLeft = () => chart.step(event.shiftKey ? -10 * column : -column);
      keys.ArrowRight = () => chart.step(event.shiftKey ? 10 * column : column);
    }
    const does = keys[event.key];
    if (!does) return;
    event.preventDefault();
    does();
  }

  /** The bars of the page were drawn anew. */
  rebind() {
    this.bars.release();
    this.bars = new Bars(this.element.id, this.payload, this.view);
  }

  destroy() {
    this.watch?.disconnect();
    if (this.keys) this.element.removeEventListener("keydown", this.keys);
    this.view.listeners = [];
    this.charts.forEach((chart) => chart.destroy());
  }

  restyle() {
    this.charts.forEach((chart) => chart.restyle());
  }

  /** Puts every chart on the page as SVG, which printers keep, or takes those away. @param {boolean} on */
  paper(on) {
    for (const chart of this.charts) {
      chart.element.querySelector(".paper")?.remove();
      if (!on) continue;
      const paper = document.createElement("div");
      paper.className = "paper";
      paper.innerHTML = svgOf(chart, PAPER).svg;
      chart.element.append(paper);
    }
  }
}
