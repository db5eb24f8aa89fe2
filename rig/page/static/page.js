// The operator's page. Every text is set as text, never as markup: names and notes may be hostile.
import {Traces, number} from "./traces.js";
import {Manual} from "./manual.js";

const $ = id => document.getElementById(id);
const LATENESS = [5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
const HOLD = 3, OFF = 0;
const STANDBY = "standby", MANUAL = "manual";

let socket, contents = null, state = null, session = "", viewer = false, seated = false;
let adopt = false, takeOver = false, lastSet = {}, fading = 0;
let lastBeat = 0, lastState = 0, confirmUntil = 0, chosen = null, asked = 0, retry = 500;
const ticked = new Set();
const traces = new Traces($("plots"), $("cursor-time"));
const manual = new Manual($("columns"));

function element(tag, text, name) {
  const found = document.createElement(tag);
  if (text !== undefined) found.textContent = text;
  if (name) found.className = name;
  return found;
}

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

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
  show(answer, answer.ask);
  if (answer.ask === "arm" && answer.accepted) confirmUntil = performance.now() + 10000;
  if (answer.ask === "confirm") confirmUntil = 0;
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
  buildRows();
  buildGauges();
  $("best-by").replaceChildren(...contents.stations.filter(s => s.mean).map(s => element("option", s.label)));
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

function buildRows() {
  const head = element("tr");
  head.append(element("th", "row"), ...contents.columns.map(c => element("th", c.label)),
    ...contents.stations.filter(s => s.mean).map(s => element("th", s.heading + " W")));
  $("row-table").tHead.replaceChildren(head);
  const body = contents.rows.map((row, at) => {
    const line = element("tr");
    line.append(element("td", String(at)), ...row.map(v => element("td", number(v))),
      ...contents.stations.filter(s => s.mean).map(() => element("td", "")));
    return line;
  });
  $("row-table").tBodies[0].replaceChildren(...body);
  $("powers").replaceChildren(...contents.stations.map(station => {
    const line = element("tr");
    line.append(element("td", station.label), element("td", "–"), element("td", station.mean ? "–" : ""));
    return line;
  }));
}

function buildGauges() {
  $("limits").replaceChildren(...contents.limits.map(limit => {
    const box = element("div", undefined, "gauge");
    const scale = element("div", undefined, "scale");
    scale.append(element("i", undefined, "span"));
    if (limit.warn !== null)
      for (const at of [-limit.warn, limit.warn]) {
        const mark = element("i", undefined, "mark");
        mark.style.left = share(at, limit.low, limit.high) + "%";
        scale.append(mark);
      }
    scale.append(element("i", undefined, "now"));
    box.append(element("span", limit.label, "name"), element("span", "", "number"), element("span", "", "number margin"), scale);
    box.title = "from " + number(limit.low) + " to " + number(limit.high) + " " + limit.unit;
    return box;
  }));
  $("ages").replaceChildren(...contents.ages.map(age => {
    const box = element("div", undefined, "age"), scale = element("div", undefined, "scale");
    scale.append(element("i", undefined, "span"));
    box.append(element("span", age.label), element("span", ""), scale);
    return box;
  }));
  $("histogram").replaceChildren(...[...LATENESS.map(String), "∞"].map(edge => {
    const box = element("div");
    box.append(element("i"), element("span", edge));
    return box;
  }));
}

function share(value, low, high) {
  return Math.min(100, Math.max(0, 100 * (value - low) / (high - low)));
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
  showLimits();
  showLoop(source);
  showAlarms(state.alarms);
  showArming(orders);
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
  setText($("setpoint"), row && !manualRun ? contents.columns.map((c, k) => c.label + " " + number(row[k]) + " " + c.unit).join("   ") : "");
  const segment = state.segment || {};
  const known = segment.length !== null && segment.elapsed !== null && segment.length > 0.01;
  $("progress").style.width = known ? Math.min(100, 100 * segment.elapsed / segment.length) + "%" : "0";
  const parts = ["run time " + clock(state.time)];
  if (segment.elapsed !== null && segment.elapsed !== undefined) parts.push(phase + " " + segment.elapsed.toFixed(0) + (known ? " of " + segment.length.toFixed(0) : "") + " s");
  if (segment.left !== null && segment.left !== undefined && !manualRun)
    parts.push(clock(segment.left) + " left, ends " + new Date(Date.now() + 1000 * segment.left).toLocaleTimeString([], {hour: "2-digit", minute: "2-digit"}));
  else if (!contents.title.live && contents.duration_s) parts.push("of " + clock(contents.duration_s));
  setText($("times"), parts.join("   "));
}

function clock(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const s = Math.floor(seconds), two = n => String(n).padStart(2, "0");
  return (s >= 3600 ? Math.floor(s / 3600) + ":" : "") + two(Math.floor(s / 60) % 60) + ":" + two(s % 60);
}

function watts(value) {
  if (value === null || value === undefined) return "–";
  const text = value.toFixed(Math.abs(value) < 100 ? 1 : 0);
  return Number(text) === 0 ? "0.0" : text.replace("-", "\u2212");
}

function showPowers() {
  if (!state.powers) return;
  state.powers.forEach(([now, mean], k) => {
    const cells = $("powers").rows[k].cells;
    setText(cells[1], watts(now));
    if (contents.stations[k].mean) setText(cells[2], state.samples > 0 ? watts(mean) : "–");
  });
  const stations = contents.stations.filter(s => s.mean), first = 1 + contents.columns.length;
  const by = $("best-by").selectedIndex, at = contents.stations.indexOf(stations[by]);
  let best = null, low = Infinity;
  for (const [row, [powers, whole]] of Object.entries(state.rows)) {
    const line = $("row-table").tBodies[0].rows[row];
    if (!line) continue;
    contents.stations.forEach((station, k) => {
      if (station.mean) setText(line.cells[first + stations.indexOf(station)], watts(powers[k]));
    });
    line.classList.toggle("part", !whole);
    if (whole && at >= 0 && powers[at] !== null && powers[at] < low) { low = powers[at]; best = Number(row); }
  }
  const box = $("row-table").closest(".scroll");
  for (const line of $("row-table").tBodies[0].rows) {
    const index = line.rowIndex - 1, present = index === state.row;
    if (present && !line.classList.contains("present")) box.scrollTop = Math.max(0, line.offsetTop - 120);
    line.classList.toggle("present", present);
    for (const cell of line.cells) cell.classList.remove("best");
    if (index === best) { line.cells[first + by].classList.add("best"); }
    setText(line.cells[0], index + (index === best ? " ★" : ""));
  }
}

function showLimits() {
  if (!state.limits) return;
  state.limits.forEach(([now, low, high], k) => {
    const limit = contents.limits[k], box = $("limits").children[k];
    const [bottom, top] = [Math.min(low ?? now, now), Math.max(high ?? now, now)];
    const margin = Math.min(top === null ? Infinity : limit.high - top, bottom === null ? Infinity : bottom - limit.low);
    const span = box.querySelector(".span");
    span.style.left = share(bottom, limit.low, limit.high) + "%";
    span.style.width = Math.max(0.5, share(top, limit.low, limit.high) - share(bottom, limit.low, limit.high)) + "%";
    box.querySelector(".now").style.left = share(now, limit.low, limit.high) + "%";
    setText(box.children[1], number(now) + " " + limit.unit);
    setText(box.children[2], "margin " + (100 * margin / limit.high).toFixed(0) + " %");
    const beyond = limit.warn === null ? margin < 0.1 * limit.high : Math.max(top, -bottom) >= limit.warn;
    box.classList.toggle("warn", beyond && margin > 0);
    box.classList.toggle("bad", margin <= 0);
  });
  state.ages.forEach((age, k) => {
    const limit = contents.ages[k].limit, box = $("ages").children[k], span = box.querySelector(".span");
    setText(box.children[1], (age === null ? "–" : (1000 * age).toFixed(1)) + (limit === null ? "" : " / " + 1000 * limit));
    span.style.left = "0";
    span.style.width = limit === null || age === null ? "0" : share(age, 0, limit) + "%";
    box.classList.toggle("warn", limit !== null && (age === null || age > 0.5 * limit));
    box.classList.toggle("bad", limit !== null && age !== null && age > limit);
  });
}

function showLoop(source) {
  if (!state.lateness) return;
  const most = Math.log10(1 + Math.max(...state.lateness));
  state.lateness.forEach((count, k) => {
    const box = $("histogram").children[k];
    box.firstElementChild.style.height = (most ? 70 * Math.log10(1 + count) / most : 0) + "%";
    box.title = count + " wake-ups";
  });
  setText($("counts"), state.skipped + " ticks skipped   " + source.unsaved + " rows not on disk   " + source.dropped + " rows lost   wake-ups by lateness, µs:");
}

function showAlarms(alarms) {
  const seen = alarms.filter(each => each.acknowledged).length;
  setText($("alarm-count"), alarms.length ? alarms.length + ", " + (alarms.length - seen) + " not acknowledged" : "none");
  const key = JSON.stringify(alarms.map(each => [each.key, each.acknowledged, each.times > 1])) + seated;
  if ($("alarms").dataset.key === key) return;
  $("alarms").dataset.key = key;
  const open = $("alarms").querySelector("details[open]") !== null;
  const boxes = alarms.map(each => {
    const box = element("div", undefined, "alarm " + each.priority + (each.acknowledged ? " seen" : ""));
    box.append(element("div", (each.priority === "high" ? "■ " : "▲ ") + each.cause, "cause"), element("div", each.action),
      element("div", "at " + clock(each.time) + (each.times > 1 ? ", repeated" : "") + (each.acknowledged ? ", acknowledged by " + each.acknowledged : ""), "quiet"));
    if (!each.acknowledged && seated) {
      const button = element("button", "Acknowledge");
      button.addEventListener("click", () => ask("acknowledge", {alarm: each.key}));
      box.append(button);
    }
    return box;
  });
  const rest = element("details");
  rest.open = open;
  rest.append(element("summary", boxes.length - 1 + " more"), ...boxes.slice(1));
  $("alarms").replaceChildren(...boxes.slice(0, 1), ...(boxes.length > 1 ? [rest] : []));
}

// --- before power on

function checklist() {
  const late = state.ages ? state.ages.filter((age, k) => contents.ages[k].limit !== null && (age === null || age > contents.ages[k].limit)).length : 1;
  const granted = contents.privileges || {}, refused = Object.entries(granted).filter(([, v]) => /false|refused|no$/i.test(v)).map(([k]) => k);
  return [
    {key: "devices", text: late ? late + " values are too old" : "all values are younger than their limits", ok: late === 0},
    {key: "tare", text: "the sensor zeros are measured", ok: contents.phases[state.phase] === STANDBY},
    {key: "host", text: contents.title.mode === "rehearsal" ? "host: a rehearsal needs no real time" : refused.length ? "host did not grant: " + refused.join(", ") : "host granted real time", ok: contents.title.mode === "rehearsal" || !refused.length},
    {key: "doctor", text: "`rig doctor` passed today", tick: true},
    {key: "calibrations", text: "the calibrations are those of this rig", tick: true},
    {key: "e-stop", text: "the emergency stop was tested", tick: true},
    {key: "people", text: "nobody is within reach of the moving parts", tick: true},
  ];
}

function showArming(orders) {
  const standby = contents.phases[state.phase] === STANDBY && state.mode === OFF && !state.reason;
  $("arming").hidden = !(orders.must_arm && contents.title.live && (standby || state.time < 1));
  if ($("arming").hidden) return;
  const checks = checklist();
  if (!$("checks").childElementCount)
    $("checks").append(...checks.map(each => {
      const line = element("li"), label = element("label");
      if (each.tick) {
        const box = document.createElement("input");
        box.type = "checkbox";
        box.addEventListener("change", () => { box.checked ? ticked.add(each.key) : ticked.delete(each.key); showArming(state.orders); });
        label.append(box, " ");
      } else line.append(element("span", "", "mark"));
      label.append(element("span", each.text));
      line.append(label);
      return line;
    }));
  checks.forEach((each, k) => {
    const line = $("checks").children[k], ok = each.tick ? ticked.has(each.key) : each.ok;
    if (!each.tick) { setText(line.querySelector(".mark"), ok ? "✓" : "✗"); setText(line.querySelector("label span"), each.text); }
    line.classList.toggle("no", !ok);
  });
  const ready = checks.every(each => each.tick ? ticked.has(each.key) : each.ok);
  const left = (confirmUntil - performance.now()) / 1000;
  $("arm").disabled = !seated || !standby || !ready;
  $("tare").disabled = !seated || !standby;
  $("confirm").disabled = !seated || !(left > 0) || !orders.arming;
  setText($("arming-time"), left > 0 && orders.arming ? "confirm within " + left.toFixed(0) + " s" : !seated ? "take the seat first" : ready ? "" : "complete the list first");
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
    line.append(element("td", each.utc.slice(11, 19)), element("td", each.person),
      element("td", each.request.replaceAll("_", " ") + (given ? ": " + given : "")),
      element("td", (each.accepted ? "" : "refused: ") + each.reason));
    $("journal").prepend(line);
    while ($("journal").rows.length > 300) $("journal").lastElementChild.remove();
  }
}

// --- what people do

const acts = {
  hold: () => ask("hold"), resume: () => ask("resume"), stop: () => ask("stop"), abort: () => ask("abort"),
  skip: () => ask("skip"), repeat: () => ask("repeat"), finish: () => ask("finish"), tare: () => ask("tare"),
  "to-manual": () => ask("manual"), "to-campaign": () => ask("campaign"),
  arm: () => ask("arm"), confirm: () => ask("confirm"), leave: () => ask("leave_seat"), undo: () => ask("undo"),
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
$("span").addEventListener("change", () => { traces.span = Number($("span").value); traces.redraw(); });
$("speed").addEventListener("change", () => send({speed: Number($("speed").value)}));
$("annotate").addEventListener("submit", event => { event.preventDefault(); ask("annotate", {text: $("note").value}); $("note").value = ""; });
$("login").addEventListener("submit", event => { event.preventDefault(); login($("token").value); $("token").value = ""; });
manual.form.addEventListener("submit", () => acts.apply());

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
