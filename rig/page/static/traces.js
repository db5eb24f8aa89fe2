// Live traces: one plot for each group of units over one shared axis of time.
import {number} from "./dom.js";

const FINEST_S = 60;  // s that the finest buckets reach back; those of a coarser level by its size more
const PIXEL_MS = 1.5;  // ms of a pixel for a span of 1 s: drawing more often would show nothing new
const WIDTHS = [[], [6, 3], [2, 2], [10, 3, 2, 3], [1, 3], [12, 4]];
const SHADES = ["#111111", "#1b4f9c", "#5d3f00", "#6a6f73", "#1f5c3a", "#5b2a6b"];

export class Traces {
  constructor(place, cursorTime) {
    this.place = place;
    this.cursorTime = cursorTime;
    this.plots = [];
    this.fields = [];
    this.levels = [];  // from fine to coarse: {size, time, low, high, waiting}, size in finest buckets
    this.bucket = 0.05;
    this.span = 30;
    this.paused = false;
    this.due = false;
    this.drawn = 0;  // ms, when new buckets were last drawn
    new ResizeObserver(() => this.resize()).observe(place);
  }

  // groups: [{unit, fields}]; labels: {field: {label, unit}}
  build(groups, labels) {
    this.plots.forEach(each => each.chart.destroy());
    this.place.replaceChildren();
    this.plots = [];
    const shown = groups.filter(group => group.fields.length);
    for (const group of shown) {
      const box = document.createElement("div");
      box.className = "plot";
      const head = document.createElement("h3");
      const unit = document.createElement("strong");
      unit.textContent = group.unit;
      head.append(unit);
      const values = group.fields.map((field, at) => {
        const key = document.createElement("span");
        key.className = "key";
        key.append(stroke(at));
        const text = document.createElement("span");
        const value = document.createElement("span");
        text.textContent = labels[field].label;
        key.append(text, value);
        head.append(key);
        return value;
      });
      box.append(head);
      this.place.append(box);
      const last = group === shown[shown.length - 1];
      this.plots.push({fields: group.fields, values, last, box, chart: this.chart(box, group, values, last)});
    }
    this.redraw();
  }

  chart(box, group, values, last) {
    const series = [{}], bands = [];
    group.fields.forEach((_, at) => {
      const style = {stroke: SHADES[at % SHADES.length], dash: WIDTHS[at % WIDTHS.length], width: 1.5, points: {show: false}};
      series.push({...style}, {...style});
      bands.push({series: [2 * at + 2, 2 * at + 1], fill: SHADES[at % SHADES.length] + "38"});
    });
    const axis = {stroke: "#545b61", grid: {stroke: "#bfc3c6", width: 1}, ticks: {show: false}, font: "12px system-ui"};
    return new uPlot({
      width: Math.max(200, box.clientWidth), height: this.height(last), series, bands,
      legend: {show: false}, padding: [6, 14, 2, 0],
      cursor: {sync: {key: "time", setSeries: false}, drag: {x: false, y: false}, y: false},
      scales: {x: {time: false}},
      axes: [{...axis, size: last ? 26 : 0, show: last, values: (_, at) => at.map(t => t + " s")}, {...axis, size: 56}],
      hooks: {setCursor: [chart => this.showValues(chart, group.fields, values)]},
    }, [[], ...series.slice(1).map(() => [])], box);
  }

  height(last) {
    const count = Math.max(1, this.plots.length || 4);
    const room = window.innerWidth > 720 ? Math.min(150, Math.max(96, (window.innerHeight - 420) / count)) : 100;
    return Math.round(room) + (last ? 26 : 0);
  }

  showValues(chart, fields, values) {
    const at = chart.cursor.idx;
    const index = at === null || at === undefined ? chart.data[0].length - 1 : at;
    fields.forEach((_, k) => {
      const low = chart.data[2 * k + 1][index], high = chart.data[2 * k + 2][index];
      values[k].textContent = low === undefined || low === null ? "" : number((low + high) / 2);
    });
    const time = chart.data[0][index];
    const live = at === null || at === undefined;
    this.cursorTime.textContent = live || time === undefined ? "" : "cursor at " + time.toFixed(2) + " s";
  }

  reset(message) {
    this.fields = message.fields;
    this.bucket = message.bucket_s;
    this.levels = message.levels.map(each => ({...each, waiting: 0}));
    this.redraw();
  }

  // New finest buckets: each level takes them, a coarse one by least and greatest values.
  add(message) {
    if (message.fields.join() !== this.fields.join()) return;
    for (const level of this.levels) {
      message.time.forEach((time, i) => {
        const joins = level.waiting > 0;
        level.waiting = (level.waiting + 1) % level.size;
        const at = joins ? level.time.length - 1 : level.time.length;
        level.time[at] = time;
        this.fields.forEach((_, k) => {
          level.low[k][at] = joins ? least(level.low[k][at], message.low[k][i]) : message.low[k][i];
          level.high[k][at] = joins ? greatest(level.high[k][at], message.high[k][i]) : message.high[k][i];
        });
      });
      this.drop(level);
    }
    // A window in which nobody works is drawn less often: drawing takes most of a browser's time.
    const now = performance.now(), pause = document.hasFocus() ? 200 : 500;
    if (this.paused || now - this.drawn < Math.min(1000, Math.max(pause, this.span * PIXEL_MS))) return;
    this.drawn = now;
    this.redraw();
  }

  // Forget what is older than the level's span, in large steps: moving long lists is slow.
  drop(level) {
    const kept = Math.round(FINEST_S / this.bucket), spare = level.time.length - kept;
    if (spare < kept / 10) return;
    for (const list of [level.time, ...level.low, ...level.high]) list.splice(0, spare);
  }

  // The finest level that reaches over the span.
  level() {
    const reaching = this.levels.find(each => each.size * FINEST_S >= this.span);
    return reaching || this.levels[this.levels.length - 1] || {time: [], low: [], high: []};
  }

  redraw() {
    if (this.due) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      const level = this.level();
      const end = level.time.length ? level.time[level.time.length - 1] : 0;
      let first = 0;
      while (level.time[first] < end - this.span) first++;
      const time = level.time.slice(first);
      for (const plot of this.plots) {
        const data = [time];
        for (const field of plot.fields) {
          const k = this.fields.indexOf(field);
          const none = time.map(() => null);
          data.push(k < 0 ? none : level.low[k].slice(first), k < 0 ? none : level.high[k].slice(first));
        }
        plot.chart.setData(data, false);
        plot.chart.batch(() => {
          plot.chart.setScale("x", {min: end - this.span, max: end});
          const range = extent(data.slice(1));
          plot.chart.setScale("y", range);
        });
        if (plot.chart.cursor.idx === null || plot.chart.cursor.idx === undefined || plot.chart.cursor.left < 0) {
          plot.chart.cursor.idx = null;
          this.showValues(plot.chart, plot.fields, plot.values);
        }
      }
    });
  }

  resize() {
    for (const plot of this.plots)
      plot.chart.setSize({width: Math.max(200, plot.box.clientWidth), height: this.height(plot.last)});
    this.redraw();
  }
}

// Least and greatest of two values, of which either may be missing.
function least(a, b) {
  return a === null ? b : b === null ? a : Math.min(a, b);
}

function greatest(a, b) {
  return a === null ? b : b === null ? a : Math.max(a, b);
}

function extent(series) {
  let low = Infinity, high = -Infinity;
  for (const each of series) for (const v of each) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
  if (low > high) return {min: -1, max: 1};
  const margin = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
  return {min: low - margin, max: high + margin};
}

function stroke(at) {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg"), line = document.createElementNS(space, "line");
  const values = {x1: 0, x2: 26, y1: 4, y2: 4, stroke: SHADES[at % SHADES.length], "stroke-width": 2, "stroke-dasharray": WIDTHS[at % WIDTHS.length].join(" ")};
  for (const [name, value] of Object.entries(values)) line.setAttribute(name, value);
  svg.append(line);
  return svg;
}
