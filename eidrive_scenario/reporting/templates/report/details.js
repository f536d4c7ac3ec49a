/* Details of a run: criteria with reasons and metrics, warnings, links, command, metrics and settings. */

/* Return a list of pairs as definitions. */
function definitions(pairs) {
  return make("dl", { class: "pairs" }, ...pairs.flatMap(([name, value]) => [make("dt", null, name), make("dd", null, value)]));
}

/* Return a section that is filled when it is first opened. */
function folded(title, fill) {
  const section = make("details", null, make("summary", null, title));
  section.addEventListener("toggle", () => { if (section.open && section.childElementCount === 1) section.append(fill()); });
  return section;
}

/* Return a metric as text: its unit, which its title contains in brackets, follows the value. */
function measured(title, value) {
  const [, name, unit] = /^(.*?)(?: ?\[(.*)\])?$/s.exec(title);
  return [name, short(value), unit].filter(Boolean).join(" ");
}

/* Return the beginning of the titles of metrics of a criterion: its name without dots. */
const beginningOf = ({ name }) => `${name.replaceAll(".", " ")} `;

/* Return the metrics whose titles begin with this criterion, and with none of the others that has a longer name. */
function metricsOfCriterion(criterion, criteria, metrics) {
  const own = beginningOf(criterion), longer = criteria.map(beginningOf).filter((other) => other.length > own.length);
  return metrics.filter(([title]) => title.startsWith(own) && !longer.some((other) => title.startsWith(other)))
    .map(([title, value]) => [title.slice(own.length), value]);
}

/* Return the line of a criterion. Its metrics, such as the distances of centers and of boxes, are beside its value. */
function criterionItem(criterion, own) {
  const values = [withUnit(criterion.value, criterion.unit), criterion.limit === null ? "" : `limit ${withUnit(criterion.limit, criterion.unit)}`];
  const verdict = criterion.passed ? "passed" : "failed";
  return make("li", { class: criterion.passed ? "holds" : "fails" },
    make("strong", null, criterion.name), " ", make("span", { class: verdict }, verdict), " ",
    make("span", { class: "values" }, values.filter(Boolean).join(", ")),
    ...(criterion.reason ? [make("div", null, criterion.reason)] : []),
    ...criterion.state.map((line) => make("div", { class: "setting" }, line)),
    ...(own.length ? [make("div", { class: "setting" }, own.map(([title, value]) => measured(title, value)).join(" · "))] : []));
}

/* Return the content of the opened row of a run. */
function detailsOf(run) {
  const metrics = metricsOf(run), criteria = criteriaOf(run), settings = settingsOf(run);
  const command = text(data.commands[run]), replay = text(data.replays[run]), group = data.groups[run];
  const parts = [criteria.length ? make("ul", { class: "checks" }, ...criteria.map((criterion) => criterionItem(criterion, metricsOfCriterion(criterion, criteria, metrics))))
                                 : make("p", null, "No criterion judges the run.")];
  const facts = data.facts.map((fact) => fact.number ? measured(fact.title, valueIn(fact, run)) : `${fact.title} ${valueIn(fact, run)}`);
  parts.push(make("p", { class: "setting" }, facts.join(" · ")));
  for (const warning of data.warnings[run]) parts.push(make("p", { class: "did-not-finish" }, `warning: ${text(warning)}`));
  const links = make("p", { class: "links" });
  if (replay) links.append(make("a", { href: replay }, "Open the replay"));
  if (data.groupNames.length > 1) links.append(make("a", { href: `#group=${group}` }, "Runs with equal settings"));
  if (links.childElementCount) parts.push(links);
  if (command) parts.push(make("pre", { tabindex: 0, "aria-label": "command" }, command));
  if (metrics.length) parts.push(folded(`Metrics (${metrics.length})`, () => definitions(metrics.map(([title, value]) => [title, String(value)]))));
  if (settings.length) parts.push(folded(`Settings (${settings.length})`, () => definitions(settings)));
  return parts;
}
