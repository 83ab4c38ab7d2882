// A tour for who is new: five steps, each at the part of an asset's page that it speaks of. It is offered once where
// the plant is simulated, and always there behind its button.

import { make } from "./elements.js";
import { linkOf } from "./overview.js";

const OFFERED = "faultbond.tour"; // what the browser remembers it by
const GAP = 14;                   // px between a part and the card
const DOCKED = matchMedia("(max-width: 700px)");

const isSimulated = (state) => state.site.source.startsWith("sim:") && !state.site.source.includes("fault=none");
const STEPS = [
  { part: ".verdict", title: "How the plant stands", says: (state) => [
    "A word and a sentence, by NAMUR NE 107. Normal: the plant behaves as its model expects. Without data it is never called normal.",
    isSimulated(state) ? "This plant is simulated. After a while a fault comes by itself." : ""] },
  { part: ".plant-drawing", title: "The plant", says: () => [
    "Its parts, in a picture of the process where there is one, or in the bond graph, whose bonds show how power flows.",
    "The likelier it is that a component is at fault, the stronger its colour."] },
  { part: ".trends", title: "Measured and expected", says: () => [
    "What each sensor measured, and what the model expects, with a band of two standard deviations.",
    "The detector adds up what lies off. Where it reaches its limit there is an alarm."] },
  { part: ".explanations", title: "What may be at fault", says: () => [
    "After an alarm: the explanations, each with its probability, and with what its parameter was and is now.",
    "Where some cannot be told apart yet, what would help stands below them."] },
  { part: ".verdict .buttons", title: "What you can do", says: () => [
    "Acknowledge: you have seen the alarm. Accept: the diagnosis becomes the model. Reject: it is not that. Repaired: the part was mended.",
    "They are here while there is an alarm, as far as your role allows. What was done stands in the journal, and decisions can be undone, the last one first."] },
];

const memory = { // a browser may refuse to keep anything
  has: () => { try { return localStorage.getItem(OFFERED) != null; } catch { return true; } },
  keep: () => { try { localStorage.setItem(OFFERED, "yes"); } catch { /* it is offered again */ } },
};

export class Tour {
  constructor({ button, offer, main }) {
    Object.assign(this, { button, offer, main, step: 0, wanted: null, state: null });
    this.count = make("p", { class: "hint" });
    this.title = make("h2", { id: "tour-title" });
    this.text = make("div", { id: "tour-text" });
    this.back = make("button", { type: "button", on: { click: () => this.go(this.step - 1) } }, "Back");
    this.next = make("button", { type: "button", class: "main", on: { click: () => this.go(this.step + 1) } });
    const card = this.card = make("dialog", { class: "tour", id: "tour-card", "aria-labelledby": "tour-title", "aria-describedby": "tour-text" },
      make("div", { "aria-live": "polite" }, this.count, this.title, this.text),
      make("div", { class: "dialog-end" }, make("button", { type: "button", class: "leave", on: { click: () => this.end() } }, "End tour"), this.back, this.next));
    card.addEventListener("close", () => this.ended());
    card.addEventListener("keydown", (event) => {
      if (event.key === "ArrowRight") this.go(Math.min(this.step + 1, STEPS.length - 1));
      if (event.key === "ArrowLeft") this.go(Math.max(this.step - 1, 0));
    });
    offer.append(make("p", {}, "New here? Five steps show how to read this page."),
      make("button", { type: "button", class: "main", on: { click: () => this.begin() } }, "Show me"),
      make("button", { type: "button", on: { click: () => this.decline() } }, "No, thanks"));
    button.addEventListener("click", () => this.begin());
    addEventListener("hashchange", () => { if (location.hash !== this.wanted) this.end(); });
    for (const event of ["resize", "scroll"]) addEventListener(event, () => this.place(), { passive: true });
  }

  // What the page shows is another.
  show(state) {
    this.state = state;
    this.button.hidden = !state.assets.size;
    if (!this.button.hidden && isSimulated(state) && !memory.has()) {
      memory.keep();
      this.offer.hidden = false;
    }
    if (this.wanted === location.hash && this.main.querySelector(".sentences p")) this.open();
    else this.place();
  }

  // Go to an asset, the first with an alarm unless one is shown, and begin there.
  begin() {
    this.offer.hidden = true;
    const known = [...this.state.assets.values()], isHere = this.main.dataset.place === "asset";
    this.wanted = isHere ? location.hash : linkOf((known.find((item) => item.alarm) ?? known[0]).name);
    if (isHere) this.show(this.state);
    else location.hash = this.wanted;
  }

  decline() {
    this.offer.hidden = true;
    this.button.focus();
  }

  open() {
    this.wanted = null;
    document.body.append(this.card);
    this.card.showModal();
    this.go(0);
  }

  // Show a step; behind the last one the tour ends.
  go(step) {
    if (step >= STEPS.length) return this.end();
    this.step = step;
    const { part, title, says } = STEPS[step];
    this.leave();
    this.part = this.main.querySelector(part);
    this.part.dataset.toured = "";
    for (const fold of this.part.querySelectorAll("details")) fold.open = true; // as where a phone folds it
    this.count.textContent = `Step ${step + 1} of ${STEPS.length}`;
    this.title.textContent = title;
    this.text.replaceChildren(...says(this.state).filter(Boolean).map((text) => make("p", {}, text)));
    this.back.hidden = step === 0;
    this.next.textContent = step === STEPS.length - 1 ? "Done" : "Next";
    this.part.scrollIntoView({ block: "start" });
    this.place();
    this.next.focus({ preventScroll: true });
  }

  // Put the card beside its part, where there is room; else, as on a phone, at the bottom.
  place() {
    if (!this.card.open) return;
    const { style } = this.card, part = this.part.getBoundingClientRect();
    style.removeProperty("left");
    style.removeProperty("top");
    if (DOCKED.matches) return;
    const { width, height } = this.card.getBoundingClientRect();
    const across = Math.max(GAP, Math.min(part.left, innerWidth - width - GAP)), down = Math.max(GAP, Math.min(part.top, innerHeight - height - GAP));
    const spots = [[across, part.bottom + GAP], [part.right + GAP, down], [part.left - GAP - width, down], [across, part.top - GAP - height]];
    const [left, top] = spots.find(([x, y]) => x >= 0 && y >= 0 && x + width <= innerWidth && y + height <= innerHeight) ?? [innerWidth - width - 2 * GAP, innerHeight - height - GAP];
    style.setProperty("left", `${left}px`);
    style.setProperty("top", `${top}px`);
  }

  leave() {
    if (this.part) delete this.part.dataset.toured;
    this.part = null;
  }

  end() {
    this.wanted = null;
    if (this.card.open) this.card.close();
  }

  ended() {
    this.card.remove();
    this.leave();
    this.button.focus();
  }

  // Nobody is logged in any more.
  hide() {
    this.end();
    this.button.hidden = this.offer.hidden = true;
  }
}
