// Bars of "where it fails": each lights up its samples in every record, and the sample that is read marks its bars.

import { binAt } from "./data.js";

export class Bars {
  /** @param {string} group @param {import("./data.js").Payload} payload @param {import("./view.js").View} view */
  constructor(group, payload, view) {
    this.payload = payload;
    this.view = view;
    /** A picture is there in two layouts, of which one is seen. @type {Map<string, SVGElement[]>} */
    this.bars = new Map();
    /** Bars of the sample that is read, per coordinate. @type {(SVGElement[] | undefined)[]} */
    this.marked = [];
    const figures = document.querySelectorAll(`figure[data-group="${group}"] [data-bar]`);
    for (const bar of /** @type {NodeListOf<SVGElement>} */ (figures)) {
      const [coordinate, bin] = (bar.dataset.bar ?? "").split(":").map(Number);
      const place = payload.coordinates[coordinate];
      if (!place || place.places.every((p) => p.length === 0)) {
        // It stands for no samples: nothing to press, but its value is read.
        bar.setAttribute("role", "img");
        continue;
      }
      const key = `${coordinate}:${bin}`;
      this.bars.set(key, [...(this.bars.get(key) ?? []), bar]);
      bar.classList.add("bar");
      // One stop of the tab key for each panel; the arrows go along it.
      const panel = `${coordinate}:first`;
      const first = this.bars.get(panel) ?? [];
      const later = first.some((other) => other.ownerSVGElement === bar.ownerSVGElement);
      bar.setAttribute("tabindex", later ? "-1" : "0");
      if (!later) this.bars.set(panel, [...first, bar]);
      // A picture's parts cannot be pressed; those of a group can.
      bar.closest("svg")?.setAttribute("role", "group");
      bar.setAttribute("role", "button");
      bar.setAttribute("aria-pressed", "false");
      const toggle = () => {
        const lit = view.lit;
        view.light(lit?.coordinate === coordinate && lit?.bin === bin ? null : { coordinate, bin });
      };
      bar.addEventListener("click", toggle);
      bar.addEventListener("keydown", (event) => {
        const along = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (event.key === "Enter" || event.key === " ") toggle();
        else if (along) this.bars.get(`${coordinate}:${bin + along}`)?.forEach((other) => other.focus());
        else if (event.key === "Escape") view.light(null);
        else return;
        event.preventDefault();
      });
    }
    this.listener = (/** @type {string} */ what) => what === "lit" && this.show();
    view.listeners.push(this.listener);
    this.show();
  }

  /** Lets go of bars that are on the page no more. */
  release() {
    this.view.listeners = this.view.listeners.filter((listener) => listener !== this.listener);
  }

  show() {
    const { lit } = this.view;
    for (const [key, bars] of this.bars) {
      if (key.endsWith("first")) continue;
      const on = lit !== null && key === `${lit.coordinate}:${lit.bin}`;
      for (const bar of bars) {
        bar.classList.toggle("lit", on);
        bar.setAttribute("aria-pressed", String(on));
      }
    }
  }

  /** Marks the bars that a sample belongs to. @param {{record: number, sample: number} | null} at */
  mark(at) {
    this.payload.coordinates.forEach((coordinate, index) => {
      const places = at && coordinate.places[at.record];
      const bin = places ? binAt(places, at.sample) : -1;
      const now = bin < 0 ? undefined : this.bars.get(`${index}:${bin}`);
      const before = this.marked[index];
      if (before !== now) {
        before?.forEach((bar) => bar.classList.remove("here"));
        now?.forEach((bar) => bar.classList.add("here"));
      }
      this.marked[index] = now;
    });
  }
}
