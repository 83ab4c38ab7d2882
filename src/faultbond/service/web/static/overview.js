// All assets: what needs somebody first, then each at a place that stays the same.

import { alarmMark, capital, conditionOf, countText, isSilenced, isUnacknowledged, make, momentText, renew, sinceText, symbol } from "./elements.js";

export const linkOf = (name) => `#/${encodeURIComponent(name)}`;
const needsSomebody = (summary) => conditionOf(summary).key !== "normal" || Boolean(summary.alarm);

// Strings are put in order as people do, `tank_2` before `tank_10`.
const byName = (one, other) => one.name.localeCompare(other.name, "en", { numeric: true });
const byUrgency = (one, other) =>
  isUnacknowledged(other.alarm) - isUnacknowledged(one.alarm) || conditionOf(one).rank - conditionOf(other).rank || byName(one, other);

export class Overview {
  constructor(place) {
    this.attention = make("tbody");
    this.silenced = make("tbody");
    this.tiles = make("ul", { class: "tiles" });
    this.filter = make("input", { type: "search", id: "filter", autocomplete: "off", on: { input: () => this.showTiles() } });
    this.headings = ["attention", "silenced", "all"].map((name) => make("h2", { id: `of-${name}` }));
    const [first, second, third] = this.headings;
    this.silencedPanel = make("section", { class: "panel", "aria-labelledby": "of-silenced" }, second,
      make("p", { class: "hint" }, "Their alarms do not call; what is wrong is still watched."), tableOf(this.silenced));
    this.search = make("label", { class: "search" }, make("span", {}, "Find"), this.filter);
    this.title = make("h1", { class: "unseen" });
    place.replaceChildren(
      this.title,
      make("section", { class: "panel", "aria-labelledby": "of-attention" }, first, tableOf(this.attention)),
      this.silencedPanel,
      make("section", { class: "panel", "aria-labelledby": "of-all" }, make("div", { class: "heading" }, third, this.search), this.tiles),
    );
    this.tileOf = new Map();
  }

  show(state) {
    this.state = state;
    const assets = [...state.assets.values()];
    const calling = assets.filter((item) => needsSomebody(item) && !isSilenced(item.alarm)).sort(byUrgency);
    const silenced = assets.filter((item) => isSilenced(item.alarm)).sort(byUrgency);
    this.title.textContent = state.site.name;
    this.headings[0].textContent = calling.length ? `${state.isLost ? "Needed" : "Needs"} attention: ${calling.length}` : state.isLost ? "Nothing needed attention" : "Nothing needs attention";
    this.headings[1].textContent = `Silenced: ${silenced.length}`;
    this.headings[2].textContent = `All assets: ${assets.length}`;
    this.attention.closest("table").hidden = !calling.length;
    this.silencedPanel.hidden = !silenced.length;
    this.search.hidden = assets.length < 12;
    showRows(this.attention, calling, state);
    showRows(this.silenced, silenced, state);
    this.showTiles();
  }

  showTiles() {
    const wanted = this.filter.value.trim().toLowerCase();
    const shown = [...this.state.assets.values()].sort(byName).filter((item) => `${item.name} ${item.model}`.toLowerCase().includes(wanted));
    renew(this.tiles, shown.map((item) => item.name), () => shown.map((item) => this.tile(item.name)));
    for (const item of shown) showTile(this.tile(item.name), item, this.state.isLost);
  }

  tile(name) {
    if (!this.tileOf.has(name)) this.tileOf.set(name, make("li", {}, make("a", { href: linkOf(name) }), make("p", { class: "last" })));
    return this.tileOf.get(name);
  }
}

function tableOf(body) {
  const heads = ["Condition", "Asset", "What is known", "Since", "Alarm"].map((text) => make("th", { scope: "col" }, text));
  return make("table", { class: "assets" }, make("thead", {}, make("tr", {}, heads)), body);
}

// Rows are renewed one by one where the order stays, so that a link keeps the focus.
function showRows(body, assets, state) {
  renew(body, assets.map((item) => item.name), () => assets.map((item) => make("tr", { "data-asset": item.name })));
  assets.forEach((item, k) => {
    const { name, headline, alarm } = item, condition = conditionOf(item, state.isLost), told = sinceText(item, state);
    renew(body.children[k], { name, headline, alarm, told, condition }, () => [
      make("td", {}, make("span", { class: `condition ${condition.key}` }, symbol(condition), condition.word)),
      make("th", { scope: "row" }, make("a", { href: linkOf(name) }, name)),
      make("td", { class: "wrap" }, headline.replace(/ %/g, `${NO_BREAK}%`)),
      make("td", { class: "moment" }, told),
      make("td", {}, alarmMark(alarm)),
    ]);
  });
}

function showTile(tile, summary, isLost) {
  const condition = conditionOf(summary, isLost), [link, last] = tile.children;
  tile.className = `${condition.key} ${isUnacknowledged(summary.alarm) ? "is-new" : ""}`;
  renew(link, { condition, model: summary.model }, () => [
    symbol(condition), make("b", {}, summary.name), make("span", { class: "model" }, summary.model), make("span", { class: "word" }, condition.word),
  ]);
  const told = isLost || summary.monitoring !== "running" ? "last sample" : summary.operation;
  renew(last, [told, summary.time], () => [`${capital(told)}, `, make("span", { class: "moment" }, momentText(summary.time))]);
  last.title = `${countText(summary.samples)} samples`;
}
