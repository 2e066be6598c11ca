// What the page holds: values of pictures and maps, and what a display shows of them.

// From base64 of a zlib stream to its bytes.
async function inflate(text) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// A 16-bit float: sign, five bits of exponent, ten of fraction.
function half(bits) {
  const exponent = (bits >> 10) & 31, fraction = bits & 1023, sign = bits & 32768 ? -1 : 1;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

// Three floats a pixel, from planes of bytes that are alike.
function unpack(bytes, format, n) {
  const out = new Float32Array(3 * n);
  const plane = (k) => bytes.subarray(k * n, (k + 1) * n);
  if (format === "u8") {
    for (let c = 0; c < 3; c++) {
      const p = plane(c);
      for (let i = 0; i < n; i++) out[3 * i + c] = p[i] / 255;
    }
  } else if (format === "f16") {
    const table = Float32Array.from({ length: 65536 }, (_, bits) => half(bits));
    for (let c = 0; c < 3; c++) {
      const low = plane(2 * c), high = plane(2 * c + 1);
      for (let i = 0; i < n; i++) out[3 * i + c] = table[low[i] | (high[i] << 8)];
    }
  } else if (format === "rgb9e5") {
    const [a, b, c, d] = [0, 1, 2, 3].map(plane);
    const steps = Float32Array.from({ length: 32 }, (_, e) => 2 ** (e - 24));
    for (let i = 0; i < n; i++) {
      const step = steps[d[i] >> 3];
      out[3 * i] = (a[i] | ((b[i] & 1) << 8)) * step;
      out[3 * i + 1] = ((b[i] >> 1) | ((c[i] & 3) << 7)) * step;
      out[3 * i + 2] = ((c[i] >> 2) | ((d[i] & 7) << 6)) * step;
    }
  } else {
    const raw = new Uint8Array(out.buffer);
    for (let k = 0; k < 12; k++) {
      const p = plane(k);
      for (let i = 0; i < n; i++) raw[12 * i + k] = p[i];
    }
  }
  return out;
}

const toLinear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const toDisplay = (v) => (v <= 0.0031308 ? v * 12.92 : 1.055 * v ** (1 / 2.4) - 0.055);
// By the square root, of which the curve is nearly a line: within 0.02 of a step of 255.
const DISPLAY = Uint8Array.from({ length: 16385 }, (_, i) => Math.round(255 * toDisplay((i / 16384) ** 2)));
const byteOf = (v) => (v >= 1 ? 255 : v > 0 ? DISPLAY[(Math.sqrt(v) * 16384 + 0.5) | 0] : 0);

// Tone operators on three floats at `o` of `p`, in place; the same as those of the program's PNG files, where their sources
// are named (`skylit list tonemap`).
const TONEMAPS = {
  none() {},
  reinhard(p) {
    const l = 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2], k = (1 + l / 64) / (1 + l);
    for (let c = 0; c < 3; c++) p[c] *= k;
  },
  "aces-fit"(p) {
    transform([0.59719, 0.35458, 0.04823, 0.076, 0.90834, 0.01566, 0.0284, 0.13383, 0.83777], p);
    for (let c = 0; c < 3; c++) {
      const v = Math.min(p[c], 1e6);
      p[c] = Math.max(0, (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081));
    }
    transform([1.60475, -0.53108, -0.07367, -0.10208, 1.10813, -0.00605, -0.00327, -0.07276, 1.07602], p);
  },
  agx(p) {
    transform([0.84247905, 0.0784336, 0.079223745, 0.042328242, 0.87846864, 0.07916613, 0.042375655, 0.0784336, 0.879143], p);
    for (let c = 0; c < 3; c++) {
      const x = Math.min(1, Math.max(0, (Math.log2(Math.max(p[c], 1e-37)) + 12.47393) / 16.499999));
      const q = ((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191;
      p[c] = Math.max(0, q * x - 0.00232);
    }
    transform([1.196879, -0.09802088, -0.09902974, -0.05289685, 1.1519031, -0.09896118, -0.052971635, -0.09804345, 1.1510737], p);
    for (let c = 0; c < 3; c++) p[c] = toLinear(Math.min(1, Math.max(0, p[c])));
  },
};

function transform(m, p) {
  const [r, g, b] = p;
  for (let c = 0; c < 3; c++) p[c] = m[3 * c] * r + m[3 * c + 1] * g + m[3 * c + 2] * b;
}

// A canvas of every `stride`th pixel of a picture, as a display shows it.
function shade(picture, [w, h], look, stride) {
  const tone = TONEMAPS[look.tonemap], scale = 2 ** look.exposure, plain = look.tonemap === "none";
  const asStored = look.encoded && plain && look.exposure === 0;
  return paint(w, h, stride, (i, out, o) => {
    let r = picture[3 * i], g = picture[3 * i + 1], b = picture[3 * i + 2];
    if (!(Number.isFinite(r) && Number.isFinite(g) && Number.isFinite(b))) {
      // No number has a colour that no picture has.
      out[o] = 255; out[o + 1] = 0; out[o + 2] = 255;
      return;
    }
    if (asStored) {
      // The canvas rounds by itself.
      out[o] = 255 * r; out[o + 1] = 255 * g; out[o + 2] = 255 * b;
      return;
    }
    if (look.encoded) [r, g, b] = [toLinear(r), toLinear(g), toLinear(b)];
    r = Math.max(0, r * scale); g = Math.max(0, g * scale); b = Math.max(0, b * scale);
    if (!plain) {
      const p = [r, g, b];
      tone(p);
      [r, g, b] = p;
    }
    out[o] = byteOf(r); out[o + 1] = byteOf(g); out[o + 2] = byteOf(b);
  });
}

function paint(w, h, stride, color) {
  const canvas = document.createElement("canvas");
  canvas.width = Math.ceil(w / stride);
  canvas.height = Math.ceil(h / stride);
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, canvas.height);
  const out = image.data;
  let o = 0;
  for (let y = 0; y < h; y += stride) {
    for (let x = 0; x < w; x += stride, o += 4) {
      color(y * w + x, out, o);
      out[o + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

// Blue over grey to red, for signed errors: the ends and the middle of Moreland 2009, "Diverging Color Maps for Scientific
// Visualization", joined by straight lines.
const DIVERGING = [[59, 76, 192], [221, 221, 221], [180, 4, 38]];
function diverging(t, out, o) {
  const s = Math.min(1, Math.abs(t)), end = DIVERGING[t < 0 ? 0 : 2], middle = DIVERGING[1];
  for (let c = 0; c < 3; c++) out[o + c] = middle[c] + s * (end[c] - middle[c]);
}

// Errors that follow from the values, one number a pixel: `of(r, t)` of a channel, put together by `join`.
const mean3 = (a, b, c) => (a + b + c) / 3;
const ERRORS = [
  { metric: "signed", help: "test minus reference, mean of the channels: red is too bright, blue too dark", signed: true,
    of: (r, t) => t - r, join: mean3 },
  { metric: "absolute", help: "largest |test - reference| of the channels", of: (r, t) => Math.abs(t - r), join: Math.max },
  { metric: "relative", help: "root of the mean relative squared error: (test - reference)^2 / (reference^2 + epsilon)",
    of: (r, t, e) => ((t - r) * (t - r)) / (r * r + e), join: (a, b, c) => Math.sqrt(mean3(a, b, c)) },
];

function errorValues(error, reference, test, epsilon) {
  const n = reference.length / 3, out = new Float32Array(n), { of, join } = error;
  for (let i = 0, k = 0; i < n; i++, k += 3) {
    const v = join(of(reference[k], test[k], epsilon), of(reference[k + 1], test[k + 1], epsilon),
      of(reference[k + 2], test[k + 2], epsilon));
    out[i] = Number.isFinite(v) ? v : 0;
  }
  return out;
}

// What most values stay below: a few outliers shall not make everything else black.
function mostly(values) {
  const step = Math.max(1, Math.floor(values.length / 200000));
  const some = Float32Array.from({ length: Math.floor(values.length / step) }, (_, i) => Math.abs(values[i * step]));
  some.sort();
  return some[Math.floor(0.995 * (some.length - 1))] || some[some.length - 1] || 1;
}
