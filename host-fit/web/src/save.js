// Figures as files: SVG, and PNG at twice the size.

import { SvgContext, SvgPath, escape } from "./svgcontext.js";

/** @param {string} name @param {Blob} blob */
function download(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

const plain = (/** @type {string} */ name) => name.replace(/[^\p{L}\p{N}_-]+/gu, "-").slice(0, 60) || "figure";

/** A PNG of an SVG text. @param {string} svg @param {number} width @param {number} height @returns {Promise<Blob>} */
async function png(svg, width, height) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  canvas.width = 2 * width;
  canvas.height = 2 * height;
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  context.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((resolve, reject) =>
    canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png"),
  );
}

/** @param {() => {name: string, svg: string, width: number, height: number}} figure */
function buttons(figure) {
  const bar = document.createElement("span");
  bar.className = "save";
  for (const kind of ["SVG", "PNG"]) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = kind;
    button.title = `save this figure as ${kind}`;
    button.setAttribute("aria-label", `save this figure as ${kind}`);
    button.addEventListener("click", async () => {
      const { name, svg, width, height } = figure();
      const blob = kind === "SVG" ? new Blob([svg], { type: "image/svg+xml" }) : await png(svg, width, height);
      download(`${plain(name)}.${kind.toLowerCase()}`, blob);
    });
    bar.append(button);
  }
  return bar;
}

/** For pictures that are SVG on the page. @param {Iterable<Element>} figures */
export function saveButtons(figures) {
  for (const figure of figures) {
    const all = [...figure.querySelectorAll("svg")];
    if (all.length === 0) continue;
    figure.append(
      buttons(() => {
        // Of the layouts, the one that is seen.
        const svg = all.find((one) => one.clientWidth > 0) ?? all[0];
        return {
          name: svg.querySelector("title")?.textContent ?? "figure",
          svg: new XMLSerializer().serializeToString(svg),
          width: svg.viewBox.baseVal.width,
          height: svg.viewBox.baseVal.height,
        };
      }),
    );
  }
}

/** For the chart of a record. @param {import("./chart.js").Chart} chart */
export function figureButtons(chart) {
  return buttons(() => ({ name: chart.record.name, ...svgOf(chart) }));
}

/** The legend of a chart as SVG, below its title. @param {import("./chart.js").Chart} chart @param {CSSStyleDeclaration} style @param {CanvasRenderingContext2D} measure @param {number} width */
function legendOf(chart, style, measure, width) {
  const value = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  measure.font = "13px Helvetica, Arial, sans-serif";
  let [x, y] = [10, 42];
  const parts = chart.shown().map(({ name, colour, dash, band }) => {
    const wide = 34 + measure.measureText(name).width;
    if (x > 10 && x + wide > width - 10) [x, y] = [10, y + 20];
    const sample = band
      ? `<rect x="${x}" y="${y - 9}" width="24" height="10" fill="${value("--band")}" stroke="${value("--floor")}"/>`
      : `<path d="M${x} ${y - 4}h24" stroke="${value(colour)}" stroke-width="2.5" stroke-dasharray="${(dash ?? []).join(" ")}"/>`;
    const text = `<text x="${x + 30}" y="${y}" fill="${value("--ink")}" style="font:13px Helvetica, Arial, sans-serif">${escape(name)}</text>`;
    x += wide + 18;
    return sample + text;
  });
  return { text: parts.join(""), height: y - 20 };
}

/** The chart as it is on the screen, as SVG: drawn once more by the same code, onto a context that writes SVG. @param {import("./chart.js").Chart} chart @param {number=} wide pixels; as on the screen if left out */
export function svgOf(chart, wide) {
  const target = document.createElement("div");
  target.style.cssText = "position:absolute;left:-9999px;top:0";
  document.body.append(target);
  const measure = /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));
  const canvas = HTMLCanvasElement.prototype;
  const { Path2D } = globalThis;
  const { getContext } = canvas;
  /** @type {SvgContext[]} */
  const drawn = [];
  try {
    Object.assign(globalThis, { Path2D: SvgPath });
    canvas.getContext = /** @type {any} */ (
      () => {
        drawn.push(new SvgContext(measure));
        return drawn.at(-1);
      }
    );
    const width = wide ?? (chart.charts.clientWidth || 900);
    const plots = chart.plotsOf(target, width);
    chart.fill(plots);
    const scale = devicePixelRatio;
    const style = getComputedStyle(document.documentElement);
    const [paper, ink] = ["--paper", "--ink"].map((name) => style.getPropertyValue(name).trim());
    const legend = legendOf(chart, style, measure, width);
    let height = 30 + legend.height;
    const parts = plots.map((plot, i) => {
      const part = `<g transform="translate(0 ${height}) scale(${1 / scale})">${drawn[i].text(`p${i}`)}</g>`;
      height += plot.height;
      return part;
    });
    plots.forEach((plot) => plot.destroy());
    const title = chart.element.querySelector("h3")?.textContent ?? "";
    const svg =
      `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">` +
      `<title>${escape(title)}</title><rect width="100%" height="100%" fill="${paper}"/>` +
      `<text x="10" y="20" fill="${ink}" style="font:600 15px Helvetica, Arial, sans-serif">${escape(title)}</text>${legend.text}${parts.join("")}</svg>`;
    return { svg, width, height };
  } finally {
    canvas.getContext = getContext;
    Object.assign(globalThis, { Path2D });
    target.remove();
  }
}
