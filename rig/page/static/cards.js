// The cards of limits, ages, loop and alarms.
import {$, clock, element, number, setText, share} from "./dom.js";

const LATENESS = [5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
const NEAR = 0.1; // least margin without a mark, where a limit has no warning of its own
let gauges = []; // of all limits, in their order

export function buildCards(contents) {
  gauges = contents.limits.map(gauge);
  const derived = contents.limits.map(limit => limit.derived);
  $("limits").replaceChildren(...gauges.filter((_, k) => !derived[k]));
  $("derived-limits").replaceChildren(...gauges.filter((_, k) => derived[k]));
  $("derived").hidden = !derived.some(Boolean);
  $("ages").replaceChildren(...contents.ages.map(age => {
    const box = element("div", undefined, "age"), scale = element("div", undefined, "scale");
    scale.append(element("i", undefined, "span"));
    box.append(element("span", age.label.replace(/ age$/, "")), element("span", ""), scale);
    return box;
  }));
  $("histogram").replaceChildren(...[...LATENESS.map(String), "∞"].map(edge => {
    const box = element("div");
    box.append(element("i"), element("span", edge));
    return box;
  }));
}

// A value with a thousandth of its limit as the last digit.
function fixed(value, limit) {
  const digits = Math.min(6, Math.max(0, 3 - Math.ceil(Math.log10(Math.abs(limit) || 1))));
  return value.toFixed(digits).replace("-", "\u2212");
}

function gauge(limit) {
  const box = element("div", undefined, "gauge"), scale = element("div", undefined, "scale");
  scale.append(element("i", undefined, "span"));
  if (limit.warn !== null)
    for (const at of [-limit.warn, limit.warn].filter(each => each > limit.low)) {
      const mark = element("i", undefined, "mark");
      mark.style.left = share(at, limit.low, limit.high) + "%";
      scale.append(mark);
    }
  scale.append(element("i", undefined, "now"));
  box.append(element("span", limit.label, "name"), element("span", "", "number"), element("span", "", "number margin"), scale);
  box.title = limit.key + ": from " + number(limit.low) + " to " + number(limit.high) + " " + limit.unit;
  return box;
}

export function showLimits(contents, state) {
  if (!state.limits) return;
  let least = Infinity, marked = false;
  state.limits.forEach(([now, low, high], k) => {
    const limit = contents.limits[k], box = gauges[k];
    const known = [now, low, high].filter(each => each !== null);
    box.classList.toggle("none", !known.length);
    const [bottom, top] = [Math.min(...known), Math.max(...known)];
    const below = limit.both ? bottom - limit.low : Infinity, size = limit.both ? (limit.high - limit.low) / 2 : limit.high;
    const margin = known.length ? Math.min(limit.high - top, below) / size : Infinity;
    const from = share(known.length ? bottom : 0, limit.low, limit.high), to = share(known.length ? top : 0, limit.low, limit.high);
    const span = box.querySelector(".span"), mark = box.querySelector(".now");
    span.style.left = from + "%";
    span.style.width = known.length ? Math.max(0.5, to - from) + "%" : "0";
    mark.hidden = now === null;
    mark.style.left = share(now, limit.low, limit.high) + "%";
    setText(box.children[1], now === null ? "–" : fixed(now, limit.high) + " " + limit.unit);
    setText(box.children[2], known.length ? Math.round(100 * margin) + " %" : "not in use");
    const near = limit.warn === null ? margin < NEAR : Math.max(top, -bottom) >= limit.warn;
    box.classList.toggle("warn", near && (margin > 0 || !limit.stops));
    box.classList.toggle("bad", margin <= 0 && limit.stops);
    if (limit.derived) { least = Math.min(least, margin); marked = marked || near; }
  });
  setText($("derived-least"), least < Infinity ? "least margin " + Math.round(100 * least) + " %" : "");
  $("derived").classList.toggle("warn", marked);
}

export function showAges(contents, state) {
  if (!state.ages) return;
  state.ages.forEach((age, k) => {
    const limit = contents.ages[k].limit, box = $("ages").children[k], span = box.querySelector(".span");
    setText(box.children[1], (age === null ? "–" : (1000 * age).toFixed(1)) + (limit === null ? " / none" : " / " + 1000 * limit));
    span.style.left = "0";
    span.style.width = limit === null || age === null ? "0" : share(age, 0, limit) + "%";
    box.classList.toggle("warn", limit !== null && (age === null || age > 0.5 * limit));
    box.classList.toggle("bad", limit !== null && age !== null && age > limit);
  });
}

export function showLoop(state) {
  if (!state.lateness) return;
  const most = Math.log10(1 + Math.max(...state.lateness)), source = state.source;
  state.lateness.forEach((count, k) => {
    const box = $("histogram").children[k];
    box.firstElementChild.style.height = (most ? 70 * Math.log10(1 + count) / most : 0) + "%";
    box.title = count + " wake-ups";
  });
  setText($("counts"), state.skipped + " ticks skipped   " + source.unsaved + " rows not on disk   " + source.dropped + " rows lost   wake-ups by lateness, µs:");
}

export function showAlarms(alarms, seated, ask) {
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
