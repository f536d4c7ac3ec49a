"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);
const canvas = element("street"), pen = canvas.getContext("2d");
const C = data.colors, INK = "#334155", SELF = "#0f172a", NEAR = 30;
let index = 0, playing = false, startedAt = 0, startedFrom = 0;
let scale = 10, centerX = 0, centerY = 0;

function make(tag, text, parent) {
  const made = document.createElement(tag);
  made.textContent = text;
  parent.appendChild(made);
  return made;
}

for (const name of Object.keys(data.stations)) make("option", "detections of " + name, element("station")).value = name;
make("option", "ground truth only", element("station")).value = "";
element("slider").max = data.times.length - 1;
for (const [time, path, after, why] of data.changes) {
  const item = make("li", time.toFixed(2) + " s  " + path.split("/").pop() + " → " + after, element("changes"));
  item.dataset.time = time;
  item.title = path + (why ? ": " + why : "");
  item.onclick = () => { pause(); show(data.times.findIndex((t) => t >= time - 1e-6)); };
}
for (const [color, text] of [[C.own, "detected by the station (%: probability of existence)"], [C.received, "received from others"], [C.link, "message delivered"], [C.lost, "message lost"]]) {
  const entry = make("span", "", element("legend"));
  const patch = make("i", "", entry);
  patch.className = "swatch";
  patch.style.background = color;
  patch.style.margin = "0";
  entry.append(text);
}

function fit() {
  let left = Infinity, right = -Infinity, bottom = Infinity, top = -Infinity;
  const first = Object.keys(data.stations)[0];
  for (const poses of data.poses) for (const [x, y] of Object.values(poses)) {
    if (first && poses[first] && Math.hypot(x - poses[first][0], y - poses[first][1]) > NEAR) continue;
    left = Math.min(left, x); right = Math.max(right, x); bottom = Math.min(bottom, y); top = Math.max(top, y);
  }
  const area = canvas.getBoundingClientRect();
  centerX = (left + right) / 2; centerY = (bottom + top) / 2;
  scale = Math.min(area.width / (right - left + 16), area.height / (top - bottom + 16));
  draw();
}

function trace(points) {
  pen.beginPath();
  points.forEach(([x, y], i) => i ? pen.lineTo(x, y) : pen.moveTo(x, y));
}

function box([x, y, length, width, yaw], fill, stroke, line, opacity) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(yaw);
  pen.globalAlpha = opacity;
  pen.fillStyle = fill;
  pen.fillRect(-length / 2, -width / 2, length, width);
  pen.globalAlpha = 1;
  pen.lineWidth = line;
  pen.strokeStyle = stroke;
  pen.strokeRect(-length / 2, -width / 2, length, width);
  pen.restore();
}

/* Draw a detected box; opacity and line width decrease with the probability of existence. */
function perceived(at, color, line) {
  const existence = at.length > 5 ? at[5] : 1;
  box(at, color, color, line * (0.3 + 0.7 * existence), 0.28 * existence);
  if (existence < 0.995) {
    pen.save();
    pen.translate(at[0], at[1]); pen.scale(1, -1);
    pen.font = "1.4px sans-serif"; pen.textAlign = "center"; pen.textBaseline = "middle"; pen.fillStyle = color;
    pen.fillText(`${Math.round(100 * existence)} %`, 0, 0);
    pen.restore();
  }
}

function outline(name, [x, y, yaw], at) {
  const [length, width] = data.actors[name].size, cos = Math.abs(Math.cos(yaw)), sin = Math.abs(Math.sin(yaw));
  const across = (cos * length + sin * width) / 2, up = (sin * length + cos * width) / 2;
  return [...at(x - across, y + up), ...at(x + across, y - up)];
}

/* Return the label position (right, left, above or below) with the smallest overlap with other labels. */
function place(text, [left, top, right, bottom], others) {
  const width = pen.measureText(text).width, middle = (left + right) / 2 - width / 2 - 7;
  const spots = [[right, (top + bottom) / 2], [left - width - 14, (top + bottom) / 2], [middle, top - 11], [middle, bottom + 11]];
  const covered = ([x, y]) => others.reduce((sum, [, l, t, r, b]) =>
    sum + Math.max(0, Math.min(x + 7 + width, r) - Math.max(x + 7, l)) * Math.max(0, Math.min(y + 8, b) - Math.max(y - 8, t)), 0);
  return spots.reduce((best, spot) => covered(spot) < covered(best) ? spot : best);
}

function draw() {
  const area = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  canvas.width = area.width * ratio;
  canvas.height = area.height * ratio;
  const poses = data.poses[index], self = element("station").value;
  const station = self ? data.stations[self][index] : null;
  const at = (x, y) => [area.width / 2 + (x - centerX) * scale, area.height / 2 - (y - centerY) * scale];
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = C.ground;
  pen.fillRect(0, 0, area.width, area.height);
  pen.setTransform(scale * ratio, 0, 0, -scale * ratio, (area.width / 2 - centerX * scale) * ratio, (area.height / 2 + centerY * scale) * ratio);
  for (const [color, polygon] of data.roads.lanes) {
    trace(polygon); pen.closePath(); pen.fillStyle = pen.strokeStyle = color; pen.lineWidth = 0.05; pen.fill(); pen.stroke();
  }
  pen.lineWidth = 0.18;
  for (const [broken, color, line] of data.roads.lines) {
    pen.setLineDash(broken ? [3, 3] : []); pen.strokeStyle = color; trace(line); pen.stroke();
  }
  if (station && poses[self]) for (const [sender, delivered] of station.links) if (poses[sender]) {
    pen.setLineDash(delivered ? [] : [0.9, 0.9]);
    pen.strokeStyle = delivered ? C.link : C.lost;
    pen.lineWidth = 0.2;
    trace([poses[sender], poses[self]]); pen.stroke();
  }
  pen.setLineDash([]);
  if (station) for (const box of station.received) perceived(box, C.received, 0.5);
  if (station) for (const own of station.own) perceived(own, C.own, 0.25);
  for (const [name, [x, y, yaw]] of Object.entries(poses)) {
    const [length, width] = data.actors[name].size, filled = name === self;
    if (Math.max(length, width) < 1) {
      pen.beginPath(); pen.arc(x, y, 0.6, 0, 2 * Math.PI); pen.fillStyle = filled ? SELF : "#fff"; pen.fill();
      pen.lineWidth = 0.22; pen.strokeStyle = INK; pen.stroke();
      continue;
    }
    box([x, y, length, width, yaw], filled ? SELF : "#fff", INK, 0.14, filled ? 1 : 0.35);
    const bar = 0.28 * length, dx = Math.cos(yaw), dy = Math.sin(yaw);
    trace([[x + bar * dx - dy * width / 2, y + bar * dy + dx * width / 2], [x + bar * dx + dy * width / 2, y + bar * dy - dx * width / 2]]);
    pen.strokeStyle = filled ? "#fff" : INK; pen.lineWidth = 0.2; pen.stroke();
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.font = "600 12.5px system-ui, sans-serif";
  pen.textBaseline = "middle";
  const taken = Object.entries(poses).map(([name, pose]) => [name, ...outline(name, pose, at)]);
  for (const [name, pose] of Object.entries(poses)) {
    const speed = pose[3], text = Math.abs(speed) > 0.05 ? name + "  " + (3.6 * speed).toFixed(0) + " km/h" : name;
    const [left, middle] = place(text, outline(name, pose, at), taken.filter(([other]) => other !== name));
    taken.push(["", left + 7, middle - 8, left + 7 + pen.measureText(text).width, middle + 8]);
    pen.lineWidth = 3.5; pen.lineJoin = "round"; pen.strokeStyle = "#fff"; pen.strokeText(text, left + 7, middle);
    pen.fillStyle = SELF; pen.fillText(text, left + 7, middle);
  }
}

function show(next) {
  index = Math.max(0, Math.min(data.times.length - 1, next));
  element("slider").value = index;
  element("clock").textContent = data.times[index].toFixed(2) + " s";
  const known = element("known"), station = (data.stations[element("station").value] || [])[index];
  known.textContent = "";
  for (const [key, value] of station ? [["own detections", station.own.length], ["received objects", station.received.length], ["plan", station.plan || "none"]] : [["", "absent"]]) {
    make("dt", key, known); make("dd", value, known);
  }
  let last = null;
  for (const item of element("changes").children) {
    const past = item.dataset.time <= data.times[index] + 1e-6;
    item.className = past ? "past" : "future";
    if (past) last = item;
  }
  const list = element("changes");
  if (last) list.scrollTop = last.offsetTop - list.offsetTop - list.clientHeight / 2;
  draw();
}

function pause() { playing = false; element("play").textContent = "Play"; }

function play() {
  if (index === data.times.length - 1) show(0);
  playing = true;
  element("play").textContent = "Pause";
  startedAt = performance.now();
  startedFrom = data.times[index];
  requestAnimationFrame(advance);
}

function advance(now) {
  if (!playing) return;
  const wanted = startedFrom + (now - startedAt) / 1000 * Number(element("rate").value);
  let next = index;
  while (next < data.times.length - 1 && data.times[next + 1] <= wanted) next += 1;
  if (next !== index) show(next);
  if (index === data.times.length - 1) pause(); else requestAnimationFrame(advance);
}

element("play").onclick = () => playing ? pause() : play();
element("slider").oninput = (event) => { pause(); show(Number(event.target.value)); };
element("rate").onchange = () => { if (playing) play(); };
element("station").onchange = () => show(index);
element("fit").onclick = fit;
addEventListener("keydown", (event) => {
  if (["SELECT", "INPUT", "BUTTON"].includes(event.target.tagName)) return;
  if (event.key === " ") { event.preventDefault(); playing ? pause() : play(); }
  if (event.key === "ArrowRight") { pause(); show(index + 1); }
  if (event.key === "ArrowLeft") { pause(); show(index - 1); }
});
canvas.addEventListener("wheel", (event) => { event.preventDefault(); scale *= Math.exp(-event.deltaY / 600); draw(); }, { passive: false });
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  if (!event.buttons) return;
  centerX -= event.movementX / scale; centerY += event.movementY / scale; draw();
});
addEventListener("resize", draw);
show(0);
fit();
