// A plot over time on a canvas, in the colours and with the marks of the report.

const SIZE = 12; // px of its text, and in proportion to it all about the plot; more where the text of the page is large
const FONT = 'system-ui, "Segoe UI", "Helvetica Neue", Arial, "DejaVu Sans", sans-serif';
const LEFT = 52, TOP = 10, RIGHT = 12, BOTTOM = 24; // px about the area of the plot
const FAR = 1e5;          // px; farther than this nothing is drawn
const STEPS = [1, 2, 5, 10];
const CLOCK_STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];

const paints = new Map(); // colours by name, asked for once; cleared where the page turns dark or light

function paintOf(name) {
  if (!paints.has(name)) paints.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return paints.get(name);
}

// Round values from low to high, no more than `most`.
function ticksOf(low, high, most, isClock) {
  const rough = (high - low) / Math.max(most, 1), order = 10 ** Math.floor(Math.log10(rough));
  const clock = isClock && CLOCK_STEPS.find((step) => step >= rough);
  const step = clock || (isClock ? 86400 * Math.ceil(rough / 86400) : order * STEPS.find((each) => each * order >= rough * 0.999));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { step, found };
}

function tickText(value, step) {
  const places = Math.max(0, Math.min(8, -Math.floor(Math.log10(step) + 1e-9)));
  return value.toFixed(places).replace(/^-(?=[0.]*$)/, "").replace("-", MINUS);
}

function clockTick(value, step) {
  const text = new Date(value * 1000).toISOString();
  if (step >= 86400) return text.slice(5, 10);
  return value % 86400 === 0 ? text.slice(5, 10) : text.slice(11, step < 60 ? 19 : 16);
}

// lines: each with label, colour, width and `values()`; `sd()` draws a band of two of them; `times()` and `count()` where they are
// not those of the samples. unit: of the values. isBestFirst: they are probabilities, of which the first is on top.
class Chart {
  constructor(place, { title, unit = "", lines, level = null, lowest = null, highest = null, isBestFirst = false }) {
    Object.assign(this, { unit, lines, level, lowest, highest, isBestFirst, shade: null, scale: 1, large: 1, places: 2 });
    this.forget();
    this.figure = document.createElement("figure");
    this.figure.innerHTML = '<figcaption><span class="what"></span><span class="in"></span><span class="legend"></span></figcaption><canvas role="img"></canvas>';
    this.figure.querySelector(".what").textContent = title;
    this.canvas = this.figure.querySelector("canvas");
    this.canvas.setAttribute("aria-label", `${title} over time`);
    this.legend = this.figure.querySelector(".legend");
    this.name(lines);
    place.append(this.figure);
  }

  // Show the names of the lines; `tell` shows their values.
  name(lines) {
    this.lines = lines;
    this.legend.replaceChildren(...lines.map((line) => {
      const entry = document.createElement("span");
      entry.innerHTML = "<i></i><em></em><b></b>";
      entry.firstChild.style.background = `var(--${line.color})`;
      entry.children[1].textContent = line.label;
      return entry;
    }));
  }

  tell(k) {
    [...this.legend.children].forEach((entry, place) => {
      const line = this.lines[place], value = line.values()[line.count ? line.count() - 1 : k];
      entry.lastChild.textContent = isNumber(value) ? this.text(value) : "–";
    });
  }

  text(value) { return this.isBestFirst ? probabilityText(value / 100) : (value / this.scale).toFixed(this.places).replace("-", MINUS); }

  // Another run begins.
  forget() {
    this.seen = { count: 0, low: Infinity, high: -Infinity };
  }

  // Learn the lowest and highest value of the lines up to sample `count`, from where it stopped the last time.
  learn(count) {
    const { seen } = this;
    for (const line of this.lines) {
      const values = line.values();
      for (let k = seen.count; k < count; k++) {
        if (values[k] < seen.low) seen.low = values[k];
        if (values[k] > seen.high) seen.high = values[k];
      }
    }
    seen.count = count;
  }

  range(count) {
    if (this.highest == null) this.learn(count);
    let { low, high } = this.seen;
    if (this.level != null && this.level > high) high = this.level;
    low = this.lowest ?? (low === Infinity ? 0 : low);
    high = this.highest ?? (high === -Infinity ? 1 : high);
    if (!(high > low)) return [low - (Math.abs(low) * 0.1 || 1), high + (Math.abs(high) * 0.1 || 1)];
    const room = 0.06 * (high - low);
    return [this.lowest ?? low - room, this.highest ?? high + room];
  }

  // Draw what `view` shows: `known` samples, of which `shown` are drawn; from time `begin` to `end`; `marks`; `cursor`.
  draw(view) {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight, dense = devicePixelRatio || 1;
    if (!width) return;
    if (this.canvas.width !== Math.round(width * dense)) this.canvas.width = Math.round(width * dense);
    if (this.canvas.height !== Math.round(height * dense)) this.canvas.height = Math.round(height * dense);
    const pen = this.canvas.getContext("2d");
    const [low, high] = this.range(view.known);
    this.scale = 10 ** exponentOf(Math.max(Math.abs(low), Math.abs(high)));
    this.places = Math.max(0, Math.min(6, 2 - orderOf((high - low) / this.scale)));
    const exponent = Math.round(Math.log10(this.scale));
    this.figure.querySelector(".in").textContent = `${exponent ? powerOfTen(exponent) + NO_BREAK : ""}${this.unit}`;
    this.large = Math.max(1, Math.round(0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize)) / SIZE);
    this.area = { left: LEFT * this.large, right: width - RIGHT, top: TOP, bottom: height - BOTTOM * this.large };
    const { left, right, top, bottom } = this.area;
    const x = (time) => left + (right - left) * (time - view.begin) / (view.end - view.begin);
    const y = (value) => bottom - (bottom - top) * (value - low) / (high - low);
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = `${SIZE * this.large}px ${FONT}`;
    this.drawAxes(pen, view, low, high, x, y);
    pen.save();
    pen.beginPath();
    pen.rect(left, top - 2, right - left, bottom - top + 3);
    pen.clip();
    this.drawShade(pen, view, x);
    for (const line of this.isBestFirst ? [...this.lines].reverse() : this.lines) this.drawLine(pen, view, line, x, y);
    pen.restore();
    this.drawMarks(pen, view, x, y);
  }

  drawAxes(pen, view, low, high, x, y) {
    const { left, right, top, bottom } = this.area;
    const values = ticksOf(low / this.scale, high / this.scale, (bottom - top) / (28 * this.large));
    const times = ticksOf(view.begin, view.end, (right - left) / (76 * this.large), view.isClock);
    pen.lineWidth = 1;
    pen.strokeStyle = paintOf("grid");
    pen.fillStyle = paintOf("soft");
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    for (const value of values.found) {
      const at = Math.round(y(value * this.scale)) + 0.5;
      stroke(pen, left, at, right, at);
      pen.fillText(tickText(value, values.step), left - 8, at);
    }
    pen.textBaseline = "top";
    pen.textAlign = "center";
    for (const time of times.found) {
      const at = Math.round(x(time)) + 0.5, text = view.isClock ? clockTick(time, times.step) : tickText(time, times.step);
      stroke(pen, at, top, at, bottom);
      const half = pen.measureText(text).width / 2;
      const isLast = time === times.found[times.found.length - 1];
      pen.fillText(isLast && !view.isClock ? `${text} s` : text, Math.min(at, right - half - (isLast ? 6 : 0)), bottom + 7);
    }
    pen.strokeStyle = paintOf("rule");
    stroke(pen, left, bottom + 0.5, right, bottom + 0.5);
  }

  drawShade(pen, view, x) {
    if (!this.shade) return;
    const [from, to] = this.shade.map(x);
    pen.fillStyle = `color-mix(in srgb, ${paintOf("level")} 14%, transparent)`;
    pen.fillRect(from, this.area.top, Math.max(to - from, 2), this.area.bottom - this.area.top);
  }

  drawLine(pen, view, line, x, y) {
    const times = line.times ? line.times() : view.times, values = line.values();
    const count = line.count ? line.count() : view.shown;
    const paint = paintOf(line.color);
    if (line.sd) fillBand(pen, times, values, line.sd(), count, x, y, `color-mix(in srgb, ${paint} 22%, transparent)`);
    pen.strokeStyle = paint;
    pen.lineWidth = line.width || 1.6;
    pen.lineJoin = "round";
    pen.beginPath();
    trace(pen, times, values, count, x, y, line.stepped);
    pen.stroke();
    if (count === 1 && isNumber(values[0])) dot(pen, x(times[0]), y(values[0]), paint);
  }

  drawMarks(pen, view, x, y) {
    const { left, right, top, bottom } = this.area;
    if (this.level != null) {
      const at = y(this.level);
      pen.strokeStyle = paintOf("level");
      pen.setLineDash([6, 4]);
      stroke(pen, left, at, right, at);
      write(pen, "limit", left + 6, at - 3, paintOf("level"), "left");
    }
    let taken = [NaN, NaN], row = 0; // where the label before stands
    for (const { time, label } of view.marks) {
      if (time < view.begin || time > view.end) continue;
      const at = x(time), isAlarm = label === "alarm", paint = paintOf(label), width = pen.measureText(label).width + 8;
      pen.strokeStyle = paint;
      pen.lineWidth = 1.5;
      pen.setLineDash(isAlarm ? [] : [2, 4]);
      stroke(pen, at, top, at, bottom);
      const isRight = isAlarm ? at + width <= right || at - width < left : at - width < left;
      const box = isRight ? [at, at + width] : [at - width, at];
      row = box[0] < taken[1] && taken[0] < box[1] ? row + 1 : 0;
      taken = box;
      write(pen, label, at + (isRight ? 5 : -5), top + 14 * this.large * (1 + row), paint, isRight ? "left" : "right");
    }
    pen.setLineDash([]);
    pen.lineWidth = 1;
    pen.strokeStyle = paintOf("soft");
    if (view.cursor != null) stroke(pen, x(view.cursor), top, x(view.cursor), bottom);
  }
}

function stroke(pen, x1, y1, x2, y2) {
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

function dot(pen, x, y, paint) {
  pen.fillStyle = paint;
  pen.beginPath();
  pen.arc(x, y, 3.5, 0, 7);
  pen.fill();
}

// Trace values that are there; of those in one column of pixels only the first, the lowest, the highest and the last.
function trace(pen, times, values, count, x, y, isStepped) {
  let column = NaN, low = 0, high = 0, final = 0, isDown = false;
  const end = () => {
    if (!isDown) return;
    pen.lineTo(column, low);
    pen.lineTo(column, high);
    pen.lineTo(column, final);
  };
  for (let k = 0; k < count; k++) {
    if (!isNumber(values[k])) {
      end();
      isDown = false;
      column = NaN;
      continue;
    }
    const at = Math.round(2 * x(times[k])) / 2, height = y(values[k]);
    if (at === column) {
      low = Math.max(low, height);
      high = Math.min(high, height);
      final = height;
      continue;
    }
    end();
    if (!isDown) pen.moveTo(at, height);
    else {
      if (isStepped) pen.lineTo(at, final);
      pen.lineTo(at, height);
    }
    isDown = true;
    column = at;
    low = high = final = height;
  }
  end();
}

// Fill between two standard deviations above and below; what is not known is left out.
function fillBand(pen, times, values, deviations, count, x, y, paint) {
  const bound = (height) => Math.max(-FAR, Math.min(FAR, height));
  pen.fillStyle = paint;
  for (let first = 0; first < count;) {
    while (first < count && !isNumber(values[first] + deviations[first])) first++;
    let end = first;
    while (end < count && isNumber(values[end] + deviations[end])) end++;
    if (end - first > 1) {
      const stride = Math.max(1, Math.floor((end - first) / 3000));
      pen.beginPath();
      for (let k = first; k < end; k += stride) pen.lineTo(x(times[k]), bound(y(values[k] + 2 * deviations[k])));
      for (let k = end - 1; k >= first; k -= stride) pen.lineTo(x(times[k]), bound(y(values[k] - 2 * deviations[k])));
      pen.fill();
    }
    first = end + 1;
  }
}
