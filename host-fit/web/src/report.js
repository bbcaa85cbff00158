// The living part of a report: its groups of records, their charts and bars.

import { Group } from "./group.js";
import { saveButtons } from "./save.js";

const groups = [...document.querySelectorAll(".living")].map((element) => {
  const carrier = document.getElementById(`${element.id}-data`);
  return new Group(/** @type {HTMLElement} */ (element), JSON.parse(carrier?.textContent ?? "{}"));
});
saveButtons(document.querySelectorAll("figure"));

const redraw = () => groups.forEach((group) => group.restyle());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
// Paper is white, whatever the screen is.
addEventListener("beforeprint", () => {
  document.documentElement.classList.add("on-paper");
  groups.forEach((group) => group.drawAll());
  redraw();
});
addEventListener("afterprint", () => {
  document.documentElement.classList.remove("on-paper");
  redraw();
});
// For whoever measures the page.
Object.assign(globalThis, { hostFit: { groups } });
