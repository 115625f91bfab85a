// Hands on the viewer: menus, slider, pointer, wheel, keys.

const SHORTCUTS = [
  ["← →", "previous, next frame"], ["Space", "play or stop"], ["1 … 9", "A shows the input, the methods, the reference"],
  ["Shift 1 … 9", "B shows them"], ["X", "swap A and B"], ["R", "B shows the reference, and back"], ["V", "both show the result"],
  ["E", "both show the error"], ["F", "both show FLIP"], ["G", "next guide of the frame, on both"], ["M", "slider or side by side"],
  ["[ ]", "move the slider"], ["+ −", "zoom"], ["0", "fit"], ["W A S D", "move the picture"], [", .", "darker, brighter"], ["/", "exposure 0"],
  ["C", "copy a link to this view"], ["L", "full screen"], ["T", "dark or light"], ["?", "this list"],
];

class Controls {
  constructor(viewer) {
    this.viewer = viewer;
    this.menus();
    this.buttons();
    this.handle();
    this.pointer();
    document.addEventListener("keydown", (event) => this.key(event));
    addEventListener("hashchange", () => {
      if (!location.hash.includes("=") || location.hash === viewer.saved) return;
      viewer.touched = true;
      viewer.set(stateOfHash(location.hash));
    });
  }

  set(changes) {
    this.viewer.touched = true;
    this.viewer.set(changes);
  }

  /** Redraw after the view moved. */
  moved() {
    this.viewer.touched = true;
    this.viewer.draw();
    this.viewer.readout.showPixel();
  }

  menus() {
    const named = (value, text = value) => html("option", { value }, text);
    const guides = DATA.channels.map((c) => c.name);
    for (const side of ["a", "b"]) {
      byId(side).append(...SOURCES.map((name) => named(name)));
      byId(`c${side}`).append(...CHANNELS.filter((c) => !guides.includes(c)).map((c) => named(c, c === "flip" ? "FLIP" : c)),
        ...(guides.length ? [html("optgroup", { label: "of the frame" }, ...guides.map((c) => named(c)))] : []));
      for (const id of [side, `c${side}`]) byId(id).addEventListener("change", (e) => this.set({ [id]: e.target.value }));
    }
    const frame = byId("frame");
    frame.max = DATA.frames.length - 1;
    frame.addEventListener("input", () => this.set({ frame: DATA.frames[Number(frame.value)] }));
    byId("ev").addEventListener("input", (e) => this.set({ ev: Number(e.target.value) }));
  }

  buttons() {
    const { viewer } = this;
    const press = (id, action) => byId(id).addEventListener("click", action);
    press("play", () => { viewer.touched = true; viewer.play(); });
    press("previous", () => this.step(-1));
    press("next", () => this.step(1));
    press("swap", () => this.swap());
    press("fit", () => this.fit());
    press("zoom-in", () => this.zoom(1.5));
    press("zoom-out", () => this.zoom(1 / 1.5));
    press("ev-reset", () => this.set({ ev: 0 }));
    press("full", () => this.fullScreen());
    press("link", () => this.copyLink());
    press("help-button", () => byId("help").showModal());
    byId("shortcuts").append(...SHORTCUTS.flatMap(([keys, what]) => [html("dt", {}, ...keys.split(" ").map((k) => (k === "…" ? " … " : html("kbd", {}, k)))), html("dd", {}, what)]));
    for (const button of document.querySelectorAll("[data-set-mode]")) button.addEventListener("click", () => this.set({ mode: button.dataset.setMode }));
  }

  step(by) {
    this.viewer.touched = true;
    this.viewer.play(false);
    this.viewer.step(by);
  }

  swap() {
    const { a, b, ca, cb } = this.viewer.state;
    this.set({ a: b, b: a, ca: cb, cb: ca });
  }

  fit() {
    Object.assign(this.viewer.state, { zoom: 0, x: DATA.width / 2, y: DATA.height / 2 });
    this.moved();
  }

  zoom(factor, left, top) {
    const [width, height] = this.viewer.size;
    const middle = this.viewer.state.mode === "side" ? width / 4 : width / 2;
    zoomAt(this.viewer.state, width, height, factor, left ?? middle, top ?? height / 2);
    this.moved();
  }

  pan(dx, dy) {
    const [width, height] = this.viewer.size;
    const zoom = zoomOf(this.viewer.state, width, height);
    this.viewer.state.x -= dx / zoom;
    this.viewer.state.y -= dy / zoom;
    this.moved();
  }

  split(value) {
    this.viewer.state.split = Math.max(0, Math.min(1, value));
    this.viewer.showControls();
    this.moved();
  }

  fullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else byId("screen").requestFullscreen?.();
  }

  async copyLink() {
    const link = `${location.href.split("#")[0]}${hashOfState(this.viewer.state)}`;
    history.replaceState(null, "", hashOfState(this.viewer.state));
    const done = await copy(link);
    byId("status").textContent = done ? "Link copied." : "The address bar has the link.";
    byId("link").classList.add("done");
    setTimeout(() => byId("link").classList.remove("done"), 1200);
  }

  handle() {
    const handle = byId("handle");
    const { stage } = this.viewer;
    handle.addEventListener("pointerdown", (e) => { handle.setPointerCapture(e.pointerId); e.preventDefault(); handle.focus(); });
    handle.addEventListener("pointermove", (e) => {
      if (!handle.hasPointerCapture(e.pointerId)) return;
      const box = stage.getBoundingClientRect();
      this.split((e.clientX - box.left) / box.width);
    });
    handle.addEventListener("keydown", (e) => {
      const { split } = this.viewer.state;
      const to = { ArrowLeft: split - 0.02, ArrowDown: split - 0.02, ArrowRight: split + 0.02, ArrowUp: split + 0.02,
        PageDown: split - 0.1, PageUp: split + 0.1, Home: 0, End: 1 }[e.key];
      if (to === undefined) return;
      e.preventDefault();
      e.stopPropagation();
      this.split(to);
    });
  }

  /** Drag moves, two fingers and the wheel zoom. The wheel scrolls the page until the stage has the focus. */
  pointer() {
    const { canvas, stage } = this.viewer;
    const down = new Map();
    const at = (e) => { const box = stage.getBoundingClientRect(); return [e.clientX - box.left, e.clientY - box.top]; };
    canvas.addEventListener("pointerdown", (e) => {
      down.set(e.pointerId, at(e));
      if (e.pointerType === "mouse" || this.viewer.state.zoom) canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      const now = at(e), before = down.get(e.pointerId);
      if (before) {
        if (down.size === 1) this.drag(now, before);
        else this.pinch(down, e.pointerId, now);
        down.set(e.pointerId, now);
      }
      this.read(now);
    });
    for (const type of ["pointerup", "pointercancel"]) canvas.addEventListener(type, (e) => down.delete(e.pointerId));
    canvas.addEventListener("pointerleave", () => { this.viewer.pixel = null; this.viewer.draw(); });
    canvas.addEventListener("dblclick", (e) => (this.viewer.state.zoom ? this.fit() : this.zoom(4, ...at(e))));
    canvas.addEventListener("wheel", (e) => {
      if (!e.ctrlKey && document.activeElement !== canvas && !document.fullscreenElement) return;
      e.preventDefault();
      this.zoom(2 ** (-e.deltaY / (e.ctrlKey ? 100 : 300)), ...at(e));
    }, { passive: false });
  }

  /** Moves the picture; where all of it is in view, the slider. */
  drag(now, before) {
    const { state, size } = this.viewer;
    if (state.zoom || state.mode === "side") this.pan(now[0] - before[0], now[1] - before[1]);
    else this.split(state.split + (now[0] - before[0]) / size[0]);
  }

  pinch(down, id, now) {
    const [other] = [...down].filter(([key]) => key !== id).map(([, point]) => point);
    const before = down.get(id);
    const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
    this.zoom(apart(now) / Math.max(1, apart(before)), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
  }

  read([left, top]) {
    const { viewer } = this;
    const [x, y] = imageFromStage(viewer.state, ...viewer.size, left, top).map(Math.floor);
    viewer.pixel = x >= 0 && y >= 0 && x < DATA.width && y < DATA.height ? [x, y] : null;
    if (viewer.pixel) viewer.readout.showPixel();
    viewer.draw();
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || byId("help").open) return;
    if (event.key === "?") return byId("help").showModal();
    const target = event.target;
    const inside = byId("viewer").contains(target), idle = target === document.body;
    const box = byId("screen").getBoundingClientRect();
    if (!inside && !(idle && box.top < innerHeight && box.bottom > 0)) return;
    if (["SELECT", "INPUT"].includes(target.tagName) || (target.tagName === "BUTTON" && [" ", "Enter"].includes(event.key))) return;
    const action = this.actionOf(event);
    if (!action) return;
    event.preventDefault();
    action();
  }

  actionOf({ key, code, shiftKey }) {
    const { state } = this.viewer;
    const digit = /^Digit([1-9])$/.exec(code)?.[1];
    const source = digit && SOURCES[digit - 1];
    if (source) return () => this.set({ [shiftKey ? "b" : "a"]: source });
    const both = (channel) => CHANNELS.includes(channel) && (() => this.set({ ca: channel, cb: channel }));
    const guides = DATA.channels.map((c) => c.name);
    return {
      ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1), " ": () => { this.viewer.touched = true; this.viewer.play(); },
      x: () => this.swap(), r: DATA.hasReference && (() => this.reference()), v: both("result"), e: both("error"), f: both("flip"),
      g: guides.length && (() => both(guides[(guides.indexOf(state.ca) + 1) % guides.length])()),
      m: () => this.set({ mode: state.mode === "side" ? "slider" : "side" }),
      "[": () => this.split(state.split - 0.05), "]": () => this.split(state.split + 0.05),
      "+": () => this.zoom(1.5), "=": () => this.zoom(1.5), "-": () => this.zoom(1 / 1.5), 0: () => this.fit(),
      w: () => this.pan(0, 60), s: () => this.pan(0, -60), a: () => this.pan(60, 0), d: () => this.pan(-60, 0),
      ",": () => this.set({ ev: Math.max(-6, state.ev - 0.5) }), ".": () => this.set({ ev: Math.min(6, state.ev + 0.5) }),
      "/": () => this.set({ ev: 0 }), c: () => this.copyLink(), l: () => this.fullScreen(), t: () => byId("theme").click(),
    }[key.length === 1 ? key.toLowerCase() : key];
  }

  reference() {
    const { b } = this.viewer.state;
    if (b === "reference") return this.set({ b: this.before ?? SOURCES[0] });
    this.before = b;
    this.set({ b: "reference" });
  }
}

/** Copies text; false where the browser refuses. */
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return false;
  }
}
