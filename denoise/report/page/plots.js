// What a plot is made of: scales, axes, a tooltip, markers. SVG in CSS pixels, drawn to fit its box.

const PLOT = { left: 46, right: 14, top: 12, bottom: 40 };

/** Linear or logarithmic map from values to pixels, with ticks. */
function scale(low, high, from, to, log = false) {
  const f = log ? Math.log10 : (x) => x;
  const [a, b] = [f(low), f(high)];
  const map = (x) => from + ((f(x) - a) / (b - a || 1)) * (to - from);
  map.inverse = (pixel) => {
    const value = a + ((pixel - from) / (to - from)) * (b - a);
    return log ? 10 ** value : value;
  };
  map.ticks = log ? logTicks(low, high) : linearTicks(low, high, Math.max(2, Math.abs(to - from) / 70));
  return map;
}

function linearTicks(low, high, count) {
  const rough = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((k) => k * power >= rough) * power;
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) ticks.push(i * step);
  return ticks.map((t) => Number(t.toPrecision(12)));
}

function logTicks(low, high) {
  const decades = Math.log10(high / low);
  const steps = decades > 3 ? [1] : decades > 1.2 ? [1, 2, 5] : [1, 1.5, 2, 3, 5, 7];
  const ticks = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e++) {
    for (const k of steps) {
      const t = Number((k * 10 ** e).toPrecision(3));
      if (t >= low && t <= high) ticks.push(t);
    }
  }
  return ticks;
}

/** low and high with a margin, of the finite values; at least `least` apart. */
function extent(values, margin = 0.08, least = 1e-9) {
  const finite = values.filter((v) => Number.isFinite(v));
  let [low, high] = [Math.min(...finite), Math.max(...finite)];
  const room = Math.max(high - low, least) * margin;
  if (high - low < least) [low, high] = [low - least / 2, high + least / 2];
  return [low - room, high + room];
}

/** Empties a box and puts an SVG of its width into it. */
function canvasOf(box, height, label) {
  const width = Math.max(260, box.clientWidth);
  const node = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "group",
    "aria-label": label, class: "plot" });
  box.replaceChildren(node);
  return { node, width, height };
}

function axes(node, x, y, { width, height }, labels, formatX = short, formatY = short) {
  const bottom = height - PLOT.bottom, left = labels.left ?? PLOT.left;
  const group = svg("g", { class: "axes", "aria-hidden": "true" });
  let last = -Infinity;
  for (const t of x.ticks) {
    group.append(svg("line", { x1: x(t), x2: x(t), y1: PLOT.top, y2: bottom, class: "rule" }));
    const text = formatX(t);
    if (x(t) - last < 7 * text.length + 4) continue;  // labels keep a distance
    last = x(t);
    group.append(svg("text", { x: x(t), y: bottom + 16, "text-anchor": "middle" }, text));
  }
  for (const t of y.ticks || []) {
    group.append(svg("line", { x1: left, x2: width - PLOT.right, y1: y(t), y2: y(t), class: "rule" }));
    group.append(svg("text", { x: left - 7, y: y(t) + 4, "text-anchor": "end" }, formatY(t)));
  }
  group.append(
    svg("line", { x1: left, x2: width - PLOT.right, y1: bottom, y2: bottom, class: "axis" }),
    svg("text", { x: (left + width - PLOT.right) / 2, y: height - 5, "text-anchor": "middle",
      class: "label" }, labels.x));
  if (labels.y) {
    group.append(svg("text", { transform: `translate(12 ${(PLOT.top + bottom) / 2}) rotate(-90)`,
      "text-anchor": "middle", class: "label" }, labels.y));
  }
  node.append(group);
}

const axisName = (metric) =>
  `${metric.label}${metric.unit ? ` in ${metric.unit}` : ""} (${metric.higherIsBetter ? "higher" : "lower"} is better)`;

// One tooltip for all plots: follows the pointer, or stands at what has the focus.

function showTip(x, y, lines) {
  const tip = byId("tip");
  tip.replaceChildren(...lines.map((line) => html("div", {}, ...[line].flat())));
  tip.hidden = false;
  const { width, height } = tip.getBoundingClientRect();
  const left = x + 14 + width > innerWidth - 6 ? x - width - 14 : x + 14;
  tip.style.left = `${Math.max(6, left)}px`;
  tip.style.top = `${Math.max(6, Math.min(y + 12, innerHeight - height - 6))}px`;
}

const hideTip = () => (byId("tip").hidden = true);

/** A marker that says its values on hover and on focus. */
function marker(method, x, y, lines, onclick = null, r = 6.5, hollow = false) {
  const say = (left, top) => showTip(left, top, [[swatch(method), html("b", {}, method.name)], ...lines]);
  const press = onclick && ((event) => {
    if (event.type === "click" || event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      event.stopPropagation();
      onclick();
    }
  });
  return svg("g", { transform: `translate(${x} ${y})`, class: "marker", tabindex: 0,
    role: onclick ? "button" : "img", "aria-label": `${method.name}: ${lines.join(", ")}`,
    onpointermove: (e) => say(e.clientX, e.clientY), onpointerleave: hideTip,
    onfocus: (e) => { const r = e.target.getBoundingClientRect(); say(r.right, r.bottom); },
    onblur: hideTip, ...(press ? { onclick: press, onkeydown: press } : {}) },
    svg("circle", { r: 2 * r, fill: "transparent" }),
    svg("path", { d: markerPath(method, r), class: hollow ? "mark hollow" : "mark",
      [hollow ? "stroke" : "fill"]: colourOf(method) }));
}

/** Where to write names so that they miss each other: [{x, y, text}] -> [{x, y, anchor}]. */
function placeLabels(points, box) {
  const size = (text) => 7.1 * text.length;
  const taken = points.map((p) => [p.x - 9, p.y - 9, p.x + 9, p.y + 9]);
  return points.map((p) => {
    const w = size(p.text);
    const spots = [[0, -14, "middle"], [13, 4, "start"], [0, 23, "middle"], [-13, 4, "end"],
      [10, -12, "start"], [10, 20, "start"], [-10, -12, "end"], [-10, 20, "end"],
      [0, -30, "middle"], [0, 39, "middle"]];
    let chosen = null;
    for (const [dx, dy, anchor] of spots) {
      const left = p.x + dx - (anchor === "middle" ? w / 2 : anchor === "end" ? w : 0);
      const rect = [left, p.y + dy - 11, left + w, p.y + dy + 3];
      const inside = rect[0] >= box[0] && rect[2] <= box[2] && rect[1] >= box[1] && rect[3] <= box[3];
      const free = inside && !taken.some((t) => rect[0] < t[2] && t[0] < rect[2] && rect[1] < t[3] && t[1] < rect[3]);
      if (free) {
        chosen = { x: p.x + dx, y: p.y + dy, anchor };
        taken.push(rect);
        break;
      }
    }
    return chosen;  // null: no room; the tooltip has the name
  });
}
