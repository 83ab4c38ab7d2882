/* Draws the charts of the page from the JSON element `data`; uPlot does the drawing. */
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const places = [...document.querySelectorAll("[data-chart]")];
  const FONT = '13px system-ui, "Segoe UI", "Helvetica Neue", Arial, "DejaVu Sans", sans-serif';
  const HEIGHT = 250;
  const LEFT = 66, RIGHT = 66;
  const start = data.calendar ? data.start : 0;
  const shift = data.calendar ? 0 : data.start;
  const ends = [start + shift, start + shift + (data.length || 1)];
  let plots = [];
  let range = ends;
  let busy = false;

  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const digits = (value) => (value == null ? "–" : String(Number(value.toPrecision(5))).replace("-", "\u2212"));
  const clock = (seconds) => new Date(seconds * 1000).toISOString().replace("T", " ").replace(/\.?0*Z$/, "");
  const moment = (value) => (value == null ? "–" : data.calendar ? clock(value) : digits(Number(value.toFixed(3))) + " s");
  const ticks = (plot, values, axis, space, step) => {
    const places = Math.max(0, Math.min(8, -Math.floor(Math.log10(step) + 1e-9)));
    return values.map((value) => value == null ? "" : value.toFixed(places).replace("-", "\u2212"));
  };

  function line(context, x1, y1, x2, y2, paint, dash) {
    context.strokeStyle = paint;
    context.lineWidth = 1.5 * devicePixelRatio;
    context.setLineDash(dash.map((part) => part * devicePixelRatio));
    context.beginPath();
    context.moveTo(x1, y1);
    context.lineTo(x2, y2);
    context.stroke();
  }

  function write(context, text, x, y, paint, align) {
    context.font = FONT.replace("13px", 12 * devicePixelRatio + "px");
    context.textAlign = align;
    context.textBaseline = "bottom";
    context.setLineDash([]);
    context.lineWidth = 4 * devicePixelRatio;
    context.lineJoin = "round";
    context.strokeStyle = color("panel");
    context.strokeText(text, x, y);
    context.fillStyle = paint;
    context.fillText(text, x, y);
  }

  function annotate(plot, chart) {
    const { ctx, bbox } = plot;
    const right = bbox.left + bbox.width, top = bbox.top, bottom = bbox.top + bbox.height;
    ctx.save();
    if (chart.shade) {
      const [from, to] = [0, 1].map((end) => Math.min(Math.max(plot.valToPos(chart.shade[end] + ends[0], "x", true), bbox.left), right));
      ctx.fillStyle = `color-mix(in srgb, ${color("level")} 14%, transparent)`;
      ctx.fillRect(from, top, to - from, bbox.height);
      if (to > from) write(ctx, chart.shade[2], to - 4 * devicePixelRatio, bottom - 4 * devicePixelRatio, color("level"), "right");
    }
    for (const [value, label] of chart.levels) {
      const y = plot.valToPos(value, "y", true);
      if (y <= top || y >= bottom) continue;
      const paint = color(label === "limit" ? "level" : "soft");
      line(ctx, bbox.left, y, right, y, paint, [6, 4]);
      write(ctx, label, bbox.left + 6 * devicePixelRatio, y - 2, paint, "left");
    }
    for (const mark of chart.now == null ? data.marks : [{ x: chart.now, label: "now" }]) {
      const x = plot.valToPos(mark.x + ends[0], "x", true);
      if (x < bbox.left || x > right) continue;
      const alarm = mark.label === "alarm";
      const paint = color(mark.label) || color("soft");
      line(ctx, x, top, x, bottom, paint, alarm ? [] : [2, 4]);
      const away = (alarm ? 4 : -4) * devicePixelRatio;
      write(ctx, mark.label, x + away, top + 16 * devicePixelRatio, paint, alarm ? "left" : "right");
    }
    ctx.restore();
  }

  const combine = (trace, sign) => trace.y.map((value, k) => value == null || trace.sd[k] == null ? null : value + sign * trace.factor * trace.sd[k]);

  function columns(chart) {
    const x = chart.x.map((value) => value + ends[0]);
    const rows = [x], series = [{ label: "time", value: (plot, value) => moment(value) }], bands = [];
    for (const trace of chart.traces) {
      const paint = color(trace.color);
      const alone = trace.y.filter((value) => value != null).length === 1;
      series.push({
        label: trace.label, stroke: paint, width: trace.width, spanGaps: false,
        value: (plot, value) => digits(value), points: { show: alone || undefined, size: alone ? 8 : 4 },
        paths: trace.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
      });
      rows.push(trace.y);
      if (!trace.sd) continue;
      for (const sign of [1, -1]) {
        series.push({ label: "", class: "edge", stroke: "transparent", width: 0, points: { show: false } });
        rows.push(combine(trace, sign));
      }
      bands.push({ series: [rows.length - 2, rows.length - 1], fill: `color-mix(in srgb, ${paint} 22%, transparent)` });
    }
    return { rows, series, bands };
  }

  function limits(chart) {
    return (plot, low, high) => {
      const shown = [low, high, ...chart.levels.map((level) => level[0])].filter((value) => value != null);
      low = chart.lowest ?? (shown.length ? Math.min(...shown) : 0);
      high = chart.highest ?? (shown.length ? Math.max(...shown) : 1);
      if (!(high > low)) { const room = Math.abs(low) * 0.1 || 1; return [low - room, high + room]; }
      const room = 0.06 * (high - low);
      return [chart.lowest ?? low - room, chart.highest ?? high + room];
    };
  }

  function axes(chart) {
    const common = { stroke: color("ink"), font: FONT, labelFont: FONT, grid: { stroke: color("grid"), width: 1 }, ticks: { stroke: color("rule"), width: 1, size: 5 } };
    const found = [
      { ...common, label: data.calendar ? "time (UTC)" : "time / s", labelSize: 22, size: data.calendar ? 44 : 30, values: data.calendar ? undefined : ticks },
      { ...common, label: chart.unit || undefined, labelSize: 20, size: chart.unit ? LEFT - 20 : LEFT, values: ticks },
    ];
    if (chart.relativeTo) {
      found.push({ ...common, scale: "share", side: 1, label: "% of nominal", labelSize: 20, size: RIGHT - 20, values: ticks, grid: { show: false } });
    }
    return found;
  }

  function follow(plot) {
    if (busy) return;
    busy = true;
    range = [plot.scales.x.min, plot.scales.x.max];
    for (const other of plots) if (other !== plot && !other.alone) other.setScale("x", { min: range[0], max: range[1] });
    busy = false;
  }

  function build(place) {
    const chart = data.charts[Number(place.dataset.chart)];
    const alone = chart.now != null;
    const whole = alone ? [chart.x[0] + ends[0], chart.x[chart.x.length - 1] + ends[0]] : ends;
    const { rows, series, bands } = columns(chart);
    const scales = { x: { time: data.calendar, auto: false, min: (alone ? whole : range)[0], max: (alone ? whole : range)[1] }, y: { range: limits(chart) } };
    if (chart.relativeTo) {
      scales.share = { from: "y", range: (plot, low, high) => [low, high].map((value) => 100 * value / chart.relativeTo) };
    }
    const plot = new uPlot({
      width: Math.max(place.clientWidth, 320), height: HEIGHT, scales, series, bands, axes: axes(chart),
      tzDate: (seconds) => uPlot.tzDate(new Date(seconds * 1000), "Etc/UTC"),
      padding: [12, chart.relativeTo ? 0 : RIGHT, 0, 0],
      cursor: { sync: alone ? undefined : { key: "faultbond", setSeries: false, scales: ["x", null] }, drag: { x: true, y: false }, y: false },
      legend: { live: true },
      hooks: {
        draw: [(drawn) => annotate(drawn, chart)],
        setScale: [(scaled, name) => { if (name === "x" && !alone && plots.includes(scaled)) follow(scaled); }],
        ready: [(made) => made.root.querySelectorAll(".edge").forEach((row) => row.remove())],
      },
    }, rows, place);
    plot.over.addEventListener("dblclick", () => plot.setScale("x", { min: whole[0], max: whole[1] }));
    plot.alone = alone;
    return plot;
  }

  function rebuild() {
    plots.forEach((plot) => plot.destroy());
    plots = [];
    plots = places.map(build);
  }

  rebuild();
  let waiting = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(() => plots.forEach((plot, k) => plot.setSize({ width: Math.max(places[k].clientWidth, 320), height: HEIGHT })));
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", rebuild);
  addEventListener("beforeprint", () => { document.documentElement.dataset.theme = "light"; rebuild(); });
  addEventListener("afterprint", () => { delete document.documentElement.dataset.theme; rebuild(); });
})();
