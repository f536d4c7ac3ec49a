/* Views in perspective: behind, above or inside the vehicle of the shown station. This drawing is shown where a browser
   has no WebGL, and until three.js is loaded. Its ground is level at height 0. */
const VIEWS = {
  follow: { back: 14, up: 6, ahead: 16, side: 0, field: 60 },
  third: { back: 22, up: 15, ahead: 9, side: 7, field: 55 },
  driver: { back: -0.2, up: null, ahead: 40, side: 0, field: 75 },
};
const needsStation = (view) => view in VIEWS;
const CLIP = 0.4, FAR_AWAY = 220;
const SIDES = [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]];
const EDGES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/* Return the camera of a view for a vehicle: its position, and its axes to the right, up and ahead. */
function cameraOf(view, [x, y, yaw], size) {
  const { back, up, ahead, side, field } = VIEWS[view], dx = Math.cos(yaw), dy = Math.sin(yaw);
  const height = up === null ? Math.max(1.25, 0.8 * size[2]) : up;
  const eye = [x - back * dx - side * dy, y - back * dy + side * dx, height];
  return cameraTo(eye, [x + ahead * dx, y + ahead * dy, up === null ? height - 1.2 : 0.5], field);
}

/* Return a camera at `eye` towards `look` with its horizontal field of view [degrees]. */
function cameraTo(eye, look, field) {
  const away = look.map((value, axis) => value - eye[axis]), long = Math.hypot(...away), forward = away.map((value) => value / long);
  const level = Math.max(Math.hypot(forward[0], forward[1]), 1e-6), right = [forward[1] / level, -forward[0] / level, 0];
  const up = [right[1] * forward[2], -right[0] * forward[2], right[0] * forward[1] - right[1] * forward[0]];
  return { eye, right, up, forward, field };
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/* Return a point in camera coordinates: right, up, depth. */
function seen(camera, point) {
  const offset = [point[0] - camera.eye[0], point[1] - camera.eye[1], (point[2] || 0) - camera.eye[2]];
  return [dot(offset, camera.right), dot(offset, camera.up), dot(offset, camera.forward)];
}

function between(a, b) {
  const share = (CLIP - a[2]) / (b[2] - a[2]);
  return [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), CLIP];
}

/* Return the part of a polygon or line in front of the camera. */
function clipped(points, closed) {
  const kept = [];
  for (let i = 0; i < points.length; i += 1) {
    const here = points[i], before = points[(i + points.length - 1) % points.length];
    if ((closed || i) && (here[2] >= CLIP) !== (before[2] >= CLIP)) kept.push(between(before, here));
    if (here[2] >= CLIP) kept.push(here);
  }
  return kept;
}

/* Return the functions that map camera coordinates to the canvas, and that trace the visible part of a line or polygon;
   the latter returns false without one. */
function projectionOf(camera, focal, area) {
  const flat = ([x, y, z]) => [area.width / 2 + focal * x / z, area.height / 2 - focal * y / z];
  const polygon = (points, closed) => {
    const visible = clipped(points.map((point) => seen(camera, point)), closed);
    if (visible.length < 2) return false;
    trace(visible.map(flat));
    if (closed) pen.closePath();
    return true;
  };
  return { flat, polygon };
}

/* Return the corners (8) of a box on the ground of height `base`: the bottom, then the top. */
function corners(x, y, length, width, yaw, height, base = 0) {
  const cos = Math.cos(yaw), sin = Math.sin(yaw), found = [];
  for (const z of [base, base + height]) for (const [u, v] of [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
    found.push([x + cos * u * length - sin * v * width, y + sin * u * length + cos * v * width, z]);
  return found;
}

function shade(color, share) {
  const value = parseInt(color.slice(1), 16);
  return "rgb(" + [value >> 16, (value >> 8) & 255, value & 255].map((part) => Math.round(part * share)).join(",") + ")";
}

function drawPerspective() {
  const own = shown.station && poseOf(shown.station);
  if (!own || !needsStation(shown.view)) { drawTop(); return; }
  const area = prepare(), camera = cameraOf(shown.view, own, data.actors[shown.station].size);
  const focal = area.width / 2 / Math.tan(camera.field * Math.PI / 360);
  const { polygon } = projectionOf(camera, focal, area);
  const horizon = area.height / 2 + focal * camera.forward[2] / Math.max(Math.hypot(camera.forward[0], camera.forward[1]), 1e-3);
  const sky = pen.createLinearGradient(0, 0, 0, Math.max(horizon, 1));
  sky.addColorStop(0, "#8fb7e3"); sky.addColorStop(1, "#e6eef6");
  pen.fillStyle = sky; pen.fillRect(0, 0, area.width, area.height);
  pen.fillStyle = "#dfe5d6"; pen.fillRect(0, horizon, area.width, area.height - horizon);
  const near = ({ area: [left, bottom, right, top] }) => Math.hypot(
    Math.max(left - camera.eye[0], 0, camera.eye[0] - right), Math.max(bottom - camera.eye[1], 0, camera.eye[1] - top)) < FAR_AWAY;
  for (const { lanes, lines } of levels) {
    for (const lane of lanes) if (near(lane) && polygon(lane.points, true)) { pen.fillStyle = lane.color; pen.fill(); }
    for (const line of lines) if (near(line)) drawMark(line, camera, polygon);
  }
  const path = shown.layers.plan && isPresent() ? part("path") : [];
  if (path.length > 1 && polygon(ribbon(path, 0.9), true)) {
    pen.fillStyle = part("braking") ? C.braking : C.plan; pen.globalAlpha = 0.55; pen.fill(); pen.globalAlpha = 1;
  }
  drawBodies(camera, polygon, near);
  drawOver(camera, focal, area);
}

/* Draw perceived boxes, messages and names over the picture.

   baseOf   height of the bottom of an actor [m]
   floorOf  height of the ground below a box [m] */
function drawOver(camera, focal, area, baseOf = () => 0, floorOf = () => 0) {
  const { flat, polygon } = projectionOf(camera, focal, area);
  for (const { box, color, kind } of perceivedBoxes()) drawWire(box, color, kind, camera, flat, floorOf(box));
  for (const { sender, receiver, state } of shown.layers.messages ? messagesNow() : []) drawLink(sender, receiver, state, polygon, baseOf);
  if (shown.layers.labels) drawNames(camera, flat, area, baseOf);
}

/* Draw a road mark as a strip, with 3 m strokes if it is broken. */
function drawMark({ broken, color, points }, camera, polygon) {
  pen.fillStyle = color;
  let begun = 0;
  for (let i = 1; i < points.length; i += 1) {
    const [a, b] = [points[i - 1], points[i]], length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    const at = (s) => [a[0] + (b[0] - a[0]) * s / length, a[1] + (b[1] - a[1]) * s / length];
    if (!broken) { if (length > 0 && polygon(ribbon([a, b], 0.16), true)) pen.fill(); continue; }
    for (let s = -(begun % 6); s < length; s += 6) {
      const from = Math.max(s, 0), to = Math.min(s + 3, length);
      const middle = at((from + to) / 2);
      if (to > from && Math.hypot(middle[0] - camera.eye[0], middle[1] - camera.eye[1]) < 90 && polygon(ribbon([at(from), at(to)], 0.16), true)) pen.fill();
    }
    begun += length;
  }
}

/* Return the outline of a line of a width. */
function ribbon(points, width) {
  const left = [], right = [];
  points.forEach(([x, y], i) => {
    const a = points[Math.max(i - 1, 0)], b = points[Math.min(i + 1, points.length - 1)];
    const long = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1, nx = -(b[1] - a[1]) / long * width / 2, ny = (b[0] - a[0]) / long * width / 2;
    left.push([x + nx, y + ny]); right.unshift([x - nx, y - ny]);
  });
  return [...left, ...right];
}

function drawBodies(camera, polygon, near) {
  const bodies = houses.filter(near).map(({ height, points }) => {
    const middle = points.reduce(([x, y], p) => [x + p[0] / points.length, y + p[1] / points.length], [0, 0]);
    return { middle, color: C.house, all: [...points.map(([x, y]) => [x, y, 0]), ...points.map(([x, y]) => [x, y, height])] };
  });
  for (const name of names) {
    const pose = poseOf(name);
    if (!pose || (shown.view === "driver" && name === shown.station) || (!shown.layers.truth && name !== shown.station)) continue;
    const [length, width, height] = data.actors[name].size;
    bodies.push({ middle: pose, color: name === shown.station ? "#334155" : "#aab4c3",
                  all: corners(pose[0], pose[1], length, width, pose[2], height) });
  }
  const away = ({ middle }) => Math.hypot(middle[0] - camera.eye[0], middle[1] - camera.eye[1]);
  for (const { all, color } of bodies.filter((body) => away(body) < FAR_AWAY).sort((a, b) => away(b) - away(a))) {
    for (const [number, side] of SIDES.entries()) {
      const [a, b, c] = side.map((k) => all[k]), u = b.map((v, k) => v - a[k]), w = c.map((v, k) => v - b[k]);
      let normal = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
      const inside = all.reduce((sum, p) => sum.map((v, k) => v + p[k] / 8), [0, 0, 0]);
      if (dot(normal, a.map((v, k) => v - inside[k])) < 0) normal = normal.map((v) => -v);
      if (dot(normal, camera.eye.map((v, k) => v - a[k])) <= 0 || !polygon(side.map((k) => all[k]), true)) continue;
      const level = Math.hypot(normal[0], normal[1]) || 1;
      pen.fillStyle = shade(color, number === 4 ? 1 : 0.72 + 0.13 * normal[1] / level);
      pen.strokeStyle = shade(color, 0.5); pen.lineWidth = 0.8; pen.fill(); pen.stroke();
    }
  }
}

function drawWire([x, y, length, width, yaw, height, existence], color, kind, camera, flat, base) {
  const dx = camera.eye[0] - x, dy = camera.eye[1] - y, cos = Math.cos(yaw), sin = Math.sin(yaw);
  if (Math.abs(cos * dx + sin * dy) < length / 2 && Math.abs(cos * dy - sin * dx) < width / 2) return;  // around the eye
  const points = corners(x, y, length, width, yaw, height, base).map((point) => seen(camera, point));
  pen.strokeStyle = color; pen.lineWidth = 1 + (typeof existence === "number" ? existence : 1);
  pen.setLineDash(kind === "fused" ? [6, 4] : []);
  for (const [i, k] of EDGES) {
    let [a, b] = [points[i], points[k]];
    if (a[2] < CLIP && b[2] < CLIP) continue;
    if (a[2] < CLIP) a = between(a, b); else if (b[2] < CLIP) b = between(b, a);
    trace([flat(a), flat(b)]); pen.stroke();
  }
  pen.setLineDash([]);
}

function drawLink(sender, receiver, state, polygon, baseOf) {
  const ends = [sender, receiver].map((name) => [poseOf(name), name]);
  if (!ends.every(([pose]) => pose)) return;
  const line = ends.map(([pose, name]) => [pose[0], pose[1], baseOf(name) + Math.max(data.actors[name].size[2], 1.5)]);
  pen.setLineDash(state === "lost" ? [8, 7] : state === "flying" ? [2, 5] : []);
  pen.strokeStyle = state === "lost" ? C.lost : C.link; pen.lineWidth = 2;
  if (polygon(line, false)) pen.stroke();
  pen.setLineDash([]);
}

/* Write the names of the actors, near ones first, without those that would cover another one. */
function drawNames(camera, flat, area, baseOf) {
  pen.font = "600 12px system-ui, sans-serif"; pen.textBaseline = "bottom";
  const taken = [];
  const points = names.filter((name) => name !== shown.station && shown.layers.truth && poseOf(name))
    .map((name) => { const pose = poseOf(name); return [name, pose[3], seen(camera, [pose[0], pose[1], baseOf(name) + data.actors[name].size[2] + 0.4])]; })
    .filter(([, , point]) => point[2] > 2 && point[2] < 120).sort((a, b) => a[2][2] - b[2][2]);
  for (const [name, speed, point] of points) {
    const [x, y] = flat(point), text = labelOf(name, speed), half = pen.measureText(text).width / 2;
    const hidden = taken.some(([u, v, other]) => Math.abs(u - x) < half + other + 3 && Math.abs(v - y) < 15);
    if (hidden || x < -50 || x > area.width + 50) continue;
    taken.push([x, y, half]);
    writeLabel(text, x - half, y);
  }
}
