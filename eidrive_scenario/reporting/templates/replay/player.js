/* Player: time, controls, keyboard, layers, and the panels beside the street. */
const LAYERS = [["truth", "true boxes"], ["labels", "names"], ["own", "own detections"], ["fused", "fused objects, 95 % ellipse"],
                ["plan", "planned path"], ["messages", "messages"]];
let playing = false, startedAt = 0, startedFrom = 0, announced = 0;

function showTime(time) {
  if (last < 0) return;
  shown.time = Math.max(data.times[0], Math.min(data.times[last], time));
  shown.index = indexAt(shown.time);
  draw();
  showCursors();
  showPanels();
}

/* Stop, and show an instant. */
function seek(time) {
  pause();
  followEnd(false);
  showTime(time);
  announce();
}

function step(frames) { seek(data.times[Math.max(0, Math.min(last, shown.index + frames))]); }

/* Write the instant into the address, so that the address leads to it. */
function announce() {
  announced = Number(shown.time.toFixed(2));
  try { history.replaceState(null, "", "#t=" + announced); } catch (error) { /* not allowed for this address */ }
}

function fromAddress() {
  const match = /^#t=(\d+(?:\.\d+)?)$/.exec(location.hash);
  return match ? Number(match[1]) : null;
}

let panelIndex = -1, panelStation = null;
function showPanels() {
  element("slider").max = last;
  element("slider").value = shown.index;
  element("clock").textContent = shown.time.toFixed(2) + " s";
  if (shown.index === panelIndex && shown.station === panelStation) return;
  panelIndex = shown.index; panelStation = shown.station;
  element("slider").setAttribute("aria-valuetext", data.times[shown.index].toFixed(2) + " s");
  const known = element("known");
  known.textContent = "";
  const pose = data.poses[shown.station] && data.poses[shown.station][shown.index];
  const rows = !isPresent() ? [["", "absent"]] : [
    ["plan", (part("plan") || "none") + (part("braking") ? " (braking)" : "")],
    ...(pose ? [["speed", `${pose[3].toFixed(2)} m/s`]] : []),
    ["own detections", part("own").length],
    ...Object.entries(part("received")).map(([sender, boxes]) => ["from " + sender, boxes.length]),
    ["fused objects", part("fused").length],
  ];
  for (const [key, value] of rows) { make("dt", key, known); make("dd", value, known); }
  showChanges();
  showImages();
}

let marked = -1;
function showChanges() {
  const list = element("changes"), time = data.times[shown.index] + 1e-6;
  let latest = -1;
  for (const [i, [at]] of data.changes.entries()) if (at <= time) latest = i;
  if (latest === marked) return;
  marked = latest;
  for (const [i, item] of [...list.children].entries()) item.className = i <= latest ? "past" : "future";
  const item = list.children[latest];
  if (item) list.scrollTop = item.offsetTop - list.offsetTop - list.clientHeight / 2;
}

function showImages() {
  const cameras = data.images[shown.station], panel = element("camera-panel"), choice = element("camera");
  panel.hidden = !cameras;
  if (!cameras) return;
  if (choice.dataset.station !== shown.station) {
    choice.textContent = "";
    for (const name of Object.keys(cameras)) make("option", name, choice).value = name;
    choice.dataset.station = shown.station;
  }
  const { address, ticks } = cameras[choice.value], tick = data.ticks[shown.index];
  const newest = ticks.filter((number) => number <= tick).pop();
  const image = element("image"), source = newest === undefined ? "" : `${address}${String(newest).padStart(6, "0")}.jpg`;
  image.hidden = !source;
  if (source && image.dataset.source !== source) { image.dataset.source = source; image.setAttribute("src", source); }
  image.alt = source ? `camera ${choice.value} of ${shown.station} at ${shown.time.toFixed(2)} s` : "";
}

function pause() {
  if (playing) announce();
  playing = false;
  element("play").textContent = "Play";
}

/* Show the newest frame of a run in progress, or stay at the shown instant. */
function followEnd(on) {
  atEnd = on && running;
  if (element("at-end")) element("at-end").checked = atEnd;
}

function play() {
  if (running && shown.time >= data.times[last] - 1e-6) { followEnd(true); return; }
  followEnd(false);
  if (shown.time >= data.times[last] - 1e-6) showTime(data.times[0]);
  playing = true;
  element("play").textContent = "Pause";
  startedAt = performance.now();
  startedFrom = shown.time;
  requestAnimationFrame(advance);
}

function advance(now) {
  if (!playing) return;
  showTime(startedFrom + Math.max(0, now - startedAt) / 1000 * Number(element("rate").value));
  if (shown.time < data.times[last]) { requestAnimationFrame(advance); return; }
  pause();
  followEnd(true);
}

function selectView(view) {
  shown.view = view;
  element("view").value = view;
  canvas.setAttribute("aria-label", element("view").selectedOptions[0].textContent + " of the street");
  for (const id of ["fit", "following"]) element(id).disabled = view !== "top";
  draw();
}

function selectStation(name) {
  shown.station = name;
  element("station").value = name;
  for (const option of element("view").options) option.disabled = !name && option.value !== "top";
  if (!name && shown.view !== "top") selectView("top");
  layLayers();
  layCharts();
  showTime(shown.time);
}

/* Check boxes of the layers and of the senders whose messages the station receives. */
let laidLayers = "";
function layLayers() {
  const parent = element("layers"), received = [...(senders[shown.station] || [])];
  const layout = JSON.stringify([shown.station, received]);
  if (layout === laidLayers) return;
  laidLayers = layout;
  parent.textContent = "";
  const colors = { own: C.own, fused: C.fused, plan: C.link, messages: C.link };
  const add = (text, color, checked, change) => {
    const label = make("label", "", parent), box = make("input", "", label, { type: "checkbox", checked });
    box.onchange = () => { change(box.checked); draw(); };
    if (color) make("i", "", label, { className: "swatch" }).style.background = color;
    label.append(text);
  };
  for (const [key, text] of LAYERS) {
    if (!shown.station && ["own", "fused", "plan"].includes(key)) continue;
    add(text, colors[key], shown.layers[key], (on) => { shown.layers[key] = on; });
  }
  for (const sender of received) add("received from " + sender, senderColor(sender), !shown.hidden.has(sender),
    (on) => { if (on) shown.hidden.delete(sender); else shown.hidden.add(sender); });
}

/* Add the parts of the page that new frames contain. */
function grow() {
  const choice = element("station");
  for (const name of stations.slice(choice.options.length - 1)) choice.add(new Option(name, name), choice.options.length - 1);
  if (!shown.station && stations.length && !hasChosen) selectStation(stations[0]);
  document.querySelector(".stations").hidden = !stations.length;
  addChanges();
  showDecisive();
  layLayers();
  layCharts();
  if (running && !topView.follow && !hasMoved) fit();
}

let listed = 0;
function addChanges() {
  for (const [time, path, after, why] of data.changes.slice(listed)) {
    const item = make("li", "", element("changes"), { title: path, className: "future" });
    const button = make("button", `${time.toFixed(2)} s  ${path.split("/").pop()} → ${after}`, item, { type: "button" });
    if (why) make("span", why, button);
    button.onclick = () => seek(time);
  }
  listed = data.changes.length;
}

function showDecisive() {
  const decisive = element("decisive"), mark = element("mark");
  decisive.hidden = mark.hidden = !data.decisive;
  if (!data.decisive) return;
  const { time, text } = data.decisive;
  decisive.textContent = `Decisive instant${running ? " so far" : ""}: ${time.toFixed(2)} s`;
  decisive.title = mark.title = text;
  decisive.onclick = () => seek(time);
  mark.style.left = `${duration > 0 ? 100 * (time - data.times[0]) / duration : 0}%`;
}

/* Show the first frames. */
function begin() {
  for (const name of stations) if (!shown.station) shown.station = name;
  grow();
  follow(Boolean(shown.station) && (data.series[shown.station] || {}).speed !== undefined);
  selectStation(shown.station);
  fit();
  const linked = fromAddress();
  followEnd(linked === null);
  showTime(linked !== null ? linked : atEnd ? data.times[last] : data.decisive ? data.decisive.time : data.times[0]);
}

let hasChosen = false, hasMoved = false;
function setUp() {
  for (const [key] of LAYERS) shown.layers[key] = true;
  make("option", "ground truth only", element("station")).value = "";
  element("play").onclick = () => playing ? pause() : play();
  element("back").onclick = () => step(-1);
  element("forward").onclick = () => step(1);
  element("slider").oninput = (event) => seek(data.times[Number(event.target.value)]);
  element("rate").onchange = () => { if (playing) play(); };
  element("station").onchange = (event) => { hasChosen = true; selectStation(event.target.value); };
  element("view").onchange = (event) => selectView(event.target.value);
  element("camera").onchange = () => showImages();
  element("fit").onclick = () => { follow(false); fit(); draw(); };
  element("following").onchange = (event) => { follow(event.target.checked); draw(); };
}

function follow(on) { topView.follow = on; element("following").checked = on; }

const KEYS = {
  " ": () => playing ? pause() : play(),
  ArrowRight: (event) => event.shiftKey ? seek(shown.time + 1) : step(1),
  ArrowLeft: (event) => event.shiftKey ? seek(shown.time - 1) : step(-1),
  Home: () => seek(data.times[0]),
  End: () => { seek(data.times[last]); followEnd(true); },
  d: () => { if (data.decisive) seek(data.decisive.time); },
  f: () => { follow(!topView.follow); draw(); },
};
["top", "follow", "third", "driver"].forEach((view, i) => { KEYS[String(i + 1)] = () => { if (shown.station) selectView(view); }; });

addEventListener("keydown", (event) => {
  const tag = event.target.tagName;
  if (event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
  if (tag === "SELECT" || (["INPUT", "BUTTON", "SUMMARY"].includes(tag) && (event.key === " " || tag === "INPUT"))) return;
  event.preventDefault();
  KEYS[event.key](event);
});
canvas.addEventListener("wheel", (event) => {
  if (shown.view !== "top") return;
  event.preventDefault();
  hasMoved = true;
  topView.scale = Math.max(0.05, Math.min(200, topView.scale * Math.exp(-event.deltaY / 600)));
  draw();
}, { passive: false });
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  if (!event.buttons || shown.view !== "top") return;
  hasMoved = true;
  follow(false);
  topView.x -= event.movementX / topView.scale; topView.y += event.movementY / topView.scale;
  draw();
});
addEventListener("resize", () => { if (last >= 0) { layCharts(); draw(); } });
addEventListener("hashchange", () => { const time = fromAddress(); if (time !== null && time !== announced) seek(time); });

setUp();
