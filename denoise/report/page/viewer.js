// The viewer: two pictures of a frame, one stage.

const keyOf = (source, frame) =>
  `${source === "input" ? "frame/color" : source === "reference" ? source : `denoised/${source}`}/${String(frame).padStart(4, "0")}`;
const guideKey = (channel, frame) => `frame/${channel}/${String(frame).padStart(4, "0")}`;

class Viewer {
  constructor(onFrame) {
    this.onFrame = onFrame;
    this.images = new Images();
    this.canvas = byId("canvas");
    this.stage = byId("stage");
    this.sides = ["a", "b"].map((side) => ({ side, canvas: document.createElement("canvas"), painted: "", trouble: "" }));
    for (const { canvas } of this.sides) [canvas.width, canvas.height] = [DATA.width, DATA.height];
    this.pixel = null;
    this.readout = new Readout(this);
    this.playing = false;
    this.stale = false;    // what is shown is no longer what is wanted
    this.showing = null;   // promise of what is shown, while images load
    this.state = stateOfHash(location.hash);
    this.stage.style.setProperty("--aspect", DATA.width / DATA.height);
    new ResizeObserver(() => this.draw()).observe(this.stage);
    this.update();
  }

  /** Change the state; loads and paints what that needs. */
  set(changes) {
    Object.assign(this.state, changes);
    this.update();
  }

  get size() {
    return [this.stage.clientWidth, this.stage.clientHeight];
  }

  /** What a side shows, the images it is made of, or why there is none. */
  wanted(side) {
    const { frame } = this.state;
    const [source, channel] = [this.state[side], this.state[`c${side}`]];
    const has = source === "reference" ? DATA.references.includes(frame) : METHOD[source].frames.includes(frame);
    if (DATA.channels.some((c) => c.name === channel)) return { source, channel, keys: [guideKey(channel, frame)] };
    if (!has) return { source, channel, keys: [], trouble: `${source} has no frame ${frame}` };
    if (channel === "error") {
      if (!DATA.references.includes(frame)) return { source, channel, keys: [], trouble: `frame ${frame} has no reference` };
      return { source, channel, keys: [keyOf(source, frame), keyOf("reference", frame)] };
    }
    if (channel === "flip") {
      if (source === "reference") return { source, channel, keys: [], trouble: "the reference has no FLIP to itself" };
      if (!DATA.references.includes(frame)) return { source, channel, keys: [], trouble: `frame ${frame} has no reference` };
      return { source, channel, keys: [`flip ${keyOf(source, frame)} ${keyOf("reference", frame)}`] };
    }
    return { source, channel, keys: [keyOf(source, frame)] };
  }

  /** Shows the state. What is wanted while images load waits, and of that only the latest is loaded. */
  update() {
    this.stage.dataset.ready = "false";
    this.showControls();
    this.stale = true;
    this.showing ??= this.show();
    return this.showing;
  }

  async show() {
    const slow = setTimeout(() => this.stage.classList.add("loading"), 150);
    while (this.stale) {
      this.stale = false;
      const loaded = await Promise.all(this.sides.map(({ side }) => this.loaded(this.wanted(side))));
      loaded.forEach((want, i) => this.paint(this.sides[i], want));
      this.draw();
    }
    clearTimeout(slow);
    this.stage.classList.remove("loading");
    this.readout.showNumbers();
    this.readout.showPixel();
    this.stage.dataset.ready = "true";
    this.stage.dataset.frame = this.state.frame;
    this.showing = null;
    this.onFrame(this.state.frame);
    this.saveSoon();
  }

  /** What is wanted with its images, or with why there are none. */
  async loaded(want) {
    try {
      return { ...want, images: await Promise.all(want.keys.map((key) => this.images.load(key))) };
    } catch (error) {
      return { ...want, trouble: error.message, images: [] };
    }
  }

  paint(target, want) {
    target.trouble = want.trouble ?? "";
    const { ev } = this.state;
    const name = JSON.stringify([want.keys, want.channel, ev]);
    if (target.painted === name || target.trouble) return;
    target.painted = name;
    const context = target.canvas.getContext("2d");
    const picture = context.createImageData(DATA.width, DATA.height);
    const out = new Uint32Array(picture.data.buffer);
    const [image, reference] = want.images;
    const { range, display } = DATA.channels.find((c) => c.name === want.channel) ?? {};
    if (want.channel === "error") paintError(out, image, reference, ev);
    else if (want.channel === "flip") paintFlip(out, image, ev);
    else if (display === "object") paintObjects(out, image);
    else if (display === "axes") paintRange(out, image, -1, 1);
    else if (range) paintRange(out, image, range[0], range[1] === range[0] ? range[0] + 1 : range[1]);
    else paintRadiance(out, image, ev);
    context.putImageData(picture, 0, 0);
  }

  draw() {
    const [width, height] = this.size;
    if (!width || !height) return;
    const { state, canvas } = this;
    keepInside(state, width, height);
    const ratio = window.devicePixelRatio || 1;
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const zoom = zoomOf(state, width, height);
    context.imageSmoothingEnabled = zoom * ratio < 1;
    context.imageSmoothingQuality = "high";
    const split = Math.round(state.split * width * ratio) / ratio;
    panesOf(state, width).forEach(([start, pane], i) => {
      const [left, right] = state.mode === "side" ? [start, start + pane] : i ? [split, width] : [0, split];
      context.save();
      context.beginPath();
      context.rect(left, 0, right - left, height);
      context.clip();
      if (!this.sides[i].trouble) {
        context.drawImage(this.sides[i].canvas, start + pane / 2 - state.x * zoom, height / 2 - state.y * zoom, DATA.width * zoom, DATA.height * zoom);
      }
      context.restore();
    });
    this.stage.dataset.mode = state.mode;
    this.stage.style.setProperty("--split", state.mode === "side" ? "50%" : `${split}px`);
    this.canvas.style.touchAction = state.zoom ? "none" : "pan-y";
    this.drawPixelFrame(context, zoom, width, height);
    byId("zoom").textContent = state.zoom ? `${Math.round(100 * zoom)} %` : "fit";
    this.saveSoon();
  }

  /** A frame around the pixel that is read out, once pixels are large enough to be told apart. */
  drawPixelFrame(context, zoom, width, height) {
    if (!this.pixel || zoom < 6) return;
    context.lineWidth = 1.5;
    for (const [start, pane] of panesOf(this.state, width).slice(this.state.mode === "side" ? 0 : 1)) {
      const left = start + pane / 2 + (this.pixel[0] - this.state.x) * zoom, top = height / 2 + (this.pixel[1] - this.state.y) * zoom;
      for (const [grow, colour] of [[1.5, "#000"], [0, "#fff"]]) {
        context.strokeStyle = colour;
        context.strokeRect(left - grow, top - grow, zoom + 2 * grow, zoom + 2 * grow);
      }
    }
  }

  saveSoon() {
    clearTimeout(this.saving);
    this.saving = setTimeout(() => {
      this.saved = hashOfState(this.state);
      if (this.touched) history.replaceState(null, "", this.saved);
    }, 200);
  }

  showControls() {
    const { state } = this;
    for (const key of ["a", "b", "ca", "cb"]) byId(key).value = state[key];
    byId("frame").value = DATA.frames.indexOf(state.frame);
    byId("frame").setAttribute("aria-valuetext", `frame ${state.frame}`);
    byId("frame-name").textContent = `frame ${state.frame}`;
    byId("ev").value = state.ev;
    byId("ev-value").textContent = `${state.ev > 0 ? "+" : ""}${Number(state.ev.toFixed(2))} EV`;
    byId("handle").setAttribute("aria-valuenow", Math.round(100 * state.split));
    for (const button of document.querySelectorAll("[data-set-mode]")) button.setAttribute("aria-pressed", String(button.dataset.setMode === state.mode));
    byId("play").setAttribute("aria-pressed", String(this.playing));
  }

  // Playing

  step(by) {
    const { frames } = DATA;
    const at = frames.indexOf(this.state.frame);
    this.set({ frame: frames[(at + by + frames.length) % frames.length] });
  }

  async play(on = !this.playing) {
    if (on === this.playing) return;
    this.playing = on;
    this.showControls();
    const run = (this.run = {});
    let due = performance.now();
    while (this.playing && this.run === run) {
      due = Math.max(due + 1000 / DATA.fps, performance.now());
      const next = DATA.frames[(DATA.frames.indexOf(this.state.frame) + 1) % DATA.frames.length];
      Object.assign(this.state, { frame: next });
      await this.update();
      this.prefetch(3);
      await new Promise((resolve) => setTimeout(resolve, Math.max(0, due - performance.now())));
    }
    if (!this.playing) this.update();
  }

  prefetch(count) {
    const at = DATA.frames.indexOf(this.state.frame);
    for (let n = 1; n <= count; n++) {
      const frame = DATA.frames[(at + n) % DATA.frames.length];
      const there = { ...this.state, frame };
      for (const { side } of this.sides) {
        for (const key of this.wanted.call({ state: there }, side).keys) this.images.load(key).catch(() => {});
      }
    }
  }
}
