/* Charts over time, with a common cursor. */
const SVG = "http://www.w3.org/2000/svg";
const LEFT = 44, RIGHT = 10, TALL = 74;
/* Functions that move the cursors and draw the lines; the charts as they are laid out, and the length of their axis [s]. */
let cursors = [], redraws = [], laidCharts = "", axis = 0;

function draws(tag, attributes, parent) {
  const made = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.appendChild(made);
  return made;
}

const shareOf = (time) => axis > 0 ? Math.min(1, (time - data.times[0]) / axis) : 0;

/* Return the length of the time axis [s]: the duration, while the run is in progress rounded up. */
function axisLength() {
  const round = duration < 60 ? 10 : duration < 600 ? 60 : 600;
  return running ? round * Math.max(1, Math.ceil(duration / round)) : duration;
}

/* Return the charts of the shown station: title, unit, lower and upper limit, and lines with name, color and values by
   frame. */
function chartsOf(station) {
  const columns = data.series[station] || {}, found = [];
  const add = (key, title, unit) => {
    if (columns[key]) found.push({ title, unit, lines: [{ name: "", color: C.own, values: columns[key] }] });
  };
  add("speed", "speed", "m/s");
  add("gap", "gap to the nearest body", "m");
  add("ttc", "time to collision", "s");
  for (const [key, title, unit] of [["age", "age of information", "s"], ["expired", "messages too old on arrival", "total"]]) {
    const lines = Object.entries(columns[key] || {}).map(([name, values]) => ({ name, color: senderColor(name), values }));
    if (lines.length) found.push({ title, unit, lines });
  }
  for (const chart of found) {
    let lowest = 0, highest = 0;
    for (const { values } of chart.lines) for (const v of values) { lowest = Math.min(lowest, v); highest = Math.max(highest, v); }
    chart.limit = limitOf(highest);
    chart.floor = lowest < -0.05 ? -limitOf(-lowest) : 0;
  }
  return found;
}

/* Return a round upper limit of a chart. */
function limitOf(largest) {
  const power = 10 ** Math.floor(Math.log10(Math.max(largest, 1e-3)));
  return [1, 2, 5, 10].map((k) => k * power).find((value) => value >= largest * 0.999);
}

function drawChart({ title, unit, lines, limit, floor }, parent) {
  const figure = make("div", "", parent, { className: "chart" }), head = make("div", "", figure, { className: "head" });
  make("span", `${title} [${unit}]`, head);
  const value = make("span", "", head, { className: "value" });
  const width = Math.max(figure.clientWidth, 200), height = TALL;
  const picture = draws("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${title} over time` }, figure);
  const x = (i) => LEFT + (width - LEFT - RIGHT) * shareOf(data.times[i]), y = (v) => 6 + (height - 12) * (1 - (v - floor) / (limit - floor));
  for (const level of [floor, (floor + limit) / 2, limit]) {
    draws("line", { x1: LEFT, x2: width - RIGHT, y1: y(level), y2: y(level), class: "grid" }, picture);
    draws("text", { x: LEFT - 7, y: y(level) + 4, class: "tick" }, picture).textContent = String(Number(level.toPrecision(3)));
  }
  for (const { color, values } of lines) {
    const line = draws("path", { fill: "none", stroke: color, "stroke-width": 1.8, "stroke-linejoin": "round" }, picture);
    redraws.push(() => {
      let path = "", open = false;
      values.forEach((v, i) => {
        if (v === null) { open = false; return; }
        path += `${open ? "L" : "M"}${x(i).toFixed(1)} ${y(v).toFixed(1)}`;
        open = true;
      });
      line.setAttribute("d", path);
    });
  }
  const cursor = draws("line", { y1: 2, y2: height - 2, class: "cursor" }, picture);
  const move = (event) => {
    const area = picture.getBoundingClientRect();
    seek(data.times[0] + axis * (event.clientX - area.left - LEFT) / (area.width - LEFT - RIGHT));
  };
  picture.addEventListener("pointerdown", (event) => { picture.setPointerCapture(event.pointerId); move(event); });
  picture.addEventListener("pointermove", (event) => { if (event.buttons) move(event); });
  cursors.push(() => {
    const at = LEFT + (width - LEFT - RIGHT) * shareOf(shown.time);
    cursor.setAttribute("x1", at); cursor.setAttribute("x2", at);
    value.textContent = lines.map(({ name, values }) => {
      const v = values[shown.index];
      return (name ? name + " " : "") + (v === null || v === undefined ? "–" : v.toFixed(2));
    }).join("   ");
  });
}

/* Lay out the charts if the shown station, a limit or the width has changed, and draw their lines. */
function layCharts() {
  const parent = element("charts"), charts = chartsOf(shown.station);
  axis = axisLength();
  element("chart-panel").hidden = !charts.length;
  const layout = JSON.stringify([shown.station, axis, parent.clientWidth,
    charts.map(({ title, limit, floor, lines }) => [title, limit, floor, lines.map(({ name }) => name)])]);
  if (layout !== laidCharts) {
    laidCharts = layout;
    [cursors, redraws, parent.textContent] = [[], [], ""];
    for (const chart of charts) drawChart(chart, parent);
    cursors.push(moveTimeline);
  }
  for (const redraw of redraws) redraw();
  layTimeline();
  showCursors();
}

function showCursors() { for (const show of cursors) show(); }
