// The four plots: speed against error, error over frames, error by cause, histogram of error.

class Charts {
  constructor(onFrame, onMethod) {
    this.onFrame = onFrame;
    this.onMethod = onMethod;
    this.hidden = new Set();
    this.split = "cause";
    this.frame = DATA.frames[0];
    const first = METRIC[DATA.headline] ? DATA.headline : DATA.metrics[0]?.name;
    this.metric = METRIC[first];
    if (!this.metric) return;
    const select = byId("metric");
    select.append(...DATA.metrics.map((m) => html("option", { value: m.name }, m.unit ? `${m.label} (${m.unit})` : m.label)));
    select.value = first;
    select.addEventListener("change", () => { this.metric = METRIC[select.value]; this.draw(); });
    byId("legend").append(...DATA.methods.map((method) => html("button",
      { type: "button", class: "chip", "aria-pressed": "true", onclick: (e) => this.toggle(method, e.currentTarget) },
      swatch(method), method.name)));
    for (const button of document.querySelectorAll("[data-split]")) {
      button.addEventListener("click", () => { this.split = button.dataset.split; this.drawClasses(); });
    }
    this.draw();
    let width = byId("plots").clientWidth;
    new ResizeObserver(() => {
      if (byId("plots").clientWidth !== width) this.draw();
      width = byId("plots").clientWidth;
    }).observe(byId("plots"));
  }

  toggle(method, button) {
    if (!this.hidden.delete(method.name)) this.hidden.add(method.name);
    button.setAttribute("aria-pressed", String(!this.hidden.has(method.name)));
    this.draw();
  }

  get shown() {
    return DATA.methods.filter((m) => !this.hidden.has(m.name));
  }

  draw() {
    if (!this.metric) return;
    hideTip();
    byId("times-are").textContent = DATA.timesAre;
    byId("metric-about").textContent = this.metric.about;
    this.drawSpeed();
    this.drawFrames();
    this.drawClasses();
    this.drawHistogram();
  }

  setFrame(frame) {
    this.frame = frame;
    const line = byId("now");
    if (line && this.frameX) {
      const x = this.frameX(DATA.frames.indexOf(frame));
      line.setAttribute("x1", x);
      line.setAttribute("x2", x);
    }
  }

  drawSpeed() {
    const metric = this.metric;
    const box = byId("plot-speed");
    const points = this.shown.filter((m) => m.ms && m.values[metric.name] !== null);
    box.closest("figure").hidden = !DATA.methods.some((m) => m.ms && m.values[metric.name] !== null);
    const size = canvasOf(box, box.clientWidth < 560 ? 340 : 430, "Speed against error, a point a method");
    if (!points.length) return;
    const noisy = METHOD.input && !this.hidden.has("input") ? METHOD.input.values[metric.name] : null;
    const times = points.map((m) => m.ms);
    const values = points.map((m) => m.values[metric.name]);
    const best = metric.higherIsBetter ? Math.max(...values) : Math.min(...values);
    const floor = metric.name === DATA.headline && DATA.floor !== null && DATA.floor < best + 8 ? DATA.floor : null;
    const near = noisy !== null && isNear(noisy, values);
    const [low, high] = extent([...values, ...(near ? [noisy] : []), ...(floor === null ? [] : [floor])], 0.1);
    const [bottom, top] = [size.height - PLOT.bottom, PLOT.top];
    const y = metric.higherIsBetter ? scale(low, high, bottom, top) : scale(low, high, top, bottom);
    const x = scale(Math.min(...times) / 1.8, Math.max(...times) * 2.2, PLOT.left + 6, size.width - PLOT.right, true);
    axes(size.node, x, y, size, { x: "milliseconds a frame (log scale, less is better)", y: axisName(metric), left: PLOT.left + 6 });
    for (const [value, text, kind] of [[noisy, "input", "dashed"], [floor, "noise floor of the reference", "dotted"]]) {
      if (value === null) continue;
      if (kind === "dashed" && !near) {
        size.node.append(svg("text", { x: size.width - PLOT.right, y: bottom - 8, "text-anchor": "end", class: "note" }, `${text}: ${withUnit(value, metric)}, below ↓`));
        continue;
      }
      size.node.append(
        svg("line", { x1: PLOT.left + 6, x2: size.width - PLOT.right, y1: y(value), y2: y(value), class: `level ${kind}` }),
        svg("text", { x: size.width - PLOT.right, y: y(value) - 5, "text-anchor": "end", class: "note" },
          `${text}, ${withUnit(value, metric)}`));
    }
    this.drawFront(size, x, y, metric);
    const at = points.map((m) => ({ x: x(m.ms), y: y(m.values[metric.name]), text: m.name }));
    const labels = placeLabels(at, [PLOT.left + 8, 0, size.width, bottom - 2]);
    const mixed = DATA.methods.some((m) => m.inTurns);
    points.forEach((m, i) => {
      size.node.append(marker(m, at[i].x, at[i].y, [known(m, metric),
        `${formatted(m.ms, ".1f")} ms a frame${m.inTurns ? ", in turns" : ""}`], () => this.onMethod(m.name), 6.5, mixed && !m.inTurns));
      const label = labels[i];
      if (label) size.node.append(svg("text", { x: label.x, y: label.y, "text-anchor": label.anchor, class: "name", "aria-hidden": "true" }, m.name));
    });
  }

  drawFront({ node, width }, x, y, metric) {
    const front = metric.front.filter((name) => !this.hidden.has(name)).map((name) => METHOD[name]);
    if (!front.length) return;
    const at = front.map((m) => [x(m.ms), y(m.values[metric.name])]);
    let path = `M${at[0][0]} ${at[0][1]}`;
    for (const [px, py] of at.slice(1)) path += `H${px}V${py}`;
    node.append(svg("path", { d: `${path}H${width - PLOT.right}`, class: "front", "aria-label":
      `Pareto front: ${front.map((m) => m.name).join(", ")}`, role: "img" }));
  }

  drawFrames() {
    const metric = this.metric;
    const of = (m) => m.perFrame[metric.name].filter((v) => v !== null);
    const some = this.shown.filter((m) => of(m).length);
    const others = some.filter((m) => m.name !== "input").flatMap(of);
    const shown = some.filter((m) => m.name !== "input" || !others.length || isNear(of(m)[0], others));
    const size = canvasOf(byId("plot-frames"), 290, `${metric.label} over frames`);
    byId("input-off").hidden = shown.length === some.length;
    if (!shown.length) return;
    const values = shown.flatMap(of);
    const floors = metric.name === DATA.headline ? DATA.floors.filter((v) => v !== null) : [];
    const floor = floors.length > 0 && isNear(Math.min(...floors), values);
    const y = scale(...extent([...values, ...(floor ? floors : [])]), size.height - PLOT.bottom, PLOT.top);
    const last = DATA.frames.length - 1;
    const x = scale(0, last || 1, PLOT.left + 8, size.width - PLOT.right - 6);
    x.ticks = x.ticks.filter(Number.isInteger);
    this.frameX = x;
    axes(size.node, x, y, size, { x: "frame", y: axisName(metric) }, (i) => String(DATA.frames[i] ?? ""));
    // Some measures are taken on some frames only: the line goes on from one to the next.
    const line = (row) => row.map((v, i) => [v, i]).filter(([v]) => v !== null)
      .map(([v, i], n) => `${n ? "L" : "M"}${x(i).toFixed(1)} ${y(v).toFixed(1)}`).join("");
    if (floor) size.node.append(svg("path", { d: line(DATA.floors), class: "level dotted" }));
    for (const m of shown) {
      const row = m.perFrame[metric.name];
      size.node.append(svg("path", { d: line(row), class: "line", stroke: colourOf(m), role: "img",
        "aria-label": `${m.name}: ${known(m, metric)} on average` }));
      if (of(m).length > 40) continue;
      row.forEach((v, i) => v !== null && size.node.append(
        svg("path", { d: markerPath(m, 2.8), fill: colourOf(m), transform: `translate(${x(i)} ${y(v)})` })));
    }
    size.node.append(svg("line", { id: "now", y1: PLOT.top, y2: size.height - PLOT.bottom, class: "now" }));
    this.setFrame(this.frame);
    this.hoverFrames(size, x, some, metric, last);
  }

  /** Values of all methods at the frame under the pointer or, with arrow keys, the focus. */
  hoverFrames(size, x, shown, metric, last) {
    const cross = svg("line", { y1: PLOT.top, y2: size.height - PLOT.bottom, class: "cross", visibility: "hidden" });
    let index = DATA.frames.indexOf(this.frame);
    const area = svg("rect", { x: PLOT.left, y: 0, width: size.width - PLOT.left, height: size.height - PLOT.bottom, fill: "transparent",
      tabindex: 0, role: "slider", "aria-label": `Frame; ${metric.label} of each method`, "aria-valuemin": DATA.frames[0], "aria-valuemax": DATA.frames[last] });
    const say = (i, left, top) => {
      index = Math.max(0, Math.min(last, i));
      cross.setAttribute("x1", x(index));
      cross.setAttribute("x2", x(index));
      cross.setAttribute("visibility", "visible");
      const rows = shown.filter((m) => m.perFrame[metric.name][index] !== null)
        .sort((a, b) => (metric.higherIsBetter ? 1 : -1) * (b.perFrame[metric.name][index] - a.perFrame[metric.name][index]));
      area.setAttribute("aria-valuenow", DATA.frames[index]);
      area.setAttribute("aria-valuetext", `frame ${DATA.frames[index]}: ${rows.map((m) => `${m.name} ${withUnit(m.perFrame[metric.name][index], metric)}`).join(", ")}`);
      showTip(left, top, [html("b", {}, `frame ${DATA.frames[index]}`), ...rows.map((m) => [swatch(m), `${m.name} `, html("b", {}, withUnit(m.perFrame[metric.name][index], metric))])]);
    };
    const hide = () => { cross.setAttribute("visibility", "hidden"); hideTip(); };
    const beside = () => { const r = cross.getBoundingClientRect(); return [r.right, r.top]; };
    area.addEventListener("pointermove", (e) => say(Math.round(x.inverse(e.clientX - size.node.getBoundingClientRect().left)), e.clientX, e.clientY));
    area.addEventListener("pointerleave", hide);
    area.addEventListener("blur", hide);
    area.addEventListener("focus", () => { say(index, 0, 0); say(index, ...beside()); });
    area.addEventListener("click", () => this.onFrame(DATA.frames[index]));
    area.addEventListener("keydown", (e) => {
      const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[e.key];
      if (!step && e.key !== "Enter") return;
      e.preventDefault();
      e.stopPropagation();
      if (step) { say(index + step, 0, 0); say(index, ...beside()); } else this.onFrame(DATA.frames[index]);
    });
    size.node.append(cross, area);
  }

  drawClasses() {
    const classes = DATA.classes[this.split];
    byId("classes").hidden = !Object.values(DATA.classes).some((rows) => rows.length);
    for (const button of document.querySelectorAll("[data-split]")) button.setAttribute("aria-pressed", String(button.dataset.split === this.split));
    this.drawDots(byId("plot-class-db"), classes, "psnr_srgb", `${METRIC[DATA.headline].label} in the class, ${METRIC[DATA.headline].unit}`,
      (v) => withUnit(v, METRIC[DATA.headline]), false);
    this.drawDots(byId("plot-class-share"), classes, "mse_share", "share of its squared error (bar: of the pixels)",
      (v) => `${(100 * v).toFixed(1)} % of its squared error`, true);
  }

  /** A row for each class, a dot for each method; as shares with the class's share of pixels. */
  drawDots(box, classes, key, label, say, shares) {
    const value = (m, c) => {
      const v = m.classes[this.split][c.name]?.[key] ?? null;
      return !shares && v >= DATA.exact ? null : v;  // no error at all is off the scale
    };
    const values = this.shown.flatMap((m) => classes.map((c) => value(m, c)).filter((v) => v !== null));
    const row = Math.max(40, 8 * this.shown.length), left = 92;
    const size = canvasOf(box, PLOT.top + row * classes.length + PLOT.bottom, `${label}, by ${this.split}`);
    if (!values.length) return;
    const pixelsOf = (c) => this.shown.map((m) => m.classes[this.split][c.name]?.pixels).find((p) => p !== undefined) ?? 0;
    const range = shares ? [0, 1.06 * Math.max(...values, ...classes.map(pixelsOf))] : extent(values);
    const x = scale(...range, left + (shares ? 0 : 10), size.width - PLOT.right - 8);
    axes(size.node, x, {}, size, { x: label, left }, shares ? (v) => `${Math.round(100 * v)}%` : short);
    classes.forEach((c, i) => {
      const middle = PLOT.top + row * (i + 0.5), pixels = pixelsOf(c);
      size.node.append(
        shares ? svg("rect", { x: left, width: Math.max(0, x(pixels) - left), y: middle - row / 2 + 3, height: row - 6, class: "share" })
          : svg("rect", { x: left, width: size.width - PLOT.right - left, y: middle - row / 2 + 3, height: row - 6, class: "lane" }),
        svg("text", { x: left - 8, y: middle - 2, "text-anchor": "end", class: "name" }, c.name, svg("title", {}, c.about)),
        svg("text", { x: left - 8, y: middle + 13, "text-anchor": "end", class: "note" }, `${Number((100 * pixels).toPrecision(2))} % of px`));
      for (const [k, m] of this.shown.entries()) {
        const lane = middle + (row - 16) * ((k + 0.5) / this.shown.length - 0.5);  // each has its own height
        if (value(m, c) !== null) size.node.append(marker(m, x(value(m, c)), lane, [`${c.name}: ${say(value(m, c))}`], null, 4.5));
      }
    });
  }

  drawHistogram() {
    const box = byId("plot-histogram");
    const shown = this.shown.filter((m) => m.histogram);
    box.closest("figure").hidden = !DATA.methods.some((m) => m.histogram);
    const size = canvasOf(box, 280, "Histogram of per-pixel error");
    if (!shown.length) return;
    const bottom = size.height - PLOT.bottom;
    const x = scale(DATA.edges[0], DATA.edges.at(-1), PLOT.left, size.width - PLOT.right, true);
    x.ticks = [1e-4, 1e-3, 1e-2, 1e-1, 1];
    const tallest = Math.max(...shown.flatMap((m) => m.histogram.slice(1)));  // the first bin is all below it
    const y = scale(0, 1.08 * (tallest || 1), bottom, PLOT.top);
    axes(size.node, x, y, size, { x: "error of a pixel: mean |ΔsRGB| (log scale)", y: "share of pixels" },
      String, (v) => `${Number((100 * v).toPrecision(3))}%`);
    const middles = DATA.edges.slice(1).map((edge, i) => Math.sqrt(edge * DATA.edges[i]));
    for (const m of shown) {
      const at = m.histogram.map((v, i) => `${x(middles[i]).toFixed(1)} ${y(v).toFixed(1)}`).slice(1);
      size.node.append(svg("path", { d: `M${at.join("L")}`, class: "line", stroke: colourOf(m), role: "img",
        "aria-label": `${m.name}: half of the pixels err by less than ${short(quantile(m.histogram, 0.5))}, 95 % by less than ${short(quantile(m.histogram, 0.95))}` }));
    }
    const area = svg("rect", { x: PLOT.left, y: 0, width: size.width - PLOT.left, height: bottom, fill: "transparent" });
    area.addEventListener("pointermove", (e) => {
      const error = x.inverse(e.clientX - size.node.getBoundingClientRect().left);
      const bin = Math.max(0, DATA.edges.findIndex((edge) => edge > error) - 1);
      const above = (m) => m.histogram.slice(bin).reduce((a, b) => a + b, 0);
      showTip(e.clientX, e.clientY, [`pixels with an error above ${short(DATA.edges[bin])}`,
        ...[...shown].sort((a, b) => above(a) - above(b)).map((m) => [swatch(m), `${m.name} `, html("b", {}, `${(100 * above(m)).toFixed(1)} %`)])]);
    });
    area.addEventListener("pointerleave", hideTip);
    size.node.append(area);
  }
}

/** Whether a level can be shown with the values without pressing them together. */
function isNear(level, values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  return level > low - 0.4 * (high - low) && level < high + 0.4 * (high - low);
}

/** Upper edge of the bin in which the cumulated shares pass q. */
function quantile(shares, q) {
  let sum = 0;
  const bin = shares.findIndex((share) => (sum += share) >= q);
  return DATA.edges[(bin < 0 ? shares.length - 1 : bin) + 1];
}
