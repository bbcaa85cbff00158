// Bundles the pages' scripts and styles into `bundle/`, which is checked in: `cargo build` needs no node.
// `cargo xtask pages` runs this; `cargo xtask pages --check` proves that the bundle is what the sources give.
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync, mkdirSync } from "node:fs";
import { build } from "esbuild";

const out = process.argv[2] ?? "bundle";
mkdirSync(out, { recursive: true });
const licence = readFileSync("node_modules/uplot/LICENSE", "utf8");
const notice = `/*! uPlot ${JSON.parse(readFileSync("node_modules/uplot/package.json", "utf8")).version}\n${licence.trim()}\n*/\n`;

for (const page of ["report", "workbench"]) {
  const result = await build({
    entryPoints: [`src/${page}.js`, `src/${page}.css`],
    bundle: true,
    minify: true,
    charset: "utf8",
    format: "esm",
    target: "es2022",
    legalComments: "none",
    outdir: out,
    write: false,
  });
  for (const file of result.outputFiles) {
    // The text stands within <script> and <style> of a page.
    const text = notice + file.text.trim() + "\n";
    if (/<\/(script|style)/i.test(text)) throw new Error(`${file.path} would end its element early`);
    writeFileSync(`${out}/${file.path.split("/").pop()}`, text);
    if (file.path.endsWith(".js")) {
      const hash = createHash("sha256").update(text).digest("base64");
      writeFileSync(`${out}/${page}.sha256`, `sha256-${hash}\n`);
    }
  }
}
