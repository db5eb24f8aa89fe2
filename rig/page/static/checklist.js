// The checklist before power on, and arming in two steps.
import {$, element, setText} from "./dom.js";

const OFF = 0;
let confirmUntil = 0, refused = false, lines = [];

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
  const key = JSON.stringify(items.map(item => [item.key, item.by_hand]));
  if ($("checks").dataset.key !== key) {
    $("checks").dataset.key = key;
    lines = items.map(item => new Line(item, ask));
    $("checks").replaceChildren(...lines.map(line => line.node));
  }
  lines.forEach((line, at) => line.show(items[at], seated));
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

// Its elements stay while its texts change, several times a second: a click on one that is replaced
// between press and release is lost.
class Line {
  constructor(item, ask) {
    this.item = item;
    this.node = element("li");
    const label = element(item.by_hand ? "label" : "span", undefined, "item");
    if (item.by_hand) {
      this.box = document.createElement("input");
      this.box.type = "checkbox";
      this.box.id = "item-" + item.key;
      // It is ticked when the journal has it, not before.
      this.box.addEventListener("click", event => { event.preventDefault(); ask("confirm_item", {item: this.item.key, confirmed: !this.item.done}); });
    } else this.mark = element("span", "", "mark");
    this.text = element("span");
    label.append(this.box || this.mark, this.text);
    this.node.append(label);
    if (item.key === "host") {
      this.button = element("button", "Run checks");
      this.button.id = "run-checks";
      this.button.addEventListener("click", () => ask("check_host"));
      this.node.append(this.button);
    }
    this.by = element("span", "", "quiet");
    this.details = element("div", undefined, "detail");
    this.node.append(this.by, this.details);
  }

  show(item, seated) {
    this.item = item;
    this.node.className = item.done ? "" : "open";
    if (this.box) {
      // After a click the browser sets the box itself, so it is set anew even if nothing changed.
      this.box.checked = item.done;
      this.box.disabled = !seated;
    } else setText(this.mark, item.done ? "✓" : "✗");
    setText(this.text, item.text);
    if (this.button) this.button.disabled = !seated || item.text.endsWith("running");
    const time = item.utc.slice(11, 19);
    setText(this.by, [item.by, time && time + " UTC"].filter(Boolean).join(", "));
    this.by.hidden = !this.by.textContent;
    while (this.details.childElementCount > item.details.length) this.details.lastChild.remove();
    while (this.details.childElementCount < item.details.length) this.details.append(element("div"));
    item.details.forEach((text, at) => setText(this.details.children[at], text));
    this.details.hidden = !item.details.length;
  }
}
