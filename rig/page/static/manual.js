// The panel of manual mode: the columns of a whole set point, and the signal generator.
import {element} from "./dom.js";

const COARSE = 0.05;

export class Manual {
  constructor(form) {
    this.form = form;
    this.inputs = new Map();
    this.columns = [];
    this.present = null;
    form.addEventListener("submit", event => event.preventDefault());
  }

  build(columns) {
    if (JSON.stringify(columns) === JSON.stringify(this.columns)) return;
    this.columns = columns;
    this.inputs.clear();
    this.form.replaceChildren();
    let part = "";
    for (const column of columns) {
      if (column.part !== part) {
        part = column.part;
        this.form.append(element("h3", part === "signal" ? "Signal generator" : "Set point"));
      }
      this.row(column);
    }
    if (this.present) this.fill(this.present);
  }

  row(column) {
    const id = "column-" + column.part + "-" + column.key;
    const label = element("label", column.label);
    label.htmlFor = id;
    if (column.choices) {
      const choice = document.createElement("select");
      for (const each of column.choices) choice.append(element("option", each));
      choice.id = id;
      this.form.append(label, element("span", ""), choice, element("span", ""), element("span", ""));
      this.remember(column, choice);
      return;
    }
    const input = document.createElement("input");
    input.id = id;
    input.type = "number";
    input.step = "any";
    if (column.low !== null) input.min = column.low;
    if (column.high !== null) input.max = column.high;
    const range = (column.low === null ? "" : short(column.low)) + " … " + (column.high === null ? "" : short(column.high));
    input.title = column.low === null && column.high === null ? "no range of its own; limits and stability are checked" : "allowed " + range;
    const unit = element("span", column.unit === "1" ? "" : column.unit.replaceAll("*", "·"));
    unit.className = "quiet";
    this.form.append(label, this.step(input, column, -1), input, this.step(input, column, 1), unit);
    this.remember(column, input);
  }

  step(input, column, sign) {
    const button = element("button", sign < 0 ? "−" : "+");
    button.type = "button";
    button.setAttribute("aria-label", (sign < 0 ? "less " : "more ") + column.label);
    button.addEventListener("click", () => {
      const value = Number(input.value) || 0;
      const span = column.low !== null && column.high !== null ? column.high - column.low : Math.max(Math.abs(value), 10);
      const size = 10 ** Math.floor(Math.log10(span * COARSE));
      let next = value + sign * size;
      if (column.low !== null) next = Math.max(column.low, next);
      if (column.high !== null) next = Math.min(column.high, next);
      input.value = Number(next.toPrecision(8));
      this.mark();
    });
    return button;
  }

  remember(column, input) {
    this.inputs.set(column.part + "." + column.key, {column, input});
    input.addEventListener("input", () => this.mark());
  }

  // A new set point in force fills the fields, but not those that a person has changed since.
  fill(set) {
    const before = this.present;
    this.present = set;
    for (const {column, input} of this.inputs.values()) {
      const now = set[column.part][column.key];
      const untouched = !before || input.value === "" || input.value === String(before[column.part][column.key]);
      if (untouched) input.value = now;
    }
    this.mark();
  }

  reset() {
    for (const {column, input} of this.inputs.values()) input.value = this.present[column.part][column.key];
    this.mark();
  }

  mark() {
    for (const {column, input} of this.inputs.values()) {
      const present = this.present && String(this.present[column.part][column.key]);
      input.classList.toggle("changed", present !== null && input.value !== present);
    }
  }

  // The whole set, or the reason why it is none.
  read() {
    const found = {values: {}, signal: {}};
    for (const {column, input} of this.inputs.values()) {
      const value = column.choices ? input.value : Number(input.value);
      if (!column.choices && (input.value === "" || !Number.isFinite(value))) return {problem: column.label + ": not a number"};
      found[column.part][column.key] = value;
    }
    return found;
  }
}

function short(value) {
  return Number(value.toPrecision(4)).toString();
}
