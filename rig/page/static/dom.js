// Parts of the page that all its cards use. Every text is set as text, never as markup.
export const $ = id => document.getElementById(id);

export function element(tag, text, name) {
  const found = document.createElement(tag);
  if (text !== undefined) found.textContent = text;
  if (name) found.className = name;
  return found;
}

export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function share(value, low, high) {
  return Math.min(100, Math.max(0, 100 * (value - low) / (high - low)));
}

export function clock(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const s = Math.floor(seconds), two = n => String(n).padStart(2, "0");
  return (s >= 3600 ? Math.floor(s / 3600) + ":" : "") + two(Math.floor(s / 60) % 60) + ":" + two(s % 60);
}

export function number(value) {
  if (value === null || value === undefined) return "–";
  if (typeof value !== "number") return String(value);
  const size = Math.abs(value);
  if (size < 1e-7) return "0";
  const text = size >= 1e6 || size < 1e-4 ? value.toExponential(2) : size >= 1000 ? value.toFixed(0) : value.toPrecision(4);
  return text.replace("-", "\u2212");
}

// A number of a file, without digits that it does not have.
export function plain(value) {
  return typeof value === "number" ? String(Number(value.toPrecision(6))).replace("-", "\u2212") : String(value ?? "–");
}

// A power with the half width of its interval where that is known, both with the same decimals (W).
export function interval(value, half) {
  if (value === null || value === undefined || half === null || half === undefined) return watts(value);
  const digits = half >= 9.5 ? 0 : half >= 0.095 ? 1 : 2, text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text.replace("-", "\u2212")) + " ± " + (half >= 0.005 ? half.toFixed(digits) : "<0.01");
}

// Set a cell to a power and its half width, which may stand below each other.
export function setPower(cell, value, half) {
  const text = interval(value, half);
  if (cell.textContent === text) return;
  const at = text.indexOf(" ±");
  cell.replaceChildren(...(at < 0 ? [text] : [text.slice(0, at), element("span", text.slice(at), "half")]));
}

export function watts(value) {
  if (value === null || value === undefined) return "–";
  const text = value.toFixed(Math.abs(value) < 100 ? 1 : 0);
  return Number(text) === 0 ? "0.0" : text.replace("-", "\u2212");
}
