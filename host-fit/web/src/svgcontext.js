// A drawing context that writes SVG: the charts are drawn once more onto it, so that a saved figure is what is on the screen.

/** Path2D that remembers its commands. */
export class SvgPath {
  /** @type {string[]} */
  d = [];
  /** @param {SvgPath=} other */
  constructor(other) {
    if (other) this.d = other.d.slice();
  }
  /** @param {number} x @param {number} y */
  moveTo(x, y) {
    this.d.push(`M${round(x)} ${round(y)}`);
  }
  /** @param {number} x @param {number} y */
  lineTo(x, y) {
    // A line from nowhere starts where it goes.
    this.d.push(`${this.d.length ? "L" : "M"}${round(x)} ${round(y)}`);
  }
  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  rect(x, y, w, h) {
    this.d.push(`M${round(x)} ${round(y)}h${round(w)}v${round(h)}h${round(-w)}z`);
  }
  closePath() {
    this.d.push("z");
  }
  /** @param {SvgPath} other */
  addPath(other) {
    this.d.push(...other.d);
  }
  /** @param {number} x @param {number} y @param {number} r @param {number} from @param {number} to */
  arc(x, y, r, from, to) {
    if (Math.abs(to - from) >= 6.28) this.d.push(`M${round(x - r)} ${round(y)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`);
  }
}

const round = (/** @type {number} */ v) => Math.round(v * 100) / 100;
/** Text for XML. */
export const escape = (/** @type {string} */ t) => t.replace(/[<>&"']/g, (c) => `&#${c.charCodeAt(0)};`);

/** The part of CanvasRenderingContext2D that uPlot and the charts use. */
export class SvgContext {
  /** @param {CanvasRenderingContext2D} measure tells how wide words are */
  constructor(measure) {
    this.measure = measure;
    /** @type {string[]} */
    this.out = [];
    this.clips = 0;
    this.defs = "";
    this.path = new SvgPath();
    /** @type {any[]} */
    this.stack = [];
    this.fillStyle = "#000";
    this.strokeStyle = "#000";
    this.lineWidth = 1;
    this.lineJoin = "round";
    this.lineCap = "butt";
    this.font = "12px sans-serif";
    this.textAlign = "left";
    this.textBaseline = "alphabetic";
    this.globalAlpha = 1;
    this.lineDash = /** @type {number[]} */ ([]);
    this.shift = [0, 0];
    this.transform = "";
    this.clipped = "";
  }
  save() {
    const { fillStyle, strokeStyle, lineWidth, font, textAlign, textBaseline, globalAlpha, lineDash, shift, transform, clipped } = this;
    this.stack.push({ fillStyle, strokeStyle, lineWidth, font, textAlign, textBaseline, globalAlpha, lineDash, shift, transform, clipped });
  }
  restore() {
    Object.assign(this, this.stack.pop());
  }
  /** @param {number[]} dash */
  setLineDash(dash) {
    this.lineDash = dash;
  }
  /** @param {number} x @param {number} y */
  translate(x, y) {
    if (this.transform) this.transform += `translate(${round(x)} ${round(y)})`;
    else this.shift = [this.shift[0] + x, this.shift[1] + y];
  }
  /** @param {number} angle */
  rotate(angle) {
    const [x, y] = this.shift;
    if (!this.transform) this.transform = `translate(${round(x)} ${round(y)})`;
    this.transform += `rotate(${round((angle * 180) / Math.PI)})`;
  }
  beginPath() {
    this.path = new SvgPath();
  }
  /** @param {number} x @param {number} y */
  moveTo(x, y) {
    this.path.moveTo(x, y);
  }
  /** @param {number} x @param {number} y */
  lineTo(x, y) {
    this.path.lineTo(x, y);
  }
  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  rect(x, y, w, h) {
    this.path.rect(x, y, w, h);
  }
  closePath() {
    this.path.closePath();
  }
  clearRect() {
    this.out = [];
    this.defs = "";
  }
  /** What was drawn; `name` keeps the names of its parts apart from those of other drawings. @param {string} name */
  text(name) {
    return `<defs>${this.defs}</defs>${this.out.join("")}`.replaceAll("@clip", name);
  }
  /** @param {SvgPath=} path */
  clip(path) {
    const id = `@clip${++this.clips}`;
    // Within the clip there is already.
    this.defs += `<clipPath id="${id}"${this.clipped}><path d="${(path ?? this.path).d?.join("")}"/></clipPath>`;
    this.clipped = ` clip-path="url(#${id})"`;
  }
  attributes() {
    const alpha = this.globalAlpha < 1 ? ` opacity="${this.globalAlpha}"` : "";
    const [x, y] = this.shift.map(round);
    const moved = x || y ? `translate(${x} ${y})` : "";
    const transform = this.transform || moved ? ` transform="${this.transform || moved}"` : "";
    return alpha + transform + this.clipped;
  }
  /** @param {SvgPath=} path */
  stroke(path) {
    const d = (path ?? this.path).d?.join("");
    if (!d) return;
    const dash = this.lineDash.length ? ` stroke-dasharray="${this.lineDash.join(" ")}"` : "";
    this.out.push(
      `<path fill="none" stroke="${this.strokeStyle}" stroke-width="${round(this.lineWidth)}" stroke-linejoin="round"${dash}${this.attributes()} d="${d}"/>`,
    );
  }
  /** @param {SvgPath=} path */
  fill(path) {
    const d = (path ?? this.path).d?.join("");
    if (d) this.out.push(`<path fill="${this.fillStyle}"${this.attributes()} d="${d}"/>`);
  }
  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  fillRect(x, y, w, h) {
    this.out.push(
      `<rect fill="${this.fillStyle}"${this.attributes()} x="${round(x)}" y="${round(y)}" width="${round(w)}" height="${round(h)}"/>`,
    );
  }
  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  strokeRect(x, y, w, h) {
    const path = new SvgPath();
    path.rect(x, y, w, h);
    this.stroke(path);
  }
  /** @param {string} text */
  measureText(text) {
    this.measure.font = this.font;
    return this.measure.measureText(text);
  }
  /** @param {string} text @param {number} x @param {number} y */
  fillText(text, x, y) {
    const anchor = { center: "middle", right: "end", end: "end" }[this.textAlign] ?? "start";
    const baseline = { top: "hanging", middle: "central", bottom: "text-after-edge" }[this.textBaseline] ?? "auto";
    const font = escape(this.font);
    this.out.push(
      `<text fill="${this.fillStyle}" style="font:${font}" text-anchor="${anchor}" dominant-baseline="${baseline}"${this.attributes()} x="${round(x)}" y="${round(y)}">${escape(String(text))}</text>`,
    );
  }
}
