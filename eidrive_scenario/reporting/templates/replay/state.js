"use strict";
const element = (id) => document.getElementById(id);
const page = JSON.parse(element("data").textContent);
/* Return an object for entries by names of the scenario. It inherits nothing, so that `constructor` is no entry of it. */
const table = (entries) => Object.assign(Object.create(null), entries);
/* Return a run without frames; `addPart` appends frames. */
const newRun = () => ({ times: [], ticks: [], actors: table(), poses: table(), stations: table(), changes: [], messages: [],
                        timeline: [], series: table(), models: {}, light: [], contacts: [], decisive: null });
/* The run of the page, and the run that is shown over it; null without one. */
const data = Object.assign(newRun(), { roads: page.roads, street: page.street, colors: page.colors, images: table(page.images) });
const other = page.other ? newRun() : null;
const runs = other ? [data, other] : [data];
const letterOf = (run) => run === other ? "B" : "A";
/* Colors of the mode of the browser, also as variables of CSS. */
const C = {}, darkMode = matchMedia("(prefers-color-scheme: dark)");
function setColors() {
  Object.assign(C, data.colors[darkMode.matches ? "dark" : "light"]);
  for (const key of ["own", "fused", "plan", "braking", "link", "lost", "self", "paper"]) document.documentElement.style.setProperty("--map-" + key, C[key]);
}
setColors();
/* Time after its outcome for which a message is drawn [s]. */
const SHOWN = 0.15;
/* Index of the last frame and duration [s], names of the actors and of the stations, and senders by station. */
let last = -1, duration = 0, names = [], stations = [];
/* Instants to which the controls lead: those of the frames, and those of the other run after its end [s]. */
let instants = data.times;
const senders = table();
/* Whether the run is in progress, and whether the page shows its newest frame. */
let running = false, atEnd = false;

/* Replace each 0 of a column by its predecessor. */
function unpack(column) {
  for (let i = 1; i < column.length; i += 1) if (column[i] === 0) column[i] = column[i - 1];
  return column;
}

/* Append the entries of new frames to a column of `columns`, of which `before` frames were present. */
function addColumn(columns, key, added, before) {
  const column = columns[key] || (columns[key] = []);
  while (column.length < before) column.push(null);
  for (const entry of added) column.push(entry);
}

/* Append null to the columns that have no entries of the last frames. */
function padColumns(columns, count) {
  for (const column of Object.values(columns)) while (column.length < count) column.push(null);
}

/* Append a part of the run in the format of the page. */
function addPart(part, run = data) {
  const before = run.times.length;
  for (const key of ["times", "ticks", "changes", "contacts", "light"]) for (const entry of part[key]) run[key].push(entry);
  Object.assign(run.models, part.models);
  const text = (index) => part.texts[index];
  for (const [sent, sender, receiver, arrives, reason, size, content] of part.messages)
    run.messages.push([sent, text(sender), text(receiver), arrives, text(reason), size, text(content)]);
  for (const index of part.lost) run.messages[index].splice(3, 2, null, "absent");
  for (const [name, actor] of Object.entries(part.actors)) run.actors[name] = run.actors[name] || actor;
  const count = run.times.length;
  for (const [name, column] of Object.entries(part.poses)) addColumn(run.poses, name, unpack(column), before);
  padColumns(run.poses, count);
  for (const [name, parts] of Object.entries(part.stations)) addStation(run, name, parts, before);
  for (const columns of Object.values(run.stations)) padColumns(columns, count);
  for (const [name, columns] of Object.entries(part.series)) addSeries(run, name, columns, before);
  for (const { age, expired, ...columns } of Object.values(run.series)) for (const one of [columns, age, expired]) padColumns(one || {}, count);
  for (const row of part.timeline) {
    const known = run.timeline.findIndex(([path]) => path === row[0]);
    if (known < 0) run.timeline.push(row); else run.timeline[known] = row;
  }
  run.decisive = part.decisive;
  last = data.times.length - 1;
  duration = last < 0 ? 0 : data.times[last] - data.times[0];
  // JavaScript sorts the keys of an object that are whole numbers
  if (run === data) names.push(...part.names);
  if (run === data) stations.push(...part.station_names.filter((name) => !stations.includes(name)));
  if (other) instants = [...data.times, ...other.times.filter((time) => time > data.times[last] + 1e-6)];
}

function addStation(run, name, parts, before) {
  const columns = run.stations[name] || (run.stations[name] = {}), known = senders[name] || (senders[name] = new Set());
  for (const [key, column] of Object.entries(parts)) addColumn(columns, key, unpack(column), before);
  for (const boxes of parts.received || []) for (const sender of Object.keys(boxes || {})) known.add(sender);
}

function addSeries(run, name, { age, expired, ...columns }, before) {
  const series = run.series[name] || (run.series[name] = {});
  for (const [key, column] of Object.entries(columns)) addColumn(series, key, column, before);
  for (const [key, bySender] of Object.entries({ age, expired })) {
    if (bySender) series[key] = series[key] || table();
    for (const [sender, column] of Object.entries(bySender || {})) addColumn(series[key], sender, column, before);
  }
}

/* What is shown: time [s], index of the frame and of that of the other run, station ("" for none), view, and layers by name. */
const shown = { time: 0, index: 0, otherIndex: 0, station: "", view: "top", layers: {}, hidden: new Set() };

function make(tag, text, parent, properties = {}) {
  const made = Object.assign(document.createElement(tag), properties);
  made.textContent = text;
  if (parent) parent.appendChild(made);
  return made;
}

/* Return the number of entries at the start of a list for which a function is true. */
function countFirst(list, isBefore) {
  let low = 0, high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (isBefore(list[middle])) low = middle + 1; else high = middle;
  }
  return low;
}

/* Return the index of the last one of ascending times that is not after the time; 0 if all are. */
const indexAt = (time, times = data.times) => Math.max(0, countFirst(times, (each) => each <= time + 1e-6) - 1);

const indexOf = (run) => run === other ? shown.otherIndex : shown.index;
const endOf = (run) => run.times[run.times.length - 1];

/* Return x, y, yaw and speed of an actor at the shown time, between two frames by linear interpolation; the last ones
   after the end of the run. */
function poseOf(name, run = data) {
  const { time } = shown, index = indexOf(run), poses = run.poses[name] || [], from = poses[index], to = poses[index + 1];
  if (!from || !to || time <= run.times[index]) return from;
  if (Math.hypot(to[0] - from[0], to[1] - from[1]) > 8) return from;
  const part = Math.min(1, (time - run.times[index]) / (run.times[index + 1] - run.times[index]));
  const turn = Math.atan2(Math.sin(to[2] - from[2]), Math.cos(to[2] - from[2]));
  return [from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1]), from[2] + part * turn,
          from[3] + part * (to[3] - from[3])];
}

/* Return the contacts of an actor in the shown frame of a run: time, both names, relative speed at the impact. */
const contactsOf = (name, run = data) => run.contacts.filter(([time, first, second]) =>
  (name === first || name === second) && Math.abs(time - run.times[indexOf(run)]) < 1e-6);

/* Return the speed of an actor in the shown frame. Where a contact begins it is that before, as the pose has the speed
   after the bounce. */
function speedOf(name, run = data) {
  const poses = run.poses[name] || [], index = indexOf(run), before = poses[index - 1];
  if (before && contactsOf(name, run).length) return before[3];
  return poses[index] ? poses[index][3] : null;
}

/* Return a part of the information of the shown station at the shown frame. */
function part(key) {
  const parts = data.stations[shown.station];
  return parts && parts[key] ? parts[key][shown.index] : null;
}

const isPresent = () => part("own") !== null;
const senderColor = (name) => C.senders[(stations.indexOf(name) + C.senders.length - 1) % C.senders.length];

/* Yield the perceived boxes that are shown: box, color, line width in m. */
function* perceivedBoxes() {
  if (!isPresent()) return;
  const { layers, hidden } = shown;
  for (const [sender, boxes] of Object.entries(part("received")))
    if (!hidden.has(sender)) for (const box of boxes) yield { box, color: senderColor(sender), line: 0.45, kind: "received" };
  if (layers.own) for (const box of part("own")) yield { box, color: C.own, line: 0.25, kind: "own" };
  const causes = new Set(part("cause"));
  if (layers.fused) for (const [row, box] of part("fused").entries())
    yield { box, color: C.fused, line: causes.has(row) ? 0.5 : 0.25, kind: "fused", cause: causes.has(row) };
}

/* Return the messages to draw, to the shown station or without one to all: sender, receiver, state, and the share of
   the way that a message in flight has covered. */
let bySent = [], longest = SHOWN;
function sortMessages() {
  bySent = data.messages.slice().sort((a, b) => a[0] - b[0]);
  longest = bySent.reduce((most, [sent, , , arrives]) => Math.max(most, (arrives === null ? sent : arrives) - sent), 0) + SHOWN;
}

function messagesNow() {
  const { time, station } = shown, found = new Map();
  if (bySent.length < data.messages.length) sortMessages();
  for (let i = countFirst(bySent, ([sent]) => sent < time - longest); i < bySent.length && bySent[i][0] <= time + 1e-6; i += 1) {
    const [sent, sender, receiver, arrives, reason] = bySent[i];
    if (station && receiver !== station && sender !== station) continue;
    const end = arrives === null ? sent : arrives;
    if (time > end + SHOWN) continue;
    const flying = arrives !== null && time < arrives - 1e-6;
    const state = arrives === null ? "lost" : flying ? "flying" : "delivered";
    found.set(sender + "\n" + receiver + (flying ? sent : ""),
              { sender, receiver, state, reason, share: flying ? (time - sent) / (arrives - sent) : 1 });
  }
  return [...found.values()];
}

if (other) addPart(page.other, other);
