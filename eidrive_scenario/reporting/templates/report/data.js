"use strict";
/* Runs of the report: their columns, criteria, metrics and settings, from the data of the page. */
const element = (id) => document.getElementById(id);
const data = JSON.parse(element("data").textContent);
const OUTCOMES = ["failed", "did not finish", "not judged", "passed"], PASSED = 3;
const FIRST_SORT = "outcome";
const count = data.outcomes.length;
const text = (number) => data.texts[number];

/* Return the value of a run in a column of the data; those of scenario, channel and their settings have one per group. */
function valueIn({ number, grouped, values }, run) {
  const value = values[grouped ? data.groups[run] : run];
  return number ? value : text(value);
}

/* Return a new element. All texts of runs enter the page here, as text nodes or attributes, never as HTML. */
function make(tag, attributes, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) if (value !== null) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

const classOf = (outcome) => OUTCOMES[outcome].replaceAll(" ", "-");

/* Return a measured value with two decimals, or a count without decimals. */
function withUnit(value, unit) {
  if (value === null) return "";
  return unit ? `${value.toFixed(2)} ${unit}` : String(value);
}

/* Return a number with at most four significant digits behind the decimal point. */
function short(value) {
  return Number.isInteger(value) ? String(value) : String(Math.abs(value) < 1000 ? Number(value.toPrecision(4)) : Number(value.toFixed(1)));
}

/* Return the criteria of a run. */
function criteriaOf(run) {
  return data.criteria[run].map(([kind, passed, value, reason, ...state]) => {
    const [name, limit, unit] = data.kinds[kind];
    return { name, limit, unit, passed: Boolean(passed), value, reason: text(reason), state: state.map(text) };
  });
}

const failedCriteria = (run) => criteriaOf(run).filter((criterion) => !criterion.passed);

/* Return the metrics of a run as pairs of title and number. */
function metricsOf(run) {
  const [set, ...values] = data.metrics[run];
  return data.metricSets[set].map((title, i) => [title, values[i]]).filter(([, value]) => value !== null);
}

/* Return the numbers of the texts of the settings of a run, in the order of the paths of its set. */
function settingNumbers(run) {
  const [set, ...changes] = data.settings[run], values = [...data.settingSets[set].values];
  for (let i = 0; i < changes.length; i += 2) values[changes[i]] = changes[i + 1];
  return values;
}

/* Return the settings of a run as pairs of path and text. */
function settingsOf(run) {
  const { paths } = data.settingSets[data.settings[run][0]];
  return settingNumbers(run).map((number, i) => [paths[i], text(number)]);
}

/* Return what the reason of a run says in its row: the failed criteria, else the names of all. */
function reasonOf(run) {
  const failed = failedCriteria(run);
  if (data.outcomes[run] === PASSED || !failed.length) return criteriaOf(run).map(({ name }) => name).join(", ");
  return failed.map(({ name, reason }) => `${name} ${reason}`).join(" ");
}

/* Return the value of each run in a column of criteria, metrics or settings, made when the column is first used. */
function lazy(valueOf) {
  let values = null;
  return () => values || (values = Array.from({ length: count }, (_, run) => valueOf(run)));
}

/* Return the paths of settings that differ between runs and have no other column. */
function differingPaths() {
  const values = new Map(), differing = new Set();
  const note = (path, number) => {
    if (!values.has(path)) values.set(path, number); else if (values.get(path) !== number) differing.add(path);
  };
  for (const { paths, values: numbers } of data.settingSets) paths.forEach((path, i) => note(path, numbers[i]));
  for (const [set, ...changes] of data.settings) {
    for (let i = 0; i < changes.length; i += 2) differing.add(data.settingSets[set].paths[changes[i]]);
  }
  const present = new Set(data.columns.flatMap(({ title }) => [title, `parameters.${title}`, title.replace(/^channel\./, "channel_profile.")]));
  return [...differing].filter((path) => !present.has(path) && path !== "files");
}

/* Return all columns: title, part of the list of columns, whether shown at first, and values of all runs as numbers or
   texts; null and the empty text stand for none. */
function allColumns() {
  const given = (column) => ({ ...column, part: "Run", values: lazy((run) => valueIn(column, run)) });
  const criteria = [...new Set(data.kinds.map(([name]) => name))];
  const metrics = [...new Set(data.metricSets.flat())];
  return [
    { title: FIRST_SORT, part: "Run", shown: true, number: true, values: () => data.outcomes },
    ...data.columns.map(given),
    { title: "reason", part: "Run", shown: true, values: lazy(reasonOf) },
    ...data.facts.map(given),
    ...(data.replays.some((replay) => text(replay)) ? [
      { title: "replay", part: "Run", shown: true, values: lazy((run) => text(data.replays[run])) }] : []),
    ...criteria.map((name) => ({
      title: `value of ${name}`, part: "Values of criteria", number: true,
      values: lazy((run) => (criteriaOf(run).find((criterion) => criterion.name === name) || { value: null }).value) })),
    ...metrics.map((title) => ({
      title, part: "Metrics", number: true,
      values: lazy((run) => (metricsOf(run).find(([metric]) => metric === title) || [title, null])[1]) })),
    ...differingPaths().map((path) => ({
      title: path, part: "Settings",
      values: lazy((run) => (settingsOf(run).find(([name]) => name === path) || [path, ""])[1]) })),
  ];
}

const columns = allColumns();
