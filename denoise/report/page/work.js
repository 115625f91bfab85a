// What other threads do: unpack images, map FLIP. The text of these functions is their program.

/** Half float of every 16-bit word. */
function halfFloats() {
  const table = new Float32Array(65536);
  for (let u = 0; u < 65536; u++) {
    const exponent = (u >> 10) & 31, mantissa = u & 1023;
    const size = exponent === 0 ? mantissa * 2 ** -24
      : exponent === 31 ? (mantissa ? NaN : Infinity)
      : (1 + mantissa / 1024) * 2 ** (exponent - 15);
    table[u] = u & 0x8000 ? -size : size;
  }
  return table;
}

/** A packed image (denoise/packed.py): planes of half floats' words or, if whole, of numbers + 1. */
async function unpack(head, text) {
  const { width, height, planes, drop, color, whole } = head;
  const letters = atob(text);
  const packed = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) packed[i] = letters.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = width * height, low = planes * size;
  const words = [];
  for (let c = 0; c < planes; c++) {
    const plane = new Uint16Array(size);
    for (let y = 0, i = 0; y < height; y++) {
      let last = y ? plane[i - width] : 0;
      for (const end = i + width; i < end; i++) {
        const at = c * size + i;
        last = (last + (raw[at] << 8) + raw[low + at]) & 0xffff;
        plane[i] = last;
      }
    }
    words.push(plane);
  }
  if (color) {
    const [red, green, blue] = words;
    for (let i = 0; i < size; i++) {
      red[i] += green[i];
      blue[i] += green[i];
    }
  }
  if (drop) for (const plane of words) for (let i = 0; i < size; i++) plane[i] <<= drop;
  return { width, height, planes: words, whole, bytes: 2 * planes * size };
}

/**
 * LDR-FLIP (Andersson et al. 2020) of two images of radiance, as flip-evaluator has it: one plane
 * of float32 in [0, 1]. Colours are X, Y, Z relative to white. Figures come from the library.
 */
function flipMap(image, reference) {
  const [a, b] = [image, reference].map((one) => ({ colours: filteredColours(one), edges: features(one) }));
  const lab = [0, 1, 2].map(() => 0), other = [0, 1, 2].map(() => 0);
  const hyab = () => (Math.abs(lab[0] - other[0]) + Math.hypot(lab[1] - other[1], lab[2] - other[2])) ** 0.7;
  huntLab(lab, 0, 1, 0);
  huntLab(other, 0, 0, 1);
  const most = hyab(), knee = 0.4 * most;
  const size = image.width * image.height, map = new Float32Array(size);
  for (let i = 0; i < size; i++) {
    huntLab(lab, a.colours[0][i], a.colours[1][i], a.colours[2][i]);
    huntLab(other, b.colours[0][i], b.colours[1][i], b.colours[2][i]);
    const error = hyab();
    const colour = error < knee ? (0.95 * error) / knee : 0.95 + (0.05 * (error - knee)) / (most - knee);
    const feature = Math.max(...a.edges.map((plane, k) => Math.abs(plane[i] - b.edges[k][i])));
    map[i] = colour ** (1 - Math.sqrt(feature / Math.SQRT2));
  }
  return { width: image.width, height: image.height, planes: [map], float: true, bytes: 4 * size };
}

/** Linear R, G, B as seen through the eye's contrast sensitivity, clipped to [0, 1]. */
function filteredColours({ width, height, planes }) {
  const half = halfFloats(), size = width * height;
  const clip = (x) => (x > 0 && x !== Infinity ? Math.min(x, 1) : 0);
  const [luma, first, second] = [0, 1, 2].map(() => new Float32Array(size)), xyz = [0, 0, 0];
  for (let i = 0; i < size; i++) {
    relativeXyz(xyz, clip(half[planes[0][i]]), clip(half[planes[1][i]]), clip(half[planes[2][i]]));
    luma[i] = xyz[1];
    first[i] = xyz[0] - xyz[1];
    second[i] = xyz[1] - xyz[2];
  }
  // Gaussians a sqrt(pi / b) exp(-pi^2 d^2 / b) of degrees d, at 67 pixels a degree.
  const gaussian = (b) => Array.from({ length: 21 }, (_, k) => Math.exp(-(((Math.PI * (k - 10)) / 67) ** 2) / b));
  const blurred = (plane, terms) => {
    const rows = terms.map(([a, b]) => [a * Math.sqrt(Math.PI / b), gaussian(b)]);
    const total = rows.reduce((sum, [scale, row]) => sum + scale * row.reduce((p, q) => p + q) ** 2, 0);
    const out = new Float32Array(size);
    for (const [scale, row] of rows) {
      const part = separable(plane, width, height, row, row);
      for (let i = 0; i < size; i++) out[i] += (part[i] * scale) / total;
    }
    return out;
  };
  const [y, c, d] = [blurred(luma, [[1, 0.0047]]), blurred(first, [[1, 0.0053]]), blurred(second, [[34.1, 0.04], [13.5, 0.025]])];
  for (let i = 0; i < size; i++) {
    const X = 0.95042855 * (y[i] + c[i]), Y = y[i], Z = 1.0889004 * (y[i] - d[i]);
    y[i] = clip(3.2410033 * X - 1.5373989 * Y - 0.4986159 * Z);
    c[i] = clip(-0.9692243 * X + 1.8759301 * Y + 0.0415542 * Z);
    d[i] = clip(0.0556394 * X - 0.2040112 * Y + 1.0571489 * Z);
  }
  return [y, c, d];
}

/** Strength of edges and of points in luminance. */
function features({ width, height, planes }) {
  const half = halfFloats(), size = width * height, sigma = 0.5 * 0.082 * 67, radius = Math.ceil(3 * sigma);
  const clip = (x) => (x > 0 && x !== Infinity ? Math.min(x, 1) : 0);
  const luma = new Float32Array(size), xyz = [0, 0, 0];
  for (let i = 0; i < size; i++) {
    relativeXyz(xyz, clip(half[planes[0][i]]), clip(half[planes[1][i]]), clip(half[planes[2][i]]));
    luma[i] = xyz[1];
  }
  const at = Array.from({ length: 2 * radius + 1 }, (_, k) => k - radius);
  const unit = (row) => {  // positive weights sum to 1, negative ones to -1
    const [up, down] = [1, -1].map((sign) => row.reduce((sum, w) => sum + Math.max(0, sign * w), 0));
    return row.map((w) => w / (w > 0 ? up : down || 1));
  };
  const bell = (x) => Math.exp(-(x * x) / (2 * sigma * sigma));
  const smooth = unit(at.map(bell));
  return [(x) => -x * bell(x), (x) => ((x / sigma) ** 2 - 1) * bell(x)].map((kernel) => {
    const row = unit(at.map(kernel));
    const across = separable(luma, width, height, row, smooth), down = separable(luma, width, height, smooth, row);
    for (let i = 0; i < size; i++) across[i] = Math.hypot(across[i], down[i]);
    return across;
  });
}

/** A plane filtered along x by one row of weights and along y by another; its border repeats. */
function separable(plane, width, height, alongX, alongY) {
  const radius = (alongX.length - 1) / 2;
  const middle = new Float32Array(plane.length), out = new Float32Array(plane.length);
  const padded = new Float32Array(width + 2 * radius);
  for (let y = 0; y < height; y++) {
    const start = y * width;
    padded.set(plane.subarray(start, start + width), radius);
    padded.fill(plane[start], 0, radius);
    padded.fill(plane[start + width - 1], radius + width);
    for (let x = 0; x < width; x++) {
      let sum = 0;
      for (let k = 0; k < alongX.length; k++) sum += alongX[k] * padded[x + k];
      middle[start + x] = sum;
    }
  }
  for (let y = 0; y < height; y++) {
    for (let k = 0; k < alongY.length; k++) {
      const from = Math.max(0, Math.min(height - 1, y + k - radius)) * width, w = alongY[k];
      for (let x = 0, to = y * width; x < width; x++) out[to + x] += w * middle[from + x];
    }
  }
  return out;
}

/** L*a*b* of linear R, G, B into `out`; a and b weaker in the dark (Hunt). */
function huntLab(out, r, g, b) {
  const f = (t) => (t > 0.008856452 ? Math.cbrt(t) : 7.787037 * t + 4 / 29);
  relativeXyz(out, r, g, b);
  const x = f(out[0]), y = f(out[1]), z = f(out[2]);
  out[0] = 116 * y - 16;
  out[1] = 5 * out[0] * (x - y);
  out[2] = 2 * out[0] * (y - z);
}

/** X, Y, Z of linear R, G, B into `out`, each relative to white's. */
function relativeXyz(out, r, g, b) {
  out[0] = 0.43389539 * r + 0.37624237 * g + 0.18986224 * b;
  out[1] = 0.21263682 * r + 0.71518298 * g + 0.0721802 * b;
  out[2] = 0.01775242 * r + 0.10946563 * g + 0.87278195 * b;
}

const WORK = { unpack, flipMap };
const PROGRAM = `${[halfFloats, unpack, flipMap, filteredColours, features, separable, huntLab, relativeXyz].join("\n")}
const WORK = { unpack, flipMap };
onmessage = async ({ data: { id, task, given } }) => {
  try {
    const image = await WORK[task](...given);
    postMessage({ id, image }, image.planes.map((plane) => plane.buffer));
  } catch (error) {
    postMessage({ id, trouble: String(error) });
  }
};`;

/** A few threads that each do one thing after another; this thread, where a browser gives none. */
class Crew {
  constructor() {
    this.waiting = new Map();  // id -> {resolve, reject, worker}
    this.next = 0;
    this.workers = [];
    try {
      const address = URL.createObjectURL(new Blob([PROGRAM], { type: "text/javascript" }));
      const count = Math.max(2, Math.min(4, (navigator.hardwareConcurrency || 2) - 1));
      this.workers = Array.from({ length: count }, () => Object.assign(new Worker(address), { tasks: 0 }));
    } catch { /* the page is slower, and the same */ }
    for (const worker of this.workers) worker.onmessage = ({ data }) => this.done(data);
  }

  /** Promise of what WORK[task] makes of what is given. */
  async work(task, ...given) {
    if (!this.workers.length) return WORK[task](...given);
    const worker = this.workers.reduce((p, q) => (q.tasks < p.tasks ? q : p));
    worker.tasks += 1;
    const id = this.next++;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject, worker });
      worker.postMessage({ id, task, given });
    });
  }

  done({ id, image, trouble }) {
    const { resolve, reject, worker } = this.waiting.get(id);
    this.waiting.delete(id);
    worker.tasks -= 1;
    if (trouble) reject(new Error(trouble));
    else resolve(image);
  }
}
