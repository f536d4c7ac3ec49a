/* Timeline of the storyboard. */
let laidTimeline = "", openBars = [];

function textOf(kind, name, [start, end, why, whyEnd]) {
  const until = end !== null ? "to " + end.toFixed(2) + " s" : running ? "on" : "to the end of the run";
  return `${kind} ${name}: ${start.toFixed(2)} s ${until}` + (why ? `. Start: ${why}` : "") + (whyEnd ? `. End: ${whyEnd}` : "");
}

/* Rows of the timeline; each interval is a button that leads to its start. */
function layTimeline() {
  const rows = data.timeline.slice(0, 150), layout = JSON.stringify([rows, axis, running]);
  if (layout !== laidTimeline) {
    laidTimeline = layout;
    layRows(rows);
  }
  for (const { bar, start } of openBars) bar.style.width = widthOf(start, data.times[last]);
}

const widthOf = (start, end) => `max(4px, ${100 * (shareOf(end) - shareOf(start))}%)`;

function layRows(rows) {
  const parent = element("timeline");
  [openBars, parent.textContent] = [[], ""];
  element("timeline-panel").hidden = !rows.length;
  for (const [path, kind, intervals] of rows) {
    const row = make("div", "", parent, { className: "row" }), depth = path.split("/").length - 1, name = path.split("/").pop();
    const label = make("span", name, row, { className: "label", title: `${kind} ${path}` });
    label.style.paddingLeft = `${Math.min(depth, 6) * 8}px`;
    const track = make("div", "", row, { className: "track" });
    for (const interval of intervals) {
      const [start, end] = interval, text = textOf(kind, name, interval);
      const bar = make("button", "", track, { type: "button", className: "bar " + kind, title: text });
      bar.setAttribute("aria-label", text);
      bar.style.left = `${100 * shareOf(start)}%`;
      if (end === null) openBars.push({ bar, start }); else bar.style.width = widthOf(start, end);
      bar.onclick = () => seek(start);
    }
  }
  if (data.timeline.length > rows.length) make("p", `${data.timeline.length - rows.length} more elements are in the list of the storyboard.`, parent);
  make("div", "", make("div", "", parent, { className: "over" }), { id: "now" });
}

function moveTimeline() { const now = element("now"); if (now) now.style.left = `${100 * shareOf(shown.time)}%`; }
