// What the viewer shows: its state, as text in the address, and where pixels are on the screen.

const SOURCES = [...DATA.methods.map((m) => m.name), ...(DATA.hasReference ? ["reference"] : [])];
const CHANNELS = ["result", ...(DATA.hasReference ? ["error", "flip"] : []),
  ...DATA.channels.map((c) => c.name)];
const MOST_ZOOM = 64;

/** The state that an address without settings means: the noisy input against the best method. */
function firstState() {
  const metric = METRIC[DATA.headline];
  const judged = DATA.methods.filter((m) => m.name !== "input" && (!metric || m.values[metric.name] !== null));
  const best = judged.sort((a, b) => (metric ? b.values[metric.name] - a.values[metric.name] : 0))[0];
  const b = best?.name ?? (DATA.hasReference ? "reference" : SOURCES[0]);
  const middle = DATA.frames[Math.floor(DATA.frames.length / 2)];
  return { frame: middle, a: SOURCES[0], b, ca: "result", cb: "result", x: DATA.width / 2, y: DATA.height / 2,
    zoom: 0, split: 0.5, ev: 0, mode: "slider" };
}

/** `zoom` is screen pixels an image pixel, 0: fit. Numbers out of range and unknown names are ignored. */
function stateOfHash(hash) {
  const state = firstState();
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (key, low, high) => {
    const value = parseFloat(given.get(key));
    if (value >= low && value <= high) state[key] = value;
  };
  const name = (key, known) => {
    if (known.includes(given.get(key))) state[key] = given.get(key);
  };
  const frame = Number(given.get("frame") ?? NaN);
  if (DATA.frames.includes(frame)) state.frame = frame;
  name("a", SOURCES);
  name("b", SOURCES);
  name("ca", CHANNELS);
  name("cb", CHANNELS);
  name("mode", ["slider", "side"]);
  number("x", 0, DATA.width);
  number("y", 0, DATA.height);
  number("zoom", 0, MOST_ZOOM);
  number("split", 0, 1);
  number("ev", -10, 10);
  return state;
}

function hashOfState(state) {
  const standard = firstState();
  const text = new URLSearchParams();
  for (const [key, value] of Object.entries(state)) {
    const plain = typeof value === "number" ? Number(value.toFixed(3)) : value;
    if (["frame", "a", "b"].includes(key) || plain !== standard[key]) text.set(key, plain);
  }
  return `#${text}`;
}

/** Panes of the stage: [left, width] for A and B, in CSS pixels. */
function panesOf(state, width) {
  return state.mode === "side" ? [[0, width / 2], [width / 2, width / 2]] : [[0, width], [0, width]];
}

function fitZoom(state, width, height) {
  const pane = panesOf(state, width)[0][1];
  return Math.min(pane / DATA.width, height / DATA.height);
}

const zoomOf = (state, width, height) => state.zoom || fitZoom(state, width, height);

/** Image coordinates under a point of the stage. */
function imageFromStage(state, width, height, left, top) {
  const zoom = zoomOf(state, width, height);
  const [start, pane] = panesOf(state, width)[state.mode === "side" && left >= width / 2 ? 1 : 0];
  return [state.x + (left - start - pane / 2) / zoom, state.y + (top - height / 2) / zoom];
}

/** Zoom by a factor so that the point of the stage stays where it is. */
function zoomAt(state, width, height, factor, left, top) {
  const [x, y] = imageFromStage(state, width, height, left, top);
  const fit = fitZoom(state, width, height);
  const before = zoomOf(state, width, height);
  const zoom = Math.min(MOST_ZOOM, Math.max(Math.min(fit, 1), before * factor));
  state.zoom = Math.abs(zoom / fit - 1) < 1e-3 ? 0 : zoom;
  state.x = x + (state.x - x) * (before / zoom);
  state.y = y + (state.y - y) * (before / zoom);
  keepInside(state, width, height);
}

/** No emptiness beside the picture that isn't needed. */
function keepInside(state, width, height) {
  const zoom = zoomOf(state, width, height);
  for (const [key, size, room] of [["x", DATA.width, panesOf(state, width)[0][1] / zoom], ["y", DATA.height, height / zoom]]) {
    state[key] = room >= size ? size / 2 : Math.max(room / 2, Math.min(size - room / 2, state[key]));
  }
}
