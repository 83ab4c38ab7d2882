// The drawing of the plant, coloured by suspicion. It stands in a tree of its own, so that its styles stay with it.

import { make } from "./elements.js";

const STRONGEST = 0.85; // opacity of the colour at probability 1, as in the report
const SUSPECT = 0.05;
const NAMED = "[data-component], g.node[data-name]";

// The service's policy lets no style stand in the markup; styles set by a script of the page may.
function adopted(drawing) {
  const text = drawing.replace(/(<[^>]*\s)style=/g, "$1data-style=").replace(/<style[^>]*>/g, "<desc data-sheet=''>").replaceAll("</style>", "</desc>");
  const parsed = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
  if (parsed.localName !== "svg") return null;
  parsed.querySelectorAll("script, foreignObject").forEach((item) => item.remove());
  const sheet = new CSSStyleSheet();
  const rules = [...parsed.querySelectorAll("[data-sheet]")].map((item) => { item.remove(); return item.textContent; });
  sheet.replaceSync(`${rules.join("\n")}\nsvg{display:block;max-width:100%;height:auto;margin:0 auto}.heat{fill:var(--suspect);transition:fill-opacity .3s}`);
  for (const item of [parsed, ...parsed.querySelectorAll("[data-style]")]) if (item.dataset.style) item.style.cssText = item.dataset.style;
  return { parsed: document.importNode(parsed, true), sheet };
}

export class Picture {
  constructor(place) {
    this.place = place;
    this.root = null;
    this.drawn = null;
  }

  show(drawing, suspicion) {
    if (drawing !== this.drawn) this.build(drawing);
    const named = new Set();
    for (const [name, { node, heat, title }] of this.heats) {
      const share = suspicion[name] ?? 0;
      named.add(name);
      heat.setAttribute("fill-opacity", (STRONGEST * share).toFixed(3));
      node.classList.toggle("suspect", share >= SUSPECT);
      title.textContent = share > 0 ? `${name}: ${probabilityText(share)} %` : name;
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

  build(drawing) {
    this.drawn = drawing;
    this.heats = new Map();
    const host = make("div", { class: "picture" });
    this.chips = make("ul", { class: "instruments", "aria-label": "Sensors and inputs that may be at fault" });
    this.place.replaceChildren(host, this.chips);
    const found = adopted(drawing);
    if (!found) return host.replaceWith(make("p", { class: "hint" }, "There is no drawing."));
    const root = host.attachShadow({ mode: "open" });
    root.adoptedStyleSheets = [found.sheet];
    root.append(found.parsed);
    this.svg = found.parsed;
    this.svg.setAttribute("role", "img");
    for (const node of this.svg.querySelectorAll(NAMED)) this.heats.set(node.dataset.component ?? node.dataset.name, heatOf(node));
  }
}

// What is coloured of a part: its label in a bond graph, or the area about it in a picture of the process.
function heatOf(node) {
  const paper = node.querySelector(".paper"), area = paper ? null : node.getBBox();
  const heat = paper ? paper.cloneNode() : document.createElementNS(node.namespaceURI, "rect");
  const title = node.querySelector(":scope > title") ?? document.createElementNS(node.namespaceURI, "title");
  heat.setAttribute("class", "heat");
  if (paper) paper.after(heat);
  else {
    const room = 4;
    Object.entries({ x: area.x - room, y: area.y - room, width: area.width + 2 * room, height: area.height + 2 * room, rx: 4 })
      .forEach(([name, value]) => heat.setAttribute(name, String(value)));
    node.prepend(heat);
  }
  node.prepend(title);
  return { node, heat, title };
}

function labelOf(suspicion) {
  const told = Object.entries(suspicion).filter(([, share]) => share >= SUSPECT).sort((a, b) => b[1] - a[1]);
  const names = told.map(([name, share]) => `${name} ${probabilityText(share)} %`);
  return `Drawing of the plant; ${names.length ? `at fault may be ${names.join(", ")}` : "no part is suspected"}`;
}
