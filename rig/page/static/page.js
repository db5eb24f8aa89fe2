// The operator's page. Every text is set as text, never as markup: names and notes may be hostile.
import {$, clock, element, plain, setText} from "./dom.js";
import {buildCards, showAges, showAlarms, showLimits, showLoop} from "./cards.js";
import {armingAnswered, showArming} from "./checklist.js";
import {Manual} from "./manual.js";
import {Rows} from "./rows.js";
import {Surface, legend} from "./surface.js";
import {Traces} from "./traces.js";

const HOLD = 3;
const MANUAL = "manual";

let socket, contents = null, state = null, session = "", viewer = false, seated = false;
let adopt = false, takeOver = false, lastSet = {}, fading = 0;
let lastBeat = 0, lastState = 0, chosen = null, asked = 0, retry = 500;
const traces = new Traces($("plots"), $("cursor-time"));
const manual = new Manual($("columns"));
const rows = new Rows();
const surface = new Surface($("surface"), $("surface-text"));
legend($("surface-legend"));

// --- the connection

function secret() {
  let found = sessionStorage.getItem("session");
  if (!found) {
    found = Array.from(crypto.getRandomValues(new Uint8Array(16)), b => b.toString(16).padStart(2, "0")).join("");
    sessionStorage.setItem("session", found);
  }
  return found;
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  socket = new WebSocket(scheme + "//" + location.host + "/socket");
  socket.onopen = () => {
    retry = 500;
    send({hello: {session: secret(), person: $("person").value}});
    if (chosen) send({fields: chosen});
  };
  socket.onmessage = event => receive(JSON.parse(event.data));
  socket.onclose = event => {
    if (event.code === 4401) {
      $("login").hidden = false;
      $("token").focus();
      show({accepted: false, reason: "this page needs a token"});
      return;
    }
    setTimeout(connect, retry);
    retry = Math.min(5000, 2 * retry);
  };
}

function send(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  else if (message.ask) show({accepted: false, reason: "no connection"});
}

function ask(name, args = {}) {
  send({ask: name, arguments: args, id: ++asked});
}

function receive(message) {
  if (message.type === "welcome") ({session, viewer} = message);
  else if (message.type === "contents") showContents(message.contents);
  else if (message.type === "history") traces.reset(message);
  else if (message.type === "traces") traces.add(message);
  else if (message.type === "state") { state = message; lastState = performance.now(); showState(); }
  else if (message.type === "journal") showJournal(message);
  else if (message.type === "answer") showAnswer(message);
  // The beat follows messages, because browsers slow the timers of a tab in the background.
  if (seated && performance.now() - lastBeat > 900) { lastBeat = performance.now(); ask("beat"); }
}

async function login(token) {
  const answer = await fetch("/login", {method: "POST", body: token});
  if (answer.ok) { $("login").hidden = true; show(null); connect(); }
  else { show({accepted: false, reason: await answer.text()}); $("login").hidden = false; }
}

// --- answers

function show(answer, name = "") {
  const box = $("answer");
  box.classList.toggle("refused", Boolean(answer) && !answer.accepted);
  const text = !answer ? "" : (answer.accepted ? (answer.reason || "accepted") : "Refused: " + answer.reason);
  setText(box, name && text ? name.replaceAll("_", " ") + ": " + text : text);
  clearTimeout(fading);
  if (answer && answer.accepted) fading = setTimeout(() => setText(box, ""), 8000);
}

function showAnswer(answer) {
  if (answer.ask === "beat") return;
  show(answer, answer.ask === "confirm_item" ? "" : answer.ask);
  armingAnswered(answer);
  if (answer.ask === "take_seat" && !answer.accepted && /take over/.test(answer.reason)) offerTakeOver(true);
  if (["set", "undo"].includes(answer.ask) && answer.accepted) adopt = true;
}

function offerTakeOver(on) {
  takeOver = on;
  setText($("take"), on ? "Take over" : "Take seat");
}

// --- what does not change from tick to tick

function showContents(found) {
  const first = !contents || contents.title.run !== found.title.run;
  contents = found;
  const title = contents.title;
  document.title = title.run;
  setText($("stamp"), title.stamp + (title.live ? "" : " (REPLAY)"));
  setText($("run"), title.run);
  setText($("where"), title.rig + (contents.sea ? ", " + contents.sea : ""));
  $("replay").hidden = title.live;
  $("plan-acts").hidden = !title.live;
  manual.build(contents.columns_live);
  if (!first) return;
  buildFields();
  rows.build(contents);
  buildCards(contents);
  const drawn = surface.build(contents) && rows.chosen >= 0;
  $("surface-box").hidden = !drawn;
  $("rows-list").open = !drawn;
}

function chosenGroups() {
  return contents.traces.map(group => ({unit: group.unit, fields: group.fields.filter(f => chosen.includes(f))}));
}

function buildFields() {
  chosen = contents.traces.flatMap(group => group.first);
  const boxes = contents.traces.flatMap(group => group.fields).map(field => {
    const label = element("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = chosen.includes(field);
    box.addEventListener("change", () => {
      chosen = box.checked ? [...chosen, field] : chosen.filter(each => each !== field);
      if (chosen.length > 24) { box.checked = false; chosen.pop(); }
      send({fields: chosen});
      traces.build(chosenGroups(), contents.fields);
    });
    label.append(box, element("span", contents.fields[field].label + " " + contents.fields[field].unit));
    return label;
  });
  $("fields").replaceChildren(...boxes);
  traces.build(chosenGroups(), contents.fields);
}

// --- the state, five times a second

function showState() {
  if (!contents) return;
  const orders = state.orders || {}, source = state.source;
  const ended = source.ended || (state.end.status && state.end.status !== "running");
  showRunState(ended);
  showSeat(orders, ended);
  showPosition(orders);
  showPowers();
  showLimits(contents, state);
  showAges(contents, state);
  showLoop(state);
  showAlarms(state.alarms, seated, ask);
  showArming(contents, state, seated, ask);
  showManual(orders);
  const products = ended ? state.products : [];
  if ($("products").childElementCount !== products.length)
    $("products").replaceChildren(...products.map(name => {
      const link = element("a", name);
      link.href = "/products/" + encodeURIComponent(name);
      link.target = "_blank";
      link.rel = "noopener";
      return link;
    }));
}

function showRunState(ended) {
  const box = $("state");
  box.dataset.state = state.state;
  const fault = state.reason && !["PLAN_END", "OPERATOR_STOP"].includes(state.reason);
  const silent = contents.title.live && !ended && state.silent_s > 2;
  if (silent) box.dataset.state = "LOST";
  box.toggleAttribute("data-fault", Boolean(fault) && state.state !== "RUNNING");
  const over = ended && contents.title.live && state.end.status !== "running";
  setText(box.lastElementChild, over ? "ENDED, OFF" : silent ? "NO ROWS" : state.state);
  if (silent) setText($("reason"), "no row for " + state.silent_s.toFixed(0) + " s");
  else setText($("reason"), state.reason_text ? state.reason_text + (over ? ", record " + (state.end.record || "being written") : "") : "");
}

function showSeat(orders, ended) {
  const live = contents.title.live && !ended;
  const was = seated;
  seated = live && orders.operator_session === session;
  if (was && !seated && live) show({accepted: false, reason: "you do not have the seat any more" + (orders.operator ? "; it is with " + orders.operator : "")});
  setText($("operator"), !contents.title.live ? "A recorded run." : ended ? "The run has ended." : seated ? "You are the operator" + (orders.operator ? " (" + orders.operator + ")." : ".") :
    orders.operator ? orders.operator + " is the operator." : "Nobody has the seat.");
  setText($("beat"), seated ? "beat " + ((performance.now() - lastBeat) / 1000).toFixed(1) + " s ago" : viewer ? "You may only look." : "");
  $("take").hidden = !live || seated || viewer;
  $("person").parentElement.hidden = $("take").hidden;
  $("leave").hidden = !seated;
  if (!takeOver && orders.operator && !seated) offerTakeOver(true);
  if (takeOver && !orders.operator) offerTakeOver(false);
  const may = seated && live, running = state.state === "RUNNING";
  $("stop").disabled = !live;
  $("abort").disabled = !live || viewer;
  $("hold").disabled = !may || !running;
  $("resume").disabled = !may || state.mode !== HOLD;
  const phase = contents.phases[state.phase];
  const rows = may && (running || state.mode === HOLD) && phase !== MANUAL;
  $("skip").disabled = $("repeat").disabled = !rows || state.row < 0;
  $("finish").disabled = !may || !(running || state.mode === HOLD);
  $("to-manual").hidden = !orders.live || orders.manual || Boolean(state.live);
  $("to-manual").disabled = !may || state.mode !== HOLD;
  $("to-campaign").hidden = orders.manual || !state.live;
  $("to-campaign").disabled = !may || state.mode !== HOLD;
  $("rows-card").hidden = Boolean(orders.manual);
  $("skip").hidden = $("repeat").hidden = Boolean(orders.manual);
}

function showPosition(orders) {
  const phase = contents.phases[state.phase] || "", count = contents.rows.length;
  const manualRun = orders.manual || phase === MANUAL;
  setText($("position"), manualRun ? "Manual mode   " + (phase === MANUAL ? "" : phase) : state.row >= 0 && state.row !== undefined ?
    "Row " + state.row + " (" + (state.row + 1) + " of " + count + ")   " + phase + (state.attempt ? "   attempt " + (state.attempt + 1) : "") : phase + "   (" + count + " rows)");
  const row = contents.rows[state.row];
  setText($("setpoint"), row && !manualRun ? contents.columns.map((c, k) => c.label + " " + plain(row[k]) + " " + c.unit).join("   ") : "");
  const segment = state.segment || {};
  const over = contents.phases[state.phase] === "done", held = state.mode === HOLD || over; // no time of the plan runs
  const known = !held && segment.length !== null && segment.elapsed !== null && segment.length > 0.01;
  $("progress").style.width = known ? Math.min(100, 100 * segment.elapsed / segment.length) + "%" : "0";
  const parts = ["run time " + clock(state.time)];
  if (!held && segment.elapsed !== null && segment.elapsed !== undefined) parts.push(phase + " " + segment.elapsed.toFixed(0) + (known ? " of " + segment.length.toFixed(0) : "") + " s");
  if (!held && segment.left !== null && segment.left !== undefined && !manualRun)
    parts.push(clock(segment.left) + " left, ends " + new Date(Date.now() + 1000 * segment.left).toLocaleTimeString([], {hour: "2-digit", minute: "2-digit"}));
  else if (!contents.title.live && contents.duration_s) parts.push("of " + clock(contents.duration_s));
  setText($("times"), parts.join("   "));
}

function showPowers() {
  rows.show(state);
  if (!$("surface-box").hidden && state.rows) surface.show(state, rows.chosen, rows.best(state));
}

// --- manual mode

function showManual(orders) {
  const on = Boolean(orders.live && orders.set && (orders.manual || state.live || orders.set_number));
  $("manual").hidden = !on || !contents.title.live;
  if (!on) return;
  const changed = JSON.stringify(orders.set) !== JSON.stringify(manual.present);
  if (changed) {
    manual.fill(orders.set);
    if (adopt) { manual.reset(); adopt = false; }
  }
  setText($("set-number"), "set point " + (orders.set_number || 0) + (state.live === orders.set_number ? " in force" : " on its way"));
  for (const id of ["apply", "keep"]) $(id).disabled = !seated;
  $("undo").disabled = !seated || !orders.undo;
  setText($("kept"), orders.kept ? "kept rows: " + orders.kept : "");
}

// --- the journal

// The columns of a set point that differ from those of the one before.
function changes(entry) {
  const given = {...entry.arguments.values, ...entry.arguments.signal};
  const found = Object.entries(given).filter(([key, value]) => lastSet[key] !== value);
  if (entry.accepted) Object.assign(lastSet, given);
  return found.map(([key, value]) => key + " " + value).join(", ");
}

function showJournal(message) {
  if (message.all) { $("journal").replaceChildren(); lastSet = {}; }
  for (const each of message.entries) {
    const line = element("tr", undefined, each.accepted ? "" : "refused");
    const given = each.arguments.text || each.arguments.comment || each.arguments.alarm || changes(each);
    const text = element("td", each.request.replaceAll("_", " ") + (given ? ": " + given : ""));
    text.prepend(element("strong", each.person + " "));
    if (each.reason || !each.accepted) text.append(element("span", " (" + (each.accepted ? "" : "refused: ") + each.reason + ")", "quiet"));
    line.append(element("td", each.utc.slice(11, 19)), text);
    $("journal").prepend(line);
    while ($("journal").rows.length > 300) $("journal").lastElementChild.remove();
  }
}

// --- what people do

const acts = {
  hold: () => ask("hold"), resume: () => ask("resume"), stop: () => ask("stop"), abort: () => ask("abort"),
  skip: () => ask("skip"), repeat: () => ask("repeat"), finish: () => ask("finish"), tare: () => ask("tare"),
  "to-manual": () => ask("manual"), "to-campaign": () => ask("campaign"),
  arm: () => ask("arm"), "arm-anyway": () => ask("arm", {all_the_same: true}), confirm: () => ask("confirm"), leave: () => ask("leave_seat"), undo: () => ask("undo"),
  take: () => {
    sessionStorage.setItem("person", $("person").value);
    send({hello: {session: secret(), person: $("person").value}});
    lastBeat = performance.now();
    ask("take_seat", takeOver ? {take_over: true} : {});
    offerTakeOver(false);
  },
  apply: () => {
    const set = manual.read();
    if (set.problem) show({accepted: false, reason: set.problem}, "set");
    else { show({accepted: true, reason: "checking …"}, "set"); ask("set", set); }
  },
  keep: () => { ask("keep", {comment: $("comment").value}); $("comment").value = ""; },
  pause: () => {
    traces.paused = !traces.paused;
    $("pause").setAttribute("aria-pressed", traces.paused);
    setText($("pause"), traces.paused ? "Go on" : "Pause");
    if (!traces.paused) traces.redraw();
  },
  restart: () => send({speed: "restart"}),
};
for (const [id, act] of Object.entries(acts)) $(id).addEventListener("click", act);
$("best-by").addEventListener("change", () => { if (state) showPowers(); });
$("span").addEventListener("change", () => { traces.span = Number($("span").value); traces.redraw(); });
$("speed").addEventListener("change", () => send({speed: Number($("speed").value)}));
$("annotate").addEventListener("submit", event => { event.preventDefault(); ask("annotate", {text: $("note").value}); $("note").value = ""; });
$("login").addEventListener("submit", event => { event.preventDefault(); login($("token").value); $("token").value = ""; });
// A form of several fields without a button of its own is not submitted by Enter.
manual.form.addEventListener("keydown", event => { if (event.key === "Enter" && event.target.matches("input")) acts.apply(); });

document.addEventListener("keydown", event => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
  const typing = event.target.matches("input:not([type=checkbox]), select, textarea");
  if (event.key === "Escape" && typing) event.target.blur();
  else if (event.key === "Escape") (event.shiftKey ? acts.abort : acts.stop)();
  else if (typing) return;
  else if (event.key === "s" || event.key === "S") acts.stop();
  else if (event.key === "h") acts.hold();
  else if (event.key === "r") acts.resume();
  else if (event.key === "p") acts.pause();
});

// A page without fresh rows must not look like a running one.
setInterval(() => {
  if (performance.now() - lastState < 2000) return;
  $("state").dataset.state = "LOST";
  setText($("state").lastElementChild, "NO CONNECTION");
  setText($("reason"), "what is shown is old; the run goes on without this page");
}, 500);

$("person").value = sessionStorage.getItem("person") || "";
const token = new URLSearchParams(location.hash.slice(1)).get("token");
if (token) {
  history.replaceState(null, "", location.pathname);
  login(token);
} else connect();
