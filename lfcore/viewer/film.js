// A film: its instants, of which one is shown, and what plays them.

const PULL = 0.2;             // the share of the way to a clicked focus that is gone from picture to picture
const HELD_BYTES = 512 << 20;  // of decoded instants: what a page may take on a small machine

/**
 * @typedef {object} Shown
 * @property {Restored} first
 * @property {Restored | null} second
 * @property {Uint8Array | null} map
 * @property {Uint8Array | null} beside
 * @property {Instant} own
 */

class Film {
  /** @param {Viewer} viewer @param {NonNullable<Field["film"]>} film */
  constructor(viewer, film) {
    this.viewer = viewer;
    this.fps = film.fps;
    const {depth, specular, map, beside} = viewer.field;
    this.instants = [{depth: /** @type {Depth} */ (depth), specular, map, beside}, ...film.instants];
    /** @type {Map<number, Promise<Shown>>} */ this.held = new Map();
    const {columns, rows, width, height} = viewer.field;
    // Colours and depths of all views, with four bytes per pixel.
    const bytes = this.instants.some((one) => one.specular) ? 16 : 8;
    this.most = Math.max(2, Math.floor(HELD_BYTES / (bytes * columns.length * rows.length * width * height)));
    this.playing = false;
    this.runs = 0;            // how often it was played or stopped
    this.at = 0;              // what is shown
    /** @type {number | null} */ this.target = null;  // the focus that is pulled to
  }

  /** @param {number} k @returns {Promise<Shown>} */
  restored(k) {
    const {held, instants} = this, own = instants[k], found = held.get(k);
    if (found) return found;
    const {field} = this.viewer, made = (async () => ({
      first: await restored(field, own.depth), second: own.specular && await restored(field, own.specular), own,
      map: await mapOf(own.map), beside: await mapOf(own.beside),
    }))();
    held.set(k, made);
    made.catch(() => { if (held.get(k) === made) held.delete(k); });
    // The film begins again at its end: what is due last goes.
    const due = (/** @type {number} */ one) => (one - k + instants.length) % instants.length;
    while (held.size > this.most) held.delete([...held.keys()].reduce((a, b) => (due(a) > due(b) ? a : b)));
    return made;
  }

  /** Show an instant. @param {number} k */
  async show(k) {
    if (k === this.at) return;
    const {first, second, map, beside, own} = await this.restored(k), {viewer} = this;
    if (viewer.state.k !== k) return;  // another one was chosen meanwhile
    this.at = k;
    Object.assign(viewer.field, own);
    Object.assign(viewer, {pages: first.colours, second, map, beside});
    if (viewer.drawing) viewer.drawing.swap(first, second, own.depth, map);
  }

  /** Play, or stop. */
  async play() {
    this.playing = !this.playing;
    element("play").textContent = this.playing ? "Stop" : "Play";
    const {viewer} = this, run = ++this.runs, from = viewer.state.k, begun = performance.now();
    while (this.playing && run === this.runs) {
      const due = Math.floor((performance.now() - begun) / 1000 * this.fps) + from;
      const k = due % this.instants.length;
      await this.restored(k);
      if (run !== this.runs) return;
      const {d} = viewer.state;
      viewer.set({k, ...(this.target === null ? {} : {d: d + PULL * (this.target - d)})});
      await new Promise((next) => setTimeout(next, 1000 / this.fps));
    }
    if (run === this.runs) viewer.show();
  }
}
