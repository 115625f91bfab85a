// What stands beside the pictures in words and numbers: tags, the frame's measures, a pixel's values.

class Readout {
  constructor(viewer) {
    this.viewer = viewer;
    this.missing = new Set();  // keys of images that the pixel's values lack
    this.asking = null;
  }

  title(side) {
    const { state } = this.viewer;
    const [source, channel] = [state[side], state[`c${side}`]];
    const metric = METRIC[DATA.headline];
    const value = metric && METHOD[source]?.perFrame[metric.name][DATA.frames.indexOf(state.frame)];
    if (DATA.channels.some((c) => c.name === channel)) return channel;
    return source + (channel === "result" ? "" : ` · ${channel}`) + (value === null || value === undefined ? "" : ` · ${withUnit(value, metric)}`);
  }

  showNumbers() {
    const { viewer } = this;
    for (const { side, trouble } of viewer.sides) {
      byId(`tag-${side}`).textContent = `${side.toUpperCase()} · ${this.title(side)}`;
      byId(`trouble-${side}`).textContent = trouble;
    }
    const { a, b, frame } = viewer.state;
    viewer.canvas.setAttribute("aria-label", `Frame ${frame}: ${this.title("a")} against ${this.title("b")}`);
    if (!viewer.playing) byId("status").textContent = `Frame ${frame}: A ${this.title("a")}, B ${this.title("b")}`;
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
    const { state, pixel, sides } = this.viewer;
    this.missing.clear();
    const [x, y] = (pixel ?? [state.x, state.y]).map((v, k) => Math.max(0, Math.min([DATA.width, DATA.height][k] - 1, Math.floor(v))));
    const i = y * DATA.width + x;
    const ids = this.glance(DATA.channels.some((c) => c.name === "id") && guideKey("id", state.frame));
    const reference = this.glance(DATA.references.includes(state.frame) && keyOf("reference", state.frame));
    const object = ids && (DATA.objects[valuesAt(ids, i)[0]] ?? "background");
    byId("pixel").textContent = `x ${x}, y ${y}${object ? ` · ${object}` : ""}`;
    const rows = sides.map(({ side }) => {
      const { source, channel, keys, trouble } = this.viewer.wanted(side);
      const image = !trouble && this.viewer.images.peek(keys[0]);
      const judged = reference && image && ["result", "error"].includes(channel) && image.planes.length === 3;
      const name = ["result", "error"].includes(channel) ? source : channel === "flip" ? `FLIP ${source}` : channel;
      return this.row(side.toUpperCase(), name, image && valuesAt(image, i), judged ? errorAt(image, reference, i) : null);
    });
    if (reference) rows.push(this.row("", "reference", valuesAt(reference, i), null));
    byId("pixels").replaceChildren(...rows);
  }

  row(side, name, values, error) {
    const cells = [0, 1, 2].map((k) => html("td", {}, values && k < values.length ? short(values[k]) : ""));
    return html("tr", {}, html("th", { scope: "row", title: name }, side ? html("b", {}, side) : null, ` ${name}`), ...cells, html("td", {}, error === null ? "" : error.toFixed(3)));
  }

  /** The image if it is here; if not, it is asked for soon, unless frames fly by, and then read out. */
  glance(key) {
    if (!key) return null;
    const { images } = this.viewer;
    const image = images.peek(key);
    if (image) return image;
    this.missing.add(key);
    this.asking ??= setTimeout(() => {
      this.asking = null;
      if (this.viewer.playing || this.viewer.showing) return;
      for (const wanted of this.missing) images.load(wanted).then(() => this.showPixel(), () => {});
    }, 100);
    return null;
  }
}
