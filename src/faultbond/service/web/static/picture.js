// The drawing of the plant, coloured by suspicion. It stands in a tree of its own, so that its styles stay with it.

import { pictureOf } from "./connection.js";
import { make } from "./elements.js";

const STRONGEST = 0.85; // opacity of the colour at probability 1, as in the report
const SUSPECT = 0.05;
const CHOSEN = "faultbond.drawing";
const SPEAKS_OF_THEMES = /currentcolor|var\(--|light-dark\(/i; // else its colours are for white paper
const SHAPES = "path, rect, circle, ellipse, line, polyline, polygon";
const NAMED = "[data-component], g.node[data-name]";

const SHEET = `
svg { display: block; max-width: 100%; height: auto; margin: 0 auto; overflow: hidden } svg:not([width]) { width: 100%; max-height: 56vh }
.heat { fill: var(--suspect); transition: opacity .3s }
g.heat * { fill: none !important; stroke: var(--suspect) !important; stroke-width: 14px !important; stroke-linejoin: round !important; stroke-linecap: round !important;
  stroke-dasharray: none !important; stroke-opacity: 1 !important; opacity: 1 !important; vector-effect: non-scaling-stroke !important; marker: none !important; clip-path: none !important }
g.heat .area { fill: var(--suspect) !important }`;

// The service's policy lets no style stand in the markup; styles set by a script of the page may.
function adopted(drawing) {
  const text = drawing.replace(/(<[^>]*\s)style=/g, "$1data-style=").replace(/<style[^>]*>/g, "<desc data-sheet=''>").replaceAll("</style>", "</desc>");
  const parsed = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
  if (parsed.localName !== "svg") return null;
  parsed.querySelectorAll("script, foreignObject").forEach((item) => item.remove());
  const sheet = new CSSStyleSheet();
  const rules = [...parsed.querySelectorAll("[data-sheet]")].map((item) => { item.remove(); return item.textContent; });
  sheet.replaceSync(`${rules.join("\n")}\n${SHEET}`);
  for (const item of [parsed, ...parsed.querySelectorAll("[data-style]")]) if (item.dataset.style) item.style.cssText = item.dataset.style;
  return { parsed: document.importNode(parsed, true), sheet };
}

// The picture of the process, where the site has one, or the bond graph: a person chooses, and the browser keeps that.
export class Picture {
  constructor(place, name) {
    Object.assign(this, { place, name, process: "", tag: "", drawn: null, heats: [] });
    this.buttons = ["Process", "Model"].map((text, k) =>
      make("button", { type: "button", on: { click: () => { choice.keep(Boolean(k)); this.draw(); } } }, text));
    this.choice = make("div", { class: "buttons", role: "group", "aria-label": "What is drawn of the plant", hidden: true }, this.buttons);
  }

  show({ drawing, picture, suspicion }) {
    Object.assign(this, { drawing, suspicion });
    if (picture !== this.tag) this.fetch(picture);
    else this.draw();
  }

  async fetch(tag) {
    this.tag = tag;
    this.process = tag ? null : ""; // null: it is on its way
    const process = tag ? await pictureOf(this.name).catch(() => "") : "";
    if (tag !== this.tag) return;
    this.process = process;
    this.draw();
  }

  draw() {
    if (this.process === null && !choice.isModel()) return;
    const isModel = !this.process || choice.isModel();
    this.choice.hidden = !this.process;
    this.buttons.forEach((button, k) => button.setAttribute("aria-pressed", String(isModel === Boolean(k))));
    const drawing = isModel ? this.drawing : this.process;
    if (drawing !== this.drawn) this.build(drawing, isModel);
    this.colour(this.suspicion);
  }

  colour(suspicion) {
    const named = new Set();
    for (const { name, label, node, heat, title } of this.heats) {
      const share = suspicion[name] ?? 0;
      named.add(name);
      heat.setAttribute("opacity", (STRONGEST * share).toFixed(3));
      node.classList.toggle("suspect", share >= SUSPECT);
      title.textContent = share > 0 ? `${label}: ${probabilityText(share)} %` : label;
    }
    const others = Object.entries(suspicion).filter(([name, share]) => !named.has(name) && share >= 0.005).sort((a, b) => b[1] - a[1]);
    this.chips.replaceChildren(...others.map(([name, share]) => {
      const chip = make("li", {}, `${name} `, make("b", {}, `${probabilityText(share)} %`));
      chip.style.setProperty("--heat", (STRONGEST * share).toFixed(3));
      return chip;
    }));
    this.chips.hidden = !others.length;
    this.svg?.setAttribute("aria-label", labelOf(suspicion));
  }

  build(drawing, isModel) {
    this.drawn = drawing;
    this.heats = [];
    this.svg = null;
    const host = make("div", { class: `picture ${isModel ? "" : "process"} ${isModel || SPEAKS_OF_THEMES.test(drawing) ? "" : "on-paper"}` });
    this.chips = make("ul", { class: "instruments", "aria-label": "What is not drawn and may be at fault" });
    this.place.replaceChildren(host, this.chips);
    const found = adopted(drawing);
    if (!found) return host.replaceWith(make("p", { class: "hint" }, "There is no drawing."));
    const root = host.attachShadow({ mode: "open" });
    root.adoptedStyleSheets = [found.sheet];
    root.append(found.parsed);
    this.svg = found.parsed;
    this.svg.setAttribute("role", "img");
    this.heats = [...this.svg.querySelectorAll(NAMED)].map(heatOf);
  }
}

const choice = {
  isModel: () => { try { return localStorage.getItem(CHOSEN) === "model"; } catch { return false; } },
  keep: (isModel) => { try { localStorage.setItem(CHOSEN, isModel ? "model" : "process"); } catch { /* it is chosen anew */ } },
};

// What is coloured of a part: its label in a bond graph, or what is about it in a picture of the process.
function heatOf(node) {
  const name = node.dataset.component ?? node.dataset.name;
  const paper = node.classList.contains("node") ? node.querySelector(".paper") : null;
  const told = node.querySelector("title"), title = made(node, "title");
  const heat = paper ? paper.cloneNode() : haloOf(node);
  heat.setAttribute("class", "heat");
  if (paper) paper.after(heat);
  else node.prepend(heat);
  node.querySelectorAll("title").forEach((item) => item.remove()); // an inner one would hide how likely a fault is
  node.prepend(title);
  return { name, label: told?.textContent.trim() || name, node, heat, title };
}

const made = (node, kind) => document.createElementNS(node.namespaceURI, kind);

// The lines of a part as broad ones behind it, or where it has none the area that it takes.
function haloOf(node) {
  const halo = made(node, "g");
  halo.append(...[...node.children].map((child) => child.cloneNode(true)));
  halo.querySelectorAll("[data-component], text, use, title, desc, style, defs, marker, clipPath").forEach((item) => item.remove());
  halo.querySelectorAll("[id]").forEach((item) => item.removeAttribute("id"));
  if (halo.querySelector(SHAPES)) return halo;
  const area = node.getBBox(), rect = made(node, "rect");
  for (const key of ["x", "y", "width", "height"]) rect.setAttribute(key, String(area[key]));
  rect.setAttribute("class", "area");
  halo.replaceChildren(rect);
  return halo;
}

function labelOf(suspicion) {
  const told = Object.entries(suspicion).filter(([, share]) => share >= SUSPECT).sort((a, b) => b[1] - a[1]);
  const names = told.map(([name, share]) => `${name} ${probabilityText(share)} %`);
  return `Drawing of the plant; ${names.length ? `at fault may be ${names.join(", ")}` : "no part is suspected"}`;
}
