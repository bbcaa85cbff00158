// Panes that can be made wider: with the mouse, a finger or the arrow keys. Their widths are kept by the browser.

const KEY = "host-fit.panes";

export function grips() {
  const panes = /** @type {HTMLElement} */ (document.getElementById("panes"));
  /** @type {Record<string, number>} */
  let widths = {};
  try {
    widths = JSON.parse(localStorage.getItem(KEY) ?? "{}");
  } catch {
    // A browser that keeps nothing, or kept something else.
  }
  for (const grip of /** @type {NodeListOf<HTMLElement>} */ (panes.querySelectorAll(".grip"))) {
    const name = grip.dataset.pane ?? "";
    const pane = /** @type {HTMLElement} */ (document.getElementById(name));
    const sign = name === "left" ? 1 : -1;
    const set = (/** @type {number} */ width) => {
      const fitting = Math.round(Math.min(0.45 * innerWidth, Math.max(180, width)));
      panes.style.setProperty(`--${name}`, `${fitting}px`);
      grip.setAttribute("aria-valuenow", String(fitting));
      widths[name] = fitting;
      try {
        localStorage.setItem(KEY, JSON.stringify(widths));
      } catch {
        // As above: the width holds as long as the page is open.
      }
    };
    if (widths[name]) set(widths[name]);
    grip.addEventListener("pointerdown", (event) => {
      const [from, width] = [event.clientX, pane.offsetWidth];
      grip.setPointerCapture(event.pointerId);
      const move = (/** @type {PointerEvent} */ now) => set(width + sign * (now.clientX - from));
      grip.addEventListener("pointermove", move);
      grip.addEventListener("pointerup", () => grip.removeEventListener("pointermove", move), { once: true });
    });
    grip.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -20, ArrowRight: 20 }[event.key];
      if (!by) return;
      event.preventDefault();
      set(pane.offsetWidth + sign * by);
    });
  }
}
