// Views of a file with depth are stored as differences from their neighbours. This undoes lfcore/viewer/neighbours.py,
// in the same whole numbers.

/** @typedef {HTMLImageElement | HTMLCanvasElement} Page */
/** @typedef {{width: number, height: number}} Sides */
/** @typedef {{colours: Page[], depths: Page[]}} Restored  A part of the light of all views, and their depths' codes. */

const PARTS = 32;             // of a pixel, between which colours are interpolated

/** A canvas that is read. @param {number} width @param {number} height */
function sheet(width, height) {
  const canvas = Object.assign(document.createElement("canvas"), {width, height});
  const context = canvas.getContext("2d", {willReadFrequently: true});
  return /** @type {CanvasRenderingContext2D} */ (context);
}

/**
 * The reader of an atlas's cells.
 * @param {Page[]} pages @param {{across: number, down: number}} atlas @param {Sides} sides
 */
function cellsOf(pages, {across, down}, {width, height}) {
  const context = sheet(width, height);
  return (/** @type {number} */ k) => {
    const cell = k % (across * down), page = pages[Math.floor(k / (across * down))];
    context.drawImage(page, -(cell % across) * width, -Math.floor(cell / across) * height);
    return context.getImageData(0, 0, width, height);
  };
}

/** @param {ImageData} picture */
function greys({data}) { return Uint8Array.from({length: data.length / 4}, (_, k) => data[4 * k]); }

/**
 * From a pixel of view `one` to its surface's place in the other, by its code: along x and y, in parts of a pixel.
 * @param {Field} field @param {Depth} depth @param {number} one @param {number} other @param {number} parts
 */
function apart({columns, rows}, {codes, displaced, low, step}, one, other, parts) {
  const wide = columns.length, row = (/** @type {number} */ k) => rows[Math.floor(k / wide)];
  return [columns[one % wide] - columns[other % wide], row(one) - row(other)].map((place, axis) => {
    const own = displaced[one][axis] - displaced[other][axis];
    return Int32Array.from({length: codes}, (_, code) => Math.floor((place * (low + step * code) + own) * parts + 0.5));
  });
}

/**
 * Add to differences the depth of a neighbour, moved; a gap is as left of it.
 * @param {Uint8Array} to @param {Uint8Array} from @param {Int32Array[]} move @param {number} codes @param {Sides} sides
 */
function addDepth(to, from, [right, below], codes, {width, height}) {
  const moved = new Int16Array(width * height).fill(-1);
  for (let y = 0, k = 0; y < height; y++) for (let x = 0; x < width; x++, k++) {
    const code = from[k], column = x + right[code], row = y + below[code], at = row * width + column;
    if (column >= 0 && row >= 0 && column < width && row < height && moved[at] < code) moved[at] = code;
  }
  for (let k = 0, last = 0; k < moved.length; k++) {
    if (k % width === 0) last = 0;
    if (moved[k] >= 0) last = moved[k];
    to[k] = (to[k] + last) % codes;
  }
}

/**
 * Add to differences the colours of a neighbour at the moved places.
 * @param {Uint8ClampedArray} to @param {Uint8ClampedArray} from @param {Uint8Array} codes @param {Int32Array[]} move
 * @param {number} gain @param {Sides} sides
 */
function addColours(to, from, codes, [right, below], gain, {width, height}) {
  const inside = (/** @type {number} */ place, /** @type {number} */ side) => Math.min(Math.max(place, 0), side - 1);
  for (let y = 0, k = 0; y < height; y++) for (let x = 0; x < width; x++, k++) {
    const across = right[codes[k]], down = below[codes[k]], a = across & (PARTS - 1), b = down & (PARTS - 1);
    const column = x + Math.floor(across / PARTS), row = y + Math.floor(down / PARTS);
    const x0 = inside(column, width), x1 = inside(column + 1, width);
    const y0 = inside(row, height) * width, y1 = inside(row + 1, height) * width;
    for (let c = 0; c < 3; c++) {
      const above = from[4 * (y0 + x0) + c] * (PARTS - a) + from[4 * (y0 + x1) + c] * a;
      const under = from[4 * (y1 + x0) + c] * (PARTS - a) + from[4 * (y1 + x1) + c] * a;
      const value = Math.floor((above * (PARTS - b) + under * b) / PARTS ** 2 + 0.5) + gain * (to[4 * k + c] - 128);
      to[4 * k + c] = gain === 1 ? value & 255 : value;
    }
  }
}

/**
 * The pages of an atlas of views and of one of their depths.
 * @param {Field} field @param {Depth} depth @returns {Promise<Restored>}
 */
async function restored(field, depth) {
  const {width, height, atlas: {across, down}} = field;
  const most = across * down, count = Math.ceil(field.columns.length * field.rows.length / most);
  const [colours, depths] = [0, 1].map(() => Array.from({length: count}, () => sheet(across * width, down * height)));
  const put = (/** @type {CanvasRenderingContext2D[]} */ pages, /** @type {number} */ k, /** @type {ImageData} */ one) =>
    pages[Math.floor(k / most)].putImageData(one, k % across * width, Math.floor(k % most / across) * height);
  /** @type {Uint8Array[]} */ const codes = [];
  /** @type {Uint8ClampedArray[]} */ const shown = [];
  const cell = cellsOf(await loaded(depth.pages), field.atlas, field), spread = Math.floor(255 / Math.max(depth.codes - 1, 1));
  for (const level of depth.levels) {
    const picture = cellsOf(await loaded(level.pages), level, field);
    for (const [number, [view, other]] of level.views.entries()) {
      const far = cell(view), near = picture(number), own = greys(far).map((code) => Math.round(code / spread));
      if (view !== other) {
        addDepth(own, codes[other], apart(field, depth, other, view, 1), depth.codes, field);
        addColours(near.data, shown[other], own, apart(field, depth, view, other, PARTS), depth.gain, field);
      }
      own.forEach((code, k) => { far.data[4 * k] = code; });
      [codes[view], shown[view]] = [own, near.data];
      put(depths, view, far);
      put(colours, view, near);
    }
  }
  return {colours: colours.map((page) => page.canvas), depths: depths.map((page) => page.canvas)};
}
