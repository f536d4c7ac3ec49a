/* Charts over time and the timeline of the storyboard, with a common cursor. */
const SVG = "http://www.w3.org/2000/svg";
const LEFT = 44, RIGHT = 10, TALL = 74;
let cursors = [];

function draws(tag, attributes, parent) {
  const made = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.appendChild(made);
  return made;
}

const shareOf = (time) => duration > 0 ? (time - data.times[0]) / duration : 0;

/* Return the charts of the shown station: title, unit, and lines with name, color and values by frame. */
function chartsOf(station) {
  const columns = data.series[station] || {}, found = [];
  const add = (key, title, unit) => {
    if (columns[key]) found.push({ title, unit, lines: [{ name: "", color: C.own, values: columns[key] }] });
  };
  add("speed", "speed", "m/s");
  add("gap", "gap to the nearest body", "m");
  add("ttc", "time to collision", "s");
  const ages = Object.entries(columns.age || {});
  if (ages.length) found.push({ title: "age of information", unit: "s",
    lines: ages.map(([name, values]) => ({ name, color: senderColor(name), values })) });
  return found;
}

/* Return a round upper limit of a chart. */
function limitOf(largest) {
  const power = 10 ** Math.floor(Math.log10(Math.max(largest, 1e-3)));
  return [1, 2, 5, 10].map((k) => k * power).find((value) => value >= largest * 0.999);
}

function drawChart({ title, unit, lines }, parent) {
  const figure = make("div", "", parent, { className: "chart" }), head = make("div", "", figure, { className: "head" });
  make("span", `${title} [${unit}]`, head);
  const value = make("span", "", head, { className: "value" });
  const width = Math.max(figure.clientWidth, 200), height = TALL;
  const picture = draws("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${title} over time` }, figure);
  const all = lines.flatMap((line) => line.values.filter((v) => v !== null));
  const limit = limitOf(Math.max(...all)), floor = Math.min(0, ...all) < -0.05 ? -limitOf(-Math.min(...all)) : 0;
  const x = (i) => LEFT + (width - LEFT - RIGHT) * shareOf(data.times[i]), y = (v) => 6 + (height - 12) * (1 - (v - floor) / (limit - floor));
  for (const level of [floor, (floor + limit) / 2, limit]) {
    draws("line", { x1: LEFT, x2: width - RIGHT, y1: y(level), y2: y(level), class: "grid" }, picture);
    draws("text", { x: LEFT - 7, y: y(level) + 4, class: "tick" }, picture).textContent = String(Number(level.toPrecision(3)));
  }
  for (const { color, values } of lines) {
    let path = "", open = false;
    values.forEach((v, i) => {
      if (v === null) { open = false; return; }
      path += `${open ? "L" : "M"}${x(i).toFixed(1)} ${y(v).toFixed(1)}`;
      open = true;
    });
    draws("path", { d: path, fill: "none", stroke: color, "stroke-width": 1.8, "stroke-linejoin": "round" }, picture);
  }
  const cursor = draws("line", { y1: 2, y2: height - 2, class: "cursor" }, picture);
  const move = (event) => {
    const area = picture.getBoundingClientRect();
    seek(data.times[0] + duration * (event.clientX - area.left - LEFT) / (area.width - LEFT - RIGHT));
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

function layCharts() {
  cursors = [];
  const parent = element("charts");
  parent.textContent = "";
  const charts = chartsOf(shown.station);
  element("chart-panel").hidden = !charts.length;
  for (const chart of charts) drawChart(chart, parent);
  cursors.push(moveTimeline);
  showCursors();
}

function showCursors() { for (const show of cursors) show(); }

/* Rows of the timeline; each interval is a button that leads to its start. */
function layTimeline() {
  const parent = element("timeline"), rows = data.timeline.slice(0, 150);
  element("timeline-panel").hidden = !rows.length;
  for (const [path, kind, intervals] of rows) {
    const row = make("div", "", parent, { className: "row" }), depth = path.split("/").length - 1;
    const label = make("span", path.split("/").pop(), row, { className: "label", title: `${kind} ${path}` });
    label.style.paddingLeft = `${Math.min(depth, 6) * 8}px`;
    const track = make("div", "", row, { className: "track" });
    for (const [start, end, why, whyEnd] of intervals) {
      const until = end === null ? data.times[last] : end;
      const text = `${kind} ${path.split("/").pop()}: ${start.toFixed(2)} s to ${end === null ? "the end of the run" : end.toFixed(2) + " s"}`
        + (why ? `. Start: ${why}` : "") + (whyEnd ? `. End: ${whyEnd}` : "");
      const bar = make("button", "", track, { type: "button", className: "bar " + kind, title: text });
      bar.setAttribute("aria-label", text);
      bar.style.left = `${100 * shareOf(start)}%`;
      bar.style.width = `max(4px, ${100 * (shareOf(until) - shareOf(start))}%)`;
      bar.onclick = () => seek(start);
    }
  }
  if (data.timeline.length > rows.length) make("p", `${data.timeline.length - rows.length} more elements are in the list of the storyboard.`, parent);
  make("div", "", make("div", "", parent, { className: "over" }), { id: "now" });
}

function moveTimeline() { const now = element("now"); if (now) now.style.left = `${100 * shareOf(shown.time)}%`; }
