// The page: mouse, touch, keys and link change a state, and the state gives a picture.

const BUDGET_MS = 70;         // of a picture while something moves
const SETTLE_MS = 150;        // from the last movement to the whole picture

/** @param {string} id */
const element = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
/** @param {string} id */
const input = (id) => /** @type {HTMLInputElement} */ (document.getElementById(id));

/** The pictures of an atlas. @param {string[]} pages */
function loaded(pages) {
  return Promise.all(pages.map(async (source) => {
    const page = new Image();
    page.src = source;
    try {
      await page.decode();
    } catch {
      const kind = source.slice("data:image/".length, source.indexOf(";")).toUpperCase();
      throw new Error(`this browser reads no ${kind} pictures. Make the page with --format jpeg, `
        + "or use another browser");
    }
    return page;
  }));
}

/** The light of codes, sRGB or PQ (SMPTE ST 2084). @param {Field} field */
function lights(field) {
  return Array.from({length: 256}, (_, code) => {
    const value = code / 255, power = value ** (32 / 2523);
    if (!field.peak) return value > 0.04045 ? ((value + 0.055) / 1.055) ** 2.4 : value / 12.92;
    return field.peak * (Math.max(power - 0.8359375, 0) / (18.8515625 - 18.6875 * power)) ** (8192 / 1305);
  });
}

/** The sRGB code of light. @param {number} light */
function codeOf(light) {
  return 255 * (light > 0.0031308 ? 1.055 * Math.min(light, 1) ** (1 / 2.4) - 0.055 : 12.92 * light);
}

const AGAIN = 0.03;           // of the picture's sides: a click so near is at the same place

/** The disparities of a map, in codes. @param {Field["map"]} map */
async function mapOf(map) {
  return map && greys(cellsOf(await loaded([map.page]), {across: 1, down: 1}, map)(0));
}

class Viewer {
  /** @param {Field} field */
  constructor(field) {
    this.field = field;
    this.canvas = /** @type {HTMLCanvasElement} */ (element("canvas"));
    this.state = fromHash(field, location.hash);
    /** @type {Drawing | null} */ this.drawing = null;
    /** @type {Page[]} */ this.pages = [];
    /** What mirrors, glass and coats add to the pages. @type {Restored | null} */ this.second = null;
    /** @type {Uint8Array | null} */ this.map = null;
    /** @type {Uint8Array | null} */ this.beside = null;
    /** The last click that a second one may follow. @type {{u: number, v: number} | null} */ this.clicked = null;
    this.film = field.film && new Film(this, field.film);
    this.cost = 0;            // milliseconds of reading a million samples
    this.job = 0;             // the picture that is being drawn; a later one ends it
    this.timer = 0;
    this.whole = false;       // whether what is seen is the whole picture
  }

  async start() {
    const {field} = this;
    [this.map, this.beside] = [await mapOf(field.map), await mapOf(field.beside)];
    const {colours, depths} = field.depth ? await restored(field, field.depth)
      : {colours: await loaded(field.atlas.pages), depths: []};
    this.pages = colours;
    this.second = field.specular && await restored(field, field.specular);
    try {
      this.drawing = new Drawing(this.canvas, field, colours, depths, this.map, this.second);
      // The first picture may compile.
      for (let turn = 0; turn < 2; turn++) this.now(initial(field), this.parts(initial(field)).slice(0, 16), 4);
    } catch (error) {
      if (!(error instanceof CannotDraw)) throw error;
      this.drawing = null;
      // A canvas that has been drawn to by WebGL2 takes nothing else.
      const fresh = /** @type {HTMLCanvasElement} */ (this.canvas.cloneNode());
      this.canvas.replaceWith(fresh);
      this.canvas = fresh;
      this.say(`${error.message}: only single views are shown. Drag to look around; for more, use `
        + "lfcore refocus or another browser.");
    }
    this.canvas.addEventListener("webglcontextlost", () => {
      this.say("The graphics card was lost: reload this page.");
    });
    this.listen();
    this.show();
    this.settle();
    element("loading").hidden = true;
  }

  /** What adds up to the picture. @param {State} state @returns {Entry[] | Cell[]} */
  parts(state) {
    const {field} = this;
    return field.depth && !state.depth ? openCells(field, field.depth, state) : openViews(field, state);
  }

  /** Draw all of a picture. @param {State} state @param {Entry[] | Cell[]} parts @param {number} divisor */
  now(state, parts, divisor) {
    const drawing = /** @type {Drawing} */ (this.drawing), begun = performance.now();
    let samples = 0;
    for (const some of drawing.paint(state, parts, divisor, Infinity)) samples += some;
    drawing.finish();
    this.learn(performance.now() - begun, samples);
  }

  /** @param {number} ms @param {number} samples */
  learn(ms, samples) {
    const found = ms / (samples / 1e6);
    this.cost = this.cost && ms > 5 ? 0.5 * (this.cost + found) : found;
  }

  /** @param {Record<string, unknown>} given */
  set(given) {
    this.state = changed(this.field, this.state, given);
    this.show();
    this.quick();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.settle(), SETTLE_MS);
  }

  /** Draw within the budget of time: coarser and from fewer views if necessary. */
  quick() {
    const job = ++this.job;
    this.whole = false;
    requestAnimationFrame(async () => {
      if (this.film) await this.film.show(this.state.k);
      if (job !== this.job) return;
      if (!this.drawing) { this.single(); return; }
      const {field, state} = this, all = this.parts(state), most = this.most();
      const byDepth = field.depth && !state.depth, least = byDepth ? all.length : Math.min(all.length, 24);
      const pixels = (/** @type {number} */ by) => field.width * field.height / stride(field, by) ** 2;
      let divisor = 1;
      while (divisor < (byDepth ? 8 : 4) && pixels(divisor) * least > most) divisor++;
      const keep = Math.max(1, Math.ceil(all.length * pixels(divisor) / most));
      const some = state.single || byDepth ? all
        : /** @type {Entry[]} */ (all).filter((_, k) => k % keep === 0);
      this.now(state, some, divisor);
    });
  }

  /** The samples that the budget of time allows for. */
  most() { return 1e6 * BUDGET_MS / Math.max(this.cost, 1e-6); }

  /** Draw the whole picture in parts, which leave time for input; resolves when it is drawn. */
  async settle() {
    const job = ++this.job, {drawing, state} = this;
    if (this.film) await this.film.show(state.k);
    if (job !== this.job) return;
    if (!drawing) { this.single(); this.whole = true; return; }
    for (const _ of drawing.paint(state, this.parts(state), 1, this.most())) {
      drawing.finish();
      await new Promise(requestAnimationFrame);
      if (job !== this.job) return;
    }
    drawing.finish();
    this.whole = true;
  }

  /** Without WebGL2: the view nearest to the viewpoint. */
  single() {
    const {field, state} = this, {across, down} = field.atlas;
    const context = this.canvas.getContext("2d");
    if (!context) return;
    Object.assign(this.canvas, {width: field.width, height: field.height});
    const view = nearestTo(field.rows, state.y) * field.columns.length + nearestTo(field.columns, state.x);
    const cell = view % (across * down);
    const drawn = (/** @type {Page[]} */ pages) => {
      context.drawImage(pages[Math.floor(view / (across * down))],
        cell % across * field.width, Math.floor(cell / across) * field.height, field.width, field.height,
        0, 0, field.width, field.height);
      return context.getImageData(0, 0, field.width, field.height);
    };
    const picture = drawn(this.pages), light = lights(field);
    if (!field.peak && !this.second) return;
    const added = this.second && drawn(this.second.colours).data;
    picture.data.forEach((code, k) => {
      if (k % 4 < 3) picture.data[k] = codeOf(light[code] + (added ? light[added[k]] : 0));
    });
    context.putImageData(picture, 0, 0);
  }

  /** @param {string} text */
  say(text) { element("status").textContent = text; }

  /** Show the state in controls, words and link. */
  show() {
    const {field, state} = this;
    for (const key of ["d", "a", "x", "y", "blades", "turn", "tx", "ty", "ev"]) {
      input(key).value = String(/** @type {any} */ (state)[key]);
    }
    for (const key of ["single", "depth", "epi"]) input(key).checked = /** @type {any} */ (state)[key];
    for (const key of ["shape", "filter"]) input(key).value = /** @type {any} */ (state)[key];
    element("polygon").hidden = state.shape !== "polygon";
    const metres = distance(field, state.d), stop = fNumber(field, state.a);
    element("d-text").textContent = (metres === null ? ""
      : `${metres === Infinity ? "infinity" : `${metres.toPrecision(3)} m`}, `) + `${state.d.toFixed(2)} px`;
    element("a-text").textContent = `${state.a.toFixed(1)} views`;
    element("f-text").textContent = stop === null ? "not known" : `f/${stop.toPrecision(3)}`;
    if (stop !== null) input("f").value = String(Math.log2(stop));
    for (const [key, views] of Object.entries({x: state.x, y: state.y})) {
      element(`${key}-text`).textContent = `${views.toFixed(1)} views`;
    }
    element("ev-text").textContent = `${state.ev.toFixed(1)} stops`;
    for (const key of ["d", "a", "f", "x", "y", "ev"]) {
      input(key).setAttribute("aria-valuetext", element(`${key}-text`).textContent || "");
    }
    element("command").textContent = command(field, state) || "no command makes this picture";
    if (this.film) {
      input("k").value = String(state.k);
      element("k-text").textContent = `${state.k} of ${this.film.instants.length}`;
      if (this.film.playing) return;  // browsers count changes of the address
    }
    try {
      history.replaceState(null, "", `#${toHash(field, state)}`);
    } catch { /* A page inside another one may have no address; nothing else depends on it. */ }
  }

  /**
   * The disparity at a place of the picture, a share of its size, by one of the maps.
   * @param {number} u @param {number} v @param {Field["map"]} map @param {Uint8Array | null} codes
   */
  disparityAt(u, v, map = this.field.map, codes = this.map) {
    if (!map || !codes) return null;
    const column = Math.min(Math.floor(u * map.width), map.width - 1);
    const row = Math.min(Math.floor(v * map.height), map.height - 1);
    return map.low + (map.high - map.low) * codes[row * map.width + column] / 255;
  }

  /**
   * Focus on a place of the picture, a share of its size; of a mirror on its image, and when clicked again on
   * the mirror.
   * @param {number} u @param {number} v
   */
  focus(u, v) {
    const {state, clicked} = this;
    const again = Boolean(this.beside && clicked && Math.hypot(u - clicked.u, v - clicked.v) < AGAIN);
    this.clicked = again ? null : {u, v};
    const found = again ? this.disparityAt(u, v, this.field.beside, this.beside) : this.disparityAt(u, v);
    if (found === null) this.say("There is no map of depth: focus with the slider.");
    // A tilted plane goes through the clicked point.
    const tilted = state.tx * (u - 0.5) + state.ty * (v - 0.5);
    const d = found === null ? null : found - tilted;
    if (this.film) this.film.target = d;
    this.set({u, v, ...(d === null || (this.film && this.film.playing) ? {} : {d})});
  }

  listen() {
    const {field} = this, bounds = limits(field);
    for (const key of ["d", "a", "x", "y", "tx", "ty", "ev"]) {
      [input(key).min, input(key).max] = bounds[key].map(String);
    }
    for (const key of ["d", "a", "x", "y", "blades", "turn", "tx", "ty", "ev", "shape", "filter"]) {
      input(key).addEventListener("input", () => this.set({[key]: input(key).value}));
    }
    for (const key of ["single", "depth", "epi"]) {
      input(key).addEventListener("change", () => this.set({[key]: input(key).checked}));
    }
    if (field.metric) {
      const {focal, pitch} = field.metric;
      [input("f").min, input("f").max] = [field.views, 0.5].map((a) => String(Math.log2(focal / (a * pitch))));
      input("f").addEventListener("input", () => this.set({a: focal / (2 ** Number(input("f").value) * pitch)}));
    } else input("f").disabled = true;
    if (this.film) {
      const film = this.film;
      element("film").hidden = false;
      input("k").max = String(film.instants.length - 1);
      input("k").addEventListener("input", () => this.set({k: input("k").value}));
      element("play").addEventListener("click", () => film.play());
      // The focus that a hand sets is pulled to no more.
      input("d").addEventListener("input", () => { film.target = null; });
    }
    input("depth").disabled = !field.map;
    /** @type {HTMLElement} */ (input("filter").parentElement).hidden = Boolean(field.depth);
    element("reset").addEventListener("click", () => this.set(initial(field)));
    addEventListener("hashchange", () => this.set(fromHash(field, location.hash)));
    this.pointers();
    this.keys();
  }

  pointers() {
    const {canvas, field} = this;
    /** @type {Map<number, {x: number, y: number}>} */ const held = new Map();
    let moved = 0, apart = 0, pinched = false;
    const spread = () => {
      const [a, b] = [...held.values()];
      return Math.hypot(a.x - b.x, a.y - b.y);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, {x: event.clientX, y: event.clientY});
      if (held.size === 1) { moved = 0; pinched = false; }
      if (held.size === 2) { apart = spread(); pinched = true; }
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = held.get(event.pointerId);
      if (!last) return;
      const dx = event.clientX - last.x, dy = event.clientY - last.y;
      held.set(event.pointerId, {x: event.clientX, y: event.clientY});
      moved += Math.hypot(dx, dy);
      if (held.size === 2) {
        const now = spread();
        if (apart > 0 && now > 0) this.set({a: this.state.a * now / apart});
        apart = now;
      } else if (held.size === 1 && moved > 4 && !pinched) {
        // Half the picture's width is the whole lens; objects follow the hand.
        const step = 2 * (field.views - 1) / canvas.clientWidth;
        this.set({x: this.state.x - dx * step, y: this.state.y - dy * step});
      }
    });
    const release = (/** @type {PointerEvent} */ event) => {
      if (!held.delete(event.pointerId) || held.size || moved > 4 || pinched) return;
      if (event.type !== "pointerup") return;
      const {left, top, width, height} = canvas.getBoundingClientRect();
      const beside = this.state.epi && this.drawing ? STRIP : 0;
      // In the picture only, not in the slices beside it.
      const u = (event.clientX - left) / width * canvas.width / (canvas.width - beside);
      const v = (event.clientY - top) / height * canvas.height / (canvas.height - beside);
      if (u >= 0 && v >= 0 && u < 1 && v < 1) this.focus(u, v);
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const [low, high] = field.range;
      this.set({d: this.state.d - Math.sign(event.deltaY) * (high - low) / 100});
    }, {passive: false});
  }

  keys() {
    const {field} = this, fine = (field.range[1] - field.range[0]) / 100;
    /** @type {Record<string, () => Record<string, unknown>>} */
    const keys = {
      ArrowLeft: () => ({x: this.state.x - 0.5}), ArrowRight: () => ({x: this.state.x + 0.5}),
      ArrowUp: () => ({y: this.state.y - 0.5}), ArrowDown: () => ({y: this.state.y + 0.5}),
      "+": () => ({d: this.state.d + fine}), "-": () => ({d: this.state.d - fine}),
      "]": () => ({a: this.state.a * 1.1}), "[": () => ({a: this.state.a / 1.1}),
      s: () => ({single: !this.state.single}), e: () => ({epi: !this.state.epi}),
      d: () => ({depth: field.map !== null && !this.state.depth}), r: () => ({...initial(field)}),
      " ": () => { if (this.film) this.film.play(); return {}; },
    };
    this.canvas.addEventListener("keydown", (event) => {
      const key = keys[event.key];
      if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      this.set(key());
    });
  }
}

{
  const text = element("field").textContent || "";
  const viewer = new Viewer(/** @type {Field} */ (JSON.parse(text)));
  Object.assign(globalThis, {lightFieldViewer: viewer});
  viewer.start().catch((error) => {
    element("loading").hidden = true;
    viewer.say(`The page cannot be shown: ${error.message}`);
  });
}
