/* Data of a run in progress, from the server of `eidrive run --live`. */
/* Time between two changes of charts and panels [ms], and time in which the view approaches the newest frame [s]. */
const PERIOD = 250, APPROACH = 0.08;
/* Failed connections after which the page stays as it is. */
const ATTEMPTS = 3;
let grownAt = -PERIOD, grownTo = -1, paintedAt = 0, failures = 0, isComplete = false;
const source = new EventSource("events");

function showState(text) {
  element("state").textContent = text;
  element("state").hidden = !text;
}

source.onopen = () => { failures = 0; if (running) showState("live"); };
source.onerror = () => {
  failures += 1;
  if (running) showState("connection lost");
  if (!running || failures >= ATTEMPTS) source.close();
};
source.addEventListener("part", (event) => addPart(JSON.parse(event.data)));
source.addEventListener("page", (event) => {
  const { badge, notices, verdict, decisive, ended } = JSON.parse(event.data);
  element("badge").innerHTML = badge;
  element("notices").innerHTML = notices;
  element("verdict").innerHTML = verdict;
  if (!ended) return;
  data.decisive = decisive;
  running = false;
});

/* Show new frames, charts and panels less often than the street. */
function paint(now) {
  const lag = atEnd ? data.times[last] - shown.time : 0, elapsed = (now - paintedAt) / 1000;
  paintedAt = now;
  if (last >= 0 && grownTo < 0) begin();
  else if (last >= 0 && (!running || (last > grownTo && now - grownAt >= PERIOD))) grow();
  if (last > grownTo && now - grownAt >= PERIOD) [grownAt, grownTo] = [now, last];
  if (lag > 0) showTime(!running || lag < 0.002 ? data.times[last] : shown.time + lag * (1 - Math.exp(-elapsed / APPROACH)));
  if (running) { requestAnimationFrame(paint); return; }
  showState("");
  element("end-choice").hidden = true;
  followEnd(false);
  draw();
}

element("at-end").onchange = (event) => { pause(); followEnd(event.target.checked); };
running = true;
followEnd(true);
showState("waiting for the run");
requestAnimationFrame(paint);
