/* Table of the messages of the shown station, which follows the cursor. Only the rows in view exist. */
let listedMessages = [], currentMessage = null, drawnRows = "", laidMessages = "";
const messageList = element("message-list");

/* Return the columns of a message: time, link, size, delay, outcome, content. */
function messageCells([sent, sender, receiver, arrives, reason, size, content]) {
  const delay = arrives === null ? "–" : `${Math.round(1000 * (arrives - sent))} ms`;
  const inFlight = arrives !== null && sent <= shown.time + 1e-6 && shown.time < arrives - 1e-6;
  const outcome = arrives === null ? `× lost: ${reason}` : inFlight ? "in flight" : "delivered";
  return [sent.toFixed(3) + " s", `${sender} → ${receiver}`, `${size} B`, delay, outcome, content];
}

/* List the messages of the shown station in the order in which they were sent, all or lost ones. */
function layMessages() {
  if (bySent.length < data.messages.length) sortMessages();
  const ofStation = bySent.filter(isOfStation), lost = ofStation.filter(([, , , arrives]) => arrives === null);
  element("message-panel").hidden = !data.messages.length;
  element("message-count").textContent = `${ofStation.length} messages, ${lost.length} lost`;
  listedMessages = element("lost-only").checked ? lost : ofStation;
  // New messages of a run in progress do not move the table
  const layout = JSON.stringify([shown.station, element("lost-only").checked, rowHeight()]);
  if (layout !== laidMessages) [laidMessages, currentMessage] = [layout, null];
  drawnRows = "";
  followMessages();
}

/* Scroll to the last message that was sent before the shown instant. */
function followMessages() {
  const newest = countFirst(listedMessages, ([sent]) => sent <= shown.time + 1e-6) - 1;
  if (newest !== currentMessage) {
    currentMessage = newest;
    messageList.scrollTop = Math.max(0, (currentMessage + 1.5) * rowHeight() - messageList.clientHeight / 2);
  }
  drawMessageRows();
}

const rowHeight = () => parseFloat(getComputedStyle(messageList).getPropertyValue("--tall"));

function drawMessageRows() {
  const tall = rowHeight(), body = messageList.querySelector("tbody"), count = listedMessages.length;
  const first = Math.max(0, Math.floor(messageList.scrollTop / tall) - 4);
  const end = Math.min(count, first + Math.ceil(messageList.clientHeight / tall) + 8);
  const rows = listedMessages.slice(first, end).map(messageCells), drawn = JSON.stringify([first, currentMessage, count, tall, rows]);
  if (drawn === drawnRows) return;
  drawnRows = drawn;
  body.textContent = "";
  messageList.querySelector("table").setAttribute("aria-rowcount", String(count + 1));
  make("tr", "", body, { className: "space" }).style.height = `${first * tall}px`;
  for (const [i, [time, ...cells]] of rows.entries()) {
    const index = first + i, [sent, , , arrives] = listedMessages[index];
    const row = make("tr", "", body, { className: (index > currentMessage ? "future" : "") + (arrives === null ? " lost" : "") });
    row.setAttribute("aria-rowindex", String(index + 2));
    if (index === currentMessage) row.setAttribute("aria-current", "true");
    make("button", time, make("td", "", row), { type: "button" }).onclick = () => seek(sent);
    for (const text of cells) make("td", text, row, { title: text });
  }
  make("tr", "", body, { className: "space" }).style.height = `${(count - end) * tall}px`;
}

messageList.addEventListener("scroll", drawMessageRows);
element("lost-only").onchange = layMessages;
