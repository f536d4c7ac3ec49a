/* View in three dimensions by three.js: the models that the cameras of a run see, in its light. The picture is drawn on
   a canvas of its own and copied to that of the street; boxes, messages and names are drawn over it.
   World frame: x, y, z up, right-handed, relative to `origin` on the graphics card. */
const space = { state: "new", actors: new Map(), models: new Map(), sectors: new Map(), cameras: [], light: null, isDue: false };
/* Turn and zoom of the view behind or in a vehicle, and direction of the orbit [rad]. */
const turned = { azimuth: 0, elevation: 0, zoom: 1, view: "" }, orbit = { azimuth: -2.2, elevation: 0.6, field: 50 };
/* Elevations of the rings of the sky [degrees]. */
const RISES = [-6, 0, 3, 7, 12, 18, 25, 35, 50, 70, 90];
/* Distance of the sky, least and greatest half side of the area with shadows, and radius of sensors without a range [m]. */
const SKY = 1500, SHADOWS = 70, MOST_SHADOWS = 250, UNLIMITED = 60;
/* Maximum number of views from sensors in the list. */
const MOST_CAMERAS = 60;
const isMovable = (view) => ["top", "orbit"].includes(view);
const isFree = (view) => view === "orbit" || view.startsWith("camera ");

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

/* Load three.js, and build what stands still. Without WebGL, or without the file of three.js that the replays of a report
   share, the drawing in perspective remains. */
async function loadSpace() {
  space.state = "loading";
  try {
    const sources = await Promise.all(threeModules.map(inflate));
    const [core, main] = sources.map((bytes) => new TextDecoder().decode(bytes));
    const address = (text) => URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    space.three = await import(address(main.replaceAll("./three.core.min.js", address(core))));
    await buildSpace(space.three);
    space.state = "ready";
  } catch (error) {
    console.info("no view in three dimensions: " + error);
    space.state = "failed";
    for (const option of [...element("view").options]) if (isFree(option.value)) option.remove();
    if (isFree(shown.view)) selectView("top");
  }
  draw();
}

async function buildSpace(THREE) {
  // Tone curve of the cameras (Reinhard et al. 2002, eq. 4), and light through air (Koschmieder 1924)
  const chunk = THREE.ShaderChunk;
  chunk.tonemapping_pars_fragment = chunk.tonemapping_pars_fragment.replace(
    "vec3 CustomToneMapping( vec3 color ) { return color; }",
    "vec3 CustomToneMapping( vec3 color ) { return color * ( 1.0 + color / 16.0 ) / ( 1.0 + color ); }");
  chunk.fog_fragment = chunk.fog_fragment.replace("fogDensity * fogDensity * vFogDepth * vFogDepth", "fogDensity * vFogDepth");
  const renderer = new THREE.WebGLRenderer({ antialias: true, powerPreference: "high-performance" });
  renderer.toneMapping = THREE.CustomToneMapping;
  renderer.shadowMap.enabled = true;
  renderer.domElement.addEventListener("webglcontextlost", (event) => { event.preventDefault(); space.isLost = true; draw(); });
  renderer.domElement.addEventListener("webglcontextrestored", () => { space.isLost = false; draw(); });
  const scene = new THREE.Scene(), { street } = data, [left, bottom, right, top] = street.land.area;
  const solid = (options = {}) => new THREE.MeshLambertMaterial({ vertexColors: true, flatShading: true, ...options });
  const over = (factor) => ({ polygonOffset: true, polygonOffsetFactor: factor, polygonOffsetUnits: 4 * factor });
  Object.assign(space, {
    renderer, scene, camera: new THREE.PerspectiveCamera(60, 1, 0.25, 4000), paints: new Map(),
    origin: street.origin,
    materials: { solid: solid(), land: solid(over(4)), road: solid(), marking: solid(over(-2)) },
    sun: new THREE.DirectionalLight(), ambient: new THREE.HemisphereLight(), sky: skyMesh(THREE) });
  const { sun, ambient, sky, materials } = space;
  ambient.position.set(0, 0, 1);
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.bias = -0.0004; sun.shadow.normalBias = 0.04;
  scene.fog = new THREE.FogExp2(0xffffff, 0);
  scene.add(sun, sun.target, ambient, sky);
  const land = new THREE.PlaneGeometry(right - left, top - bottom);
  land.setAttribute("color", new THREE.Float32BufferAttribute([0, 1, 2, 3].flatMap(() => street.land.color), 3));
  addStill(new THREE.Mesh(land, materials.land), [0, 0, street.land.z], false);
  if (street.surfaces) {
    const parts = await decode(street.surfaces), isMarking = ([kind]) => kind.startsWith("marking");
    if (!street.level) indexGround(parts);
    addStill(new THREE.Mesh(geometry(THREE, parts, isMarking), [materials.road, materials.marking]), [0, 0, 0], false);
  }
  if (street.houses) addStill(new THREE.Mesh(geometry(THREE, await decode(street.houses)), materials.solid), [0, 0, 0]);
  for (const [model, poses] of street.objects) {
    const mesh = new THREE.InstancedMesh(geometry(THREE, await decode(model)), materials.solid, poses.length);
    const turn = new THREE.Matrix4(), [ox, oy] = space.origin;
    for (const [i, [x, y, z, yaw]] of poses.entries()) mesh.setMatrixAt(i, turn.makeRotationZ(yaw).setPosition(x - ox, y - oy, z));
    addStill(mesh, [0, 0, 0]);
  }
  space.path = new THREE.Mesh(new THREE.BufferGeometry(), overlay(THREE, 0.6));
  space.path.frustumCulled = false;
  scene.add(space.path);
}

function addStill(mesh, place, casts = true) {
  mesh.position.set(...place);
  mesh.receiveShadow = true; mesh.castShadow = casts; mesh.matrixAutoUpdate = false;
  mesh.updateMatrix();
  space.scene.add(mesh);
}

/* Translucent material just above the road. */
const overlay = (THREE, opacity, color = "#ffffff") => new THREE.MeshBasicMaterial({
  color, opacity, transparent: true, depthWrite: false, toneMapped: false, fog: false, side: THREE.DoubleSide,
  polygonOffset: true, polygonOffsetFactor: -4, polygonOffsetUnits: -16 });

/* Return the parts of a model of the page: material, color, points (3 V) [m], and corners (3 F). */
async function decode({ parts, data: text }) {
  const numbers = new Int32Array(await inflate(text));
  let at = 0;
  const rows = (count, read) => {
    const found = new Array(3 * count);
    for (let row = 0; row < 3; row += 1)
      for (let i = 0, sum = 0; i < count; i += 1) found[3 * i + row] = read(sum += numbers[at++]);
    return found;
  };
  return parts.map(([material, color, vertices, triangles]) => [
    material, color, rows(vertices, (value) => value / 1000), rows(triangles, (value) => value)]);
}

/* Return the geometry of parts; those for which `isSecond` is true have the second material of the mesh. */
function geometry(THREE, parts, isSecond = () => false) {
  const made = new THREE.BufferGeometry(), positions = [], colors = [], corners = [];
  const ordered = [...parts.filter((part) => !isSecond(part)), ...parts.filter(isSecond)];
  let first = 0, begun = 0;
  for (const [, color, points, faces] of ordered) {
    for (const value of points) positions.push(value);
    for (let i = 0; i < points.length; i += 3) colors.push(...color);
    for (const corner of faces) corners.push(first + corner);
    first += points.length / 3;
  }
  for (const [material, chosen] of [[0, (part) => !isSecond(part)], [1, isSecond]]) {
    const count = parts.filter(chosen).reduce((sum, part) => sum + part[3].length, 0);
    if (count) made.addGroup(begun, count, material);
    begun += count;
  }
  made.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
  made.setAttribute("color", new THREE.Float32BufferAttribute(colors, 3));
  made.setIndex(corners);
  return made;
}

/* Return a hemisphere with the texture coordinates of the image of the sky. */
function skyMesh(THREE) {
  const turns = 48, positions = [], places = [], corners = [];
  for (const rise of RISES) for (let i = 0; i < turns; i += 1) {
    const turn = 2 * Math.PI * i / turns, up = rise * Math.PI / 180, [x, y, z] = [Math.cos(up) * Math.cos(turn), Math.cos(up) * Math.sin(turn), Math.sin(up)];
    const level = Math.max(z, 0), long = Math.hypot(x, y) || 1, reach = Math.sqrt(1 - level * level) / (1 + level) / long * 0.495;
    positions.push(SKY * x, SKY * y, SKY * z);
    places.push(0.5 + x * reach, 0.5 - y * reach);
  }
  for (let ring = 0; ring + 1 < RISES.length; ring += 1) for (let i = 0; i < turns; i += 1) {
    const [a, b] = [ring * turns + i, ring * turns + (i + 1) % turns];
    corners.push(a, b, b + turns, a, b + turns, a + turns);
  }
  const made = new THREE.BufferGeometry();
  made.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
  made.setAttribute("uv", new THREE.Float32BufferAttribute(places, 2));
  made.setIndex(corners);
  const mesh = new THREE.Mesh(made, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, depthWrite: false, fog: false, toneMapped: false }));
  mesh.renderOrder = -1; mesh.frustumCulled = false;
  return mesh;
}

/* Triangles of roads by cell of 5 m, for roads that are not level: key, corners. */
let ground = null;
function indexGround(parts) {
  ground = new Map();
  for (const [, , points, faces] of parts) for (let i = 0; i < faces.length; i += 3) {
    const triangle = [0, 1, 2].map((k) => [0, 1, 2].map((axis) => points[3 * faces[i + k] + axis] + space.origin[axis]));
    const cells = [0, 1].map((axis) => triangle.map((corner) => Math.floor(corner[axis] / 5)));
    for (let u = Math.min(...cells[0]); u <= Math.max(...cells[0]); u += 1) for (let v = Math.min(...cells[1]); v <= Math.max(...cells[1]); v += 1) {
      const key = u + " " + v;
      if (!ground.has(key)) ground.set(key, []);
      ground.get(key).push(triangle);
    }
  }
}

/* Return the height of the road at a point that is nearest to the height `near`, or `near` beside roads [m]. */
function groundAt(x, y, near) {
  let best = null;
  for (const [a, b, c] of ground ? ground.get(Math.floor(x / 5) + " " + Math.floor(y / 5)) || [] : []) {
    const area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    const v = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area;
    const w = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area;
    if (!(v >= -1e-6 && w >= -1e-6 && v + w <= 1 + 1e-6)) continue;
    const z = a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2]);
    if (best === null || Math.abs(z - near) < Math.abs(best - near)) best = z;
  }
  return best === null ? near : best;
}

/* Return height of the bottom of an actor [m], pitch and roll at the shown time. */
function stanceOf(name) {
  const { time, index } = shown, poses = data.poses[name], from = poses[index], to = poses[index + 1] || from;
  const step = data.times[index + 1] - data.times[index], share = step > 0 ? Math.min(1, Math.max(0, (time - data.times[index]) / step)) : 0;
  if (!from || Math.hypot(to[0] - from[0], to[1] - from[1]) > 8) return [0, 0, 0];
  return [4, 5, 6].map((k) => (from[k] || 0) + share * ((to[k] || 0) - (from[k] || 0)));
}
const baseOf = (name) => stanceOf(name)[0];

/* Draw once more when what was missing is there. */
function drawSoon() {
  if (space.isDue) return;
  space.isDue = true;
  requestAnimationFrame(() => { space.isDue = false; draw(); });
}

/* Return the geometry of a model of the page, null while it is unpacked. */
function modelGeometry(number) {
  if (!space.models.has(number)) {
    space.models.set(number, null);
    const source = data.models[number];
    decode(source).then((parts) => {
      space.models.set(number, geometry(space.three, parts, ([material]) => material === "paint"));
      drawSoon();
    });
  }
  return space.models.get(number);
}

/* Return the mesh of an actor, a box for an actor without a model. */
function actorMesh(name) {
  const { three: THREE, actors, materials, paints } = space, { model, paint, size } = data.actors[name];
  if (!actors.has(name)) {
    const shape = model === null || model === undefined ? new THREE.BoxGeometry(...size).translate(0, 0, size[2] / 2) : modelGeometry(model);
    if (!shape) return null;
    const key = String(paint || [0.5, 0.5, 0.5]);
    if (!paints.has(key)) paints.set(key, new THREE.MeshPhongMaterial({
      color: new THREE.Color(...key.split(",").map(Number)), specular: new THREE.Color(0.05, 0.05, 0.05), shininess: 60, flatShading: true }));
    const mesh = new THREE.Mesh(shape, shape.groups.length === 2 ? [materials.solid, paints.get(key)] : paints.get(key));
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.rotation.order = "ZYX";
    space.scene.add(mesh);
    actors.set(name, mesh);
  }
  return actors.get(name);
}

function placeActors() {
  const [ox, oy] = space.origin;
  for (const name of names) {
    const pose = poseOf(name), isInside = name === shown.station && shown.view === "driver" || name === cameraShown()[0];
    const isShown = pose && !isInside && (shown.layers.truth || name === shown.station);
    if (!isShown) { if (space.actors.has(name)) space.actors.get(name).visible = false; continue; }
    const mesh = actorMesh(name), [base, pitch, roll] = stanceOf(name);
    if (!mesh) continue;
    mesh.visible = true;
    mesh.position.set(pose[0] - ox, pose[1] - oy, base);
    mesh.rotation.set(roll, pitch, pose[2]);
  }
}

/* Set sun and sky to those of the shown time, with shadows around a point up to `half` [m]. */
function lightUp([focus, half]) {
  const { three: THREE, sun, ambient, sky, scene, materials } = space;
  const light = data.light.findLast(({ time }) => time <= shown.time + 1e-6) || data.light[0];
  if (light && light !== space.light) {
    space.light = light;
    const tone = (value) => value * (1 + value / 16) / (1 + value);
    sun.color.setRGB(...light.sun); ambient.color.setRGB(...light.sky); ambient.groundColor.setRGB(...light.ground);
    sun.visible = light.sun.some((value) => value > 0);
    sun.castShadow = light.towards[2] > 0.03;
    scene.fog.color.setRGB(...light.air.map(tone)); scene.fog.density = light.extinction;
    for (const name of ["road", "marking"]) materials[name].color.setScalar(light.wet);
    if (sky.material.map) sky.material.map.dispose();
    sky.material.map = new THREE.TextureLoader().load(light.dome, drawSoon);
    sky.material.map.colorSpace = THREE.SRGBColorSpace;
    sky.material.needsUpdate = true;
  }
  if (!light) return;
  // Whole meters, so that shadows do not flicker while the view moves
  const place = focus.map((value, axis) => Math.round(value - space.origin[axis]));
  sun.target.position.set(...place);
  sun.position.set(...place.map((value, axis) => value + 400 * light.towards[axis]));
  Object.assign(sun.shadow.camera, { left: -half, right: half, bottom: -half, top: half, near: 1, far: 800 });
  sun.shadow.camera.updateProjectionMatrix();
}

/* Return station and sensor from which the street is shown, empty for other views. */
const cameraShown = () => shown.view.startsWith("camera ") ? space.cameras[Number(shown.view.slice(7))] || [] : [];

/* Add the views from cameras, and from the sensors of masts, to the list. */
function addCameraViews() {
  const choice = element("view");
  for (const [name, { category, sensors = [] }] of Object.entries(data.actors)) for (const sensor of sensors) {
    const isListed = space.cameras.some(([station, [other]]) => station === name && other === sensor[0]);
    if (isListed || (sensor[1] !== "camera" && category !== "misc") || space.cameras.length >= MOST_CAMERAS || space.state === "failed") continue;
    choice.add(new Option(`${sensor[0]} of ${name}`, `camera ${space.cameras.length}`));
    space.cameras.push([name, sensor]);
  }
}

const limit = (value, least, most) => Math.min(most, Math.max(least, value));

/* Return the camera of the shown view; null if its actor is absent. */
function cameraOfView(area) {
  if (shown.view === "orbit") return orbitCamera(area);
  const [station, sensor] = cameraShown(), name = station || shown.station, pose = name && poseOf(name);
  if (!pose) return null;
  const [base, pitch] = stanceOf(name), [x, y, yaw] = pose, rise = -Math.tan(limit(pitch, -1, 1));
  const at = (ahead, left, up) => [x + ahead * Math.cos(yaw) - left * Math.sin(yaw), y + ahead * Math.sin(yaw) + left * Math.cos(yaw),
                                   base + rise * ahead + up];
  if (sensor) {
    const [, , ahead, left, up, turn, down, angle] = sensor;
    const look = at(ahead + Math.cos(turn), left + Math.sin(turn), up - Math.tan(limit(down, -1.5, 1.5)));
    return cameraTo(at(ahead, left, up), look, Math.min(angle * 180 / Math.PI, 100));
  }
  if (turned.view !== shown.view) Object.assign(turned, { azimuth: 0, elevation: 0, zoom: 1, view: shown.view });
  const { back, up, ahead, side, field } = VIEWS[shown.view], { azimuth, elevation, zoom } = turned;
  if (up === null) {
    const height = Math.max(1.25, 0.8 * data.actors[name].size[2]), down = limit(0.03 - elevation, -1.2, 1.2), far = 10;
    return cameraTo(at(-back, side, height), at(-back + far * Math.cos(azimuth), side + far * Math.sin(azimuth), height - far * Math.tan(down)),
                    limit(field * zoom, 15, 100));
  }
  // Behind the vehicle: around a point 1 m above the ground
  const around = Math.atan2(side, -back) + azimuth, high = limit(Math.atan2(up - 1, Math.hypot(back, side)) + elevation, 0.01, 1.5);
  const away = zoom * Math.hypot(back, side, up - 1), level = away * Math.cos(high);
  return cameraTo(at(level * Math.cos(around), level * Math.sin(around), 1 + away * Math.sin(high)),
                  at(ahead * zoom * Math.cos(azimuth), ahead * zoom * Math.sin(azimuth), 0.5), field);
}

function orbitCamera(area) {
  const center = topView.follow && shown.station ? poseOf(shown.station) : null;
  if (center) { topView.x = center[0]; topView.y = center[1]; }
  const away = area.width / topView.scale / 2 / Math.tan(orbit.field * Math.PI / 360), level = away * Math.cos(orbit.elevation);
  const look = [topView.x, topView.y, groundAt(topView.x, topView.y, center ? baseOf(shown.station) : 0)];
  return cameraTo([look[0] + level * Math.cos(orbit.azimuth), look[1] + level * Math.sin(orbit.azimuth), look[2] + away * Math.sin(orbit.elevation)],
                  look, orbit.field);
}

/* Return the point on the ground on which a camera is centered, if it is near, and the reach of shadows around it [m]. */
function focusOf({ eye, forward }) {
  const height = Math.max(eye[2] - groundAt(eye[0], eye[1], eye[2] - 2), 1), most = Math.max(SHADOWS - 10, 2 * height);
  const away = forward[2] < -0.01 ? Math.min(height / -forward[2], most) : most;
  return [eye.map((value, axis) => value + away * forward[axis]), Math.round(Math.min(Math.max(SHADOWS, away), MOST_SHADOWS))];
}

function drawPlan() {
  const { path, origin: [ox, oy] } = space, points = shown.layers.plan && isPresent() ? part("path") : [];
  path.visible = points.length > 1;
  if (!path.visible) return;
  const near = baseOf(shown.station), sides = ribbon(points, 0.9), positions = [], corners = [];
  for (let i = 0; i < points.length; i += 1) for (const [x, y] of [sides[i], sides[sides.length - 1 - i]])
    positions.push(x - ox, y - oy, groundAt(x, y, near) + 0.05);
  for (let i = 0; i + 1 < points.length; i += 1) corners.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 2, 2 * i + 1, 2 * i + 3);
  path.geometry.dispose();
  path.geometry = new space.three.BufferGeometry();
  path.geometry.setAttribute("position", new space.three.Float32BufferAttribute(positions, 3));
  path.geometry.setIndex(corners);
  path.material.color.set(part("braking") ? C.braking : C.plan);
}

/* Yield station, number and outline of each sensor of the shown station, or without one of all: points in the frame of the
   actor. */
function* sectorsShown() {
  if (!shown.layers.sensors) return;
  for (const name of shown.station ? [shown.station] : stations) {
    if (!data.actors[name] || !poseOf(name)) continue;
    for (const [number, [, , x, y, , yaw, , angle, range]] of (data.actors[name].sensors || []).entries()) {
      const steps = Math.max(2, Math.ceil(angle / 0.1)), isWhole = angle > 6.28, points = isWhole ? [] : [[x, y]];
      for (let i = 0; i <= steps; i += 1) {
        const turn = yaw + angle * (i / steps - 0.5), away = range || UNLIMITED;
        points.push([x + away * Math.cos(turn), y + away * Math.sin(turn)]);
      }
      yield { name, number, points };
    }
  }
}

function placeSectors() {
  const { three: THREE, scene, sectors, origin: [ox, oy] } = space, present = new Set();
  for (const { name, number, points } of sectorsShown()) {
    const key = name + "\n" + number, pose = poseOf(name);
    present.add(key);
    if (!sectors.has(key)) {
      const group = new THREE.Group(), outline = points.map(([x, y]) => new THREE.Vector2(x, y));
      group.add(new THREE.Mesh(new THREE.ShapeGeometry(new THREE.Shape(outline)), overlay(THREE, 0.06, C.own)),
                new THREE.LineLoop(new THREE.BufferGeometry().setFromPoints(outline),
                                   new THREE.LineBasicMaterial({ color: C.own, toneMapped: false, fog: false })));
      scene.add(group);
      sectors.set(key, group);
    }
    sectors.get(key).position.set(pose[0] - ox, pose[1] - oy, baseOf(name) + 0.08);
    sectors.get(key).rotation.z = pose[2];
  }
  for (const [key, group] of sectors) {
    if (present.has(key)) continue;
    scene.remove(group);
    for (const child of group.children) { child.geometry.dispose(); child.material.dispose(); }
    sectors.delete(key);
  }
}

/* Draw the ranges of sensors in the top view. */
function drawSectors(area) {
  const { scale, x: cx, y: cy } = topView;
  pen.fillStyle = pen.strokeStyle = C.own; pen.lineWidth = 1;
  for (const { name, points } of sectorsShown()) {
    const [x, y, yaw] = poseOf(name), cos = Math.cos(yaw), sin = Math.sin(yaw);
    trace(points.map(([u, v]) => [area.width / 2 + (x + cos * u - sin * v - cx) * scale, area.height / 2 - (y + sin * u + cos * v - cy) * scale]));
    pen.closePath();
    pen.globalAlpha = 0.07; pen.fill(); pen.globalAlpha = 0.5; pen.stroke();
  }
  pen.globalAlpha = 1;
}

/* Draw the street in three dimensions. Return false if that is not possible, or not yet. */
function drawSpace() {
  if (space.state === "new") loadSpace();
  if (space.state !== "ready" || space.isLost) return false;
  const area = prepare(), camera = cameraOfView(area), { three: THREE, renderer, scene, origin } = space;
  if (!camera) return false;
  const share = Math.min(1, 2 / area.ratio), size = renderer.getSize(new THREE.Vector2());
  const width = Math.max(1, Math.round(canvas.width * share)), height = Math.max(1, Math.round(canvas.height * share));
  if (size.x !== width || size.y !== height) renderer.setSize(width, height, false);
  const { eye, right, up, forward, field } = camera, focal = area.width / 2 / Math.tan(field * Math.PI / 360), lens = space.camera;
  lens.fov = 2 * Math.atan(area.height / 2 / focal) * 180 / Math.PI;
  lens.aspect = area.width / area.height;
  lens.position.set(...eye.map((value, axis) => value - origin[axis]));
  lens.rotation.setFromRotationMatrix(new THREE.Matrix4().makeBasis(
    new THREE.Vector3(...right), new THREE.Vector3(...up), new THREE.Vector3(...forward).negate()));
  lens.updateProjectionMatrix();
  space.sky.position.copy(lens.position);
  placeActors();
  drawPlan();
  placeSectors();
  lightUp(focusOf(camera));
  renderer.render(scene, lens);
  pen.drawImage(renderer.domElement, 0, 0, area.width, area.height);
  const near = shown.station && poseOf(shown.station) ? baseOf(shown.station) : 0;
  drawOver(camera, focal, area, baseOf, ([x, y]) => groundAt(x, y, near));
  return true;
}

function draw() {
  if (shown.view === "top") { drawTop(); drawSectors(canvas.getBoundingClientRect()); } else if (!drawSpace()) drawPerspective();
}

/* Pointers on the street, by number: a drag moves the top view and turns others; two pointers move and zoom, the right
   button and shift move. The top view is that from the south. */
const pointers = new Map();
function moveView(dx, dy) {
  if (!isMovable(shown.view)) return;
  follow(false);
  const azimuth = shown.view === "top" ? -Math.PI / 2 : orbit.azimuth, [cos, sin] = [Math.cos(azimuth), Math.sin(azimuth)];
  topView.x += (dx * sin - dy * cos) / topView.scale; topView.y += (-dx * cos - dy * sin) / topView.scale;
}
function turnView(dx, dy) {
  const view = shown.view === "orbit" ? orbit : turned, sign = shown.view === "driver" ? 1 : -1;
  view.azimuth += sign * dx / 200;
  view.elevation = limit(view.elevation - sign * dy / 200, shown.view === "orbit" ? 0.03 : -1.5, 1.55);
}
function zoomView(factor) {
  if (isMovable(shown.view)) topView.scale = limit(topView.scale * factor, 0.05, 200);
  else turned.zoom = limit(turned.zoom / factor, 0.3, 12);
}
canvas.addEventListener("pointerdown", (event) => pointers.set(event.pointerId, [event.clientX, event.clientY]));
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before || last < 0) return;
  const now = [event.clientX, event.clientY], [dx, dy] = now.map((value, axis) => value - before[axis]);
  const other = [...pointers].find(([number]) => number !== event.pointerId);
  pointers.set(event.pointerId, now);
  hasMoved = true;
  if (other) {
    const away = (point) => Math.max(Math.hypot(point[0] - other[1][0], point[1] - other[1][1]), 1);
    zoomView(away(now) / away(before));
    moveView(dx / 2, dy / 2);
  } else if (shown.view === "top" || event.buttons & 2 || event.shiftKey) moveView(dx, dy); else turnView(dx, dy);
  draw();
});
canvas.addEventListener("wheel", (event) => {
  if (last < 0) return;
  event.preventDefault();
  hasMoved = true;
  zoomView(Math.exp(-event.deltaY / 600));
  draw();
}, { passive: false });
canvas.addEventListener("contextmenu", (event) => { if (shown.view !== "top") event.preventDefault(); });
