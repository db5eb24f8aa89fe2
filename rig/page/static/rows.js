// The table of rows and powers, and the best row so far.
import {$, element, plain, setPower, setText, watts} from "./dom.js";

export class Rows {
  build(contents) {
    this.contents = contents;
    this.stations = contents.stations.filter(station => station.mean);
    const head = element("tr");
    for (const note of [$("powers-note"), $("rows-note")]) {
      setText(note, contents.budget ? "± 95 %, Type A and B" : "");
      note.title = "scatter of the row's wave periods, and the uncertainty budget " + contents.budget;
    }
    head.append(element("th", "row"), ...contents.columns.map(column => titled(column.heading, column.label + (column.unit && ", " + column.unit))),
      ...this.stations.map(station => titled(station.heading + " W", station.label)));
    $("row-table").tHead.replaceChildren(head);
    $("row-table").tBodies[0].replaceChildren(...contents.rows.map((row, at) => {
      const line = element("tr");
      line.append(element("td", String(at)), ...row.map(value => element("td", plain(value))), ...this.stations.map(() => element("td", "")));
      return line;
    }));
    $("powers").replaceChildren(...contents.stations.map(station => {
      const line = element("tr");
      line.append(element("td", station.label), element("td", "–"), element("td", station.mean ? "–" : ""));
      return line;
    }));
    const choice = $("best-by");
    choice.replaceChildren(...this.stations.map(station => element("option", station.label)));
    choice.selectedIndex = Math.max(0, this.stations.findIndex(station => station.name === contents.best_station));
  }

  // The place of the chosen station among all stations; -1 without one.
  get chosen() {
    return this.contents.stations.indexOf(this.stations[$("best-by").selectedIndex]);
  }

  show(state) {
    if (!state.powers) return;
    state.powers.forEach(([now, mean], k) => {
      const cells = $("powers").rows[k].cells;
      setText(cells[1], watts(now));
      if (this.contents.stations[k].mean) setPower(cells[2], state.samples > 0 ? mean : null, halfWidth(state.rows[state.row], k));
    });
    const first = 1 + this.contents.columns.length, lines = $("row-table").tBodies[0].rows, best = this.best(state);
    for (const [row, found] of Object.entries(state.rows)) {
      if (!lines[row]) continue;
      this.stations.forEach((station, k) => {
        const at = this.contents.stations.indexOf(station);
        setPower(lines[row].cells[first + k], found[0][at], halfWidth(found, at));
      });
      lines[row].classList.toggle("part", !found[1]);
    }
    const box = $("row-table").closest(".scroll");
    Array.from(lines).forEach((line, row) => {
      const present = row === state.row;
      if (present && !line.classList.contains("present")) box.scrollTop = Math.max(0, line.offsetTop - 120);
      line.classList.toggle("present", present);
      for (const cell of line.cells) cell.classList.remove("best");
      if (row === best) line.cells[first + $("best-by").selectedIndex].classList.add("best");
      setText(line.cells[0], row + (row === best ? " ★" : ""));
    });
  }

  // The whole row with the least power at the chosen station, absorbed being negative; -1 for none.
  best(state) {
    const at = this.chosen;
    const whole = Object.entries(state.rows || {}).filter(([row, [powers, done]]) => done && at >= 0 && powers[at] !== null && this.contents.rows[row]);
    return whole.reduce((best, [row, [powers]]) => powers[at] < best.power ? {row: Number(row), power: powers[at]} : best, {row: -1, power: Infinity}).row;
  }
}

// The half width of a station's interval in a row; undefined where it is not known.
export function halfWidth(row, station) {
  return row && row[2] ? row[2][station] : undefined;
}

function titled(text, title) {
  const found = element("th", text);
  found.title = title;
  return found;
}
