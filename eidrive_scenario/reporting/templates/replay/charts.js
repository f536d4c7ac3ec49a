/* Charts of the shown station over time; with another run, its lines are broken. */
const SVG = "http://www.w3.org/2000/svg", TALL = 74;
let redraws = [], values = [], laidCharts = "";

function draws(tag, attributes, parent) {
  const made = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.appendChild(made);
  return made;
}

/* Return the charts of a station: title, unit, lower and upper limit, and lines with run, key, name, color and values by
   frame. */
function chartsOf(station) {
  const charts = [], add = (key, title, unit, bySender) => {
    const lines = runs.flatMap((run) => {
      const column = (run.series[station] || {})[key];
      if (!column) return [];
      if (!bySender) return [{ run, key, name: "", color: C.own, values: column }];
      return Object.entries(column).map(([name, ages]) => ({ run, key, name, color: senderColor(name), values: ages }));
    });
    if (lines.length) charts.push({ title, unit, lines });
  };
  add("speed", "speed", "m/s");
  add("gap", "gap to the nearest body", "m");
  add("ttc", "time to collision", "s");
  add("age", "age of information", "s", true);
  add("expired", "messages too old on arrival", "total", true);
  for (const chart of charts) {
    let lowest = 0, highest = 0;
    for (const line of chart.lines) for (const v of line.values) { lowest = Math.min(lowest, v); highest = Math.max(highest, v); }
    chart.limit = limitOf(highest);
    chart.floor = lowest < -0.05 ? -limitOf(-lowest) : 0;
  }
  return charts;
}

/* Return a round upper limit of a chart. */
function limitOf(largest) {
  const power = 10 ** Math.floor(Math.log10(Math.max(largest, 1e-3)));
  return [1, 2, 5, 10].map((k) => k * power).find((value) => value >= largest * 0.999);
}

/* Return the value of a line at the cursor as text. */
function valueText({ run, key, name, values: column }) {
  const v = key === "speed" ? speedOf(shown.station, run) : column[indexOf(run)];
  const hasEnded = !running && shown.time > endOf(run) + 1e-6;
  const text = hasEnded || v === null || v === undefined ? "–" : v.toFixed(key === "expired" ? 0 : 2);
  return [other ? letterOf(run) : "", name, text].filter(Boolean).join(" ");
}

function drawChart({ title, unit, lines, limit, floor }, parent) {
  const track = addRow(parent, `${title} [${unit}]`, "", "chart"), label = track.previousSibling;
  const value = make("b", "", label);
  const width = plotWidth, height = TALL;
  const picture = draws("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${title} over time` }, track);
  const y = (v) => 6 + (height - 12) * (1 - (v - floor) / (limit - floor));
  const levels = [floor, floor < 0 ? 0 : limit / 2, limit].filter((level, i) => i !== 1 || Math.abs(y(level) - y(floor)) > 13);
  for (const level of levels) {
    draws("line", { x1: 0, x2: width, y1: y(level), y2: y(level), class: "grid" }, picture);
    draws("text", { x: -7, y: y(level) + 4, class: "tick" }, picture).textContent = String(Number(level.toPrecision(3)));
  }
  for (const { run, color, values: column } of lines) {
    const line = draws("path", { fill: "none", stroke: color, "stroke-width": 1.8, "stroke-linejoin": "round", ...(run === other ? { "stroke-dasharray": "5 3" } : { "stroke-linecap": "round" }) }, picture);
    redraws.push(() => {
      let path = "", open = false;
      column.forEach((v, i) => {
        if (v === null) { open = false; return; }
        // A line of length 0 is a point, for a value without neighbors
        path += `${open ? "L" : "M"}${(width * shareOf(run.times[i])).toFixed(1)} ${y(v).toFixed(1)}${open ? "" : "h0"}`;
        open = true;
      });
      line.setAttribute("d", path);
    });
  }
  values.push(() => { value.textContent = lines.map(valueText).join("   "); });
}

/* Lay out the charts if the shown station, a limit, a color or the width has changed, and draw their lines. */
function layCharts() {
  const parent = element("charts"), charts = chartsOf(shown.station);
  const layout = JSON.stringify([shown.station, axis, plotWidth,
    charts.map(({ title, limit, floor, lines }) => [title, limit, floor, lines.map(({ run, name, color }) => [letterOf(run), name, color])])]);
  if (layout !== laidCharts) {
    laidCharts = layout;
    [values, redraws, parent.textContent] = [[], [], ""];
    for (const chart of charts) drawChart(chart, parent);
  }
  for (const redraw of redraws) redraw();
  cursors.push(...values);
}
