// Plots over time: of what comes in, or of a period of the past.

import { curves } from "./connection.js";
import { make, renew } from "./elements.js";

const MOST = 1200;     // points that are asked for; more than twice as many are asked for anew, coarser
const LENGTHS = [[60, "1 min"], [300, "5 min"], [900, "15 min"], [3600, "1 h"], [8 * 3600, "8 h"], [86400, "24 h"], [7 * 86400, "7 d"]];
const USUAL = 900;
const SHORTEST = 1;    // s that a period has at least
const COLOURS = 7;
const LEADING = 6;     // candidates with a line of their own
const GAP = 8;         // times the usual step between samples, beyond which a line is broken
const EDGE = 2;        // times that step, by which a period may begin before its first sample

const GROUPS = ["inputs", "measured", "expected", "sd", "cusum"];
const emptyData = () => ({ time: [], inputs: {}, measured: {}, expected: {}, sd: {}, cusum: {} });

export class Trends {
  constructor(place, asset, tell) {
    Object.assign(this, { place, asset, tell, data: emptyData(), period: null, length: USUAL, charts: [], signals: null, lostSince: null });
    this.wanted = 0;
    this.build();
  }

  stop() {
    this.charts.forEach((chart) => chart.remove());
    this.asking?.abort();
    cancelAnimationFrame(this.wanted);
  }

  // ---- the tools

  build() {
    const press = (label, hint, act) => make("button", { type: "button", title: hint, on: { click: act } }, label);
    this.choice = make("select", { on: { change: () => this.follow(Number(this.choice.value)) } },
      LENGTHS.map(([seconds, label]) => make("option", { value: String(seconds), selected: seconds === USUAL }, label)));
    this.live = press("Back to now", "Follow what comes in", () => this.follow(this.length));
    this.range = make("p", { class: "range" });
    this.areas = make("div", { class: "charts", role: "group", "aria-label": "Plots; arrows move the period, plus and minus change its length, Home goes back to now", tabIndex: 0, on: { keydown: (event) => this.press(event) } });
    this.tools = make("div", { class: "tools" },
      make("label", {}, make("span", {}, "Last"), this.choice),
      make("div", { class: "buttons" },
        press("Earlier", "Move the period back by half of it", () => this.move(-0.5)), press("Later", "Move the period on by half of it", () => this.move(0.5)),
        press("Closer", "Halve the period", () => this.scale(0.5)), press("Wider", "Double the period", () => this.scale(2)), this.live),
      this.range);
    this.place.replaceChildren(this.tools, this.areas);
  }

  press(event) {
    const acts = { ArrowLeft: () => this.move(-0.5), ArrowRight: () => this.move(0.5), "+": () => this.scale(0.5), "=": () => this.scale(0.5), "-": () => this.scale(2), Home: () => this.follow(this.length) };
    if (event.target !== this.areas || !acts[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    acts[event.key]();
  }

  window() {
    if (this.period) return this.period;
    const { time } = this.data, last = time.length ? time[time.length - 1] : (this.newest ?? 0);
    return [Math.max(last - this.length, Math.min(time[0] ?? -Infinity, last - SHORTEST)), last]; // not before the first sample
  }

  async move(share) {
    const [begin, end] = this.window(), by = share * (end - begin);
    if (!this.period && share > 0) return;
    if (this.newest != null && end + by >= this.newest) return this.follow(this.length);
    const first = await this.look(begin + by, end + by);
    if (!(first > begin + by)) return; // else there is nothing before that
    return first + end - begin >= this.newest ? this.follow(this.length) : this.look(first, first + end - begin);
  }

  scale(factor) {
    const [begin, end] = this.window(), length = Math.max(SHORTEST, factor * (end - begin));
    if (!this.period) return this.follow(length);
    this.look((begin + end - length) / 2, Math.min((begin + end + length) / 2, this.newest ?? Infinity));
  }

  // Follow what comes in, over a length of time.
  follow(length) {
    this.length = length;
    this.period = null;
    const known = LENGTHS.find(([seconds]) => seconds === length);
    this.choice.value = known ? String(length) : "";
    return this.ask(this.newest == null ? null : this.newest - length, null);
  }

  // Look at a period of the past, as far as there is something of it; gives where that begins, NaN where another one came between.
  async look(begin, end) {
    const before = this.period, period = this.period = [begin, end];
    await this.ask(begin, end);
    if (this.period !== period) return NaN;
    const [first] = this.data.time;
    if (first == null) {
      this.tell("No samples are kept of that period.");
      if (!before) return this.follow(this.length);
      this.period = before;
      return this.ask(...before);
    }
    if (first - begin > EDGE * this.usual) this.period = [first, Math.max(end, first + SHORTEST)];
    this.later();
    return this.period[0];
  }

  async ask(begin, end) {
    this.asking?.abort();
    const asking = this.asking = new AbortController();
    this.coming = []; // samples that come meanwhile
    try {
      const told = await curves(this.asset, { begin, end, most: MOST }, asking.signal);
      if (this.asking !== asking) return;
      this.data = told;
      this.usual = stepOf(told.time);
      if (!this.period) for (const points of this.coming) this.append(points);
      this.asking = null;
    } catch (error) {
      if (asking.signal.aborted) return;
      this.asking = null;
      this.tell(error.message);
    }
    this.later();
  }

  // ---- data

  heard(points) {
    const last = points.time[points.time.length - 1];
    if (last != null) this.newest = last;
    if (this.asking) this.coming.push(points);
    if (this.period) return;
    if (!this.asking) this.append(points);
    if (this.data.time.length > 2 * MOST && !this.asking) this.follow(this.length);
    this.later();
  }

  append(points) {
    const { data } = this;
    const known = data.time.length ? data.time[data.time.length - 1] : -Infinity;
    points.time.forEach((time, k) => {
      if (time <= known) return;
      if (this.usual && time - (data.time[data.time.length - 1] ?? time) > GAP * this.usual) this.addRow(time - this.usual / 2, () => null);
      this.addRow(time, (group, name) => points[group]?.[name]?.[k] ?? null);
    });
    this.usual ||= stepOf(data.time);
    this.forget();
  }

  addRow(time, value) {
    const { data } = this;
    const length = data.time.push(time);
    for (const group of GROUPS) {
      for (const name of this.names(group)) {
        const line = data[group][name] ??= [];
        while (line.length < length - 1) line.push(null);
        line.push(value(group, name));
      }
    }
  }

  names(group) {
    return (this.signals ?? []).filter((item) => (item.role === "input") === (group === "inputs")).map((item) => item.name);
  }

  // Drop what has left the plot on the left.
  forget() {
    const { data } = this, begin = this.window()[0];
    let gone = 0;
    while (gone < data.time.length && data.time[gone] < begin) gone++;
    if (gone < 50) return;
    data.time.splice(0, gone);
    for (const group of GROUPS) for (const line of Object.values(data[group])) line.splice(0, gone);
  }

  // ---- what is drawn

  // Learn of the asset; the first time it makes the plots.
  learn(asset) {
    const { signals, cusum_limit: limit, summary, ranking } = asset;
    this.isWatched = summary.monitoring === "running" || summary.monitoring === "initialising";
    if (summary.time != null) this.newest = Math.max(this.newest ?? -Infinity, summary.time);
    const { alarm } = summary;
    this.marks = alarm ? [{ time: alarm.change_time, label: "onset" }, { time: alarm.time, label: "alarm" }].filter(({ time }) => isNumber(time)) : [];
    this.limit = limit;
    if (renew(this.areas, signals.map(({ name, role, unit }) => [name, role, unit]), () => this.plots(signals))) this.follow(this.length);
    this.later();
    return ranking;
  }

  plots(signals) {
    this.signals = signals;
    this.charts.forEach((chart) => chart.remove());
    this.charts = [];
    const place = document.createDocumentFragment();
    const of = (group, name) => () => this.data[group][name] ?? [];
    const add = (options) => this.charts.push(new Plot(place.appendChild(make("figure")), {
      ...options, group: "trends", chosen: (from, to) => this.look(from, Math.max(to, from + SHORTEST)), back: () => this.follow(this.length),
    }));
    const sensors = signals.filter((item) => item.role === "sensor"), inputs = signals.filter((item) => item.role === "input");
    for (const { name, unit } of sensors) {
      add({ title: name, unit, lines: [
        { label: "measured", color: "measured", width: 1, values: of("measured", name) },
        { label: "expected ± 2 sd", color: "expected", width: 1.6, values: of("expected", name), sd: of("sd", name) },
      ] });
    }
    add({ title: "detector", unit: "share of its limit", levels: [[1, "limit"]], lowest: 0,
      lines: sensors.map(({ name }, k) => ({ label: name, color: `line${k % COLOURS}`, width: 1.3, values: () => (this.data.cusum[name] ?? []).map((value) => value == null ? null : value / this.limit) })) });
    for (const unit of new Set(inputs.map((item) => item.unit))) {
      const same = inputs.filter((item) => item.unit === unit);
      add({ title: same.length > 1 ? "inputs" : same[0].name, unit, lines: same.map(({ name }, k) => ({ label: name, color: `line${k % COLOURS}`, stepped: true, values: of("inputs", name) })) });
    }
    return [...place.childNodes];
  }

  later() {
    if (!this.wanted) this.wanted = requestAnimationFrame(() => { this.wanted = 0; this.draw(); });
  }

  draw() {
    const { data, period } = this, [begin, end] = this.window(), count = data.time.length;
    this.areas.hidden = this.newest == null; // without a sample there is no time to draw an axis of
    for (const chart of this.charts) chart.draw({ times: data.time, begin, end, marks: this.marks, isClock: isUnix(end) });
    this.live.disabled = !period;
    const state = period ? "Past" : this.lostAt != null || !this.isWatched ? "Last known" : "Now";
    const text = count ? `${state}: ${clockText(Math.round(begin))} to ${clockText(Math.round(end))}` : this.newest == null ? "No sample has come yet" : "No samples in this period";
    if (this.range.textContent !== text) this.range.textContent = text;
    this.range.classList.toggle("is-past", Boolean(period));
  }

  // While the service is lost, nothing here is called `now`.
  lose(at) {
    this.lostAt = at;
    this.later();
  }
}

// The usual step between samples.
function stepOf(times) {
  if (times.length < 3) return 0;
  const steps = times.slice(1).map((time, k) => time - times[k]).sort((one, other) => one - other);
  return steps[steps.length >> 1];
}

// The probability of the candidates over time.
export class Chances {
  constructor(place) {
    this.chart = new Plot(place.appendChild(make("figure")), { title: "probability", unit: "%", lowest: 0, highest: 100, lines: [] });
  }

  stop() {
    this.chart.remove();
  }

  show({ time, names, probability }) {
    if (!time.length) return;
    const percent = (line) => line.map((value) => value == null ? null : 100 * value);
    const lineOf = (label, color, values, width) => ({ label, color, width, values: () => values });
    const lines = names.slice(0, LEADING).map((name, k) => lineOf(name, `line${k % COLOURS}`, percent(probability[k]), 2));
    const rest = time.map((_, k) => 100 * Math.max(0, 1 - probability.slice(0, LEADING).reduce((sum, line) => sum + (line[k] ?? 0), 0)));
    if (rest.some((value) => value > 0.5)) lines.push(lineOf("all others", "rest", rest, 1.3));
    this.chart.name(lines);
    const [begin, last] = [time[0], time[time.length - 1]];
    this.chart.draw({ times: time, begin, end: Math.max(last, begin + 1), marks: [], isClock: isUnix(last) });
  }
}
