// A film: its instants, of which one is shown, and what plays them.

const PULL = 0.2;             // the share of the way to a clicked focus that is gone from picture to picture

/** @typedef {{colours: Page[], depths: Page[], map: Uint8Array | null, own: Instant}} Shown */

class Film {
  /** @param {Viewer} viewer @param {NonNullable<Field["film"]>} film */
  constructor(viewer, film) {
    this.viewer = viewer;
    this.fps = film.fps;
    this.instants = [{depth: /** @type {Depth} */ (viewer.field.depth), map: viewer.field.map}, ...film.instants];
    /** @type {Map<number, Promise<Shown>>} */ this.held = new Map();
    this.playing = false;
    this.at = 0;              // what is shown
    /** @type {number | null} */ this.target = null;  // the focus that is pulled to
  }

  /** @param {number} k @returns {Promise<Shown>} */
  restored(k) {
    const own = this.instants[k], found = this.held.get(k) || (async () => ({
      ...await restored(this.viewer.field, own.depth), own, map: await mapOf(own.map),
    }))();
    this.held.set(k, found);
    return found;
  }

  /** Show an instant. @param {number} k */
  async show(k) {
    if (k === this.at) return;
    const {colours, depths, map, own} = await this.restored(k), {viewer} = this;
    if (viewer.state.k !== k) return;  // another one was chosen meanwhile
    this.at = k;
    Object.assign(viewer.field, own);
    Object.assign(viewer, {pages: colours, map});
    if (viewer.drawing) viewer.drawing.swap(colours, depths, own.depth, map);
  }

  /** Play, or stop. */
  async play() {
    this.playing = !this.playing;
    element("play").textContent = this.playing ? "Stop" : "Play";
    const {viewer} = this, from = viewer.state.k, begun = performance.now();
    while (this.playing) {
      const due = Math.floor((performance.now() - begun) / 1000 * this.fps) + from;
      const k = due % this.instants.length, {d} = viewer.state;
      await this.restored(k);
      viewer.set({k, ...(this.target === null ? {} : {d: d + PULL * (this.target - d)})});
      await new Promise((next) => setTimeout(next, 1000 / this.fps));
    }
    viewer.show();
  }
}
