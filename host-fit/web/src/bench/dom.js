// Elements of the page.

import { saveButtons } from "../save.js";

/**
 * An element with attributes, listeners (`onclick`) and children.
 * @param {string} tag @param {Record<string, any>=} attributes @param {...(Node | string | null | undefined)} children
 */
export function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, String(value));
  }
  element.append(...children.filter((c) => c !== null && c !== undefined));
  return element;
}

/** @param {string} id */
export const place = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** @param {string} text @param {() => unknown} does @param {Record<string, any>=} attributes */
export const button = (text, does, attributes = {}) => el("button", { type: "button", onclick: does, ...attributes }, text);

/** A picture of the server, which escapes what is the user's. @param {string} svg @param {{group?: string, caption?: string}=} more */
export function picture(svg, { group, caption } = {}) {
  const figure = el("figure", group ? { "data-group": group } : {});
  figure.innerHTML = svg;
  if (caption) figure.append(el("figcaption", {}, caption));
  saveButtons([figure]);
  return figure;
}

/**
 * A table; columns from `numbers` on stand to the right.
 * @param {string[]} columns @param {(string | Node)[][]} rows @param {(column: number) => boolean} number
 */
export const table = (columns, rows, number) =>
  el("div", { class: "table", tabindex: "0", role: "region", "aria-label": columns.join(", ") },
    el("table", {},
      el("thead", {}, el("tr", {}, ...columns.map((c, i) => el("th", { scope: "col", class: number(i) ? "n" : "" }, c)))),
      el("tbody", {}, ...rows.map((row) => el("tr", {}, ...row.map((cell, i) => el("td", { class: number(i) ? "n" : "" }, cell)))))));

/** Words with `code` between backticks. @param {string} text */
export const inline = (text) => text.split("`").map((part, i) => (i % 2 ? el("code", {}, part) : part));

/** What a form says, as options of a command; what is empty is left out. @param {HTMLFormElement} form */
export function options(form) {
  /** @type {Record<string, unknown>} */
  const found = {};
  for (const [name, value] of new FormData(form)) {
    if (typeof value !== "string" || value.trim() === "") continue;
    const field = form.elements.namedItem(name);
    found[name] = field instanceof HTMLInputElement && field.type === "checkbox" ? true : value.trim();
  }
  return found;
}
