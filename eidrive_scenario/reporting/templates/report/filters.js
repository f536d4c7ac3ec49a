/* Filters, full-text search, order and columns of the table. The address contains them, for links to a selection. */
const all = Array.from({ length: count }, (_, run) => run);
const state = { words: "", outcomes: new Set(), scenario: "", criterion: "", group: null, sort: columns[0], isDown: false, columns: null };
const collator = new Intl.Collator("en", { numeric: true });
const scenarioColumn = columns.find(({ title }) => title === "scenario");

/* Numbers of the texts of each run that differ from those of other runs with the same settings set. */
const ownTexts = lazy((run) => {
  const numbers = [...data.warnings[run], data.commands[run]];
  for (const { number, grouped, values } of [...data.columns, ...data.facts]) if (!number) numbers.push(values[grouped ? data.groups[run] : run]);
  for (const [, , , reason] of data.criteria[run]) numbers.push(reason);
  const [, ...changes] = data.settings[run];
  for (let i = 1; i < changes.length; i += 2) numbers.push(changes[i]);
  return numbers;
});
const loweredTexts = data.texts.map((value) => value.toLowerCase());
const numberColumns = [...data.columns, ...data.facts].filter(({ number }) => number);

/* Return the function that tells whether a run contains a word: in a text, or as one of its numbers. */
function contains(word) {
  const inText = loweredTexts.map((value) => value.includes(word));
  const inKind = data.kinds.map(([name]) => name.toLowerCase().includes(word));
  const inGroup = data.groupNames.map((name) => name.toLowerCase().includes(word));
  const inOutcome = OUTCOMES.map((outcome) => outcome.includes(word));
  const inSet = data.settingSets.map(({ values }) => values.map((number, i) => inText[number] ? i : -1).filter((i) => i >= 0));
  const number = Number(word);
  return (run) => inOutcome[data.outcomes[run]] || inGroup[data.groups[run]]
    || ownTexts()[run].some((own) => inText[own]) || data.criteria[run].some(([kind]) => inKind[kind])
    || numberColumns.some((column) => valueIn(column, run) === number) || inBase(run, inSet);
}

/* Whether a setting that a run shares with the first one of its set is among those that contain a word. */
function inBase(run, inSet) {
  const [set, ...changes] = data.settings[run];
  return inSet[set].some((at) => { for (let i = 0; i < changes.length; i += 2) if (changes[i] === at) return false; return true; });
}

function filtered() {
  const words = state.words.toLowerCase().split(/\s+/).filter(Boolean).map(contains);
  const scenarios = scenarioColumn.values();
  return all.filter((run) => (!state.outcomes.size || state.outcomes.has(data.outcomes[run]))
    && (!state.scenario || scenarios[run] === state.scenario)
    && (state.group === null || data.groups[run] === state.group)
    && (!state.criterion || data.criteria[run].some(([kind, passed]) => !passed && data.kinds[kind][0] === state.criterion))
    && words.every((isIn) => isIn(run)));
}

/* Return runs in the order of a column; runs without a value come last, and equal ones stay as they are. */
function sorted(runs, column, isDown) {
  if (column === columns[0] && !isDown) return runs;
  const values = column.values(), sign = isDown ? -1 : 1;
  const isEmpty = (run) => values[run] === null || values[run] === "";
  const given = runs.filter((run) => !isEmpty(run)), rest = runs.filter(isEmpty);
  if (column.number) return [...given.sort((one, other) => sign * (values[one] - values[other])), ...rest];
  const ranks = new Map([...new Set(given.map((run) => values[run]))].sort(collator.compare).map((value, rank) => [value, rank]));
  return [...given.sort((one, other) => sign * (ranks.get(values[one]) - ranks.get(values[other]))), ...rest];
}

const isFiltered = () => Boolean(state.words || state.outcomes.size || state.scenario || state.criterion || state.group !== null);

/* Apply the filters and the order. */
function update() {
  const runs = sorted(filtered(), state.sort, state.isDown);
  const group = state.group === null ? "" : ` with the settings ${data.groupNames[state.group]}`;
  element("shown").textContent = `${runs.length === count ? "" : `${runs.length} of `}${count} run${count === 1 ? "" : "s"}${group}`;
  element("clear").hidden = !isFiltered();
  for (const button of document.querySelectorAll(".outcomes button")) button.setAttribute("aria-pressed", state.outcomes.has(outcomeOf(button)));
  markSorted(state.sort, state.isDown);
  element("sort").value = `${columns.indexOf(state.sort)} ${state.isDown}`;
  showOrder(runs);
}

const outcomeOf = (button) => OUTCOMES.indexOf(button.dataset.outcome);

/* Write filters, order and chosen columns into the address. */
function announce() {
  const given = new URLSearchParams();
  if (state.words) given.set("q", state.words);
  if (state.outcomes.size) given.set("outcome", [...state.outcomes].map((outcome) => OUTCOMES[outcome]).join(","));
  if (state.scenario) given.set("scenario", state.scenario);
  if (state.criterion) given.set("criterion", state.criterion);
  if (state.group !== null) given.set("group", state.group);
  if (state.sort !== columns[0] || state.isDown) given.set("sort", `${state.isDown ? "-" : ""}${state.sort.title}`);
  if (state.columns) given.set("columns", visible.map(({ title }) => title).join("|"));
  try { history.replaceState(null, "", `#${given}`); } catch (error) { /* not allowed for this address */ }
}

/* Set filters, order and columns from the address. */
function fromAddress() {
  const given = new URLSearchParams(location.hash.slice(1)), titled = (title) => columns.find((column) => column.title === title);
  state.words = given.get("q") || "";
  state.outcomes = new Set((given.get("outcome") || "").split(",").map((name) => OUTCOMES.indexOf(name)).filter((outcome) => outcome >= 0));
  state.scenario = given.get("scenario") || "";
  state.criterion = given.get("criterion") || "";
  const group = /^\d+$/.test(given.get("group") || "") ? Number(given.get("group")) : -1;
  state.group = data.groupNames[group] === undefined ? null : group;
  const sort = given.get("sort") || FIRST_SORT;
  state.sort = titled(sort) || titled(sort.replace(/^-/, "")) || columns[0];
  state.isDown = sort.startsWith("-") && !titled(sort);
  state.columns = given.has("columns") ? new Set(given.get("columns").split("|").map(titled).filter(Boolean)) : null;
  element("search").value = state.words;
  element("scenario").value = state.scenario;
  element("criterion").value = state.criterion;
  chooseColumns();
}

const isShown = (column) => column === columns[0] || (state.columns ? state.columns.has(column) : Boolean(column.shown));

function chooseColumns() {
  for (const box of element("column-list").querySelectorAll("input")) box.checked = isShown(columns[box.value]);
  showColumns(columns.filter(isShown), sortBy);
  update();
}

function sortBy(column) {
  state.isDown = state.sort === column && !state.isDown;
  state.sort = column;
  change();
}

function change() { update(); announce(); }

/* Maximum number of values of a choice: a list of more is slow, and the search does the same. */
const CHOICES = 500;

/* Fill a choice with values and the number of runs of each; hide it without a choice, and one that is too long. */
function fillChoice(id, values, least) {
  const counts = new Map();
  for (const value of values) counts.set(value, (counts.get(value) || 0) + 1);
  const names = [...counts.keys()].sort(collator.compare);
  element(id).parentElement.hidden = names.length < least || names.length > CHOICES;
  if (names.length > CHOICES) return;
  element(id).append(make("option", { value: "" }, "all"), ...names.map((name) => make("option", { value: name }, `${name} (${counts.get(name)})`)));
  element(id).addEventListener("change", (event) => { state[id] = event.target.value; change(); });
}

function fillColumns() {
  const list = element("column-list");
  for (const part of new Set(columns.map((column) => column.part))) {
    const boxes = columns.map((column, i) => [column, i]).filter(([column]) => column.part === part && column !== columns[0]);
    list.append(make("fieldset", null, make("legend", null, part), ...boxes.map(([{ title }, i]) => make("label", null, make("input", { type: "checkbox", value: i }), " ", title))));
  }
  list.addEventListener("change", () => {
    state.columns = new Set([...list.querySelectorAll("input:checked")].map((box) => columns[box.value]));
    chooseColumns();
    announce();
  });
}

function begin() {
  element("runs").hidden = false;
  fillChoice("scenario", scenarioColumn.values(), 2);
  fillChoice("criterion", all.flatMap((run) => [...new Set(failedCriteria(run).map(({ name }) => name))]), 1);
  fillColumns();
  const sortable = columns.flatMap((column, i) => [[i, column, false], [i, column, true]]).filter(([, column]) => column.part !== "Settings");
  element("sort").append(...sortable.map(([i, { title }, isDown]) => make("option", { value: `${i} ${isDown}` }, `${title} ${isDown ? "↓" : "↑"}`)));
  element("sort").addEventListener("change", (event) => {
    const [index, isDown] = event.target.value.split(" ");
    state.sort = columns[index];
    state.isDown = isDown === "true";
    change();
  });
  element("search").addEventListener("input", (event) => { state.words = event.target.value; change(); });
  for (const button of document.querySelectorAll(".outcomes button")) {
    button.addEventListener("click", () => {
      const outcome = outcomeOf(button);
      if (!state.outcomes.delete(outcome)) state.outcomes.add(outcome);
      change();
    });
  }
  element("clear").addEventListener("click", () => {
    Object.assign(state, { words: "", outcomes: new Set(), scenario: "", criterion: "", group: null });
    for (const id of ["search", "scenario", "criterion"]) element(id).value = "";
    change();
    element("search").focus();
  });
  rowBox.addEventListener("scroll", showRows, { passive: true });
  let width = rowBox.clientWidth;
  new ResizeObserver(() => {
    if (rowBox.clientWidth !== width) { width = rowBox.clientWidth; resetRows(); } else showRows();
  }).observe(rowBox);
  addEventListener("hashchange", () => { fromAddress(); element("runs").scrollIntoView(); });
  addEventListener("beforeprint", () => placeRows(0, Math.min(order.length, PRINTED)));
  addEventListener("afterprint", showRows);
  if (count === 1) opened.add(0);
  fromAddress();
}

/* Maximum number of runs on paper. */
const PRINTED = 1000;
begin();
