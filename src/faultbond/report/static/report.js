// Draws the charts of the page from the JSON element `data`.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (moment) => data.start + moment;
  const whole = [data.start, at(data.length || 1)];
  const hasShare = data.charts.some((chart) => chart.relativeTo);
  const draws = [];
  const show = (begin, end) => draws.forEach((draw) => draw(begin, end));

  // Charts share what is shown of the time, but for one that goes beyond now and has a time of its own.
  for (const figure of document.querySelectorAll("[data-chart]")) {
    const chart = data.charts[Number(figure.dataset.chart)], { now, shade } = chart;
    const times = chart.x.map(at), isAlone = now != null, own = [times[0], times[times.length - 1]];
    const marks = (isAlone ? [{ x: now, label: "now" }] : data.marks).map(({ x, label }) => ({ time: at(x), label }));
    const lines = chart.traces.map((trace) => ({ ...trace, values: () => trace.y, sd: trace.sd && (() => trace.sd) }));
    const draw = (begin, end) => plot.draw({ times, begin, end, marks, shade: shade && shade.slice(0, 2).map(at), isClock: data.calendar });
    const plot = new Plot(figure, {
      ...chart, lines, title: figure.textContent, isBandWhole: true, right: hasShare ? 70 : undefined, shadeLabel: shade?.[2], group: isAlone ? undefined : "report",
      chosen: isAlone ? draw : show, back: () => (isAlone ? draw(...own) : show(...whole)),
    });
    if (!isAlone) draws.push(draw);
    draw(...(isAlone ? own : whole));
  }
  addEventListener("beforeprint", () => { document.documentElement.dataset.theme = "light"; repaint(); });
  addEventListener("afterprint", () => { delete document.documentElement.dataset.theme; repaint(); });
})();
