// One asset: what is wrong, what to do about it, how it came, and who did what.

import { reportPath } from "./connection.js";
import { ACTIONS, askFor, titleOf } from "./deeds.js";
import { alarmMark, capital, conditionOf, countText, headOf, make, momentText, ownClockText, percentText, renew, reportLinks, symbol, worded } from "./elements.js";
import { Picture } from "./picture.js";
import { Chances, Trends } from "./trends.js";

const SHOWN = 8;        // candidates that are listed; more on demand
const NEGLIGIBLE = 0.001;
const ENTRIES = 12;     // of the journal
const COUNTS = { missing: "missing", late: "late", duplicate: "twice", dropped: "dropped", bad: "of bad quality", uncertain: "of uncertain quality" };
const WATCHED = { "alarms on": "yes, alarms are on", waiting: "not yet", outside: "not here: the model does not hold", initialising: "not yet", "no data": "no, no data come", stopped: "no" };
const OF_ALARMS = ["shelve", "suppress"]; // what is offered only where there is one
const ORDER = ["acknowledge", "shelve", "unshelve", "unsuppress", "in service", "accept", "reject", "repaired", "suppress", "out of service"];

const panel = (name, title, ...content) =>
  make("section", { class: `panel ${name}`, "aria-labelledby": `of-${name}` }, make("h2", { id: `of-${name}` }, title), ...content);

// On a phone what is looked at less often is folded, and opened by a touch or a key; elsewhere all is open.
class Folds {
  constructor() {
    this.all = [];
    this.narrow = matchMedia("(max-width: 700px)");
    this.fit = () => this.all.forEach((fold) => {
      fold.open = !this.narrow.matches;
      fold.firstChild.tabIndex = this.narrow.matches ? 0 : -1;
    });
    this.narrow.addEventListener("change", this.fit);
  }

  panel(name, title, ...content) {
    const heading = make("summary", { on: { click: (event) => { if (!this.narrow.matches) event.preventDefault(); } } }, make("h2", { id: `of-${name}` }, title));
    const fold = make("details", { class: "fold" }, heading, ...content);
    this.all.push(fold);
    return make("section", { class: `panel ${name}`, "aria-labelledby": `of-${name}` }, fold);
  }

  stop() {
    this.narrow.removeEventListener("change", this.fit);
  }
}

export class AssetView {
  constructor(place, name, { tell }) {
    Object.assign(this, { name, tell, asset: null, entries: ENTRIES, candidates: SHOWN });
    const part = (key, kind = "div") => (this[key] = make(kind, { class: key }));
    this.head = make("section", { class: "verdict", "aria-labelledby": "asset-title" },
      part("title"), part("sentences"), part("facts", "dl"), part("buttons"));
    this.facts.className = "facts";
    this.group = make("p", { class: "hint group-hint" });
    this.list = make("ol", { class: "candidates" });
    this.more = make("button", { type: "button", class: "more", hidden: true, on: { click: () => { this.candidates = Infinity; this.showCandidates(); } } }, "Show all");
    this.beside = make("p", { class: "hint" });
    this.advice = make("div", { class: "advice" });
    this.folds = new Folds();
    this.chancePlace = make("div");
    this.chancePanel = this.folds.panel("chance-plot", "Probability over time", this.chancePlace);
    this.drawing = make("div", { class: "scroll", tabIndex: 0, role: "region", "aria-label": "Drawing of the plant" });
    this.picture = new Picture(this.drawing, name);
    this.quality = make("dl", { class: "quality" });
    this.signals = make("ul", { class: "signals" });
    this.notes = make("ul", { class: "notes" });
    this.journal = make("ol", { class: "journal" });
    this.older = make("button", { type: "button", class: "more", hidden: true, on: { click: () => { this.entries = Infinity; this.showJournal(); } } }, "Show older entries");
    this.trendPlace = make("div");
    this.explanations = panel("explanations", "What may be at fault", this.group, this.list, this.more, this.beside, this.advice);
    place.replaceChildren(
      this.head,
      make("div", { class: "pair" }, make("div", { class: "stack" }, this.explanations, this.chancePanel), this.folds.panel("plant-drawing", "Plant", this.picture.choice, this.drawing)),
      this.folds.panel("trends", "Measured and expected", this.trendPlace),
      make("div", { class: "pair" },
        this.folds.panel("journal-panel", "Journal", this.journal, this.older),
        this.folds.panel("quality-panel", "Data", this.quality, this.signals, this.notes)),
    );
    this.folds.fit();
    this.trends = new Trends(this.trendPlace, name, tell);
    this.chances = new Chances(this.chancePlace);
  }

  stop() {
    this.folds.stop();
    this.trends.stop();
    this.chances.stop();
  }

  // All of the asset is known anew.
  learn(asset, state) {
    this.asset = asset;
    this.show(state);
    this.trends.learn(asset);
    this.showCandidates();
    this.picture.show(asset);
    this.showData();
    this.showJournal();
  }

  // The summary, the person or the connection is another.
  show(state) {
    this.state = state;
    const { asset } = this;
    if (!asset) return;
    asset.summary = state.assets.get(this.name) ?? asset.summary;
    const condition = conditionOf(asset.summary, state.isLost);
    this.head.className = `verdict ${condition.key}`;
    this.trends.lose(state.isLost ? state.lostAt : null);
    this.showHead(asset, condition);
    this.showButtons(asset, state);
  }

  showHead({ summary, verdict }, condition) {
    const { alarm, monitoring, operation, time, samples, since } = summary;
    renew(this.title, { condition, alarm, model: summary.model }, () => [
      make("h1", { id: "asset-title" }, this.name, make("span", { class: "model" }, summary.model)),
      make("p", { class: `condition ${condition.key}` }, symbol(condition), make("b", {}, condition.word), make("span", { class: "moment" }, `since ${momentText(since)}`), alarmMark(alarm)),
    ]);
    renew(this.sentences, verdict, () => headOf([verdict].flat().join(" ")).map((text, k) => make("p", { class: k ? "" : "first" }, worded(text))));
    const facts = [], ownClock = ownClockText(summary, this.state);
    if (alarm) {
      if (alarm.since != null) facts.push([alarm.time == null ? "Alarm ended" : "Alarm", momentText(alarm.since)]); // none was ever raised where it was only put aside
      if (alarm.change_time != null) facts.push(["Estimated onset", momentText(alarm.change_time)]);
      if (alarm.signals.length) facts.push(["Seen in", joined(alarm.signals)]);
    }
    facts.push(["Watched", WATCHED[monitoring] ?? WATCHED[operation] ?? operation], ["Last sample", momentText(time)], ["Samples", countText(samples)]);
    if (ownClock) facts.push(["Clock of its source", `${ownClock}; ${alarm ? "alarm, onset and last sample are" : "the last sample is"} by it`]);
    renew(this.facts, facts, () => facts.map(([label, text]) => make("div", {}, make("dt", {}, label), make("dd", {}, text))));
  }

  showButtons(asset, { me, isLost }) {
    const hasAlarm = Boolean(asset.summary.alarm);
    const offered = ORDER.filter((action) => asset.may.includes(action) && me.actions.includes(action) && (hasAlarm || !OF_ALARMS.includes(action)));
    const isHeld = isLost;
    renew(this.buttons, { offered, isHeld }, () => [false, true].map((isDecision) => {
      const some = offered.filter((action) => Boolean(ACTIONS[action].isDecision) === isDecision);
      return some.length ? make("div", { class: "button-group", role: "group", "aria-label": isDecision ? "About the diagnosis" : "About the alarm" },
        make("span", { class: "of" }, isDecision ? "Diagnosis" : "Alarm"),
        some.map((action) => this.button(action, isHeld))) : null;
    }).concat(reportLinks(reportPath(this.name), `${this.name}.html`, "Report")));
  }

  button(action, isHeld, entry = null) {
    const open = () => askFor(action, this.asset, { entry, done: (kept) => this.tell(`Kept as entry ${kept.number}: ${kept.action}, ${this.name}.`) });
    return make("button", { type: "button", "data-action": action, disabled: isHeld, class: action === "acknowledge" ? "main" : null, on: { click: open } },
      entry ? "Undo" : `${ACTIONS[action].label}${ACTIONS[action].isDecision || action === "shelve" ? "…" : ""}`);
  }

  showCandidates() {
    const { rows, several, checks, ranking, summary } = this.asset;
    const worth = rows.filter((row, k) => k < this.candidates && (k < 3 || row.group || row.probability >= NEGLIGIBLE || this.candidates > SHOWN));
    this.group.textContent = !rows.length ? nothingText(summary) : several
      ? `${capital(countWord(rows.filter((row) => row.group).length))} explanations, marked ●, cannot be told apart yet.`
      : "The best explanation stands apart from the others.";
    renew(this.list, { worth, several }, () => worth.map((row) => rowOf(row, several)));
    const beside = [rows.length && this.asset.remainder ? `${this.asset.remainder}.` : "", this.asset.left_out, this.asset.contradicted ? "The data contradict them all: their order tells which comes nearest, and none is likely." : ""].filter(Boolean).join(" ");
    this.beside.textContent = beside;
    this.more.hidden = worth.length === rows.length;
    this.more.textContent = `Show all ${rows.length}`;
    renew(this.advice, checks, () => checks.length ? [
      make("h3", {}, "What would tell them apart"),
      make("ol", {}, checks.map(({ what, why }) => make("li", {}, make("b", {}, what), why ? `: ${why}` : ""))),
    ] : []);
    this.chancePanel.hidden = !ranking.time.length;
    this.explanations.classList.toggle("is-empty-panel", !rows.length);
    if (ranking.time.length) this.chances.show(ranking);
  }

  showData() {
    const { counts, signals, notes } = this.asset;
    const wrong = Object.entries(counts).filter(([name]) => name !== "samples"); // they stand in the head, and grow with each sample
    renew(this.quality, wrong, () => wrong.map(([name, number]) =>
      make("div", { class: number ? "is-some" : "" }, make("dt", {}, COUNTS[name] ?? name), make("dd", {}, countText(number)))));
    const unused = signals.filter((item) => !item.in_use);
    renew(this.signals, signals, () => [
      make("li", {}, `${signals.length - unused.length} of ${signals.length} signals in use`),
      ...unused.map((item) => make("li", { class: "is-unused" }, `${item.name} is not used now`)),
    ]);
    renew(this.notes, notes, () => notes.map((text) => make("li", {}, worded(text))));
  }

  showJournal() {
    const { journal, events, may, summary } = this.asset, isHeld = this.state.isLost;
    const mayUndo = may.includes("undo") && this.state.me.actions.includes("undo"), ownClock = ownClockText(summary, this.state);
    // The newest first: what happened by itself tells behind which entry it came, since clocks may differ.
    const all = [...events, ...journal].sort((one, other) => (other.number ?? other.behind + 0.5) - (one.number ?? one.behind + 0.5));
    const shown = all.slice(0, this.entries), last = journal.find((entry) => ACTIONS[entry.action]?.isDecision && !entry.undone_by); // it goes first
    renew(this.journal, { shown, mayUndo, isHeld, isOwn: Boolean(ownClock) }, () => {
      if (!all.length) return make("li", { class: "hint" }, "Nothing has happened yet.");
      return shown.map((entry) => entry.number == null ? eventOf(entry, ownClock)
        : entryOf(entry, mayUndo && entry === last ? this.button("undo", isHeld, entry) : null, all));
    });
    this.older.hidden = shown.length === all.length;
  }
}

function nothingText({ alarm, monitoring, operation }) {
  if (monitoring !== "running") return `Nothing is judged now: ${monitoring}.`;
  if (alarm?.time != null) return "The diagnosis is being worked out; it comes some samples after the alarm.";
  return operation === "alarms on" ? "No alarm is open." : `Nothing is judged now: ${operation}.`;
}
const countWord = (number) => ["no", "one", "two", "three", "four", "five", "six"][number] ?? String(number);

function rowOf(row, several) {
  const fill = make("i");
  fill.style.width = `${(100 * row.probability).toFixed(1)}%`;
  return make("li", { class: row.group ? "group" : "" },
    make("div", { class: "line" },
      make("span", { class: "mark" }, several && row.group ? "●" : ""), make("span", { class: "name" }, titleOf(row)),
      make("span", { class: "kind" }, row.kinds.join(", ")), make("b", {}, percentText(row))),
    row.percent ? make("span", { class: "bar" }, fill) : "",
    row.suspects.map((item) => make("p", { class: "values" },
      make("span", { class: "parameter" }, item.name),
      make("span", { class: "estimate" }, item.nominal ? make("span", { class: "nominal" }, `${item.nominal} → `) : null, item.estimate, item.sd ? ` ± ${item.sd}` : ""),
      make("span", { class: "change" }, item.change))));
}

const eventOf = ({ time, text, alarm }, ownClock) => make("li", { class: "event" },
  make("span", { class: "number", "aria-hidden": "true" }, alarm ? "!" : "–"),
  make("span", { class: "moment" }, momentText(time), ownClock && isUnix(time) ? " by its source" : ""), make("span", { class: "deed" }, text));

function entryOf(entry, undo, all) {
  const back = all.find((item) => item.undone_by != null && item.undone_by === entry.number);
  const target = back ? ` entry ${back.number}` : entry.target.length ? ` ${entry.target.join(", ")}` : "";
  return make("li", { class: entry.undone_by ? "is-undone" : "" },
    make("span", { class: "number" }, String(entry.number)),
    make("span", { class: "moment" }, momentText(entry.at)),
    make("span", { class: "deed" }, make("b", {}, entry.who), ` ${ACTIONS[entry.action]?.past ?? entry.action}${target}${ACTIONS[entry.action]?.end ?? ""}`,
      entry.undone_by ? ` (undone by ${entry.undone_by})` : "", entry.comment ? make("q", {}, entry.comment) : null),
    undo);
}
