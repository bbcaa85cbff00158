// What a page carries: records, free runs, and which samples a bar of "where it fails" stands for.

/**
 * @typedef {{edges: number[]} | {values: string}} PackedCommand
 * @typedef {object} PackedRecord
 * @property {string} name
 * @property {string} use in words
 * @property {number} t0 time of the first sample, s
 * @property {number} period s
 * @property {number} n samples
 * @property {PackedCommand} u
 * @property {string} y 32-bit floats, base64
 * @property {string=} sd
 * @property {string=} low
 * @property {string=} high
 * @property {(string | null)[]} runs one for each of the payload's runs
 *
 * @typedef {object} Coordinate
 * @property {string} name
 * @property {string} unit
 * @property {number[][]} places per record: bin, samples, bin, samples … (bin −1: none)
 *
 * @typedef {object} Payload
 * @property {string} label of the axis of y
 * @property {PackedRecord[]} records
 * @property {string[]} runs names of the models
 * @property {number[]=} colours of the runs; in their order if left out
 * @property {number[]=} off runs that are not shown at first
 * @property {Coordinate[]} coordinates
 * @property {number[]=} view what is in view at first, from and to, s since a record's start
 *
 * @typedef {object} Series
 * @property {string} name
 * @property {string} use
 * @property {number} t0
 * @property {number} period
 * @property {number} n
 * @property {Float32Array} u
 * @property {boolean} onOff
 * @property {Float32Array} y
 * @property {Float32Array | null} low of the scatter
 * @property {Float32Array | null} high
 * @property {Float32Array | null} sd
 * @property {(Float32Array | null)[]} runs
 * @property {(Float32Array | null)[]} residuals y − run
 */

/** The colour of a run, one of six. @param {Payload} payload @param {number} run */
export const colourOf = (payload, run) => (payload.colours?.[run] ?? run) % 6;

/** @param {string} text @returns {Float32Array} */
export function floats(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

/** A command of 0 and 1 from the samples where it changes; it starts at 0. @param {number[]} edges @param {number} n */
export function command(edges, n) {
  const u = new Float32Array(n);
  for (let i = 0; i < edges.length; i += 2) u.fill(1, edges[i], edges[i + 1] ?? n);
  return u;
}

/** @param {PackedRecord} packed @returns {Series} */
export function unpack(packed) {
  const { n } = packed;
  const optional = (/** @type {string | null | undefined} */ text) => (text ? floats(text) : null);
  const y = floats(packed.y);
  const sd = optional(packed.sd);
  const runs = packed.runs.map(optional);
  const around = (/** @type {number} */ by) => (sd ? y.map((v, k) => v + by * sd[k]) : null);
  return {
    name: packed.name,
    use: packed.use,
    t0: packed.t0,
    period: packed.period,
    n,
    onOff: "edges" in packed.u,
    u: "edges" in packed.u ? command(packed.u.edges, n) : floats(packed.u.values),
    y,
    sd,
    low: optional(packed.low) ?? around(-2),
    high: optional(packed.high) ?? around(2),
    runs,
    residuals: runs.map((run) => run && y.map((v, k) => v - run[k])),
  };
}

/** The stretches [from, to) of samples in a bin. @param {number[]} places @param {number} bin */
export function stretches(places, bin) {
  /** @type {[number, number][]} */
  const found = [];
  let at = 0;
  for (let i = 0; i < places.length; i += 2) {
    if (places[i] === bin) found.push([at, at + places[i + 1]]);
    at += places[i + 1];
  }
  return found;
}

/** The bin of a sample, −1 for none. @param {number[]} places @param {number} sample */
export function binAt(places, sample) {
  let at = 0;
  for (let i = 0; i < places.length; i += 2) {
    at += places[i + 1];
    if (sample < at) return places[i];
  }
  return -1;
}
