// Numbers as text, elements, and what all parts of the page know.

const DATA = JSON.parse(document.getElementById("data").textContent);
const METRIC = Object.fromEntries(DATA.metrics.map((m) => [m.name, m]));
const METHOD = Object.fromEntries(DATA.methods.map((m) => [m.name, m]));

const byId = (id) => document.getElementById(id);

/** A number in one of Python's formats that METRICS use: .2f, .4g, .1e, with or without a +. */
function formatted(value, format) {
  if (value === null || value === undefined) return "–";
  const [, sign, digits, kind] = /^(\+?)\.(\d+)([feg%])$/.exec(format) || ["", "", "4", "g"];
  const n = Number(digits);
  const text = kind === "f" ? value.toFixed(n)
    : kind === "e" ? value.toExponential(n)
    : kind === "%" ? `${(100 * value).toFixed(n)}%`
    : String(Number(value.toPrecision(n)));
  return sign && value >= 0 ? `+${text}` : text;
}

const withUnit = (value, metric) =>
  formatted(value, metric.format) + (metric.unit && value !== null ? ` ${metric.unit}` : "");

/** A method's number over the sequence, with its standard error, or as the bound that it is. */
function known(m, metric) {
  const value = withUnit(m.values[metric.name], metric);
  if (m.bounds.includes(metric.name)) return `${metric.higherIsBetter ? "≥" : "≤"} ${value}`;
  const error = m.errors[metric.name];
  return error === undefined ? value : `${value} ± ${short(error)}`;
}

/** Three significant digits, for pixels and axes. */
const short = (value) =>
  value === 0 ? "0" : !Number.isFinite(value) ? String(value)
  : Math.abs(value) >= 1e5 || Math.abs(value) < 1e-4 ? value.toExponential(1)
  : String(Number(value.toPrecision(3)));

const SVG = "http://www.w3.org/2000/svg";

function element(namespace, name, attributes, children) {
  const node = namespace ? document.createElementNS(namespace, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes || {})) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(key, value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
}

const html = (name, attributes, ...children) => element(null, name, attributes, children);
const svg = (name, attributes, ...children) => element(SVG, name, attributes, children);

const colourOf = (method) => (method.colour === null ? "var(--input)" : `var(--c${method.colour % 10})`);

/** Path of a method's marker around (0, 0): shapes tell methods apart where colours don't. */
function markerPath(method, r) {
  const shapes = [
    `M${-r} 0a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`,
    `M${-r * 0.9} ${-r * 0.9}h${1.8 * r}v${1.8 * r}h${-1.8 * r}z`,
    `M0 ${-1.3 * r}L${1.2 * r} ${0.85 * r}H${-1.2 * r}z`,
    `M0 ${-1.3 * r}L${1.3 * r} 0L0 ${1.3 * r}L${-1.3 * r} 0z`,
    `M0 ${1.3 * r}L${1.2 * r} ${-0.85 * r}H${-1.2 * r}z`,
  ];
  return shapes[method.colour === null ? 0 : method.colour % shapes.length];
}

const swatch = (method) =>
  svg("svg", { class: "swatch", viewBox: "-8 -8 16 16", "aria-hidden": "true" },
    svg("path", { d: markerPath(method, 5), fill: colourOf(method) }));
