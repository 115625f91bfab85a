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
    this.playing = false;
    this.turn = 0;
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
      if (!DATA.flipFrames.includes(frame)) return { source, channel, keys: [], trouble: `FLIP is mapped on frames ${DATA.flipFrames.join(", ")}` };
      return { source, channel, keys: [`flip/${source}/${String(frame).padStart(4, "0")}`] };
    }
    return { source, channel, keys: [keyOf(source, frame)] };
  }

  async update() {
    const turn = ++this.turn;
    this.stage.dataset.ready = "false";
    this.showControls();
    const wanted = this.sides.map(({ side }) => this.wanted(side));
    const slow = setTimeout(() => this.stage.classList.add("loading"), 150);
    const loaded = await Promise.all(wanted.map(async (want) => {
      try {
        return { ...want, images: await Promise.all(want.keys.map((key) => this.images.load(key))) };
      } catch (error) {
        return { ...want, trouble: error.message, images: [] };
      }
    }));
    clearTimeout(slow);
    if (turn !== this.turn) return;  // something newer is wanted
    this.stage.classList.remove("loading");
    loaded.forEach((want, i) => this.paint(this.sides[i], want));
    this.draw();
    this.showNumbers();
    this.showPixel();
    this.stage.dataset.ready = "true";
    this.stage.dataset.frame = this.state.frame;
    this.onFrame(this.state.frame);
    this.saveSoon();
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
    const range = DATA.channels.find((c) => c.name === want.channel)?.range;
    if (want.channel === "error") paintError(out, image, reference, ev);
    else if (want.channel === "flip") paintFlip(out, image, ev);
    else if (want.channel === "id") paintObjects(out, image);
    else if (want.channel === "normal") paintRange(out, image, -1, 1);
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

  // What stands beside the pictures

  title(side) {
    const [source, channel] = [this.state[side], this.state[`c${side}`]];
    const metric = METRIC[DATA.headline];
    const i = DATA.frames.indexOf(this.state.frame);
    const value = metric && METHOD[source]?.perFrame[metric.name][i];
    if (DATA.channels.some((c) => c.name === channel)) return channel;
    return source + (channel === "result" ? "" : ` · ${channel}`) + (value === null || value === undefined ? "" : ` · ${withUnit(value, metric)}`);
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

  showNumbers() {
    this.sides.forEach((target) => {
      const { side, trouble } = target;
      byId(`tag-${side}`).textContent = `${side.toUpperCase()} · ${this.title(side)}`;
      byId(`trouble-${side}`).textContent = trouble;
    });
    const { a, b, frame } = this.state;
    this.canvas.setAttribute("aria-label", `Frame ${frame}: ${this.title("a")} against ${this.title("b")}`);
    if (!this.playing) byId("status").textContent = `Frame ${frame}: A ${this.title("a")}, B ${this.title("b")}`;
    const i = DATA.frames.indexOf(frame);
    const value = (source, m) => METHOD[source]?.perFrame[m.name]?.[i] ?? null;
    const rows = DATA.metrics.filter((m) => value(a, m) !== null || value(b, m) !== null).map((m) => {
      const values = [value(a, m), value(b, m)];
      const better = values.includes(null) || values[0] === values[1] ? -1 : (values[0] > values[1]) === m.higherIsBetter ? 0 : 1;
      return html("tr", {}, html("th", { scope: "row", title: m.about }, m.unit ? `${m.label} (${m.unit})` : m.label),
        ...values.map((v, k) => html("td", k === better ? { class: "best" } : {}, formatted(v, m.format))));
    });
    byId("numbers").replaceChildren(...rows);
    byId("numbers-of").textContent = `This frame (${frame})`;
    byId("numbers-a").title = a;
    byId("numbers-b").title = b;
    byId("numbers-table").hidden = !rows.length;
  }

  /** Values of the pixel under the pointer, or of the middle of the stage. */
  showPixel() {
    const { state } = this;
    const [x, y] = (this.pixel ?? [state.x, state.y]).map((v, k) => Math.max(0, Math.min([DATA.width, DATA.height][k] - 1, Math.floor(v))));
    const i = y * DATA.width + x;
    const ids = this.glance(DATA.channels.some((c) => c.name === "id") && guideKey("id", state.frame));
    const reference = this.glance(DATA.references.includes(state.frame) && keyOf("reference", state.frame));
    const object = ids && (DATA.objects[valuesAt(ids, i)[0]] ?? "background");
    byId("pixel").textContent = `x ${x}, y ${y}${object ? ` · ${object}` : ""}`;
    const rows = this.sides.map(({ side }) => {
      const { source, channel, keys, trouble } = this.wanted(side);
      const image = !trouble && this.glance(keys[0]);
      const judged = reference && image && ["result", "error"].includes(channel) && image.planes.length === 3;
      const name = ["result", "error"].includes(channel) ? source : channel === "flip" ? `FLIP ${source}` : channel;
      return this.pixelRow(side.toUpperCase(), name, image && valuesAt(image, i), judged ? errorAt(image, reference, i) : null);
    });
    if (reference) rows.push(this.pixelRow("", "reference", valuesAt(reference, i), null));
    byId("pixels").replaceChildren(...rows);
  }

  pixelRow(side, name, values, error) {
    const cells = [0, 1, 2].map((k) => html("td", {}, values && k < values.length ? short(values[k]) : ""));
    return html("tr", {}, html("th", { scope: "row", title: name }, side ? html("b", {}, side) : null, ` ${name}`), ...cells, html("td", {}, error === null ? "" : error.toFixed(3)));
  }

  /** The image if it is here; if not, and nothing plays, asks for it and reads out again later. */
  glance(key) {
    if (!key) return null;
    const image = this.images.peek(key);
    if (!image && !this.playing) this.images.load(key).then(() => this.showPixel(), () => {});
    return image ?? null;
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
