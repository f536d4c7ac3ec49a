/* View from above. Lengths in m; the canvas transform maps the world to pixels. */
const canvas = element("street"), pen = canvas.getContext("2d"), NEAR = 30;
const topView = { scale: 10, x: 0, y: 0, follow: false };

function bounds(points) {
  const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}
/* Lanes and lines of each level, in the order in which they cover each other. */
const levels = data.roads.levels.map(({ lanes, lines }) => ({
  lanes: lanes.map(([kind, points]) => ({ get color() { return Object.hasOwn(C.lanes, kind) ? C.lanes[kind] : C.lane; }, points, area: bounds(points) })),
  lines: lines.map(([broken, paint, points]) => ({ broken, get color() { return Object.hasOwn(C.marks, paint) ? C.marks[paint] : C.mark; }, points, area: bounds(points) })) }));
const houses = data.roads.houses.map(([height, points]) => ({ height, points, area: bounds(points) }));

function fit() {
  let left = Infinity, right = -Infinity, bottom = Infinity, top = -Infinity;
  for (const run of runs) for (const poses of Object.values(run.poses)) for (const [i, pose] of poses.entries()) {
    const around = run.poses[shown.station], center = around && around[i];
    if (!pose || (center && Math.hypot(pose[0] - center[0], pose[1] - center[1]) > NEAR)) continue;
    left = Math.min(left, pose[0]); right = Math.max(right, pose[0]); bottom = Math.min(bottom, pose[1]); top = Math.max(top, pose[1]);
  }
  // Without actors the roads are shown
  if (left > right) for (const { area } of levels.flatMap(({ lanes }) => lanes)) {
    left = Math.min(left, area[0]); right = Math.max(right, area[2]); bottom = Math.min(bottom, area[1]); top = Math.max(top, area[3]);
  }
  if (left > right) return;
  const area = canvas.getBoundingClientRect();
  topView.x = (left + right) / 2; topView.y = (bottom + top) / 2;
  topView.scale = Math.min(area.width / (right - left + 16), area.height / (top - bottom + 16));
  const close = Math.min(area.width, area.height) / 70;
  if (topView.follow) topView.scale = Math.max(topView.scale, close);
  if (running) topView.scale = Math.min(topView.scale, close);
}

function trace(points) {
  pen.beginPath();
  points.forEach(([x, y], i) => i ? pen.lineTo(x, y) : pen.moveTo(x, y));
}

function drawBox([x, y, length, width, yaw], fill, stroke, line, opacity) {
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

/* Draw a perceived box with its ellipse; opacity and line width decrease with the probability of existence. */
function drawPerceived({ box, color, line, kind }) {
  const existence = typeof box[6] === "number" ? box[6] : 1, fused = kind === "fused";
  if (fused) pen.setLineDash([0.6, 0.35]);
  drawBox(box, color, color, line * (0.3 + 0.7 * existence), (fused ? 0.1 : 0.25) * existence);
  pen.setLineDash([]);
  if (fused && box.length > 8) {
    pen.beginPath();
    pen.ellipse(box[0], box[1], Math.max(box[7], 0.05), Math.max(box[8], 0.05), box[9], 0, 2 * Math.PI);
    pen.lineWidth = 0.12; pen.strokeStyle = color; pen.stroke();
  }
  if (existence < 0.995) {
    pen.save();
    pen.translate(box[0], box[1]); pen.scale(1, -1);
    pen.font = "1.4px sans-serif"; pen.textAlign = "center"; pen.textBaseline = "middle"; pen.fillStyle = color;
    pen.fillText(`${Math.round(100 * existence)} %`, 0, 0);
    pen.restore();
  }
}

function drawRoads([left, bottom, right, top]) {
  const inside = ({ area }) => area[0] <= right && area[2] >= left && area[1] <= top && area[3] >= bottom;
  for (const { lanes, lines } of levels) {
    pen.lineWidth = 0.05;
    for (const lane of lanes) if (inside(lane)) {
      trace(lane.points); pen.closePath(); pen.fillStyle = pen.strokeStyle = lane.color; pen.fill(); pen.stroke();
    }
    pen.lineWidth = 0.18;
    for (const line of lines) if (inside(line)) {
      pen.setLineDash(line.broken ? [3, 3] : []); pen.strokeStyle = line.color; trace(line.points); pen.stroke();
    }
    pen.setLineDash([]);
  }
  for (const house of houses) if (inside(house)) {
    trace(house.points); pen.closePath(); pen.fillStyle = C.house; pen.fill();
  }
}

/* Draw the planned path as a band, with gaps while the plan demands braking. */
function drawPath() {
  const path = shown.layers.plan && isPresent() ? part("path") : [];
  if (path.length < 2) return;
  const braking = part("braking");
  pen.setLineDash(braking ? [1.2, 0.5] : []);
  pen.lineWidth = 0.6; pen.lineJoin = "round"; pen.strokeStyle = braking ? C.braking : C.plan; pen.globalAlpha = 0.75;
  trace(path); pen.stroke();
  pen.globalAlpha = 1;
  pen.setLineDash([]);
}

/* Draw messages as lines: those in flight with a point, lost ones broken and with a cross. */
function drawMessages() {
  for (const { sender, receiver, state, share } of shown.layers.messages ? messagesNow() : []) {
    const from = poseOf(sender), to = poseOf(receiver);
    if (!from || !to) continue;
    const at = (part) => [from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1])], lost = state === "lost";
    pen.setLineDash(lost ? [0.9, 0.9] : []);
    pen.strokeStyle = lost ? C.lost : C.link;
    pen.lineWidth = state === "flying" ? 0.1 : 0.2;
    trace([from, to]); pen.stroke();
    if (lost) {
      const [x, y] = at(0.5);
      pen.setLineDash([]); pen.lineWidth = 0.3;
      for (const up of [0.8, -0.8]) { trace([[x - 0.8, y - up], [x + 0.8, y + up]]); pen.stroke(); }
    }
    if (state === "flying") {
      pen.beginPath(); pen.arc(...at(share), 0.55, 0, 2 * Math.PI);
      pen.fillStyle = C.link; pen.fill();
    }
  }
  pen.setLineDash([]);
}

function drawActors(poses) {
  for (const [name, [x, y, yaw]] of poses) {
    const [length, width] = data.actors[name].size, filled = name === shown.station;
    if (Math.max(length, width) < 1) {
      pen.beginPath(); pen.arc(x, y, 0.6, 0, 2 * Math.PI); pen.fillStyle = filled ? C.self : C.paper; pen.fill();
      pen.lineWidth = 0.22; pen.strokeStyle = C.ink; pen.stroke();
      continue;
    }
    drawBox([x, y, length, width, yaw], filled ? C.self : C.paper, C.ink, 0.14, filled ? 1 : 0.35);
    drawFront([x, y, yaw], length, width, filled ? C.paper : C.ink);
  }
}

function drawFront([x, y, yaw], length, width, color) {
  const bar = 0.28 * length, dx = Math.cos(yaw), dy = Math.sin(yaw);
  trace([[x + bar * dx - dy * width / 2, y + bar * dy + dx * width / 2], [x + bar * dx + dy * width / 2, y + bar * dy - dx * width / 2]]);
  pen.strokeStyle = color; pen.lineWidth = 0.2; pen.stroke();
}

/* Return the actors of the other run, with their poses, that differ from those of this run by 0.1 m or more. */
function otherPoses() {
  if (!other || !shown.layers.other) return [];
  return Object.keys(other.actors).map((name) => [name, poseOf(name, other)]).filter(([name, pose]) => {
    const here = pose && data.poses[name] && poseOf(name);
    return pose && !(here && Math.hypot(here[0] - pose[0], here[1] - pose[1]) < 0.1);
  });
}

/* Draw the actors of the other run as broken outlines with a halo. */
function drawOthers() {
  for (const [name, pose] of otherPoses()) {
    const length = Math.max(other.actors[name].size[0], 0.9), width = Math.max(other.actors[name].size[1], 0.9);
    const box = [pose[0], pose[1], length, width, pose[2]];
    drawBox(box, C.paper, C.paper, 0.55, 0);
    pen.setLineDash([0.7, 0.35]);
    drawBox(box, C.paper, C.self, 0.25, 0);
    pen.setLineDash([]);
    drawFront(pose, length, width, C.self);
  }
}

function outline([length, width], [x, y, yaw], at) {
  const cos = Math.abs(Math.cos(yaw)), sin = Math.abs(Math.sin(yaw));
  const across = (cos * length + sin * width) / 2, up = (sin * length + cos * width) / 2;
  return [...at(x - across, y + up), ...at(x + across, y - up)];
}

/* Return the area of a rectangle that others cover. */
const covered = ([left, top, right, bottom], others) => others.reduce((sum, [l, t, r, b]) =>
  sum + Math.max(0, Math.min(right, r) - Math.max(left, l)) * Math.max(0, Math.min(bottom, b) - Math.max(top, t)), 0);

/* Return whether a tenth of the smaller one of two rectangles is covered by the other. */
function covers(one, other) {
  const size = ([left, top, right, bottom]) => (right - left) * (bottom - top);
  return covered(one, [other]) > 0.1 * Math.min(size(one), size(other));
}

/* Return the rectangle of a label (right, left, above or below) that others cover least. */
function place(width, [left, top, right, bottom], others) {
  const middle = (left + right) / 2 - width / 2;
  const spots = [[right + 7, (top + bottom) / 2], [left - width - 7, (top + bottom) / 2], [middle, top - 11], [middle, bottom + 11]];
  return spots.map(([x, y]) => [x, y - 8, x + width, y + 8])
    .reduce((best, spot) => covered(spot, others) < covered(best, others) ? spot : best);
}

function writeLabel(text, left, middle) {
  pen.lineWidth = 3.5; pen.lineJoin = "round"; pen.strokeStyle = C.paper; pen.strokeText(text, left, middle);
  pen.fillStyle = C.self; pen.fillText(text, left, middle);
}

function labelOf(name, speed, run = data) {
  const value = contactsOf(name, run).length ? speedOf(name, run) : speed;
  return Math.abs(value) > 0.05 ? `${name}  ${value.toFixed(1)} m/s` : name;
}

/* Write the names and speeds of the actors of this run, and those of the other run where it has drawn them. */
function drawLabels(poses, at, area) {
  pen.font = "600 12.5px system-ui, sans-serif";
  pen.textBaseline = "middle";
  const entry = (run) => ([name, pose]) => ({ name, run, text: (run === other ? "B: " : "") + labelOf(name, pose[3], run),
                                              box: outline(run.actors[name].size, pose, at) });
  const entries = [...poses.map(entry(data)), ...otherPoses().map(entry(other))]
    .filter(({ box: [l, t, r, b] }) => r > 0 && l < area.width && b > 0 && t < area.height);
  const rank = ({ name }) => name === shown.station ? 0 : name in data.stations ? 1 : 2, labels = [];
  for (const labeled of entries.sort((one, next) => rank(one) - rank(next))) {
    const { text, box } = labeled, width = pen.measureText(text).width;
    const spot = place(width, box, [...entries.filter((each) => each !== labeled).map((each) => each.box), ...labels]);
    // In dense traffic a name would cover others; it is shown after zooming in
    if (rank(labeled) === 2 && labels.some((taken) => covers(spot, taken))) continue;
    labels.push(spot);
    writeLabel(text, spot[0], spot[1] + 8);
  }
}

/* Set the size of the canvas in device pixels and return its area in CSS pixels. */
function prepare() {
  const area = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  const width = Math.round(area.width * ratio), height = Math.round(area.height * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.globalAlpha = 1;
  return { width: area.width, height: area.height, ratio };
}

function drawTop() {
  const area = prepare(), { ratio } = area;
  const center = topView.follow && shown.station ? poseOf(shown.station) : null;
  if (center) { topView.x = center[0]; topView.y = center[1]; }
  const { scale, x: cx, y: cy } = topView;
  const at = (x, y) => [area.width / 2 + (x - cx) * scale, area.height / 2 - (y - cy) * scale];
  const poses = names.map((name) => [name, poseOf(name)]).filter(([, pose]) => pose);
  pen.fillStyle = C.ground;
  pen.fillRect(0, 0, area.width, area.height);
  pen.setTransform(scale * ratio, 0, 0, -scale * ratio, (area.width / 2 - cx * scale) * ratio, (area.height / 2 + cy * scale) * ratio);
  const across = area.width / 2 / scale, up = area.height / 2 / scale;
  drawRoads([cx - across, cy - up, cx + across, cy + up]);
  drawPath();
  drawMessages();
  for (const entry of perceivedBoxes()) drawPerceived(entry);
  if (shown.layers.truth) drawActors(poses); else drawActors(poses.filter(([name]) => name === shown.station));
  drawOthers();
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  if (shown.layers.labels) drawLabels(shown.layers.truth ? poses : poses.filter(([name]) => name === shown.station), at, area);
  drawScaleBar(area);
}

/* Draw a bar of a round length at the lower left. */
function drawScaleBar(area) {
  const rough = 110 / topView.scale, power = 10 ** Math.floor(Math.log10(rough));
  const length = [5, 2, 1].map((k) => k * power).find((value) => value <= rough) || power;
  const width = length * topView.scale, y = area.height - 16;
  pen.lineWidth = 2; pen.strokeStyle = C.ink;
  trace([[16, y - 5], [16, y], [16 + width, y], [16 + width, y - 5]]); pen.stroke();
  pen.font = "12px system-ui, sans-serif"; pen.textBaseline = "bottom";
  pen.fillStyle = C.ink; pen.fillText(`${length} m`, 20, y - 3);
}
