/* Everything over time, below each other with one axis and one cursor: charts, tracks of events, and the storyboard. */
/* Length of the axis [s]; width of a row's plot [pixels]; functions that show the values at the cursor. */
let axis = 0, plotWidth = 0, cursors = [];
/* Distance below which marks of a track are one mark [pixels]. */
const NEAR_MARKS = 26;

const shareOf = (time) => axis > 0 ? Math.max(0, Math.min(1, (time - data.times[0]) / axis)) : 0;
const percent = (share) => `${(100 * share).toFixed(3)}%`;

/* Return the length of the time axis [s]: that of the longer run, while the run is in progress rounded up. */
function axisLength() {
  const round = duration < 60 ? 10 : duration < 600 ? 60 : 600;
  return running ? round * Math.max(1, Math.ceil(duration / round)) : instants[instants.length - 1] - data.times[0];
}

/* Lay out what has changed since the last call, and move the cursor. */
let laidAxis = "", laidTracks = "", laidTimeline = "", openBars = [];
function layTime() {
  axis = axisLength();
  plotWidth = Math.max(element("axis").lastElementChild.clientWidth, 100);
  cursors = [];
  layAxis();
  layCharts();
  layTracks();
  layTimeline();
  showCursors();
}

function showCursors() {
  for (const show of cursors) show();
  element("now").style.left = element("now-time").style.left = percent(shareOf(shown.time));
  element("now-time").textContent = shown.time.toFixed(2) + " s";
}

function layAxis() {
  const contacts = runs.flatMap((run) => run.contacts.map(([time]) => time)), layout = JSON.stringify([axis, plotWidth, data.times[0], contacts]);
  if (layout === laidAxis) return;
  laidAxis = layout;
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000], most = Math.max(2, plotWidth / 70);
  const step = steps.find((value) => axis / value <= most) || axis / 5 || 1;
  const ticks = element("ticks"), lines = element("lines");
  ticks.textContent = lines.textContent = "";
  for (let time = Math.ceil(data.times[0] / step - 1e-6) * step; time <= data.times[0] + axis + 1e-6; time += step) {
    make("span", `${Number(time.toFixed(3))}`, ticks).style.left = percent(shareOf(time));
    make("i", "", lines).style.left = percent(shareOf(time));
  }
  for (const time of contacts) make("i", "", lines, { className: "contact" }).style.left = percent(shareOf(time));
}

/* Add a row with a label, and return the element of its plot. */
function addRow(parent, label, title, name = "") {
  const row = make("div", "", parent, { className: "row " + name });
  make("span", label, row, { className: "label", title });
  return make("div", "", row, { className: "track" });
}

/* Add marks of events [time, text] to a track; near ones are one mark with their number. A mark leads to its first event. */
function addMarks(track, events, kind, sign) {
  let bundle = null;
  const bundles = [];
  for (const [time, text] of events) {
    const at = shareOf(time) * plotWidth;
    if (bundle && at - bundle.at < NEAR_MARKS) bundle.texts.push(text); else bundles.push(bundle = { at, time, texts: [text] });
  }
  for (const { time, texts } of bundles) {
    const many = texts.length > 1, more = texts.length > 12 ? `\n… ${texts.length - 12} more` : "";
    const text = `${many ? `${texts.length} from ` : ""}${time.toFixed(2)} s: ${texts.slice(0, 12).join(";\n")}${more}`;
    const mark = make("button", many ? String(texts.length) : sign, track, { type: "button", className: "mark " + kind, title: text });
    mark.setAttribute("aria-label", text);
    mark.style.left = percent(shareOf(time));
    mark.onclick = () => seek(time);
  }
}

/* Return the intervals of equal plans of a station: start, end, reason, whether they demand braking. */
function planIntervals(run, station) {
  const { plan, braking } = run.stations[station] || {}, intervals = [];
  for (const [i, reason] of (plan || []).entries()) {
    const before = intervals[intervals.length - 1];
    if (before && before[1] === null && before[2] === reason && before[3] === braking[i]) continue;
    if (before && before[1] === null) before[1] = run.times[i];
    if (reason) intervals.push([run.times[i], null, reason, braking[i]]);
  }
  return intervals.map(([start, end, ...rest]) => [start, end === null ? endOf(run) : end, ...rest]);
}

const isOfStation = ([, sender, receiver]) => !shown.station || sender === shown.station || receiver === shown.station;

/* Events and plans of the shown station as tracks, of each run. */
function layTracks() {
  const { station } = shown, tracks = [];
  for (const run of runs) {
    const suffix = other ? ", " + letterOf(run) : "";
    const lost = run.messages.filter((row) => row[3] === null && isOfStation(row)).sort((a, b) => a[0] - b[0]);
    tracks.push(["plan" + suffix, "plan", planIntervals(run, station)]);
    tracks.push(["contacts" + suffix, "contact", run.contacts.map(([time, first, second, speed]) =>
      [time, `${first} and ${second}` + (speed === null ? "" : ` at ${speed.toFixed(1)} m/s`)])]);
    tracks.push(["lost messages" + suffix, "lost", lost.map(([time, sender, receiver, , reason]) => [time, `${sender} → ${receiver}: ${reason}`])]);
    tracks.push(["storyboard" + suffix, "change", run.changes.map(([time, , name, after]) => [time, `${name} → ${after}`])]);
  }
  const layout = JSON.stringify([tracks, axis, plotWidth]);
  if (layout === laidTracks) return;
  laidTracks = layout;
  const parent = element("tracks"), signs = { contact: "!", lost: "×", change: "•" };
  parent.textContent = "";
  for (const [label, kind, entries] of tracks) {
    if (!entries.length) continue;
    const track = addRow(parent, label, label + (kind === "change" ? "" : station ? ` of ${station}` : ""));
    if (kind !== "plan") { addMarks(track, entries, kind, signs[kind]); continue; }
    for (const [start, end, reason, braking] of entries) {
      const text = `${reason}${braking ? " (braking)" : ""}: ${start.toFixed(2)} to ${end.toFixed(2)} s`;
      const bar = addBar(track, reason, text, braking ? "plan braking" : "plan", start);
      bar.style.width = widthOf(start, end);
    }
  }
}

function addBar(track, label, text, kind, start) {
  const bar = make("button", label, track, { type: "button", className: "bar " + kind, title: text });
  bar.setAttribute("aria-label", text);
  bar.style.left = percent(shareOf(start));
  bar.onclick = () => seek(start);
  return bar;
}

const widthOf = (start, end) => `max(4px, ${percent(shareOf(end) - shareOf(start))})`;

/* Levels of the storyboard below the stories, whose rows are indented. */
const LEVELS = ["act", "maneuverGroup", "maneuver", "event", "action"];

/* Return the elements of the storyboard as rows: an element whose intervals are those of the element in it joins its row. */
function storyboardRows() {
  const rows = [];
  for (const [path, name, kind, intervals] of data.timeline) {
    const before = rows[rows.length - 1], spans = JSON.stringify(intervals.map(([start, end]) => [start, end]));
    if (before && path.startsWith(before.path + "/") && spans === before.spans) {
      before.names.push(name);
      Object.assign(before, { path, kind, intervals });
    } else rows.push({ path, kind, intervals, spans, names: [name], depth: LEVELS.indexOf(kind) + 1 });
  }
  return rows;
}

function textOf({ kind, names: joined }, [start, end, why, whyEnd]) {
  const until = end !== null ? "to " + end.toFixed(2) + " s" : running ? "on" : "to the end of the run";
  return `${kind} ${joined.join(" › ")}: ${start.toFixed(2)} s ${until}` + (why ? `. Start: ${why}` : "") + (whyEnd ? `. End: ${whyEnd}` : "");
}

/* Rows of the storyboard; each interval is a button that leads to its start. */
function layTimeline() {
  const rows = storyboardRows(), layout = JSON.stringify([rows, axis, running]);
  if (layout !== laidTimeline) {
    laidTimeline = layout;
    layRows(rows.slice(0, 150), rows.length - 150);
  }
  for (const { bar, start } of openBars) bar.style.width = widthOf(start, data.times[last]);
}

function layRows(rows, hidden) {
  const parent = element("timeline");
  [openBars, parent.textContent] = [[], ""];
  element("storyboard-title").hidden = !rows.length;
  for (const row of rows) {
    const track = addRow(parent, row.names.join(" › "), `${row.kind} ${row.path}`, "element");
    track.previousSibling.style.paddingLeft = `${row.depth * 8}px`;
    for (const interval of row.intervals) {
      const [start, end] = interval, bar = addBar(track, "", textOf(row, interval), row.kind, start);
      if (end === null) openBars.push({ bar, start }); else bar.style.width = widthOf(start, end);
    }
  }
  if (hidden > 0) make("p", `${hidden} more elements are in the list of the storyboard.`, parent);
}

/* Lead to the instant under the pointer. */
function scrub(event) {
  if (event.target.closest("button")) return;
  const area = element("axis").lastElementChild.getBoundingClientRect();
  if (event.clientX < area.left - 8) return;
  seek(data.times[0] + axis * (event.clientX - area.left) / area.width);
}

const overTime = element("over-time");
overTime.addEventListener("click", scrub);
overTime.addEventListener("pointerdown", (event) => { if (event.pointerType === "mouse" && event.button === 0) scrub(event); });
overTime.addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
