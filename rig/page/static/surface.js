// The power of the plan's rows over their set points, as they are measured: a cell for each point of
// a grid, a marker for each scattered point; over one set point, power against it.
import {element, interval, plain, setText, watts} from "./dom.js";
import {halfWidth} from "./rows.js";

// YlGnBu of ColorBrewer, as in the pictures of `rig plot`: most absorbed is dark blue. Its lightness
// falls evenly, and people with colour-blind eyes tell its colours apart.
const COLOURS = ["#081d58", "#253494", "#225ea8", "#1d91c0", "#41b6c4", "#7fcdbb", "#c7e9b4", "#edf8b1"];
const INK = "#1d2226", QUIET = "#545b61", EMPTY = "#8b9094", GROUND = "#dcdedf";
const LEFT = 64, BELOW = 34, ABOVE = 20, GAP = 12, BAR = 86; // px of a panel, and of the colour bar
const MAX_CELL = 84, MARKER = 9, FACE = "system-ui, 'DejaVu Sans', sans-serif", FONT = "12px " + FACE;
const MAX_LINES = 30; // distinct values of a column that make a grid
const FULL = 0.5; // share of a grid's cells that have a point

export class Surface {
  constructor(canvas, text) {
    this.canvas = canvas;
    this.text = text;
    this.points = [];
    this.pointed = -1;
    new ResizeObserver(() => this.draw()).observe(canvas.parentElement);
    canvas.addEventListener("pointermove", event => this.point(this.at(event.offsetX, event.offsetY)));
    canvas.addEventListener("pointerleave", () => this.point(-1));
    canvas.addEventListener("blur", () => this.point(-1));
    canvas.addEventListener("keydown", event => this.step(event));
  }

  // Whether the plan has columns to draw over.
  build(contents) {
    this.contents = contents;
    this.state = null;
    this.pointed = -1;
    const {x, y, panel} = contents.surface, byPoint = new Map();
    this.axes = [x, y].filter(column => column !== undefined);
    contents.rows.forEach((values, row) => {
      const point = contents.points[row];
      if (!byPoint.has(point)) byPoint.set(point, {rows: [], values, x: values[x], y: y === undefined ? 0 : values[y], panel: panel === undefined ? "" : values[panel]});
      byPoint.get(point).rows.push(row);
    });
    this.points = x === undefined ? [] : [...byPoint.values()];
    this.panels = distinct(this.points.map(each => each.panel));
    this.xs = distinct(this.points.map(each => each.x));
    this.ys = distinct(this.points.map(each => each.y));
    const cells = this.panels.length * this.xs.length * this.ys.length;
    this.grid = y !== undefined && this.xs.length <= MAX_LINES && this.ys.length <= MAX_LINES && this.points.length >= FULL * cells;
    this.curve = y === undefined;
    return this.points.length > 0;
  }

  // station: its place among all; best: the best row so far.
  show(state, station, best) {
    Object.assign(this, {state, station, best});
    for (const point of this.points) {
      const measured = point.rows.map(row => state.rows[row]).filter(each => each && each[0][station] !== null && each[0][station] !== undefined);
      point.count = measured.length;
      point.power = measured.length ? measured.reduce((sum, each) => sum + each[0][station], 0) / measured.length : null;
      point.half = measured.length === 1 ? halfWidth(measured[0], station) : undefined;
      point.whole = measured.length > 0 && measured.every(each => each[1]);
      point.present = point.rows.includes(state.row);
      point.best = point.rows.includes(best);
    }
    this.draw();
  }

  // --- where things are

  layout() {
    const width = this.canvas.parentElement.clientWidth, columns = this.curve ? 10 : this.xs.length;
    const room = width - BAR, least = LEFT + GAP + Math.max(120, (this.grid ? 30 : 12) * columns);
    const across = Math.max(1, Math.min(this.panels.length, Math.floor(room / least)));
    const inner = {w: room / across - LEFT - GAP};
    inner.h = this.grid ? Math.min(260, Math.max(80, 40 * this.ys.length)) : 190;
    if (this.grid) inner.w = Math.min(inner.w, MAX_CELL * this.xs.length);
    const panelHeight = ABOVE + inner.h + BELOW, down = Math.ceil(this.panels.length / across);
    const frames = this.panels.map((_, k) => ({x: LEFT + (k % across) * (LEFT + GAP + inner.w), y: ABOVE + Math.floor(k / across) * panelHeight, ...inner}));
    return {width, height: down * panelHeight, frames, barX: across * (LEFT + GAP + inner.w) + 4};
  }

  scales() {
    const powers = this.points.map(each => each.power).filter(each => each !== null);
    const span = powers.length ? [Math.min(...powers), Math.max(...powers)] : [0, 1];
    if (span[0] === span[1]) span[1] = span[0] + Math.max(1, 0.1 * Math.abs(span[0]));
    return {power: span, x: padded(this.xs), y: this.curve ? padded(span) : padded(this.ys)};
  }

  // The rectangle of a point in its panel.
  place(point, frame, scales) {
    if (this.grid) {
      const w = frame.w / this.xs.length, h = frame.h / this.ys.length;
      return {x: frame.x + this.xs.indexOf(point.x) * w, y: frame.y + frame.h - (this.ys.indexOf(point.y) + 1) * h, w, h};
    }
    const value = this.curve ? point.power : point.y;
    const x = frame.x + frame.w * part(point.x, scales.x), y = value === null ? frame.y + frame.h - MARKER - 2 : frame.y + frame.h * (1 - part(value, scales.y));
    return {x: x - MARKER, y: y - MARKER, w: 2 * MARKER, h: 2 * MARKER};
  }

  // --- drawing

  draw() {
    const {canvas} = this;
    if (!this.state || !this.points.length || !canvas.parentElement.clientWidth) return;
    const layout = this.layout(), ratio = window.devicePixelRatio || 1, scales = this.scales();
    canvas.width = Math.round(layout.width * ratio);
    canvas.height = Math.round(layout.height * ratio);
    canvas.style.height = layout.height + "px";
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = FONT;
    layout.frames.forEach((frame, k) => this.drawAxes(pen, frame, this.panels[k], scales));
    // Points at one place: the best on top. What is marked comes last, so that nothing hides it.
    const order = this.points.map((point, k) => [point, k]).sort(([a], [b]) => rank(a) - rank(b));
    this.places = order.map(([point, k]) => ({k, ...this.place(point, layout.frames[this.panels.indexOf(point.panel)], scales)}));
    order.forEach(([point], k) => this.drawPoint(pen, point, this.places[k], scales));
    for (const place of this.places) if (place.k === this.pointed) outline(pen, place, 2, INK, [3, 3], this.grid);
    if (!this.curve) this.drawBar(pen, layout, scales);
    this.describe();
  }

  drawPoint(pen, point, place, scales) {
    const measured = point.power !== null, place01 = this.curve ? 0.25 : part(point.power, scales.power);
    const colour = measured ? colourOf(place01) : GROUND;
    shape(pen, inset(place, this.grid ? 1 : 0), this.grid);
    pen.fillStyle = colour;
    pen.fill();
    pen.lineWidth = 1;
    pen.strokeStyle = EMPTY;
    pen.stroke();
    if (point.present) outline(pen, inset(place, 2), 4, INK, [], this.grid);
    if (point.present) outline(pen, inset(place, 4.5), 1.5, "#fff", [], this.grid);
    const ink = measured && dark(colour) ? "#fff" : INK;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = ink;
    const middle = {x: place.x + place.w / 2, y: place.y + place.h / 2};
    pen.font = (point.best ? "bold " : point.whole ? "" : "italic ") + "11px " + FACE;
    const text = (point.best ? "★ " : "") + watts(point.power);
    if (measured && this.grid && pen.measureText(text).width + 4 <= place.w) pen.fillText(text, middle.x, middle.y);
    else if (point.best) {
      pen.fillText("★", middle.x, middle.y);
    } else if (measured && !point.whole) { // a corner: not measured for as long as planned
      pen.beginPath();
      pen.moveTo(middle.x - 4, middle.y + 3);
      pen.lineTo(middle.x + 4, middle.y + 3);
      pen.lineTo(middle.x, middle.y - 4);
      pen.closePath();
      pen.fill();
    }
    pen.font = FONT;
  }

  drawAxes(pen, frame, panel, scales) {
    const columns = this.contents.columns, {x, y, panel: panelColumn} = this.contents.surface;
    pen.strokeStyle = "#b3b7ba";
    pen.lineWidth = 1;
    pen.strokeRect(frame.x - 0.5, frame.y - 0.5, frame.w + 1, frame.h + 1);
    pen.fillStyle = QUIET;
    pen.textBaseline = "alphabetic";
    if (panelColumn !== undefined) {
      pen.fillStyle = INK;
      pen.textAlign = "left";
      pen.fillText(titled(columns[panelColumn], panel), frame.x, frame.y - 6, frame.w);
      pen.fillStyle = QUIET;
    }
    pen.textAlign = "center";
    for (const [value, place] of ticks(this.xs, this.grid, scales.x, frame.w, 52)) pen.fillText(plain(value), frame.x + place, frame.y + frame.h + 14);
    pen.fillText(named(columns[x]), frame.x + frame.w / 2, frame.y + frame.h + 29, frame.w + 20);
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    const values = this.curve ? round(scales.y) : this.ys;
    for (const [value, place] of ticks(values, this.grid, scales.y, frame.h, 18)) pen.fillText(plain(value), frame.x - 5, frame.y + frame.h - place);
    pen.textBaseline = "alphabetic";
    pen.textAlign = "left";
    if (frame.x !== LEFT) return;
    pen.save();
    pen.translate(11, frame.y + frame.h / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(this.curve ? this.contents.stations[this.station].label + ", W" : named(columns[y]), 0, 0, frame.h + 20);
    pen.restore();
  }

  drawBar(pen, layout, scales) {
    const top = ABOVE, height = layout.frames[0].h, x = layout.barX;
    for (let k = 0; k < height; k++) {
      pen.fillStyle = colourOf(1 - k / height);
      pen.fillRect(x, top + k, 14, 1.5);
    }
    pen.strokeStyle = EMPTY;
    pen.strokeRect(x - 0.5, top - 0.5, 15, height + 1);
    pen.fillStyle = QUIET;
    pen.textAlign = "left";
    pen.fillText("W", x, top - 6);
    const measured = this.points.some(each => each.power !== null);
    for (const place of measured ? [0, 0.5, 1] : []) {
      const value = scales.power[0] + place * (scales.power[1] - scales.power[0]);
      pen.textBaseline = place === 0 ? "alphabetic" : place === 1 ? "top" : "middle";
      pen.fillText(watts(value), x + 19, top + height * (1 - place));
    }
    pen.textBaseline = "alphabetic";
    pen.fillText(this.contents.stations[this.station].label, x - 8, top + height + 14, BAR);
  }

  // --- words

  describe() {
    const {contents, state} = this, unit = contents.stations[this.station].label;
    const measured = Object.keys(state.rows).filter(row => contents.rows[row]).length;
    const best = this.points.find(point => point.best), present = contents.rows[state.row];
    const parts = [measured + " of " + contents.rows.length + " rows measured or begun"];
    if (best) parts.push("★ best row " + this.best + ": " + interval(best.power, best.half) + " W " + unit + " at " + this.where(best));
    if (present) parts.push("row " + state.row + " runs");
    this.canvas.setAttribute("aria-label", "Power, " + unit + ", over " + this.axes.map(k => contents.columns[k].label).join(" and ") + ". " + parts.join("; ") + ". Arrow keys read the points.");
    const point = this.points[this.pointed];
    setText(this.text, point ? this.textOf(point) : best ? parts[1] : parts[0]);
  }

  textOf(point) {
    const name = (point.rows.length > 1 ? "rows " : "row ") + point.rows.join(", ") + (point.best ? " ★" : "");
    const power = point.power === null ? "not measured" : interval(point.power, point.half) + " W" + (point.count > 1 ? " (mean of " + point.count + ")" : "") + (point.whole ? "" : point.present ? " so far" : ", cut short");
    return name + ": " + power + " at " + this.where(point);
  }

  where(point) {
    return this.contents.columns.map((column, k) => titled(column, point.values[k])).join(", ");
  }

  // --- pointing

  at(x, y) {
    const found = (this.places || []).findLast(each => x >= each.x && x < each.x + each.w && y >= each.y && y < each.y + each.h);
    return found ? found.k : -1;
  }

  point(k) {
    if (k === this.pointed) return;
    this.pointed = k;
    this.draw();
  }

  step(event) {
    const by = {ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1}[event.key];
    if (!by || !this.points.length) return;
    event.preventDefault();
    const from = this.pointed < 0 ? (by > 0 ? -1 : 0) : this.pointed;
    this.point((from + by + this.points.length) % this.points.length);
  }
}

export function legend(place) {
  const parts = [["cell", "not measured"], ["cell running", "running row"], ["", "★ best"], ["", "▲ or italic: part of a row"]];
  place.replaceChildren(...parts.map(([name, text]) => {
    const found = element("span");
    if (name) found.append(element("i", undefined, name));
    found.append(element("span", text));
    return found;
  }));
}

function named(column) { return column.label + (column.unit && ", " + column.unit); }

function titled(column, value) { return column.label + " " + plain(value) + (column.unit && " " + column.unit); }

function distinct(values) {
  const found = [...new Set(values)];
  return found.every(each => typeof each === "number") ? found.sort((a, b) => a - b) : found;
}

function padded(values) {
  const low = Math.min(...values), high = Math.max(...values), margin = 0.08 * (high - low) || 0.5;
  return [low - margin, high + margin];
}

function part(value, [low, high]) { return (value - low) / (high - low); }

// Five round values of a range.
function round([low, high]) {
  const step = 10 ** Math.floor(Math.log10((high - low) / 2)), fit = [1, 2, 5, 10].map(k => k * step).find(each => (high - low) / each <= 6);
  const first = Math.ceil(low / fit);
  return Array.from({length: Math.floor(high / fit) - first + 1}, (_, k) => (first + k) * fit);
}

// Values and their places (px) on an axis, as many as have room.
function ticks(values, grid, span, length, room) {
  const every = grid ? Math.ceil(values.length * room / length) : 1, found = [];
  values.forEach((value, k) => {
    const place = grid ? (k + 0.5) * length / values.length : length * part(value, span);
    const last = found[found.length - 1];
    if (grid ? k % every === 0 : !last || place - last[1] >= room) found.push([value, place]);
  });
  return found;
}

function rank(point) {
  if (point.best) return 4e9;
  if (point.present) return 3e9;
  return point.power === null ? -1e9 : -point.power;
}

function inset(place, by) { return {x: place.x + by, y: place.y + by, w: place.w - 2 * by, h: place.h - 2 * by}; }

function shape(pen, place, grid) {
  pen.beginPath();
  if (grid) pen.rect(place.x, place.y, place.w, place.h);
  else pen.arc(place.x + place.w / 2, place.y + place.h / 2, place.w / 2, 0, 2 * Math.PI);
}

function outline(pen, place, width, colour, dash, grid) {
  pen.setLineDash(dash);
  pen.lineWidth = width;
  pen.strokeStyle = colour;
  shape(pen, place, grid);
  pen.stroke();
  pen.setLineDash([]);
}

function channels(colour) { return [1, 3, 5].map(at => parseInt(colour.slice(at, at + 2), 16)); }

function colourOf(place) {
  const at = Math.min(0.9999, Math.max(0, place)) * (COLOURS.length - 1), k = Math.floor(at);
  const low = channels(COLOURS[k]), high = channels(COLOURS[k + 1]);
  return "#" + low.map((each, c) => Math.round(each + (at - k) * (high[c] - each)).toString(16).padStart(2, "0")).join("");
}

function dark(colour) {
  const [red, green, blue] = channels(colour);
  return 0.299 * red + 0.587 * green + 0.114 * blue < 140;
}
