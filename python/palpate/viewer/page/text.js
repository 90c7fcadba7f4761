// Numbers and elements.

/** A number with three digits. */
export function digits(value, count = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(1);
  return Number(value.toPrecision(count)).toLocaleString("en", { maximumSignificantDigits: count });
}

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"]];

/** A number with the prefix that suits it: 0.0021 m is 2.1 mm. */
export function withUnit(value, unit) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (!unit) return `${digits(100 * value)} %`;
  if (size < 1e-9) return `0 ${unit}`;
  if (unit === "m" && size >= 0.01 && size < 1) return `${digits(100 * value)} cm`;
  const [factor, prefix] = PREFIXES.find(([each]) => size >= each * 0.9995) ?? PREFIXES.at(-1);
  return `${digits(value / factor)} ${prefix}${unit}`;
}

/** A count with thousands set apart. */
export function whole(value) {
  return value === null || value === undefined ? "–" : Math.round(value).toLocaleString("en");
}

/** An element: `make("button", {class: "x", title: "y", onclick: f}, children...)`. */
export function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element[key] = value;
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

/** An icon from the path of a 24 x 24 drawing. */
export function icon(path) {
  const holder = document.createElement("template");
  holder.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${path}"/></svg>`;
  return holder.content.firstChild;
}
