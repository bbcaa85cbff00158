// The parts of the pages that need no browser: `npm test`.
import assert from "node:assert/strict";
import test from "node:test";
import { binAt, command, floats, stretches } from "../src/data.js";
import { significant, ticks } from "../src/number.js";
import { Pyramid, grid, places, thinned } from "../src/thin.js";

test("samples come back as they were packed", () => {
  const values = Float32Array.from([0, -1.5, 3e7, 1e-3]);
  const text = Buffer.from(values.buffer).toString("base64");
  assert.deepEqual(floats(text), values);
  assert.deepEqual([...command([1, 3, 4], 6)], [0, 1, 1, 0, 1, 1]);
});

test("a bar's samples and a sample's bar agree", () => {
  const runs = [-1, 2, 3, 4, -1, 1, 3, 2];
  assert.deepEqual(stretches(runs, 3), [
    [2, 6],
    [7, 9],
  ]);
  for (const [from, to] of stretches(runs, 3)) {
    for (let k = from; k < to; k++) assert.equal(binAt(runs, k), 3);
  }
  assert.equal(binAt(runs, 6), -1);
  assert.equal(binAt(runs, 99), -1);
});

test("no spike is lost, whatever is in view", () => {
  const n = 600_000;
  const values = new Float32Array(n).map((_, k) => Math.sin(k / 500));
  values[432_101] = 9;
  values[17] = -7;
  const series = new Pyramid(values);
  for (const [from, to] of [
    [0, n],
    [432_000, 432_300],
    [400_003, 599_999],
    [432_101, 432_102],
  ]) {
    const on = grid(from, to, 800);
    const drawn = thinned(series, on);
    assert.equal(drawn.length, places(on).length);
    assert.ok(drawn.length <= 1600);
    assert.equal(Math.max(...drawn.map(Number)), 9, `${from}..${to}`);
    const [least, most] = series.extremes(from, to);
    const part = values.slice(from, to);
    assert.equal(least, part.reduce((a, b) => Math.min(a, b)));
    assert.equal(most, part.reduce((a, b) => Math.max(a, b)));
  }
  assert.equal(series.extremes(0, 100)[0], -7);
  assert.deepEqual(thinned(new Pyramid(Float32Array.from([1, NaN, 2])), grid(0, 3, 10)), [1, null, 2]);
});

test("numbers have the digits that mean something", () => {
  assert.equal(significant(0.123456), "0.1235");
  assert.equal(significant(-12345.6, 3), "−12346");
  assert.equal(significant(NaN), "–");
  assert.deepEqual(ticks([-0.2, -1.29e-5 * 1e-3, 0.2], 0.2), ["−0.2", "0.0", "0.2"]);
  assert.deepEqual(ticks([0, 50, 100], 50), ["0", "50", "100"]);
  assert.deepEqual(ticks([0, 2.5, 5], 2.5), ["0.0", "2.5", "5.0"]);
  assert.deepEqual(ticks([0, 0.25, 0.5], 0.25), ["0.00", "0.25", "0.50"]);
});
