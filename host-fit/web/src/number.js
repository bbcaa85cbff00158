// Numbers with the digits that mean something.

/** @param {number} value @param {number} digits @returns {string} */
export function significant(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  const text =
    size < -4 || size >= 6 ? value.toExponential(digits - 1) : value.toFixed(Math.max(0, digits - 1 - size));
  return text.replace("-", "−");
}

/** Tick labels with as many decimals as the step between them needs; never −0. @param {number[]} splits @param {number} step */
export function ticks(splits, step) {
  let decimals = Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  // A step of 2.5 or 0.25 has one digit more than its size says.
  const shifted = step * 10 ** decimals;
  if (Math.abs(shifted - Math.round(shifted)) > 1e-6 * shifted) decimals += 1;
  return splits.map((v) => {
    const exact = Math.abs(v) < step * 1e-6 ? 0 : v;
    const large = Math.abs(exact) >= 1e6 || decimals > 6;
    return (large && exact !== 0 ? exact.toExponential(2) : exact.toFixed(decimals)).replace("-", "−");
  });
}
