/* Player: time, controls, keyboard, layers, and the panels beside the street. */
/* Layers: key, and its signs of the legend with their texts. */
const LAYERS = [["truth", ["", "true boxes"]], ["labels", ["", "names and speeds"]], ["own", ["box own", "own detections"]],
                ["fused", ["box fused", "fused objects, 95 % ellipse"]], ["plan", ["band plan", "planned path"], ["band braking", "if it brakes"]],
                ["messages", ["line link", "messages"], ["line lost", "lost ones"]],
                ["sensors", ["band ranges", "sensor ranges"]], ...(other ? [["other", ["box other", "run B"]]] : [])];
let playing = false, startedAt = 0, startedFrom = 0, announced = 0;

function showTime(time) {
  if (last < 0) return;
  shown.time = Math.max(data.times[0], Math.min(instants[instants.length - 1], time));
  shown.index = indexAt(shown.time);
  if (other) shown.otherIndex = indexAt(shown.time, other.times);
  draw();
  showCursors();
  showPanels();
}

/* Stop, and show an instant. Before the first frame there is none. */
function seek(time) {
  if (last < 0) return;
  pause();
  followEnd(false);
  showTime(time);
  announce();
}

function step(frames) { seek(instants[Math.max(0, Math.min(instants.length - 1, indexAt(shown.time, instants) + frames))]); }

/* Write the instant into the address, so that the address leads to it. */
function announce() {
  announced = Number(shown.time.toFixed(2));
  try { history.replaceState(null, "", "#t=" + announced); } catch (error) { /* not allowed for this address */ }
}

function fromAddress() {
  const match = /^#t=(\d+(?:\.\d+)?)$/.exec(location.hash);
  return match ? Number(match[1]) : null;
}

function showSlider() {
  element("slider").max = instants.length - 1;
  element("slider").value = indexAt(shown.time, instants);
}

let panelState = "";
function showPanels() {
  showSlider();
  element("clock").textContent = shown.time.toFixed(2) + " s";
  const { station } = shown, state = JSON.stringify([element("slider").value, shown.index, station]);
  followMessages();
  if (state === panelState) return;
  panelState = state;
  element("slider").setAttribute("aria-valuetext", shown.time.toFixed(2) + " s");
  const known = element("known"), speed = speedOf(station), contacts = contactsOf(station);
  known.textContent = "";
  const rows = !isPresent() ? [["", "absent"]] : [
    ...(!running && shown.time > endOf(data) + 1e-6 ? [["end", "run A has ended"]] : []),
    ["plan", (part("plan") || "none") + (part("braking") ? " (braking)" : "")],
    ...(speed !== null ? [["speed", `${speed.toFixed(2)} m/s${contacts.length ? " before the contact" : ""}`]] : []),
    ...contacts.map(([, first, second, impact]) =>
      ["contact", `with ${first === station ? second : first}${impact === null ? "" : ` at ${impact.toFixed(1)} m/s`}`]),
    ["own detections", part("own").length],
    ...Object.entries(part("received")).map(([sender, boxes]) => ["from " + sender, boxes.length]),
    ["fused objects", part("fused").length],
  ];
  for (const [key, value] of rows) { make("dt", key, known); make("dd", value, known); }
  for (const run of other ? runs : []) element("end-" + letterOf(run)).hidden = shown.time <= endOf(run) + 1e-6;
  showChanges();
  showImages();
}

let marked = -1;
function showChanges() {
  const list = element("changes"), time = data.times[shown.index] + 1e-6;
  const latest = changeTimes.length && changeTimes[0] <= time ? indexAt(time, changeTimes) : -1;
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
  if (last < 0) return;
  const end = instants[instants.length - 1] - 1e-6;
  if (running && shown.time >= end) { followEnd(true); return; }
  followEnd(false);
  if (shown.time >= end) showTime(data.times[0]);
  playing = true;
  element("play").textContent = "Pause";
  startedAt = performance.now();
  startedFrom = shown.time;
  requestAnimationFrame(advance);
}

function advance(now) {
  if (!playing) return;
  showTime(startedFrom + Math.max(0, now - startedAt) / 1000 * Number(element("rate").value));
  if (shown.time < instants[instants.length - 1]) { requestAnimationFrame(advance); return; }
  pause();
  followEnd(true);
}

function selectView(view) {
  shown.view = view;
  element("view").value = view;
  canvas.setAttribute("aria-label", element("view").selectedOptions[0].textContent + " of the street");
  for (const id of ["fit", "following"]) element(id).disabled = !isMovable(view);
  draw();
}

function selectStation(name) {
  shown.station = name;
  element("station").value = name;
  for (const option of element("view").options) option.disabled = !name && needsStation(option.value);
  if (!name && needsStation(shown.view)) selectView("top");
  layLayers();
  layTime();
  layMessages();
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
  const add = (signs, checked, change) => {
    const label = make("label", "", parent), box = make("input", "", label, { type: "checkbox", checked });
    box.onchange = () => { change(box.checked); draw(); };
    for (const [sign, text, color] of signs) {
      if (sign) make("i", "", label, { className: "sign " + sign }).style.setProperty("--sign", color || "");
      make("span", text, label);
    }
  };
  for (const [key, ...signs] of LAYERS) {
    if (!shown.station && ["own", "fused", "plan"].includes(key)) continue;
    add(signs, shown.layers[key], (on) => { shown.layers[key] = on; });
  }
  for (const sender of received) add([["box", "received from " + sender, senderColor(sender)]], !shown.hidden.has(sender),
    (on) => { if (on) shown.hidden.delete(sender); else shown.hidden.add(sender); });
}

/* Add the parts of the page that new frames contain. */
function grow() {
  const choice = element("station");
  addCameraViews();
  for (const name of stations.slice(choice.options.length - 1)) choice.add(new Option(name, name), choice.options.length - 1);
  if (!shown.station && stations.length && !hasChosen) selectStation(stations[0]);
  document.querySelector(".stations").hidden = !stations.length;
  addChanges();
  showSlider();
  showDecisive();
  layLayers();
  layTime();
  layMessages();
  if (running && !topView.follow && !hasMoved) fit();
}

/* Changes of one instant are one entry of the list, which opens. */
let listed = 0, changeTimes = [];
function addChanges() {
  const list = element("changes");
  for (const [time, path, name, after, why] of data.changes.slice(listed)) {
    if (changeTimes[changeTimes.length - 1] !== time) {
      changeTimes.push(time);
      make("summary", "", make("details", "", make("li", "", list, { className: "future" }))).onclick = () => seek(time);
      marked = -1;
    }
    const details = list.lastElementChild.firstElementChild, line = make("p", `${name} → ${after}`, details, { title: path });
    if (why) make("span", why, line);
    const count = details.children.length - 1;
    details.open = count === 1;
    details.firstElementChild.textContent = `${time.toFixed(2)} s` + (count > 1 ? ` ${count} changes` : "");
  }
  listed = data.changes.length;
}

function showDecisive() {
  const decisive = element("decisive"), mark = element("mark");
  decisive.hidden = mark.hidden = !data.decisive;
  if (!data.decisive) return;
  const { time, text } = data.decisive;
  decisive.textContent = `Decisive instant${other ? " of A" : ""}${running ? " so far" : ""}: ${time.toFixed(2)} s`;
  decisive.title = mark.title = text;
  decisive.onclick = () => seek(time);
  mark.style.left = percent(instants.length > 1 ? indexAt(time, instants) / (instants.length - 1) : 0);
}

/* Show the first frames. */
function begin() {
  for (const name of stations) if (!shown.station) shown.station = name;
  grow();
  follow(Boolean(shown.station) && (data.series[shown.station] || {}).speed !== undefined);
  selectStation(shown.station);
  fit();
  const linked = fromAddress();
  followEnd(atEnd && linked === null);
  showTime(linked !== null ? linked : atEnd ? data.times[last] : data.decisive ? data.decisive.time : data.times[0]);
}

let hasChosen = false, hasMoved = false;
function setUp() {
  for (const [key] of LAYERS) shown.layers[key] = true;
  make("option", "ground truth only", element("station")).value = "";
  element("play").onclick = () => playing ? pause() : play();
  element("back").onclick = () => step(-1);
  element("forward").onclick = () => step(1);
  element("slider").oninput = (event) => seek(instants[Number(event.target.value)]);
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
  End: () => { seek(instants[instants.length - 1]); followEnd(true); },
  d: () => { if (data.decisive) seek(data.decisive.time); },
  f: () => { follow(!topView.follow); draw(); },
};
["top", "follow", "third", "driver", "orbit"].forEach((view, i) => {
  KEYS[String(i + 1)] = () => { if ([...element("view").options].some(({ value, disabled }) => value === view && !disabled)) selectView(view); };
});

addEventListener("keydown", (event) => {
  const { tagName, type } = event.target;
  if (event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
  // Keys that the focused control uses itself
  if (tagName === "SELECT" || (event.key === " " && (type === "checkbox" || ["BUTTON", "SUMMARY"].includes(tagName)))) return;
  event.preventDefault();
  KEYS[event.key](event);
});
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
addEventListener("resize", () => { if (last >= 0) { layTime(); layMessages(); draw(); } });
darkMode.addEventListener("change", () => { setColors(); laidLayers = ""; if (last >= 0) { layLayers(); layTime(); draw(); } });
addEventListener("hashchange", () => { const time = fromAddress(); if (time !== null && time !== announced) seek(time); });

setUp();
