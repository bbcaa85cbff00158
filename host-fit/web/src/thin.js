// Thinning of long records: of each column of pixels the smallest and the largest sample stay, so that no spike is lost and a
// record of any length is drawn as fast as a short one.

const STEPS = [16, 256, 4096];

/** Smallest and largest values of blocks of samples, for several block lengths. */
export class Pyramid {
  /** @param {Float32Array} values */
  constructor(values) {
    this.values = values;
    /** @type {{step: number, low: Float32Array, high: Float32Array}[]} */
    this.levels = [];
    for (const step of STEPS) {
      if (values.length < 4 * step) break;
      const blocks = Math.ceil(values.length / step);
      const low = new Float32Array(blocks);
      const high = new Float32Array(blocks);
      const below = this.levels.at(-1);
      for (let b = 0; b < blocks; b++) {
        let least = Infinity;
        let most = -Infinity;
        if (below) {
          const ratio = step / below.step;
          const end = Math.min((b + 1) * ratio, below.low.length);
          for (let i = b * ratio; i < end; i++) {
            if (below.low[i] < least) least = below.low[i];
            if (below.high[i] > most) most = below.high[i];
          }
        } else {
          const end = Math.min((b + 1) * step, values.length);
          for (let i = b * step; i < end; i++) {
            const v = values[i];
            if (v < least) least = v;
            if (v > most) most = v;
          }
        }
        low[b] = least;
        high[b] = most;
      }
      this.levels.push({ step, low, high });
    }
  }

  /** Smallest and largest of the samples from..to; [Infinity, −Infinity] where there is none. @param {number} from @param {number} to @returns {[number, number]} */
  extremes(from, to) {
    from = Math.max(0, from);
    to = Math.min(this.values.length, to);
    let least = Infinity;
    let most = -Infinity;
    let at = from;
    while (at < to) {
      let level = null;
      for (const candidate of this.levels) {
        if (at % candidate.step === 0 && at + candidate.step <= to) level = candidate;
      }
      if (level) {
        const b = at / level.step;
        if (level.low[b] < least) least = level.low[b];
        if (level.high[b] > most) most = level.high[b];
        at += level.step;
      } else {
        const v = this.values[at];
        if (v < least) least = v;
        if (v > most) most = v;
        at += 1;
      }
    }
    return [least, most];
  }
}

/**
 * The samples to draw of `from..to`: all of them where they are few, otherwise two for each of `columns`.
 * @param {number} from @param {number} to @param {number} columns
 * @returns {{all: boolean, at: Int32Array}} first sample of each drawn one
 */
export function grid(from, to, columns) {
  const n = Math.max(0, to - from);
  if (n <= 2 * columns) return { all: true, at: Int32Array.from({ length: n }, (_, i) => from + i) };
  const at = new Int32Array(columns + 1);
  for (let c = 0; c <= columns; c++) at[c] = from + Math.floor((n * c) / columns);
  return { all: false, at };
}

/**
 * The values of a series on a grid, gaps as null.
 * @param {Pyramid} series @param {ReturnType<typeof grid>} on
 * @returns {(number | null)[]}
 */
export function thinned(series, on) {
  const finite = (/** @type {number} */ v) => (Number.isFinite(v) ? v : null);
  if (on.all) return Array.from(on.at, (k) => finite(series.values[k]));
  const columns = on.at.length - 1;
  const out = new Array(2 * columns);
  for (let c = 0; c < columns; c++) {
    const [least, most] = series.extremes(on.at[c], on.at[c + 1]);
    // In the order in which the record goes, as far as two ends tell.
    const rising = series.values[on.at[c]] <= series.values[on.at[c + 1] - 1];
    out[2 * c] = finite(rising ? least : most);
    out[2 * c + 1] = finite(rising ? most : least);
  }
  return out;
}

/**
 * The lower or the upper edge of a series on a grid, gaps as null; at the places of [`thinned`] values.
 * @param {Pyramid} series @param {ReturnType<typeof grid>} on @param {"low" | "high"} edge
 * @returns {(number | null)[]}
 */
export function outline(series, on, edge) {
  if (on.all) return thinned(series, on);
  const columns = on.at.length - 1;
  const out = new Array(2 * columns);
  for (let c = 0; c < columns; c++) {
    const [least, most] = series.extremes(on.at[c], on.at[c + 1]);
    const v = edge === "low" ? least : most;
    out[2 * c] = out[2 * c + 1] = Number.isFinite(v) ? v : null;
  }
  return out;
}

/** The places of [`thinned`] values, in samples. @param {ReturnType<typeof grid>} on @returns {number[]} */
export function places(on) {
  if (on.all) return Array.from(on.at);
  const out = [];
  for (let c = 0; c + 1 < on.at.length; c++) {
    const width = on.at[c + 1] - on.at[c];
    out.push(on.at[c] + width / 4, on.at[c] + (3 * width) / 4);
  }
  return out;
}
