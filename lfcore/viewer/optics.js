// The optics of the viewer's state: the views that add up, and their shifts. No browser here.
// Lengths on the lens are in views from its middle, in the picture in pixels of the file.

/**
 * @typedef {object} Field  The light field, as page.py writes it.
 * @property {string} name
 * @property {string} file
 * @property {number[]} columns  Positions of view columns, in views from the middle, ascending.
 * @property {number[]} rows
 * @property {number} views  Views per side of the whole lens in the file.
 * @property {number} width  Pixels of a view in the atlas.
 * @property {number} height
 * @property {number} scale  Pixels of the atlas per pixel of the file.
 * @property {Depth | null} depth  The depth of each ray, of a file that holds it.
 * @property {Depth | null} specular  Of what coats show beside their own light; code 0 is none.
 * @property {number} white  Linear light of the brightest code.
 * @property {number} peak  Linear light of the brightest code of PQ; 0 of sRGB.
 * @property {[number, number]} range  Range of the slider of disparities.
 * @property {{delta: number, step: number, focal: number, pitch: number} | null} metric
 * @property {{page: string, width: number, height: number, low: number, high: number} | null} map
 * @property {Field["map"]} beside  The depth of a surface where the map has that of what it shows, or the reverse.
 * @property {Atlas} atlas
 * @property {{fps: number, instants: Instant[]} | null} film  The instants after the first.
 */

/**
 * What changes from one instant of a film to another.
 * @typedef {{depth: Depth, specular: Depth | null, map: Field["map"], beside: Field["map"]}} Instant
 */

/**
 * Views side by side in pictures, row by row.
 * @typedef {object} Atlas
 * @property {string[]} pages
 * @property {number} across
 * @property {number} down
 */

/**
 * @typedef {object} Depth  Of each ray; lengths are in pixels of the atlas.
 * @property {string[]} pages  Codes, as differences between neighbours, in the atlas's cells.
 * @property {({views: [number, number][]} & Atlas)[]} levels  Views with their neighbours, and their differences.
 * @property {number} gain  Of differences between colours; 1 wraps around.
 * @property {number} low  Disparity of code 0.
 * @property {number} step  From code to code.
 * @property {number} codes  How many there are.
 * @property {[number, number]} ends  The farthest and the nearest disparity of the file's own codes.
 * @property {[number, number]} size  Width and height of a picture, pixels.
 * @property {[number, number][]} displaced  Of each view's pixels.
 */

/**
 * The part of the aperture that a view represents.
 * @typedef {object} Cell
 * @property {number} view
 * @property {number} s  Place of the view.
 * @property {number} t
 * @property {number} x  Middle of the open part of the cell.
 * @property {number} y
 * @property {number} wide  Sides of the box of equal spread.
 * @property {number} tall
 * @property {number} share  The open part over the whole cell.
 * @property {[number, number]} displaced
 */

/**
 * @typedef {object} State
 * @property {number} x  Viewpoint, views to the right of the middle.
 * @property {number} y  Viewpoint, views below the middle.
 * @property {number} d  Disparity in focus, pixels between neighbouring views.
 * @property {number} a  Diameter of the aperture, views.
 * @property {string} shape
 * @property {number} blades  Corners of a polygon.
 * @property {number} turn  Rotation of a polygon, degrees.
 * @property {number} tx  Change of the disparity in focus from the left edge to the right one.
 * @property {number} ty  The same from the upper edge to the lower one.
 * @property {string} filter
 * @property {number} ev  Exposure, stops.
 * @property {boolean} single
 * @property {boolean} depth
 * @property {boolean} epi
 * @property {number} u  Column of the epipolar slice, share of the width.
 * @property {number} v  Row of the epipolar slice, share of the height.
 * @property {number} k  The instant of a film.
 */

/** @typedef {{view: number, s: number, t: number, weight: number}} Entry */

const SHAPES = ["circle", "square", "diamond", "polygon"];
const FILTERS = ["bilinear", "nearest"];

/** As recorded: the whole lens, its middle, its focus. @param {Field} field @returns {State} */
function initial(field) {
  return {
    x: 0, y: 0, d: 0, a: field.views, shape: "circle", blades: 6, turn: 0, tx: 0, ty: 0,
    filter: "bilinear", ev: 0, single: false, depth: false, epi: false, u: 0.5, v: 0.5, k: 0,
  };
}

/** The least and greatest value of each number. @param {Field} field */
function limits(field) {
  const [low, high] = field.range, span = high - low;
  const ends = (/** @type {number[]} */ a) => [a[0], a[a.length - 1]];
  return /** @type {Record<string, number[]>} */ ({
    x: ends(field.columns), y: ends(field.rows), d: [low, high], a: [0.5, field.views],
    blades: [3, 1000], turn: [-360, 360], tx: [-span, span], ty: [-span, span],
    u: [0, 1], v: [0, 1], ev: [-16, 16], k: [0, field.film ? field.film.instants.length : 0],
  });
}

/** @param {number} value @param {number[]} ends */
function clamp(value, ends) {
  return Math.min(Math.max(value, ends[0]), ends[1]);
}

/**
 * The state with other values, each within its limits; what makes no sense is left as it was.
 * @param {Field} field @param {State} state @param {Record<string, unknown>} given
 * @returns {State}
 */
function changed(field, state, given) {
  const bounds = limits(field);
  const next = /** @type {Record<string, any>} */ ({...state});
  for (const [key, value] of Object.entries(given)) {
    if (key in bounds) {
      const number = Number(value);
      if (Number.isFinite(number)) next[key] = clamp(number, bounds[key]);
    } else if (key === "shape" ? SHAPES.includes(String(value))
        : key === "filter" && FILTERS.includes(String(value))) {
      next[key] = value;
    } else if (typeof next[key] === "boolean") {
      next[key] = value === true || value === "1";
    }
  }
  next.blades = Math.round(next.blades);
  next.k = Math.round(next.k);
  return /** @type {State} */ (next);
}

/** What differs from the state as recorded, as the end of a link. @param {Field} field @param {State} state */
function toHash(field, state) {
  const parts = new URLSearchParams(), start = initial(field);
  for (const [key, value] of Object.entries(state)) {
    if (value === /** @type {any} */ (start)[key]) continue;
    parts.set(key, typeof value === "number" ? String(+value.toPrecision(9))
      : typeof value === "boolean" ? (value ? "1" : "0") : value);
  }
  return parts.toString();
}

/** @param {Field} field @param {string} hash @returns {State} */
function fromHash(field, hash) {
  const given = Object.fromEntries(new URLSearchParams(hash.replace(/^#/, "")));
  return changed(field, initial(field), given);
}

/**
 * Whether (s, t), from the middle of the aperture, is within it: lfcore.optics.planes.Aperture.
 * @param {State} state @param {number} s @param {number} t
 */
function within(state, s, t) {
  const radius = state.a / 2, slack = 1e-9;
  if (state.shape === "square") return Math.max(Math.abs(s), Math.abs(t)) <= radius + slack;
  if (state.shape === "diamond") return Math.abs(s) + Math.abs(t) <= radius + slack;
  if (state.shape === "circle") return Math.hypot(s, t) <= radius + slack;
  const apothem = radius * Math.cos(Math.PI / state.blades);
  for (let blade = 0; blade < state.blades; blade++) {
    const angle = state.turn * Math.PI / 180 + (2 * blade + 1) * Math.PI / state.blades;
    if (s * Math.cos(angle) + t * Math.sin(angle) > apothem + slack) return false;
  }
  return true;
}

/**
 * The views that add up to the picture, at least one: those in the aperture about the viewpoint, or
 * of a single view its neighbours, by how near they are.
 * @param {Field} field @param {State} state @returns {Entry[]}
 */
function openViews(field, state) {
  /** @type {Entry[]} */ const found = [];
  const across = state.single ? shares(field.columns, state.x) : null;
  const down = state.single ? shares(field.rows, state.y) : null;
  let nearest = Infinity;
  /** @type {Entry[]} */ let closest = [];
  field.rows.forEach((t, j) => field.columns.forEach((s, i) => {
    const entry = {view: j * field.columns.length + i, s, t, weight: 1};
    if (across && down) {
      entry.weight = across[i] * down[j];
      if (entry.weight > 0) found.push(entry);
      return;
    }
    if (within(state, s - state.x, t - state.y)) found.push(entry);
    const distance = Math.hypot(s - state.x, t - state.y);
    if (distance < nearest - 1e-9) { nearest = distance; closest = []; }
    if (distance <= nearest + 1e-9) closest.push(entry);
  }));
  return found.length ? found : closest;
}

const CELL_POINTS = 32;       // along each axis of a cell, by which it is measured

/**
 * The cells that the aperture about the viewpoint leaves open: lfcore.optics.ray_cells. Of a single view, the
 * views around the viewpoint, by how near they are: lfcore.refocus.free_views.
 * @param {Field} field @param {Depth} depth @param {State} state @returns {Cell[]}
 */
function openCells(field, depth, state) {
  const {columns, rows, views} = field;
  /** @type {Cell[]} */ const found = [];
  rows.forEach((t, j) => columns.forEach((s, i) => {
    const view = j * columns.length + i, displaced = depth.displaced[view];
    const part = state.single
      ? {x: state.x, y: state.y, wide: 0, tall: 0, share: pointShare(field, state, s, t)}
      : openPart(state, views / columns.length, i * views / columns.length - views / 2,
        views / rows.length, j * views / rows.length - views / 2);
    if (part.share > 0) found.push({view, s, t, displaced, ...part});
  }));
  return found;
}

/** @param {Field} field @param {State} state @param {number} s @param {number} t */
function pointShare(field, state, s, t) {
  const across = Math.abs(s - state.x) * field.columns.length / field.views;
  const down = Math.abs(t - state.y) * field.rows.length / field.views;
  const within = (/** @type {number} */ reach) => Math.max(0, 1 - across / reach) * Math.max(0, 1 - down / reach);
  return within(2) + 1e-3 * within(4);
}

/**
 * The open part of the cell of one size from one corner.
 * @param {State} state @param {number} width @param {number} left @param {number} height @param {number} top
 */
function openPart(state, width, left, height, top) {
  const radius = state.a / 2, n = CELL_POINTS;
  const low = [Math.max(left, state.x - radius), Math.max(top, state.y - radius)];
  const dx = (Math.min(left + width, state.x + radius) - low[0]) / n;
  const dy = (Math.min(top + height, state.y + radius) - low[1]) / n;
  let count = 0, sx = 0, sy = 0, sxx = 0, syy = 0;
  if (dx > 0 && dy > 0) {
    for (let j = 0; j < n; j++) for (let i = 0; i < n; i++) {
      const x = low[0] + (i + 0.5) * dx, y = low[1] + (j + 0.5) * dy;
      if (!within(state, x - state.x, y - state.y)) continue;
      count++; sx += x; sy += y; sxx += x * x; syy += y * y;
    }
  }
  if (!count) return {x: 0, y: 0, wide: 0, tall: 0, share: 0};
  const x = sx / count, y = sy / count;
  return {
    x, y, share: count * dx * dy / (width * height),
    wide: Math.sqrt(12 * Math.max(0, sxx / count - x * x) + dx * dx),
    tall: Math.sqrt(12 * Math.max(0, syy / count - y * y) + dy * dy),
  };
}

/** Linear weights of ascending places about one of them. @param {number[]} places @param {number} at */
function shares(places, at) {
  const weights = places.map(() => 0);
  const right = places.findIndex((place) => place >= at);
  if (right <= 0) weights[right < 0 ? places.length - 1 : 0] = 1;
  else {
    const share = (at - places[right - 1]) / (places[right] - places[right - 1]);
    weights[right - 1] = 1 - share;
    weights[right] = share;
  }
  return weights;
}

/** Metres of a disparity; null where the file knows none. @param {Field} field @param {number} d */
function distance(field, d) {
  if (!field.metric) return null;
  const delta = field.metric.delta + d * field.metric.step;
  return delta > 1e-9 * field.metric.step ? 1 / delta : Infinity;
}

/** F-number of an aperture so many views across. @param {Field} field @param {number} a */
function fNumber(field, a) {
  return field.metric && field.metric.focal / (a * field.metric.pitch);
}

/** The command that makes the same picture, "" where none does. @param {Field} field @param {State} state */
function command(field, state) {
  const number = (/** @type {number} */ value) => String(+value.toPrecision(7));
  const file = /^[\w./-]+$/.test(field.file) ? field.file : `'${field.file}'`;
  const {metric} = field;
  const instant = field.film ? `--instant ${state.k} ` : "";
  const exposure = instant + (state.ev ? `--exposure ${number(state.ev)} ` : "");
  if (state.single && field.depth && metric && !state.depth) {
    const [x, y] = [state.x, state.y].map((views) => number(1e3 * views * metric.pitch));
    return `lfcore view ${file} --view ${x}mm ${y}mm ${exposure}-o picture.png`;
  }
  if (state.single || state.depth || state.x || state.y || state.tx || state.ty) return "";
  const words = ["lfcore refocus", file, `--focus ${number(state.d)}px`, `--f-number ${number(state.a)}views`];
  const corners = state.shape === "polygon" ? `:${state.blades}:${number(state.turn)}` : "";
  words.push(`--aperture ${state.shape}${corners}`);
  if (!field.depth) words.push(`--filter ${state.filter}`);
  return [...words, `${exposure}-o picture.png`].join(" ");
}
