// What the viewer listens to: buttons, keys, the pointer, fingers.
const MODES = ["side", "wipe", "flip", "map"];

// Changes of the state, with what follows from them on the toolbar.
Viewer.prototype.set = function (changes) {
  const s = this.state, before = { ...s };
  Object.assign(s, changes);
  s.test = Math.min(this.config.pictures.length - 1, Math.max(1, s.test));
  s.exposure = Math.min(16, Math.max(-16, s.exposure));
  if (s.test !== before.test) this.fillMaps();
  for (const button of this.root.querySelectorAll("[data-mode]")) {
    button.setAttribute("aria-pressed", String(button.dataset.mode === s.mode));
  }
  this.find("test").value = s.test;
  this.find("map").value = s.map;
  this.find("map").title = this.maps[s.map].help;
  this.find("tonemap").value = s.tonemap;
  this.find("exposure").value = s.exposure;
  this.find("stops").textContent = `${s.exposure > 0 ? "+" : ""}${Number(s.exposure.toFixed(2))} EV`;
  this.find("wipe").value = 100 * s.wipe;
  this.find("wipe").hidden = s.mode !== "wipe";
  const front = this.find("front");
  front.hidden = s.mode !== "flip";
  if (s.mode !== before.mode) this.fit();
  this.root.dataset.shows = s.mode;
  this.draw();
};

Viewer.prototype.listen = function () {
  const on = (name, event, act) => this.find(name).addEventListener(event, act);
  for (const button of this.root.querySelectorAll("[data-mode]")) {
    button.addEventListener("click", () => this.set({ mode: button.dataset.mode }));
  }
  on("test", "change", (e) => this.set({ test: Number(e.target.value) }));
  on("map", "change", (e) => this.set({ map: Number(e.target.value), mode: this.state.mode === "side" ? "side" : "map" }));
  on("tonemap", "change", (e) => this.set({ tonemap: e.target.value }));
  on("exposure", "input", (e) => this.expose(Number(e.target.value)));
  on("wipe", "input", (e) => this.set({ wipe: e.target.value / 100 }));
  on("front", "click", () => this.set({ front: 1 - this.state.front }));
  const tools = { in: () => this.zoom(2, ...this.middle()), out: () => this.zoom(0.5, ...this.middle()), fit: () => this.refit(),
    one: () => this.zoom(1 / this.state.scale, ...this.middle()), help: () => this.find("help").showModal() };
  for (const button of this.root.querySelectorAll("[data-tool]")) button.addEventListener("click", tools[button.dataset.tool]);
  this.listenToPointers();
  document.addEventListener("keydown", (e) => this.key(e));
  document.addEventListener("keyup", (e) => {
    if (e.key === "x" && this.held !== undefined) {
      this.set(this.held);
      this.held = undefined;
    }
  });
  this.set({});
};

Viewer.prototype.refit = function () {
  this.fit();
  this.draw();
};

// Coarse while the slider moves, in full once it rests.
Viewer.prototype.expose = function (exposure) {
  this.hasty = this.width * this.height > 4e5;
  clearTimeout(this.resting);
  this.resting = setTimeout(() => {
    this.hasty = false;
    this.draw();
  }, 150);
  this.set({ exposure });
};

Viewer.prototype.listenToPointers = function () {
  const stage = this.canvas, { pointers } = this;
  const place = (e) => {
    const box = stage.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };
  const divider = () => this.box[0] * this.state.wipe;
  stage.addEventListener("pointerdown", (e) => {
    if (e.button > 0) return;
    stage.setPointerCapture(e.pointerId);
    const at = place(e);
    const reach = e.pointerType === "touch" ? 24 : 8;
    this.wiping = this.state.mode === "wipe" && pointers.size === 0 && Math.abs(at[0] - divider()) < reach;
    pointers.set(e.pointerId, at);
    this.state.pointer = at;
    this.draw();
  });
  stage.addEventListener("pointermove", (e) => {
    const at = place(e), last = pointers.get(e.pointerId);
    this.state.pointer = at;
    if (last && this.wiping) this.set({ wipe: Math.min(1, Math.max(0, at[0] / this.box[0])) });
    else if (last && pointers.size === 1) this.pan(at[0] - last[0], at[1] - last[1]);
    else if (last && pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== e.pointerId)[1];
      const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
      this.pan((at[0] - last[0]) / 2, (at[1] - last[1]) / 2);
      this.zoom(Math.max(1, apart(at, other)) / Math.max(1, apart(last, other)), (at[0] + other[0]) / 2, (at[1] + other[1]) / 2);
    } else this.draw();
    if (last) pointers.set(e.pointerId, at);
    const near = this.state.mode === "wipe" && Math.abs(at[0] - divider()) < 8;
    stage.style.cursor = near || this.wiping ? "ew-resize" : last ? "grabbing" : "crosshair";
  });
  const up = (e) => {
    pointers.delete(e.pointerId);
    this.wiping = false;
  };
  stage.addEventListener("pointerup", up);
  stage.addEventListener("pointercancel", up);
  stage.addEventListener("pointerleave", () => {
    this.state.pointer = null;
    this.draw();
  });
  stage.addEventListener("wheel", (e) => {
    e.preventDefault();
    this.zoom(2 ** (-e.deltaY * (e.deltaMode ? 0.05 : 0.002)), ...place(e));
  }, { passive: false });
  stage.addEventListener("dblclick", (e) => {
    const near = Math.abs(this.state.scale - this.fitted) < 1e-6;
    if (near) this.zoom(Math.max(8, 8 * this.fitted) / this.state.scale, ...place(e));
    else this.refit();
  });
};

// Keys work wherever the page is, unless something else listens to them: the last viewer that was touched takes them.
Viewer.prototype.key = function (e) {
  const busy = e.target.matches("select, input:not([type='range']), textarea") || document.querySelector("dialog[open]");
  if (busy || e.ctrlKey || e.metaKey || e.altKey || Viewer.active !== this) return;
  const slides = e.target.matches("input[type='range']"), s = this.state, move = 60;
  const flip = () => this.set(s.mode === "flip" ? { front: 1 - s.front } : { mode: "flip" });
  const keys = {
    s: () => this.set({ mode: "side" }), w: () => this.set({ mode: "wipe" }), f: flip, " ": flip, d: () => this.set({ mode: "map" }),
    m: () => this.set({ map: (s.map + 1) % this.maps.length }), M: () => this.set({ map: (s.map + this.maps.length - 1) % this.maps.length }),
    e: () => this.set({ exposure: s.exposure + 0.5 }), E: () => this.set({ exposure: s.exposure - 0.5 }),
    t: () => this.set({ tonemap: Object.keys(TONEMAPS)[(Object.keys(TONEMAPS).indexOf(s.tonemap) + 1) % 4] }),
    r: () => this.set({ exposure: 0, tonemap: "none" }),
    "+": () => this.zoom(2, ...this.middle()), "=": () => this.zoom(2, ...this.middle()), "-": () => this.zoom(0.5, ...this.middle()),
    0: () => this.refit(), z: () => this.zoom(1 / s.scale, ...this.middle()), "?": () => this.find("help").showModal(),
    "[": () => this.set({ wipe: Math.max(0, s.wipe - 0.02) }), "]": () => this.set({ wipe: Math.min(1, s.wipe + 0.02) }),
    x: () => {
      if (this.held !== undefined) return;
      this.held = { mode: s.mode, front: s.front };
      this.set({ mode: "flip", front: s.mode === "flip" ? 1 - s.front : 0 });
    },
  };
  if (!slides) {
    Object.assign(keys, { ArrowLeft: () => this.pan(move, 0), ArrowRight: () => this.pan(-move, 0), ArrowUp: () => this.pan(0, move), ArrowDown: () => this.pan(0, -move) });
  }
  const isButton = e.target.matches("button, summary, a");
  const act = /^[1-9]$/.test(e.key) ? () => this.set({ test: Number(e.key) }) : keys[e.key];
  // A button under the keyboard's focus keeps its space bar, and the page its arrows, unless the viewer has the focus.
  if (!act || (isButton && e.key === " ") || (e.key.startsWith("Arrow") && !this.root.contains(e.target))) return;
  e.preventDefault();
  act();
};

// Pixels by luminance, in logarithmic bins and on a logarithmic axis: one line a picture.
Viewer.prototype.histogram = function () {
  const canvas = this.find("histogram"), box = canvas.getBoundingClientRect(), dpr = window.devicePixelRatio || 1;
  const [w, h] = [Math.max(200, box.width), 120];
  canvas.width = w * dpr;
  canvas.height = h * dpr;
  const c = canvas.getContext("2d");
  c.scale(dpr, dpr);
  const style = getComputedStyle(this.root), { encoded } = this.config;
  const [low, high] = encoded ? [0, 1] : [-12, 8], bins = 160, foot = 18;
  const x = (b) => 4 + ((w - 8) * b) / bins;
  const counts = this.pictures.map((p) => {
    const out = new Float64Array(bins);
    for (let k = 0; k < p.length; k += 3) {
      const l = 0.2126 * p[k] + 0.7152 * p[k + 1] + 0.0722 * p[k + 2], v = encoded ? l : Math.log2(l);
      if (v >= low && v < high + 1e-9) out[Math.min(bins - 1, Math.floor(((v - low) / (high - low)) * bins))]++;
    }
    return out;
  });
  const top = Math.log10(1 + Math.max(1, ...counts.flatMap((o) => Math.max(...o))));
  c.fillStyle = style.getPropertyValue("--soft");
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "center";
  const marks = encoded ? [0, 0.25, 0.5, 0.75, 1] : [-12, -8, -4, 0, 4, 8];
  for (const m of marks) {
    const at = x(((m - low) / (high - low)) * bins);
    c.fillText(encoded ? String(m) : m === 0 ? "1" : `2^${m}`, Math.min(w - 14, Math.max(14, at)), h - 4);
    c.fillRect(at, 0, 0.5, h - foot);
  }
  counts.forEach((o, i) => {
    c.strokeStyle = style.getPropertyValue(`--c${i % 8}`);
    c.lineWidth = 1.5;
    c.beginPath();
    o.forEach((n, b) => c.lineTo(x(b + 0.5), h - foot - ((h - foot - 4) * Math.log10(1 + n)) / top));
    c.stroke();
  });
  const key = (p, i) => {
    const item = document.createElement("li"), mark = Object.assign(document.createElement("i"), { className: `c${i % 8}` });
    item.append(mark, p.name);
    return item;
  };
  this.find("key").replaceChildren(...this.config.pictures.map(key));
};

for (const root of document.querySelectorAll("[data-viewer]")) {
  const viewer = new Viewer(root);
  root.viewer = viewer;
  Viewer.active ??= viewer;
  root.addEventListener("pointerdown", () => (Viewer.active = viewer));
  root.addEventListener("focusin", () => (Viewer.active = viewer));
  viewer.load().catch((e) => {
    root.dataset.ready = "failed";
    root.querySelector("[data-readout]").textContent = `These pictures cannot be shown: ${e.message}`;
    console.error(e);
  });
}
