// What all charts of a page's group share: the stretch of time in view, what is switched off, what is lit. Kept in the address.

/**
 * @typedef {{coordinate: number, bin: number} | null} Lit
 */

export class View {
  /**
   * @param {string} id of the group @param {number} length of the longest record, s @param {number} finest s
   * @param {string[]=} off what is switched off at first
   * @param {number[]=} view what is in view at first, from and to, s; everything if left out
   */
  constructor(id, length, finest, off = [], view = []) {
    this.id = id;
    this.length = length;
    this.finest = finest;
    const [from = 0, to = length] = view;
    /** @type {[number, number]} */
    this.start = to > from ? [Math.max(0, from), Math.min(length, to)] : [0, length];
    this.from = this.start[0];
    this.to = this.start[1];
    this.first = off.join();
    this.off = new Set(off);
    /** @type {Lit} */
    this.lit = null;
    /** Whether the stretch in view was changed just now: what is drawn may be drawn lightly. */
    this.moving = false;
    /** @type {((what: "range" | "off" | "lit") => void)[]} */
    this.listeners = [];
    this.restore();
  }

  /** @param {"range" | "off" | "lit"} what */
  tell(what) {
    for (const listener of this.listeners) listener(what);
    clearTimeout(this.later);
    this.later = setTimeout(() => this.rest(), 150);
  }

  /** Nothing was changed for a moment. */
  rest() {
    this.keep();
    if (!this.moving) return;
    this.moving = false;
    for (const listener of this.listeners) listener("range");
  }

  /** Shows from..to, at least a few samples, at most everything. @param {number} from @param {number} to */
  show(from, to) {
    const width = Math.min(this.length, Math.max(this.finest, to - from));
    const middle = (from + to) / 2;
    const start = Math.min(this.length - width, Math.max(0, middle - width / 2));
    if (!Number.isFinite(start)) return;
    this.from = start;
    this.to = start + width;
    this.moving = true;
    this.tell("range");
  }

  /** @param {number} factor below 1 shows less @param {number=} around s */
  zoom(factor, around) {
    const at = around ?? (this.from + this.to) / 2;
    this.show(at - (at - this.from) * factor, at + (this.to - at) * factor);
  }

  /** @param {number} share of what is in view */
  pan(share) {
    const by = share * (this.to - this.from);
    this.show(this.from + by, this.to + by);
  }

  whole() {
    this.show(0, this.length);
  }

  /** @param {string} name @param {boolean} on */
  turn(name, on) {
    if (on) this.off.delete(name);
    else this.off.add(name);
    this.tell("off");
  }

  /** @param {Lit} lit */
  light(lit) {
    if (lit?.coordinate === this.lit?.coordinate && lit?.bin === this.lit?.bin) return;
    this.lit = lit;
    this.tell("lit");
  }

  /** The part of the address after `#` that belongs to this group. */
  words() {
    const words = [];
    const digits = (/** @type {number} */ v) => String(Number(v.toFixed(6)));
    const moved = Math.abs(this.from - this.start[0]) + Math.abs(this.to - this.start[1]) > 1e-9;
    if (moved) words.push(`${this.id}.t=${digits(this.from)}..${digits(this.to)}`);
    if ([...this.off].join() !== this.first) words.push(`${this.id}.off=${[...this.off].map(encodeURIComponent).join(",")}`);
    if (this.lit) words.push(`${this.id}.bar=${this.lit.coordinate}:${this.lit.bin}`);
    return words;
  }

  keep() {
    const others = location.hash
      .replace(/^#/, "")
      .split("&")
      .filter((word) => word !== "" && !word.startsWith(`${this.id}.`));
    const hash = [...others, ...this.words()].join("&");
    history.replaceState(history.state, "", hash === "" ? location.pathname + location.search : `#${hash}`);
  }

  restore() {
    for (const word of location.hash.replace(/^#/, "").split("&")) {
      const [key, value = ""] = word.split("=");
      if (key === `${this.id}.t`) {
        const [from, to] = value.split("..").map(Number);
        if (to > from) this.show(from, to);
      } else if (key === `${this.id}.off`) {
        this.off.clear();
        for (const name of value.split(",").filter((name) => name !== "")) {
          try {
            this.off.add(decodeURIComponent(name));
          } catch {
            // A hand-written address; the name is passed over.
          }
        }
      } else if (key === `${this.id}.bar`) {
        const [coordinate, bin] = value.split(":").map(Number);
        if (Number.isInteger(coordinate) && Number.isInteger(bin)) this.lit = { coordinate, bin };
      }
    }
  }
}
