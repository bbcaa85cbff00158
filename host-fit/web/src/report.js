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

// Paper is white, whatever the screen is; a canvas may print empty, so curves are put on the page as SVG; and what is
// folded away opens.
/** @type {HTMLDetailsElement[]} */
let folded = [];
addEventListener("beforeprint", () => {
  document.documentElement.classList.add("on-paper");
  folded = [...document.querySelectorAll("details")].filter((d) => !d.open);
  for (const details of folded) details.open = true;
  redraw();
  groups.forEach((group) => group.paper(true));
});
addEventListener("afterprint", () => {
  document.documentElement.classList.remove("on-paper");
  groups.forEach((group) => group.paper(false));
  for (const details of folded) details.open = false;
  redraw();
});

// The contents say which section is in view.
const links = new Map([...document.querySelectorAll("nav a")].map((a) => [a.getAttribute("href")?.slice(1), a]));
const sections = [...document.querySelectorAll("section[id]")].filter((s) => links.has(s.id));
const follow = () => {
  const above = sections.filter((s) => s.getBoundingClientRect().top < 160);
  const current = above.at(-1) ?? sections[0];
  for (const [id, link] of links) {
    if (id === current?.id) link.setAttribute("aria-current", "true");
    else link.removeAttribute("aria-current");
  }
};
addEventListener("scroll", follow, { passive: true });
follow();

// For whoever measures the page.
Object.assign(globalThis, { hostFit: { groups } });
