// One record: measurement and free runs above, the command, and what is left of the measurement below.

import uPlot from "uplot";
import { significant, ticks } from "./number.js";
import { colourOf, stretches } from "./data.js";
import { Pyramid, grid, outline, places, thinned } from "./thin.js";
import { figureButtons } from "./save.js";

const HEIGHT = 300;
const RESIDUAL = 150;
const STRIP = 12;
const DASHES = [[], [9, 4], [3, 3], [12, 3, 3, 3], [6, 2], [2, 5]];

/** @type {Map<string, string>} */
const colours = new Map();

/** A colour of the page's style sheet; asked for once, because asking makes the browser lay the page out. @param {string} name */
function colour(name) {
  let found = colours.get(name);
  if (found === undefined) {
    found = getComputedStyle(document.documentElement).getPropertyValue(name).trim() || "#888";
    colours.set(name, found);
  }
  return found;
}

/** Range of a series, wide enough that a line is not on the frame. @param {(Pyramid | null)[]} all @param {number} foot share left free below */
function span(all, foot) {
  let [low, high] = [Infinity, -Infinity];
  for (const series of all) {
    if (!series) continue;
    const [a, b] = series.extremes(0, series.values.length);
    low = Math.min(low, a);
    high = Math.max(high, b);
  }
  if (!(high >= low)) return [-1, 1];
  const room = (high - low || Math.abs(high) || 1) * 0.05;
  return [low - room - foot * (high - low), high + room];
}

export class Chart {
  /**
   * @param {import("./data.js").Series} record @param {number} index
   * @param {import("./data.js").Payload} payload @param {import("./view.js").View} view
   */
  constructor(record, index, payload, view) {
    this.record = record;
    this.index = index;
    this.payload = payload;
    this.view = view;
    /** @type {(time: number | null) => void} */
    this.onread = () => {};
    /** @type {number | null} time since the record's start that is read, s */
    this.time = null;
    this.visible = false;
    this.stale = true;
    /** @type {uPlot[]} */
    this.plots = [];

    this.element = document.createElement("section");
    this.element.className = "record";
    this.element.tabIndex = 0;
    this.element.setAttribute("role", "group");
    const heading = document.createElement("h3");
    heading.textContent = `${record.name} (${record.use})`;
    this.element.setAttribute(
      "aria-label",
      `${record.name}, ${record.use}, ${significant(record.n * record.period)} s. Arrow keys read values, plus and minus zoom, page keys move.`,
    );
    this.readout = document.createElement("p");
    this.readout.className = "readout";
    this.charts = document.createElement("div");
    this.charts.className = "charts";
    this.charts.style.minHeight = `${HEIGHT + (payload.runs.length ? RESIDUAL : 0)}px`;
    this.legend = document.createElement("ul");
    this.legend.className = "legend";
    this.element.append(heading, figureButtons(this), this.legend, this.readout, this.charts);
    this.relabel();
    this.read(null);
    this.sized = new ResizeObserver(() => this.resize());
    this.sized.observe(this.charts);
  }

  /** Everything that is drawn, thinned; made when first looked at. */
  series() {
    if (this.made) return this.made;
    const { record } = this;
    const pyramid = (/** @type {Float32Array | null} */ values) => values && new Pyramid(values);
    const made = {
      y: new Pyramid(record.y),
      low: pyramid(record.low),
      high: pyramid(record.high),
      runs: record.runs.map(pyramid),
      residuals: record.residuals.map(pyramid),
      floorLow: record.sd && new Pyramid(record.sd.map((v) => -2 * v)),
      floorHigh: record.sd && new Pyramid(record.sd.map((v) => 2 * v)),
    };
    const [low, high] = span([made.y, made.low, made.high], 0.08);
    // A run that leaves the measurement far behind goes along the edge.
    const [least, most] = span(made.runs, 0.08);
    const room = 0.6 * (high - low);
    const limits = Number.isFinite(most - least) && made.runs.some(Boolean)
      ? [Math.max(low - room, Math.min(low, least)), Math.min(high + room, Math.max(high, most))]
      : [low, high];
    const [below, above] = span([...made.residuals, made.floorLow, made.floorHigh], 0);
    const reach = 0.6 * (high - low);
    this.limits = { y: limits, r: [Math.max(below, -reach), Math.min(above, reach)] };
    this.made = made;
    return made;
  }

  /** @param {boolean} visible */
  seen(visible) {
    this.visible = visible;
    if (!visible) return;
    if (this.plots.length === 0) this.build();
    else if (this.stale) this.draw();
  }

  /** @param {"range" | "off" | "lit"} what */
  changed(what) {
    if (what === "off") {
      this.renew();
      return;
    }
    this.stale = true;
    if (this.visible && this.plots.length > 0) this.draw();
  }

  /** Other curves are to be drawn: at once, or when it is looked at. */
  renew() {
    this.relabel();
    this.destroyPlots();
    if (this.visible) this.build();
  }

  /** The run of what a search has found so far. @param {Float32Array | null} run */
  searched(run) {
    if (!run && !this.best) return;
    this.best = run && new Pyramid(run);
    this.renew();
  }

  /** What the legend says: the curves that are on. @returns {{name: string, kind: string, colour: string, dash?: number[], band?: boolean}[]} */
  shown() {
    const { record, payload } = this;
    const repeats = record.low && record.high && !record.sd;
    return [
      ...(this.on("measured") ? [{ name: "measured", kind: "measured", colour: "--ink" }] : []),
      ...payload.runs.flatMap((name, i) =>
        record.runs[i] && this.on(`run${i}`) ? [{ name, kind: `s${colourOf(payload, i)}`, colour: `--s${colourOf(payload, i)}`, dash: DASHES[colourOf(payload, i)] }] : [],
      ),
      ...((record.sd || record.low) && this.on("scatter")
        ? [{ name: repeats ? "range over repeats" : "scatter: ± 2 standard errors or range", kind: "scatter", colour: "--band", band: true }]
        : []),
    ];
  }

  /** Writes the legend anew. */
  relabel() {
    this.legend.replaceChildren(
      ...this.shown().map(({ name, kind }) => {
        const item = document.createElement("li");
        const swatch = document.createElement("i");
        swatch.className = `swatch ${kind}`;
        item.append(swatch, name);
        return item;
      }),
    );
  }

  /** @param {string} key */
  on(key) {
    return !this.view.off.has(key);
  }

  /** What each chart draws, below to above. */
  layers() {
    const made = this.series();
    /** @typedef {{label: string, data: Pyramid, stroke: string, width: number, dash?: number[]}} Layer */
    /** @type {Layer[]} */
    const main = [];
    /** @type {Layer[]} */
    const rest = [];
    const band = (/** @type {Pyramid | null} */ low, /** @type {Pyramid | null} */ high) =>
      low && high && this.on("scatter") ? { low, high } : null;
    const bands = [band(made.low, made.high), band(made.floorLow, made.floorHigh)];
    if (this.on("measured")) main.push({ label: "measured", data: made.y, stroke: colour("--ink"), width: 1.5 });
    const style = (/** @type {number} */ i) => ({ stroke: colour(`--s${colourOf(this.payload, i)}`), width: 1.5, dash: DASHES[colourOf(this.payload, i)] });
    made.runs.forEach((run, i) => {
      if (!run || !this.on(`run${i}`)) return;
      main.push({ label: this.payload.runs[i], data: run, ...style(i) });
      const residual = made.residuals[i];
      if (residual) rest.push({ label: `y − ${this.payload.runs[i]}`, data: residual, ...style(i), width: 1.2 });
    });
    if (this.best && this.on("search")) main.push({ label: "best so far", data: this.best, ...style(made.runs.length) });
    return { main, rest, bands };
  }

  destroyPlots() {
    this.plots.forEach((plot) => plot.destroy());
    this.plots = [];
  }

  destroy() {
    this.visible = false;
    this.sized.disconnect();
    this.destroyPlots();
  }

  restyle() {
    colours.clear();
    this.renew();
  }

  build() {
    const width = this.charts.clientWidth;
    if (width < 50) return;
    this.plots = this.plotsOf(this.charts, width);
    this.draw();
  }

  /** The charts, drawn into `target`. @param {HTMLElement} target @param {number} width @returns {uPlot[]} */
  plotsOf(target, width) {
    const { main, rest, bands } = this.layers();
    const residuals = rest.length > 0 && this.on("residuals") && this.payload.runs.length > 0;
    const plots = [this.plot(target, width, HEIGHT, main, bands[0], this.payload.label, "y", !residuals)];
    if (residuals) plots.push(this.plot(target, width, RESIDUAL, rest, bands[1], "y − model", "r", true));
    return plots;
  }

  /**
   * @param {HTMLElement} target @param {number} width @param {number} height
   * @param {ReturnType<Chart["layers"]>["main"]} layers @param {ReturnType<Chart["layers"]>["bands"][0]} band
   * @param {string} label @param {"y" | "r"} kind @param {boolean} foot whether the time stands below
   */
  plot(target, width, height, layers, band, label, kind, foot) {
    const ink = colour("--ink");
    const font = "12px system-ui, Helvetica, Arial, sans-serif";
    const axis = { stroke: ink, font, labelFont: font, grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--axis"), width: 1, size: 4 } };
    const values = (/** @type {uPlot} */ _u, /** @type {number[]} */ splits) =>
      ticks(splits, splits.length > 1 ? Math.abs(splits[1] - splits[0]) : 1);
    const narrow = width < 500;
    /** @type {uPlot.Options} */
    const options = {
      width,
      height,
      padding: [10, 18, foot ? 0 : 4, 0],
      legend: { show: false },
      cursor: { points: { show: false }, drag: { x: true, y: false, setScale: false }, y: false },
      scales: {
        x: { time: false, auto: false, range: () => [this.view.from, this.view.to] },
        y: { auto: false, range: () => /** @type {[number, number]} */ (this.limits?.[kind] ?? [0, 1]) },
      },
      axes: [
        { ...axis, values, space: narrow ? 60 : 80, show: true, size: foot ? 26 : 8, ...(foot ? { label: "time since the record's start (s)", labelSize: 20 } : { values: () => [] }) },
        { ...axis, values, space: kind === "r" ? 28 : 36, label, labelSize: 20, size: narrow ? 56 : 58 },
      ],
      series: [{}, ...layers.map((layer) => ({ label: layer.label, stroke: layer.stroke, width: layer.width, dash: layer.dash, points: { show: false }, spanGaps: false }))],
      hooks: {
        drawClear: [(u) => this.under(u)],
        drawAxes: [(u) => this.band(u, band)],
        draw: [(u) => this.over(u, kind)],
        setSelect: [
          (u) => {
            if (u.select.width < 4) return;
            const from = u.posToVal(u.select.left, "x");
            const to = u.posToVal(u.select.left + u.select.width, "x");
            u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            this.view.show(from, to);
          },
        ],
        setCursor: [
          (u) => {
            if (this.quiet) return;
            const left = u.cursor.left ?? -1;
            this.read(left < 0 ? null : u.posToVal(left, "x"));
            this.cursor(this.time, u);
            this.onread(this.time);
          },
        ],
      },
    };
    const plot = new uPlot(options, [[0], ...layers.map(() => [null])], target);
    this.layersOf = this.layersOf ?? new WeakMap();
    this.layersOf.set(plot, layers);
    this.gestures(plot);
    return plot;
  }

  /** Wheel with Ctrl zooms, with Shift moves; a drag with Shift, or of one finger, moves. @param {uPlot} plot */
  gestures(plot) {
    const { view } = this;
    plot.over.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey && !event.shiftKey) return;
        event.preventDefault();
        const by = Math.sign(event.deltaY || event.deltaX);
        if (event.ctrlKey) view.zoom(by > 0 ? 1.25 : 0.8, plot.posToVal(event.offsetX, "x"));
        else view.pan(0.1 * by);
      },
      { passive: false },
    );
    plot.over.addEventListener("dblclick", () => view.whole());
    /** @type {{x: number, from: number, to: number} | null} */
    let drag = null;
    plot.over.addEventListener(
      "pointerdown",
      (event) => {
        if (!event.shiftKey && event.pointerType !== "touch") return;
        drag = { x: event.clientX, from: view.from, to: view.to };
        plot.over.setPointerCapture(event.pointerId);
      },
      { capture: true },
    );
    plot.over.addEventListener("mousedown", (event) => event.shiftKey && event.stopImmediatePropagation(), { capture: true });
    plot.over.addEventListener("pointermove", (event) => {
      if (!drag) return;
      const by = ((drag.x - event.clientX) / plot.over.clientWidth) * (drag.to - drag.from);
      view.show(drag.from + by, drag.to + by);
    });
    for (const end of ["pointerup", "pointercancel"]) plot.over.addEventListener(end, () => (drag = null));
  }

  /** Brings what is in view to the charts, once a frame. */
  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      if (!this.visible) return;
      this.fill(this.plots);
      this.stale = false;
      if (this.time !== null) this.cursor(this.time);
    });
  }

  /** @param {uPlot[]} plots */
  fill(plots) {
    const { record, view } = this;
    const on = this.gridOf(plots[0]);
    const times = places(on).map((k) => k * record.period);
    for (const plot of plots) {
      const layers = this.layersOf?.get(plot) ?? [];
      const data = [times, ...layers.map((/** @type {{data: Pyramid}} */ layer) => thinned(layer.data, on))];
      layers.forEach((/** @type {{width: number, dash?: number[]}} */ layer, /** @type {number} */ i) => {
        // Hairlines without dashes are drawn several times as fast: they do while the view moves.
        const light = { width: Math.min(1, layer.width), dash: undefined };
        Object.assign(plot.series[i + 1], view.moving ? light : { width: layer.width, dash: layer.dash });
      });
      plot.batch(() => {
        plot.setData(/** @type {uPlot.AlignedData} */ (data), false);
        plot.setScale("x", { min: view.from, max: view.to });
      });
    }
  }

  /** The samples that are drawn of what is in view. @param {uPlot | undefined} plot */
  gridOf(plot) {
    const { record, view } = this;
    const from = Math.max(0, Math.floor(view.from / record.period) - 1);
    const to = Math.min(record.n, Math.ceil(view.to / record.period) + 2);
    const columns = (plot?.bbox.width ?? 800) / devicePixelRatio;
    return grid(from, to, Math.max(100, Math.round(view.moving ? columns / 2 : columns)));
  }

  /** The scatter, behind the curves: by hand, because uPlot cuts its bands out with a path, which is slow. @param {uPlot} u @param {{low: Pyramid, high: Pyramid} | null} band */
  band(u, band) {
    if (!band) return;
    const { ctx, bbox } = u;
    const on = this.gridOf(u);
    const low = outline(band.low, on, "low");
    const high = outline(band.high, on, "high");
    const x = places(on).map((k) => u.valToPos(k * this.record.period, "x", true));
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.beginPath();
    const there = (/** @type {number} */ i) => low[i] !== null && high[i] !== null;
    for (let start = 0; start < x.length; start++) {
      if (!there(start)) continue;
      let end = start;
      while (end < x.length && there(end)) end++;
      for (let i = start; i < end; i++) ctx.lineTo(x[i], u.valToPos(/** @type {number} */ (high[i]), "y", true));
      for (let i = end - 1; i >= start; i--) ctx.lineTo(x[i], u.valToPos(/** @type {number} */ (low[i]), "y", true));
      ctx.closePath();
      start = end;
    }
    ctx.fillStyle = colour("--band");
    ctx.fill();
    ctx.strokeStyle = colour("--floor");
    ctx.lineWidth = 0.5 * devicePixelRatio;
    ctx.stroke();
    ctx.restore();
  }

  resize() {
    const width = this.charts.clientWidth;
    if (width < 50) return;
    if (this.plots.length === 0) {
      if (this.visible) this.build();
      return;
    }
    if (this.plots[0].width === width) return;
    this.renew();
  }

  /** The lit samples, behind the curves: a tint, and a bar at the top for whoever does not see the tint. @param {uPlot} u */
  under(u) {
    const { lit } = this.view;
    const places = lit && this.payload.coordinates[lit.coordinate]?.places[this.index];
    if (!places) return;
    const { ctx, bbox } = u;
    const scale = bbox.width / (this.view.to - this.view.from);
    ctx.save();
    for (const [from, to] of stretches(places, lit.bin)) {
      const left = Math.max(0, (from * this.record.period - this.view.from) * scale);
      const right = Math.min(bbox.width, (to * this.record.period - this.view.from) * scale);
      if (right <= 0 || left >= bbox.width) continue;
      const width = Math.max(1, right - left);
      ctx.fillStyle = colour("--lit");
      ctx.fillRect(bbox.left + left, bbox.top, width, bbox.height);
      ctx.fillStyle = colour("--warning");
      ctx.fillRect(bbox.left + left, bbox.top, width, 5 * devicePixelRatio);
    }
    ctx.restore();
  }

  /** The command as a strip at the foot of the upper chart, the zero of the lower one. @param {uPlot} u @param {"y" | "r"} kind */
  over(u, kind) {
    const { ctx, bbox } = u;
    const { record, view } = this;
    ctx.save();
    if (kind === "r") {
      const y = Math.round(u.valToPos(0, "y", true)) + 0.5;
      ctx.strokeStyle = colour("--muted");
      ctx.lineWidth = 1;
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    } else {
      const height = STRIP * devicePixelRatio;
      const top = bbox.top + bbox.height - height - 2;
      const scale = bbox.width / (view.to - view.from);
      const x = (/** @type {number} */ k) => bbox.left + Math.min(bbox.width, Math.max(0, (k * record.period - view.from) * scale));
      const from = Math.max(0, Math.floor(view.from / record.period));
      const to = Math.min(record.n, Math.ceil(view.to / record.period));
      ctx.fillStyle = colour("--muted");
      if (record.onOff) {
        for (const [start, end] of this.pulses()) {
          if (end > from && start < to) ctx.fillRect(x(start), top, Math.max(0.5, x(end) - x(start)), height);
        }
      } else {
        this.graded = this.graded ?? new Pyramid(record.u);
        const [low, high] = this.graded.extremes(0, record.n);
        const on = grid(from, to, 400);
        ctx.strokeStyle = colour("--muted");
        ctx.lineWidth = devicePixelRatio;
        ctx.beginPath();
        const at = places(on);
        thinned(this.graded, on).forEach((v, i) => {
          const y = top + height * (1 - ((v ?? low) - low) / (high - low || 1));
          if (i === 0) ctx.moveTo(x(at[i]), y);
          else ctx.lineTo(x(at[i]), y);
        });
        ctx.stroke();
      }
      ctx.textAlign = "left";
      ctx.textBaseline = "bottom";
      ctx.font = `${11 * devicePixelRatio}px system-ui, Helvetica, Arial, sans-serif`;
      ctx.fillText("u", bbox.left + 3, top - 1);
    }
    ctx.restore();
  }

  /** Where the command is on: from, to. */
  pulses() {
    if (this.on_) return this.on_;
    /** @type {[number, number][]} */
    const found = [];
    const { u, n } = this.record;
    for (let k = 0; k < n; k++) {
      if (u[k] !== 1) continue;
      const start = k;
      while (k < n && u[k] === 1) k++;
      found.push([start, k]);
    }
    return (this.on_ = found);
  }

  /** @param {number} time */
  sampleAt(time) {
    return Math.min(this.record.n - 1, Math.max(0, Math.round(time / this.record.period)));
  }

  /** Moves what is read by keyboard. @param {number} by s */
  step(by) {
    const { view } = this;
    const from = this.time ?? (view.from + view.to) / 2;
    const sample = Math.sign(by) * Math.max(Math.abs(by), this.record.period);
    const to = Math.min(view.to, Math.max(view.from, from + sample));
    this.cursor(to);
    this.onread(to);
  }

  /** Shows a time that is read, in every chart but the one it is read from. @param {number | null} time @param {uPlot=} except */
  cursor(time, except) {
    this.read(time);
    if (!this.visible) return;
    this.quiet = true;
    for (const plot of this.plots) {
      if (plot === except) continue;
      const left = time === null ? -10 : plot.valToPos(time, "x");
      plot.setCursor({ left, top: time === null ? -10 : 10 }, false);
    }
    this.quiet = false;
  }

  /** The values at a time. @param {number | null} time */
  read(time) {
    const { record, payload } = this;
    const inside = time !== null && time >= 0 && time <= (record.n - 1) * record.period + record.period / 2;
    this.time = inside ? time : null;
    if (!inside || time === null) {
      this.readout.textContent = "point at a curve, or move along with the arrow keys, to read values; drag to zoom";
      this.readout.classList.add("hint");
      return;
    }
    this.readout.classList.remove("hint");
    const k = this.sampleAt(time);
    const parts = [`t ${significant(record.t0 + k * record.period, 5)} s`, `u ${significant(record.u[k], 3)}`];
    parts.push(`y ${significant(record.y[k])}${record.sd ? ` ± ${significant(record.sd[k], 2)}` : ""}`);
    record.runs.forEach((run, i) => {
      const residual = record.residuals[i];
      if (run && residual) parts.push(`${payload.runs[i]} ${significant(run[k])} (y − model ${significant(residual[k], 2)})`);
    });
    this.readout.textContent = parts.join("   ");
  }
}
