// The viewer: a reference and pictures held against it. What is drawn follows from `state` alone.
class Viewer {
  constructor(root) {
    this.root = root;
    this.find = (name) => root.querySelector(`[data-${name}]`);
    this.config = JSON.parse(root.querySelector("script[type='application/json']").textContent);
    [this.width, this.height] = this.config.size;
    this.canvas = this.find("stage");
    this.context = this.canvas.getContext("2d");
    this.state = { mode: "side", test: 1, map: 0, exposure: 0, tonemap: "none", wipe: 0.5, front: 1, cx: this.width / 2,
      cy: this.height / 2, scale: 0, pointer: null };
    this.shown = new Map();
    this.pointers = new Map();
  }

  async load() {
    const { config } = this, n = this.width * this.height;
    const blocks = [...this.root.querySelectorAll("script[type='text/plain']")];
    const bytes = await Promise.all(blocks.map((b) => inflate(b.textContent.trim())));
    blocks.forEach((b) => b.remove());
    this.pictures = config.pictures.map((p, i) => {
      const values = unpack(bytes[i], p.format, n);
      for (const [at, rgb] of p.exceptions) rgb.forEach((v, c) => (values[3 * at + c] = v === "inf" ? Infinity : v === "-inf" ? -Infinity : Number(v)));
      return values;
    });
    this.embedded = config.maps.map((m, i) => ({ ...m, bytes: bytes[config.pictures.length + i] }));
    let light = 0;
    const reference = this.pictures[0];
    for (let k = 0; k < reference.length; k += 3) {
      const l = 0.2126 * reference[k] + 0.7152 * reference[k + 1] + 0.0722 * reference[k + 2];
      if (Number.isFinite(l)) light += l;
    }
    this.epsilon = Math.max(0.01 * (light / n) ** 2, 1e-30);
    this.fill();
    this.listen();
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
    this.resize();
    this.histogram();
    this.root.dataset.ready = "true";
  }

  // Choices that follow from what there is.
  fill() {
    const option = (text, value, title = "") => Object.assign(document.createElement("option"), { textContent: text, value, title });
    const tests = this.config.pictures.slice(1);
    this.find("test").append(...tests.map((p, i) => option(p.name, i + 1)));
    this.find("test").parentElement.hidden = tests.length < 2;
    this.fillMaps();
    const flights = this.config.regions.map((region, i) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: region.label });
      button.dataset.region = i;
      button.addEventListener("click", () => this.fly(region));
      const item = document.createElement("li");
      item.append(button);
      return item;
    });
    this.find("regions").append(...flights);
    this.find("regions").parentElement.hidden = flights.length === 0;
  }

  // Maps of the chosen test: those that follow from the values, then those that the page holds.
  fillMaps() {
    const own = this.embedded.filter((m) => m.test === this.state.test);
    this.maps = [...ERRORS, ...own];
    const select = this.find("map");
    select.replaceChildren(...this.maps.map((m, i) => Object.assign(document.createElement("option"), { textContent: m.metric, value: i, title: m.help })));
    this.state.map = Math.min(this.state.map, this.maps.length - 1);
    select.value = this.state.map;
    select.title = this.maps[this.state.map].help;
  }

  // A second map for a place that would be empty: FLIP, or another that the page holds, or the first; none that is chosen already.
  companion() {
    const other = (test) => this.maps.findIndex((m, i) => i !== this.state.map && test(m));
    return [(m) => /FLIP/.test(m.metric), (m) => m.bytes, () => true].map(other).find((i) => i >= 0);
  }

  // Values of a map, the chosen one if none is said, its range and canvas; kept while it is seen.
  map(index = this.state.map) {
    const of = (i) => `map ${this.state.test} ${i}`, key = of(index);
    if (!this.shown.has(key)) {
      const seen = [this.state.map, this.companion()].map(of);
      for (const k of this.shown.keys()) if (typeof k === "string" && !seen.includes(k)) this.shown.delete(k);
      const { test } = this.state, m = this.maps[index];
      const values = m.bytes ? Float32Array.from(m.bytes, (b) => (b / 255) * m.high) : errorValues(m, this.pictures[0], this.pictures[test], this.epsilon);
      const high = m.bytes ? m.high : mostly(values);
      const scale = this.scale ??= Uint8Array.from(atob(this.config.scale), (c) => c.charCodeAt(0));
      const color = m.signed
        ? (i, out, o) => diverging(values[i] / high, out, o)
        : (i, out, o) => {
            const at = 3 * Math.min(255, Math.max(0, Math.round((255 * values[i]) / high)));
            out[o] = scale[at]; out[o + 1] = scale[at + 1]; out[o + 2] = scale[at + 2];
          };
      this.shown.set(key, { values, high, m, stride: 1, canvas: paint(this.width, this.height, 1, color) });
    }
    return this.shown.get(key);
  }

  // A picture's canvas under the chosen look: coarse while a slider moves and pictures are large, then in full.
  picture(index) {
    const { exposure, tonemap } = this.state, look = { exposure, tonemap, encoded: this.config.encoded };
    const stride = this.hasty ? Math.max(1, Math.ceil(Math.sqrt((this.width * this.height) / 4e5))) : 1;
    const kept = this.shown.get(index);
    if (!kept || kept.exposure !== exposure || kept.tonemap !== tonemap || kept.stride > stride) {
      this.shown.set(index, { ...look, stride, canvas: shade(this.pictures[index], this.config.size, look, stride) });
    }
    return this.shown.get(index);
  }

  resize() {
    const stage = this.canvas.parentElement;
    stage.style.setProperty("--ideal", `${Math.round((stage.clientWidth * this.height) / this.width)}px`);
    // Of the canvas, not of the stage, whose border would stretch it by two pixels.
    const box = this.canvas.getBoundingClientRect(), dpr = window.devicePixelRatio || 1;
    const fitted = this.state.scale === 0 || Math.abs(this.state.scale - (this.fitted ?? 0)) < 1e-9;
    this.box = [box.width, box.height];
    this.canvas.width = Math.max(1, Math.round(box.width * dpr));
    this.canvas.height = Math.max(1, Math.round(box.height * dpr));
    if (fitted) this.fit();
    this.draw();
  }

  // Where pictures stand on the stage: x, y, width, height in CSS pixels.
  panels() {
    const [w, h] = this.box, { mode, test, front } = this.state;
    const whole = { x: 0, y: 0, w, h };
    if (mode === "wipe") return [{ ...whole, shows: ["picture", 0], behind: ["picture", test] }];
    if (mode === "flip") return [{ ...whole, shows: ["picture", front === 0 ? 0 : test] }];
    if (mode === "map") return [{ ...whole, shows: ["map"] }];
    const list = [["picture", 0], ["picture", test], ["map"]], gap = 2, n = list.length;
    // As many columns as make pictures largest.
    const sized = [1, 2, 3].map((columns) => {
      const rows = Math.ceil(n / columns), pw = (w - gap * (columns - 1)) / columns, ph = (h - gap * (rows - 1)) / rows;
      return { columns, pw, ph, scale: Math.min(pw / this.width, ph / this.height) };
    });
    const { columns, pw, ph } = sized.reduce((a, b) => (b.scale > a.scale * 1.001 ? b : a));
    if (columns === 2) list.push(["map", this.companion()]);
    return list.map((shows, i) => ({ x: (i % columns) * (pw + gap), y: Math.floor(i / columns) * (ph + gap), w: pw, h: ph, shows }));
  }

  fit() {
    const p = this.panels()[0];
    this.fitted = Math.min(p.w / this.width, p.h / this.height);
    Object.assign(this.state, { scale: this.fitted, cx: this.width / 2, cy: this.height / 2 });
  }

  draw() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      this.drawNow();
    });
  }

  drawNow() {
    const c = this.context, dpr = this.canvas.width / this.box[0];
    c.setTransform(dpr, 0, 0, dpr, 0, 0);
    c.clearRect(0, 0, ...this.box);
    for (const panel of this.panels()) {
      this.drawPart(panel, panel.shows, [panel.x, panel.x + panel.w]);
      if (panel.behind) {
        const at = panel.x + panel.w * this.state.wipe;
        this.drawPart(panel, panel.behind, [at, panel.x + panel.w]);
        c.fillStyle = "#fff";
        c.fillRect(at - 1, panel.y, 2, panel.h);
        c.strokeStyle = "#000a";
        c.strokeRect(at - 1.5, panel.y - 1, 3, panel.h + 2);
      }
      this.drawLabels(panel);
    }
    this.readout();
    const map = this.panels().find((p) => p.shows[0] === "map");
    this.find("legend").hidden = !map;
    if (map) this.legend(map);
  }

  // The part of a panel between two columns of the stage.
  drawPart(panel, [kind, index], [from, to]) {
    const c = this.context, { scale, cx, cy } = this.state;
    const { canvas, stride } = kind === "map" ? this.map(index) : this.picture(index);
    c.save();
    c.beginPath();
    c.rect(from, panel.y, to - from, panel.h);
    c.clip();
    c.imageSmoothingEnabled = scale < 1 || stride > 1;
    c.imageSmoothingQuality = "high";
    const left = panel.x + panel.w / 2 - cx * scale, top = panel.y + panel.h / 2 - cy * scale;
    // Only what is seen: a whole picture at a high magnification would be a canvas of gigabytes to some browsers.
    const x0 = Math.max(0, Math.floor((panel.x - left) / scale / stride)), y0 = Math.max(0, Math.floor((panel.y - top) / scale / stride));
    const x1 = Math.min(canvas.width, Math.ceil((panel.x + panel.w - left) / scale / stride));
    const y1 = Math.min(canvas.height, Math.ceil((panel.y + panel.h - top) / scale / stride));
    const step = scale * stride;
    if (x1 > x0 && y1 > y0) {
      c.drawImage(canvas, x0, y0, x1 - x0, y1 - y0, left + x0 * step, top + y0 * step, (x1 - x0) * step, (y1 - y0) * step);
      if (scale >= 12 && stride === 1) this.drawGrid([left, top], [x0, y0, x1, y1], scale, kind === "map" ? this.map(index).values : this.pictures[index]);
    }
    c.restore();
  }

  // Lines between pixels, and where there is room, their values.
  drawGrid([left, top], [x0, y0, x1, y1], scale, values) {
    const c = this.context;
    c.strokeStyle = "#8886";
    c.lineWidth = 0.5;
    c.beginPath();
    for (let x = x0; x <= x1; x++) { c.moveTo(left + x * scale, top + y0 * scale); c.lineTo(left + x * scale, top + y1 * scale); }
    for (let y = y0; y <= y1; y++) { c.moveTo(left + x0 * scale, top + y * scale); c.lineTo(left + x1 * scale, top + y * scale); }
    c.stroke();
    if (scale < 56) return;
    const colors = values.length > this.width * this.height;
    c.font = "11px ui-monospace, monospace";
    c.textAlign = "center";
    c.lineWidth = 3;
    c.strokeStyle = "#000c";
    for (let y = y0; y < y1; y++) {
      for (let x = x0; x < x1; x++) {
        const at = y * this.width + x, mx = left + (x + 0.5) * scale, my = top + (y + 0.5) * scale;
        const texts = colors ? [0, 1, 2].map((k) => short(values[3 * at + k])) : [short(values[at])];
        texts.forEach((text, k) => {
          const ty = my + 4 + (k - (texts.length - 1) / 2) * 14;
          c.strokeText(text, mx, ty);
          c.fillStyle = colors ? ["#ff9c92", "#9df09d", "#9cc4ff"][k] : "#fff";
          c.fillText(text, mx, ty);
        });
      }
    }
  }

  name([kind, index]) {
    if (kind !== "map") return this.config.pictures[index].name;
    // The legend is of the chosen one alone.
    return index === undefined ? this.maps[this.state.map].metric : `${this.maps[index].metric}, to ${short(this.map(index).high)}`;
  }

  drawLabels(panel) {
    const c = this.context;
    c.font = "600 12px system-ui, sans-serif";
    const tag = (text, x, align) => {
      const room = panel.w / (panel.behind ? 2 : 1) - 24;
      while (text.length > 4 && c.measureText(text).width > room) text = "…" + text.slice(2);
      const w = c.measureText(text).width;
      c.fillStyle = "#000a";
      c.fillRect(align === "left" ? x : x - w - 12, panel.y + 6, w + 12, 20);
      c.fillStyle = "#fff";
      c.textAlign = align;
      c.fillText(text, align === "left" ? x + 6 : x - 6, panel.y + 20);
    };
    tag(this.name(panel.shows), panel.x + 6, "left");
    if (panel.behind) tag(this.name(panel.behind), panel.x + panel.w - 6, "right");
  }

  // The panel under a place of the stage, and the pixel there.
  at(x, y) {
    const panel = this.panels().find((p) => x >= p.x && x < p.x + p.w && y >= p.y && y < p.y + p.h);
    if (!panel) return null;
    const { cx, cy, scale } = this.state;
    const px = cx + (x - panel.x - panel.w / 2) / scale, py = cy + (y - panel.y - panel.h / 2) / scale;
    return { panel, px, py, inside: px >= 0 && py >= 0 && px < this.width && py < this.height };
  }

  readout() {
    const { pointer, test } = this.state, here = pointer && this.at(...pointer), cells = this.find("readout");
    const shows = here && here.inside;
    const at = shows ? Math.floor(here.py) * this.width + Math.floor(here.px) : 0;
    const rgb = (i) => [0, 1, 2].map((c) => this.pictures[i][3 * at + c]);
    const line = (name, values) => [name, ...values];
    const rows = shows
      ? [line(this.config.pictures[0].name, rgb(0).map((v) => short(v))), line(this.config.pictures[test].name, rgb(test).map((v) => short(v))),
         line("difference", rgb(test).map((v, c) => short(v - rgb(0)[c], true)))]
      : [line(this.config.pictures[0].name, ["", "", ""]), line(this.config.pictures[test].name, ["", "", ""]), line("difference", ["", "", ""])];
    const place = shows ? `${Math.floor(here.px) + this.config.origin[0]}, ${Math.floor(here.py) + this.config.origin[1]}` : "–";
    const map = this.panels().some((p) => p.shows[0] === "map");
    const index = (here && here.panel.shows[0] === "map" && here.panel.shows[1]) || this.state.map;
    const value = shows && map ? short(this.map(index).values[at]) : "";
    const text = (tag, content, cls = "") => Object.assign(document.createElement(tag), { textContent: content, className: cls });
    cells.replaceChildren(
      ...rows.flatMap((row) => [text("span", row[0], "name"), text("span", row[1], "r"), text("span", row[2], "g"), text("span", row[3], "b")]),
      text("span", `pixel ${place}`, "name"), text("span", value && `${this.maps[index].metric} ${value}`, "map"),
      text("span", `${Math.round(100 * this.state.scale)} %`, "zoom"));
  }

  // In the corner of the chosen map.
  legend(panel) {
    const { m, high } = this.map(), legend = this.find("legend"), bar = legend.querySelector("canvas"), c = bar.getContext("2d");
    legend.style.right = `${this.box[0] - panel.x - panel.w + 8}px`;
    legend.style.maxWidth = `${panel.w - 16}px`;
    legend.style.bottom = `${this.box[1] - panel.y - panel.h + 8}px`;
    const image = c.createImageData(256, 1);
    for (let i = 0; i < 256; i++) {
      if (m.signed) diverging(i / 127.5 - 1, image.data, 4 * i);
      else image.data.set(this.scale.subarray(3 * i, 3 * i + 3), 4 * i);
      image.data[4 * i + 3] = 255;
    }
    c.putImageData(image, 0, 0);
    const [low, top] = legend.querySelectorAll("span");
    low.textContent = m.signed ? short(-high) : "0";
    top.textContent = short(high);
    legend.title = m.help;
  }

  zoom(factor, x, y) {
    const s = this.state, here = this.at(x, y), next = Math.min(256, Math.max(Math.min(this.fitted, 1) / 4, s.scale * factor));
    if (!here) return;
    const keep = 1 - s.scale / next;
    s.cx += (here.px - s.cx) * keep;
    s.cy += (here.py - s.cy) * keep;
    s.scale = next;
    this.draw();
  }

  middle() {
    const p = this.panels()[0];
    return [p.x + p.w / 2, p.y + p.h / 2];
  }

  pan(dx, dy) {
    const s = this.state;
    s.cx = Math.min(this.width, Math.max(0, s.cx - dx / s.scale));
    s.cy = Math.min(this.height, Math.max(0, s.cy - dy / s.scale));
    this.draw();
  }

  // Smoothly, unless the reader wants nothing to move.
  fly({ rect: [x, y, w, h], test }) {
    this.set({ test });
    const s = this.state, p = this.panels()[0], from = { ...s };
    const to = { cx: x + w / 2, cy: y + h / 2, scale: Math.min(64, 0.6 * Math.min(p.w / w, p.h / h)) };
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches, begin = performance.now();
    const step = (now) => {
      const t = still ? 1 : Math.min(1, Math.max(0, (now - begin) / 350)), e = t * t * (3 - 2 * t);
      s.scale = from.scale * (to.scale / from.scale) ** e;
      s.cx = from.cx + (to.cx - from.cx) * e;
      s.cy = from.cy + (to.cy - from.cy) * e;
      this.drawNow();
      if (t < 1) requestAnimationFrame(step);
    };
    step(still ? begin + 350 : begin);
  }
}

// Five digits that count, with a sign where one is wanted.
function short(v, signed = false) {
  if (!Number.isFinite(v)) return String(v).replace("Infinity", "inf");
  const size = Math.abs(v), text = v === 0 ? "0" : size < 1e-3 || size >= 1e5 ? v.toExponential(3) : String(Number(v.toPrecision(5)));
  return signed && v > 0 ? `+${text}` : text;
}
