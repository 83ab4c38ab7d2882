// A plot over time: uPlot draws it, in the colours of the style sheet and with the marks of all pages.

const SIZE = 12; // px of its text, and in proportion to it all about the plot; more where the text of the page is large
const FONT = 'system-ui, "Segoe UI", "Helvetica Neue", Arial, "DejaVu Sans", sans-serif';
const TOP = 10, RIGHT = 24, BOTTOM = 24, SIDE = 52; // px about the area of the plot
const CLOCK_STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200,
  ...[1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000].map((days) => 86400 * days)];

const paints = new Map(); // colours by name, asked for once
const living = new Set(); // plots

function paintOf(name) {
  if (!paints.has(name)) paints.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return paints.get(name);
}

// The page has become dark, or light.
function repaint() {
  paints.clear();
  living.forEach((plot) => plot.drawn?.redraw(false));
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);

function tickText(value, step) {
  const places = [0, 1, 2, 3, 4, 5, 6, 7].find((each) => Math.abs(step - step.toFixed(each)) < 1e-6 * step) ?? 8;
  return value.toFixed(places).replace(/^-(?=[0.]*$)/, "").replace("-", MINUS);
}

function clockTick(value, step) {
  const text = new Date(value * 1000).toISOString();
  return step >= 86400 || value % 86400 === 0 ? text.slice(5, 10) : text.slice(11, step < 60 ? 19 : 16);
}

// lines: each with label, colour, width and `values()`; `sd()` draws a band of `factor` of them, `stepped` steps from value to value.
// unit: of the values. levels: values that are marked, with their labels. lowest, highest: of the axis; 0 to 100 are probabilities,
// of which the first is on top. relativeTo: adds an axis in per cent of it. isBandWhole: the axis reaches as far as the bands.
// right: px kept free there. shadeLabel: of the shade. group: of plots that share a cursor. chosen: hears of a period that is dragged; back: of a double click.
class Plot {
  constructor(figure, { title, lines, unit = "", levels = [], lowest = null, highest = null, relativeTo = null, isBandWhole = false, right = RIGHT, shadeLabel = "", group, chosen, back }) {
    Object.assign(this, { title, lines, unit, levels, lowest, highest, relativeTo, isBandWhole, right, shadeLabel, group, chosen, back });
    this.isProbability = lowest === 0 && highest === 100;
    figure.innerHTML = '<figcaption><span class="what"></span> <span class="in"></span></figcaption><div class="plot"></div>';
    [this.caption, this.area] = figure.children;
    this.caption.firstChild.textContent = title;
    this.watch = new ResizeObserver(() => this.fit());
    this.watch.observe(this.area);
    living.add(this);
  }

  remove() {
    this.watch.disconnect();
    this.drawn?.destroy();
    living.delete(this);
  }

  // Draw other lines from now on.
  name(lines) {
    const about = (some) => JSON.stringify(some.map(({ label, color }) => [label, color]));
    if (about(lines) !== about(this.lines)) this.size = null;
    this.lines = lines;
  }

  // Draw what `view` shows: samples at `times`, of which `shown` are drawn, from time `begin` to `end`; `marks`; `shade`, a period.
  draw(view) {
    this.view = { shown: view.times.length, shade: null, ...view };
    this.fit();
  }

  // Fit to the room that there is, once there is some.
  fit() {
    const { clientWidth: width, clientHeight: height } = this.area;
    if (!this.view || !width || !height) return;
    const size = Math.max(SIZE, Math.round(0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize)));
    if (size !== this.size) this.build(size, width, height);
    else if (this.drawn.width !== width || this.drawn.height !== height) this.drawn.setSize({ width, height });
    this.pass();
  }

  pass() {
    const { drawn, passed, view } = this, { times, begin, end } = view;
    const now = this.passed = { times, count: times.length, last: times[times.length - 1] };
    const isSame = passed && Object.keys(now).every((key) => now[key] === passed[key]);
    drawn.batch(() => {
      if (!isSame) drawn.setData(this.columns(), false);
      drawn.setScale("x", { min: begin, max: Math.max(end, begin + 1e-6) });
    });
    const { left, top } = drawn.cursor;
    drawn.setCursor({ left, top }, false, false); // which has the legend told anew
  }

  // What uPlot draws as lines, the last one on top: the edges of a band are two without a colour.
  get strokes() {
    return (this.isProbability ? [...this.lines].reverse() : this.lines).flatMap((line) => line.sd ? [{ line, edge: 0 }, { line, edge: 1 }, { line, edge: -1 }] : [{ line, edge: 0 }]);
  }

  columns() {
    const of = ({ line, edge }) => {
      const values = line.values();
      if (!edge) return values;
      const sd = line.sd(), by = edge * (line.factor ?? 2);
      return values.map((value, k) => value == null || sd[k] == null ? null : value + by * sd[k]);
    };
    return [this.view.times, ...this.strokes.map(of)];
  }

  build(size, width, height) {
    this.size = size;
    this.large = size / SIZE;
    this.passed = null;
    this.drawn?.destroy();
    const { large, strokes } = this, font = `${size}px ${FONT}`, soft = () => paintOf("soft");
    const grid = { stroke: () => paintOf("grid"), width: 1 }, axis = { font, labelFont: font, stroke: soft, grid, ticks: { show: false } };
    const side = { ...axis, size: SIDE * large, space: 28 * large, gap: 8 };
    const none = { show: false }, paint = (line) => () => paintOf(line.color);
    const series = strokes.map(({ line, edge }) => ({
      label: line.label, class: edge ? "edge" : undefined, width: edge ? 0 : line.width ?? 1.6, auto: !edge || this.isBandWhole,
      stroke: edge ? "transparent" : paint(line), value: (_, value) => this.text(value),
      paths: line.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
      points: edge ? none : { size: 7, fill: paint(line), show: ({ data }, k) => isAlone(data[k]) }, gaps: (...all) => this.gaps(...all),
    }));
    const bands = strokes.flatMap(({ line, edge }, k) => edge > 0 ? [{ series: [k + 1, k + 2], fill: () => `color-mix(in srgb, ${paintOf(line.color)} 22%, transparent)` }] : []);
    const share = { ...side, scale: "share", side: 1, grid: none, label: "% of nominal", labelSize: 18 * large, values: (_, values, __, ___, step) => values.map((value) => tickText(value, step)) };
    this.drawn = new uPlot({
      width, height, bands, padding: [TOP, this.relativeTo ? 0 : this.right, 0, 0],
      series: [{ label: "time", value: (_, time) => isNumber(time) ? clockText(Number(time.toPrecision(14))) : "–" }, ...series],
      scales: {
        x: { time: false, auto: false }, y: { range: (_, low, high) => this.range(low, high) },
        ...(this.relativeTo && { share: { from: "y", range: (_, low, high) => [low, high].map((value) => 100 * value / this.relativeTo) } }),
      },
      axes: [
        { ...axis, size: BOTTOM * large, space: 76 * large, gap: 7, border: { show: true, stroke: () => paintOf("rule"), width: 1 }, incrs: this.view.isClock ? CLOCK_STEPS : undefined, values: (...all) => this.times(...all) },
        { ...side, values: (_, values, __, ___, step) => values.map((value) => tickText(value / this.scale, step / this.scale)) },
        ...(this.relativeTo ? [share] : []),
      ],
      legend: { mount: (_, legend) => this.caption.append(legend), markers: { width: 0, fill: (_, k) => `var(--${strokes[k - 1].line.color})` } },
      cursor: {
        y: false, drag: { x: Boolean(this.chosen), y: false, setScale: false, dist: 4 }, bind: { dblclick: () => () => this.back?.() },
        dataIdx: (_, __, near, time) => time < this.view.times[0] ? null : Math.min(near, this.view.shown - 1), ...(this.group && { sync: { key: this.group, scales: ["x", null] } }),
      },
      hooks: {
        drawAxes: [() => this.shade()], draw: [() => this.mark()], setSelect: [() => this.select()],
        setLegend: [({ legend }) => { if (legend.idx == null) this.drawn?.setLegend({ idx: this.view.shown - 1 }, false); }],
      },
    }, [[], ...strokes.map(() => [])], this.area);
    const legend = this.caption.lastChild.firstChild; // best first, though drawn last
    if (this.isProbability) [...legend.children].slice(1).reverse().forEach((row) => legend.append(row));
    const canvas = this.drawn.ctx.canvas;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${this.title} over time`);
  }

  // The lowest and highest value of the axis, and in what power of ten and to how many places values are told.
  range(low, high) {
    const known = [low, high, ...this.levels.map(([value]) => value)].filter(isNumber);
    low = this.lowest ?? (known.length ? Math.min(...known) : 0);
    high = this.highest ?? (known.length ? Math.max(...known) : 1);
    const room = high > low ? 0.06 * (high - low) : Math.abs(low) * 0.1 || 1;
    [low, high] = high > low ? [this.lowest ?? low - room, this.highest ?? high + room] : [low - room, high + room];
    const exponent = exponentOf(Math.max(Math.abs(low), Math.abs(high)));
    this.scale = 10 ** exponent;
    this.places = Math.max(0, Math.min(6, 2 - orderOf((high - low) / this.scale)));
    this.caption.children[1].textContent = `${exponent ? powerOfTen(exponent) + NO_BREAK : ""}${this.unit}`;
    return [low, high];
  }

  text(value) {
    if (!isNumber(value)) return "–";
    return this.isProbability ? probabilityText(value / 100) : (value / this.scale).toFixed(this.places).replace("-", MINUS);
  }

  times(_, values, __, ___, step) {
    return values.map((value, k) => this.view.isClock ? clockTick(value, step) : `${tickText(value, step)}${k === values.length - 1 ? " s" : ""}`);
  }

  // Nothing is drawn of a line after the samples that are shown.
  gaps({ bbox, valToPos }, _, __, ___, gaps) {
    const { times, shown } = this.view;
    return shown < times.length ? [...gaps, [Math.max(bbox.left, valToPos(times[Math.max(shown - 1, 0)], "x", true)), bbox.left + bbox.width]] : gaps;
  }

  // A period was dragged; that it is marked in the plots of the group, too, is no second choice.
  select() {
    const { drawn } = this, { left, width } = drawn.select, { event } = drawn.cursor;
    if (!width) return;
    drawn.setSelect({ left: 0, width: 0 }, false);
    if (event) this.chosen(drawn.posToVal(left, "x"), drawn.posToVal(left + width, "x"));
  }

  // Draw in px of the page, inside the area of the plot.
  within(act) {
    const { ctx: pen, bbox } = this.drawn, dense = devicePixelRatio;
    pen.save();
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.font = `${this.size}px ${FONT}`;
    const [left, top, width, height] = [bbox.left, bbox.top, bbox.width, bbox.height].map((value) => value / dense);
    act(pen, { left, top, right: left + width, bottom: top + height }, (time) => left + this.drawn.valToPos(time, "x"), (value) => top + this.drawn.valToPos(value, "y"));
    pen.restore();
  }

  shade() {
    if (!this.view.shade) return;
    this.within((pen, { left, top, right, bottom }, x) => {
      const [from, to] = this.view.shade.map((time) => Math.min(Math.max(x(time), left), right));
      pen.fillStyle = `color-mix(in srgb, ${paintOf("level")} 14%, transparent)`;
      pen.fillRect(from, top, Math.max(to - from, 2), bottom - top);
      if (to > from) write(pen, this.shadeLabel, to - 4, bottom - 4, paintOf("level"), "right");
    });
  }

  mark() {
    this.within((pen, { left, top, right, bottom }, x, y) => {
      for (const [value, label] of this.levels) {
        const at = y(value), paint = paintOf(label === "limit" ? "level" : "soft");
        if (at <= top || at >= bottom) continue;
        stroke(pen, left, at, right, at, paint, [6, 4]);
        write(pen, label, left + 6, at - 3, paint, "left");
      }
      let taken = [NaN, NaN], row = 0; // where the label before stands
      for (const { time, label } of this.view.marks) {
        const at = x(time), isAlarm = label === "alarm", paint = paintOf(label) || paintOf("soft"), width = pen.measureText(label).width + 8;
        if (at < left || at > right) continue;
        stroke(pen, at, top, at, bottom, paint, isAlarm ? [] : [2, 4]);
        const isRight = isAlarm ? at + width <= right || at - width < left : at - width < left;
        const box = isRight ? [at, at + width] : [at - width, at];
        row = box[0] < taken[1] && taken[0] < box[1] ? row + 1 : 0;
        taken = box;
        write(pen, label, at + (isRight ? 5 : -5), top + 14 * this.large * (1 + row), paint, isRight ? "left" : "right");
      }
    });
  }
}

// Whether a line has one value, which is drawn as a point.
function isAlone(values) {
  const first = values.findIndex(isNumber);
  return first >= 0 && !values.some((value, k) => k > first && isNumber(value));
}

function stroke(pen, x1, y1, x2, y2, paint, dash) {
  pen.strokeStyle = paint;
  pen.lineWidth = 1.5;
  pen.setLineDash(dash);
  pen.beginPath();
  pen.moveTo(x1, y1);
  pen.lineTo(x2, y2);
  pen.stroke();
}

// Text with a rim of the panel's colour, so that it can be read on lines.
function write(pen, text, x, y, paint, align) {
  pen.setLineDash([]);
  pen.textAlign = align;
  pen.textBaseline = "bottom";
  pen.lineWidth = 4;
  pen.lineJoin = "round";
  pen.strokeStyle = paintOf("panel");
  pen.strokeText(text, x, y);
  pen.fillStyle = paint;
  pen.fillText(text, x, y);
}
