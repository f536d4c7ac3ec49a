/* Table of runs. Only the rows in view exist; two empty bodies have the height of those above and below them. */
const SPARE = 8, GUESS = 46;
const rowBox = element("rows"), grid = element("table");
const above = make("tbody", { "aria-hidden": "true", role: "presentation" }, make("tr", { role: "presentation" }));
const below = above.cloneNode(true);
grid.append(above, below);
/* Runs that the filters show, in order; visible columns; opened runs. */
let order = [], visible = [];
const opened = new Set();
/* Bodies of the runs in view; measured heights of all runs; distances of the shown runs from the first [px]. */
const bodies = new Map(), heights = new Float64Array(count).fill(GUESS);
let offsets = new Float64Array(1);

/* Width of a column [px] for most of its values; that of reasons is what the others leave, but at least this. */
function widthOf(column) {
  if (column.title === "reason" && column.part === "Run") return 330;
  const values = column.values(), step = Math.ceil(count / 200);
  let letters = column.title === FIRST_SORT ? 16 : Math.min(column.title.length + 2, 14);
  for (let run = 0; run < count && column !== columns[0]; run += step) {
    const value = values[run];
    if (value !== null && column.title !== "replay") letters = Math.max(letters, column.number ? short(value).length : value.length);
  }
  return 22 + 8.2 * Math.min(letters, 24);
}

/* Return a title that breaks between its parts, such as those of channel.delay.seconds, before it breaks within one. */
function breakable(title) {
  return title.split(/(?<=[._])|(?<=[a-z])(?=[A-Z])/).flatMap((part, i) => (i ? [make("wbr"), part] : [part]));
}

/* Return what a cell shows. */
function cellContent(column, run) {
  if (column.title === FIRST_SORT && column.part === "Run") return [openButton(run)];
  if (column.title === "reason" && column.part === "Run") return reasonParts(run);
  const value = column.values()[run];
  if (column.title === "replay" && column.part === "Run") return value ? [make("a", { href: value }, "replay")] : [];
  return value === null || value === "" ? [] : [column.number ? short(value) : value];
}

function openButton(run) {
  const name = data.columns.filter(({ title, shown }) => shown || title === "seed")
    .map((column) => `${column.title} ${valueIn(column, run)}`).join(", ");
  const outcome = data.outcomes[run];
  const button = make("button", { type: "button", class: `open ${classOf(outcome)}`, "aria-expanded": opened.has(run), "aria-label": `${OUTCOMES[outcome]}, details of ${name}` }, OUTCOMES[outcome]);
  button.addEventListener("click", () => toggle(run));
  return button;
}

/* Return the failed criteria with their reasons. Of other runs, the reason is how they ended or the names of criteria. */
function reasonParts(run) {
  const outcome = data.outcomes[run], failed = outcome === PASSED ? [] : failedCriteria(run);
  const parts = failed.map(({ name, reason }) => make("div", null, make("strong", null, name), " ", reason));
  if (OUTCOMES[outcome] === "did not finish" || (!parts.length && outcome !== PASSED)) {
    const [end] = data.facts;
    parts.unshift(make("div", null, text(end.values[run])));
  }
  return parts.length ? parts : [make("span", { class: "quiet" }, reasonOf(run))];
}

function makeBody(run) {
  const cells = visible.map((column) => {
    const cell = make("td", { role: "cell", class: `${column.number && column.title !== FIRST_SORT ? "number" : "word"}${column.title === "reason" ? " reason" : ""}`, "data-title": column.title });
    cell.append(...cellContent(column, run));
    return cell;
  });
  const body = make("tbody", { role: "rowgroup", class: classOf(data.outcomes[run]) }, make("tr", { role: "row" }, ...cells));
  body.addEventListener("click", (event) => {
    if (!event.target.closest("a, button, .details") && !String(getSelection())) toggle(run);
  });
  if (opened.has(run)) addDetails(body, run);
  return body;
}

function addDetails(body, run) {
  const details = make("td", { role: "cell", colspan: visible.length, "aria-colspan": visible.length, class: "details" }, make("div", null, ...detailsOf(run)));
  details.addEventListener("toggle", showRows, true);
  body.append(make("tr", { role: "row" }, details));
}

/* Open or close the details of a run. */
function toggle(run) {
  const body = bodies.get(run), open = !opened.has(run);
  if (open) { opened.add(run); addDetails(body, run); } else { opened.delete(run); body.lastElementChild.remove(); }
  body.querySelector(".open").setAttribute("aria-expanded", open);
  showRows();
}

function layOut() {
  offsets = new Float64Array(order.length + 1);
  for (let i = 0; i < order.length; i += 1) offsets[i + 1] = offsets[i] + heights[order[i]];
}

/* Return the position of the row at a distance from the first one. */
function rowAt(distance) {
  let low = 0, high = order.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (offsets[middle + 1] <= distance) low = middle + 1; else high = middle;
  }
  return low;
}

/* Make the rows of these positions, and remove all others. */
function placeRows(first, end) {
  const wanted = new Set(order.slice(first, end));
  for (const [run, body] of bodies) {
    if (wanted.has(run)) continue;
    if (body.contains(document.activeElement)) rowBox.focus({ preventScroll: true });
    body.remove();
    bodies.delete(run);
  }
  let before = above;
  for (let i = first; i < end; i += 1) {
    const run = order[i];
    if (!bodies.has(run)) bodies.set(run, makeBody(run));
    const body = bodies.get(run);
    if (before.nextSibling !== body) before.after(body);
    body.firstElementChild.setAttribute("aria-rowindex", i + 2);
    before = body;
  }
  above.firstElementChild.style.height = `${offsets[first]}px`;
  below.firstElementChild.style.height = `${offsets[order.length] - offsets[end]}px`;
}

/* Make the rows in view. Heights are known once rows exist, so this is repeated until they fill the view; rows that turn
   out higher than they were thought above the view must not move it. */
function showRows() {
  for (let pass = 0; pass < 9; pass += 1) {
    const top = rowBox.scrollTop, bottom = top + rowBox.clientHeight;
    const first = Math.max(0, rowAt(top) - SPARE), end = Math.min(order.length, rowAt(bottom) + 1 + SPARE);
    placeRows(first, end);
    let moved = 0, isChanged = false;
    for (let i = first; i < end; i += 1) {
      const run = order[i], height = bodies.get(run).getBoundingClientRect().height;
      if (Math.abs(height - heights[run]) < 0.5) continue;
      isChanged = true;
      if (offsets[i] + heights[run] <= top) moved += height - heights[run];
      heights[run] = height;
    }
    if (!isChanged) break;
    layOut();
    if (moved) rowBox.scrollTop = top + moved;
  }
}

/* Show these runs from the first one on. */
function showOrder(runs) {
  order = runs;
  grid.setAttribute("aria-rowcount", order.length + 1);
  rowBox.scrollTop = 0;
  layOut();
  showRows();
}

/* Make all rows again, as their columns or the width have changed. */
function resetRows() {
  for (const body of bodies.values()) body.remove();
  bodies.clear();
  heights.fill(GUESS);
  layOut();
  showRows();
}

/* Show these columns, and sort by one on a click on its title. */
function showColumns(shown, sort) {
  visible = shown;
  const total = shown.reduce((sum, column) => sum + widthOf(column), 0);
  grid.querySelector("colgroup").replaceChildren(...shown.map((column) => make("col", { style: column.title === "reason" ? "" : `width:${widthOf(column)}px` })));
  grid.style.setProperty("--least", `${total}px`);
  const heads = shown.map((column) => {
    const button = make("button", { type: "button" }, ...breakable(column.title));
    button.addEventListener("click", () => sort(column));
    return make("th", { scope: "col", role: "columnheader", class: column.number && column.title !== FIRST_SORT ? "number" : "word" }, button);
  });
  grid.tHead.replaceChildren(make("tr", { role: "row", "aria-rowindex": 1 }, ...heads));
  resetRows();
}

/* Mark the title of the column by which the rows are sorted. */
function markSorted(column, isDown) {
  for (const [i, head] of [...grid.tHead.rows[0].cells].entries()) {
    if (visible[i] === column) head.setAttribute("aria-sort", isDown ? "descending" : "ascending"); else head.removeAttribute("aria-sort");
  }
}
