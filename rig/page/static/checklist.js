// The checklist before power on, and arming in two steps.
import {$, element, setText} from "./dom.js";

const OFF = 0;
let confirmUntil = 0, refused = false;

export function armingAnswered(answer) {
  if (answer.ask === "arm" && answer.accepted) confirmUntil = performance.now() + 10000;
  if (answer.ask === "arm") refused = !answer.accepted && answer.reason.startsWith("open on the checklist");
  if (answer.ask === "confirm") confirmUntil = 0;
}

export function showArming(contents, state, seated, ask) {
  const orders = state.orders || {}, items = state.checklist || [];
  const standby = contents.phases[state.phase] === "standby" && state.mode === OFF && !state.reason;
  $("arming").hidden = !(orders.must_arm && !orders.armed && contents.title.live && state.mode === OFF && !state.reason);
  if ($("arming").hidden) return;
  const key = JSON.stringify(items) + seated;
  if ($("checks").dataset.key !== key) {
    $("checks").dataset.key = key;
    const focused = document.activeElement.dataset ? document.activeElement.dataset.item : undefined;
    $("checks").replaceChildren(...items.map(item => line(item, seated, ask)));
    if (focused) $("checks").querySelector(`[data-item="${CSS.escape(focused)}"]`)?.focus();
  }
  const open = items.filter(item => !item.done).length, left = (confirmUntil - performance.now()) / 1000;
  if (!open) refused = false;
  const checking = items.some(item => item.key === "host" && item.text.endsWith("running"));
  $("arm").disabled = !seated || !standby || checking;
  $("arm-anyway").hidden = !refused || !seated || !standby || checking;
  $("tare").disabled = !seated || !standby;
  $("confirm").disabled = !seated || !(left > 0) || !orders.arming;
  setText($("arming-time"), left > 0 && orders.arming ? "confirm within " + left.toFixed(0) + " s" :
    !seated ? "take the seat first" : open ? open + " open" : "all done");
}

function line(item, seated, ask) {
  const found = element("li", undefined, item.done ? "" : "open"), label = element(item.by_hand ? "label" : "span", undefined, "item");
  if (item.by_hand) {
    const box = document.createElement("input");
    box.type = "checkbox";
    box.id = "item-" + item.key;
    box.dataset.item = item.key;
    box.checked = item.done;
    box.disabled = !seated;
    // It is ticked when the journal has it, not before.
    box.addEventListener("click", event => { event.preventDefault(); ask("confirm_item", {item: item.key, confirmed: !item.done}); });
    label.append(box);
  } else label.append(element("span", item.done ? "✓" : "✗", "mark"));
  label.append(element("span", item.text));
  found.append(label);
  if (item.key === "host") {
    const button = element("button", "Run checks");
    button.id = "run-checks";
    button.dataset.item = item.key;
    button.disabled = !seated || item.text.endsWith("running");
    button.addEventListener("click", () => ask("check_host"));
    found.append(button);
  }
  if (item.by || item.utc) found.append(element("span", [item.by, item.utc.slice(11, 19) && item.utc.slice(11, 19) + " UTC"].filter(Boolean).join(", "), "quiet"));
  if (item.details.length) found.append(...item.details.map(text => element("div", text, "detail")));
  return found;
}
