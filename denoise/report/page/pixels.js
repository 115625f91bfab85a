// Packed images (denoise/packed.py): loaded when they are looked at, the latest ones kept.

const CACHE_BYTES = 256 * 2 ** 20;

const HALF = halfFloats();

/** Clipped sRGB of linear radiance; what is not a number is black, as in the scores. */
function srgb(x) {
  if (!(x > 0) || x === Infinity) return 0;
  const c = Math.min(x, 1);
  return c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
}

const DISPLAY = Float32Array.from(HALF, srgb);

/** Where the file of an image is: beside the page or, of a page that is one file, in it. */
function address(key) {
  const text = window.onesppFiles?.[key];
  if (text) return URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
  return `data/${key.split("/").map(encodeURIComponent).join("/")}.js`;
}

class Images {
  constructor() {
    this.kept = new Map();     // key -> image; the oldest use comes first
    this.bytes = 0;
    this.pending = new Map();  // key -> {promise, give}
    this.crew = new Crew();
    window.onesppImage = (key, head, text) => this.pending.get(key)?.give(this.crew.work("unpack", head, text));
  }

  /** The image if it is here. */
  peek(key) {
    const image = this.kept.get(key);
    if (image) {
      this.kept.delete(key);
      this.kept.set(key, image);
    }
    return image;
  }

  /** Promise of an image. Rejects where its file is missing or the browser can't read it. */
  load(key) {
    const image = this.peek(key);
    if (image) return Promise.resolve(image);
    if (this.pending.has(key)) return this.pending.get(key).promise;
    if (key.startsWith("flip ")) return this.flip(key);
    const script = html("script", { src: address(key) });
    const promise = new Promise((resolve, reject) => {
      this.pending.set(key, { give: resolve });
      script.onerror = () => reject(new Error(`data/${key}.js is missing`));
    }).then((decoded) => this.keep(key, decoded)).finally(() => {
      this.pending.delete(key);
      script.remove();
    });
    this.pending.get(key).promise = promise;
    document.head.append(script);
    return promise;
  }

  /** FLIP of two images: of the key "flip A B", with their keys. */
  flip(key) {
    const promise = Promise.all(key.split(" ").slice(1).map((part) => this.load(part)))
      .then((images) => this.crew.work("flipMap", ...images)).then((map) => this.keep(key, map))
      .finally(() => this.pending.delete(key));
    this.pending.set(key, { promise });
    return promise;
  }

  keep(key, image) {
    this.kept.set(key, image);
    this.bytes += image.bytes;
    for (const [old, { bytes }] of this.kept) {
      if (this.bytes <= CACHE_BYTES || this.kept.size <= 6) break;
      this.kept.delete(old);
      this.bytes -= bytes;
    }
    return image;
  }
}

/** Values of a pixel: numbers, one a plane. */
const valuesAt = (image, i) => image.planes.map((plane) => (image.whole ? plane[i] - 1 : image.float ? plane[i] : HALF[plane[i]]));

/** Mean over R, G, B of |S(a) - S(b)| at a pixel; S is clipped sRGB. */
function errorAt(a, b, i) {
  let sum = 0;
  for (let c = 0; c < 3; c++) sum += Math.abs(DISPLAY[a.planes[c][i]] - DISPLAY[b.planes[c][i]]);
  return sum / 3;
}

// Drawing: each fills `out`, a Uint32Array of 0xAABBGGRR, one a pixel.

const OPAQUE = 0xff000000, NOT_FINITE = 0xffff00ff;

function paintRadiance(out, image, exposure) {
  const gain = 2 ** exposure;
  const level = new Uint8Array(65536);
  for (let u = 0; u < 65536; u++) level[u] = Math.round(255 * srgb(HALF[u] * gain));
  paintLevels(out, image, level);
}

function paintLevels(out, image, level) {
  const [red, green, blue] = image.planes.length === 3 ? image.planes : Array(3).fill(image.planes[0]);
  for (let i = 0; i < out.length; i++) {
    const r = red[i], g = green[i], b = blue[i];
    const bad = (r & 0x7c00) === 0x7c00 || (g & 0x7c00) === 0x7c00 || (b & 0x7c00) === 0x7c00;
    out[i] = bad ? NOT_FINITE : OPAQUE | (level[b] << 16) | (level[g] << 8) | level[r];
  }
}

/** Values between low and high as grey levels or colours. */
function paintRange(out, image, low, high) {
  const level = Uint8Array.from(HALF, (x) => Math.max(0, Math.min(255, (255 * (x - low)) / (high - low))));
  paintLevels(out, image, level);
}

const COLOURS = Object.fromEntries(Object.entries(DATA.maps).map(([name, text]) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return [name, Uint32Array.from({ length: 256 }, (_, i) =>
    OPAQUE | (bytes[3 * i + 2] << 16) | (bytes[3 * i + 1] << 8) | bytes[3 * i])];
}));

/** The error on the contact sheets' scale: a square root, up to DATA.errorMax at exposure 0. */
function paintError(out, image, reference, exposure) {
  const gain = 2 ** exposure / DATA.errorMax;
  for (let i = 0; i < out.length; i++) {
    const x = Math.min(1, errorAt(image, reference, i) * gain);
    out[i] = COLOURS.inferno[Math.round(255 * Math.sqrt(x))];
  }
}

function paintFlip(out, image, exposure) {
  const gain = 255 * 2 ** exposure;
  const [plane] = image.planes;
  for (let i = 0; i < out.length; i++) out[i] = COLOURS.magma[Math.min(255, Math.round(plane[i] * gain))];
}

/** A colour for each object, by the golden ratio around the wheel; nothing there is dark. */
function paintObjects(out, image) {
  const [plane] = image.planes;
  const table = Uint32Array.from({ length: DATA.objects.length + 1 }, (_, n) => {
    if (n === 0) return 0xff201c1a;
    const wave = (shift) => Math.round(140 + 90 * Math.cos(2 * Math.PI * (n * 0.618034 + shift)));
    return OPAQUE | (wave(0.67) << 16) | (wave(0.33) << 8) | wave(0);
  });
  for (let i = 0; i < out.length; i++) out[i] = table[plane[i]];
}
