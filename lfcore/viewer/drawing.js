// Draws by WebGL2: views are shifted and added in linear light (equation 6.1 of the thesis), as
// in lfcore.refocus.shift_sum. Textures are sRGB, so that reads give linear light, or of a file with light above
// white PQ, whose brightest code is PEAK; else PEAK is 0.

const VERTEX = `#version 300 es
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

const DECODE = `
// SMPTE ST 2084.
vec3 decoded(vec3 code) {
  if (PEAK == 0.0) return code;
  vec3 power = pow(code, vec3(32.0 / 2523.0));
  vec3 share = max(power - 0.8359375, 0.0) / (18.8515625 - 18.6875 * power);
  return PEAK * pow(share, vec3(8192.0 / 1305.0));
}
`;

const COMMON = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2DArray;
uniform sampler2DArray pages, more;  // what mirrors, glass and coats add
uniform int two;              // whether there is more
uniform sampler2D lens;       // of each view that adds up: its number, its place (s, t), its weight
uniform vec2 size, cells, pageSize;
uniform float step_;          // pixels of a view for one of the canvas
uniform float top;            // of the canvas, in its own pixels from below
uniform float gain;
uniform bool nearest;
out vec4 colour;
${DECODE}
vec3 texel(ivec2 at, float page) {
  ivec3 place = ivec3(at, int(page));
  vec3 own = decoded(texelFetch(pages, place, 0).rgb);
  return two > 0 ? own + decoded(texelFetch(more, place, 0).rgb) : own;
}

// Light at pixel p of a view, and in w the share of the pixel that the view covers.
vec4 light(float number, vec2 p) {
  if (nearest) p = ceil(p - 0.5 - 1e-4);
  vec2 held = clamp(min(p + 1.0, size - p), 0.0, 1.0);
  float cover = held.x * held.y;
  if (cover <= 0.0) return vec4(0.0);
  float page = floor((number + 0.5) / (cells.x * cells.y));
  float cell = number - page * cells.x * cells.y;
  float row = floor((cell + 0.5) / cells.x);
  vec2 corner = vec2(cell - row * cells.x, row) * size;
  p = corner + clamp(p, vec2(0.0), size - 1.0);
  if (PEAK > 0.0) {
    ivec2 a = ivec2(p), b = min(a + 1, ivec2(corner + size) - 1);
    vec2 share = fract(p);
    vec3 above = mix(texel(a, page), texel(ivec2(b.x, a.y), page), share.x);
    vec3 below = mix(texel(ivec2(a.x, b.y), page), texel(b, page), share.x);
    return vec4(mix(above, below, share.y) * cover, cover);
  }
  vec2 at = (p + 0.5) / pageSize;
  vec3 own = textureLod(pages, vec3(at, page), 0.0).rgb;
  if (two > 0) own += textureLod(more, vec3(at, page), 0.0).rgb;
  return vec4(own * cover, cover);
}

vec3 shown(vec3 linear) {
  vec3 c = clamp(linear * gain, 0.0, 1.0);
  return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, vec3(lessThanEqual(c, vec3(0.0031308))));
}

vec2 pixel() {
  return vec2(gl_FragCoord.x, top - gl_FragCoord.y) * step_ - 0.5;
}
`;

const PICTURE = `${COMMON}
uniform int count;
uniform float disparity;
uniform vec2 tilt;
void main() {
  vec2 x = pixel();
  float d = disparity + dot(tilt, (x - 0.5 * (size - 1.0)) / size);
  vec4 sum = vec4(0.0);
  for (int k = 0; k < count; k++) {
    vec4 entry = texelFetch(lens, ivec2(k & 63, k >> 6), 0);
    sum += entry.w * light(entry.x, x - entry.yz * d);
  }
  colour = vec4(shown(sum.w > 0.0 ? sum.rgb / sum.w : vec3(0.0)), 1.0);
}`;

const SLICE = `${COMMON}
uniform int count;
uniform float disparity;
uniform vec2 at;              // where the slice is taken, pixels
uniform vec2 origin;          // of the strip, pixels of the canvas from its upper left corner
uniform float band;           // pixels of the canvas for one view
uniform bool upright;
void main() {
  vec2 x = vec2(gl_FragCoord.x, top - gl_FragCoord.y) - origin;
  int k = clamp(int((upright ? x.x : x.y) / band), 0, count - 1);
  vec4 entry = texelFetch(lens, ivec2(k & 63, k >> 6), 0);
  vec2 p = x * step_ - 0.5;
  p = upright ? vec2(at.x, p.y) : vec2(p.x, at.y);
  vec4 found = light(entry.x, p - entry.yz * disparity);
  colour = vec4(shown(found.w > 0.0 ? found.rgb / found.w : vec3(0.0)), 1.0);
}`;

const MAP = `${COMMON}
uniform sampler2D map;
void main() {
  float near = textureLod(map, (pixel() + 0.5) / size, 0.0).r;
  colour = vec4(vec3(near), 1.0);
}`;

const STRIP = 72;             // pixels across an epipolar slice

/** Raised where the browser cannot draw; the text says why. */
class CannotDraw extends Error {}

class Drawing {
  /**
   * @param {HTMLCanvasElement} canvas @param {Field} field @param {Page[]} pages @param {Page[]} depths
   * @param {Uint8Array | null} map @param {Restored | null} second
   */
  constructor(canvas, field, pages, depths, map, second) {
    const gl = canvas.getContext("webgl2", {alpha: false, antialias: false, preserveDrawingBuffer: true});
    if (!gl) throw new CannotDraw("This browser has no WebGL2");
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (Math.max(pages[0].width, pages[0].height) > most) {
      throw new CannotDraw(`This browser's textures have at most ${most} pixels per side`);
    }
    /** @type {WebGL2RenderingContext} */ this.gl = gl;
    this.canvas = canvas;
    this.field = field;
    /** Pixels of a page. @type {[number, number]} */
    this.page = [pages[0].width, pages[0].height];
    this.programs = {picture: this.program(PICTURE), slice: this.program(SLICE), map: this.program(MAP)};
    this.upload(pages, gl.TEXTURE0, field.peak ? gl.RGBA8 : gl.SRGB8_ALPHA8, gl.RGBA);
    this.lens = this.texture(gl.TEXTURE1, gl.TEXTURE_2D, gl.NEAREST);
    this.texture(gl.TEXTURE2, gl.TEXTURE_2D, gl.LINEAR);
    this.fillMap(map);
    this.held = this.texture(gl.TEXTURE5, gl.TEXTURE_2D, gl.NEAREST);
    this.frame = gl.createFramebuffer();
    this.top = 0;             // height of what is drawn to
    this.splatting = field.depth && new Splatting(this, field.depth, depths);
    this.hasSecond = false;   // whether there is memory for the second part of light
    this.fillSecond(second);
    gl.bindVertexArray(gl.createVertexArray());
    if (gl.getError()) throw new CannotDraw("The graphics memory does not hold these views");
  }

  /** @param {string} source @param {string} vertex */
  program(source, vertex = VERTEX) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of /** @type {[number, string][]} */ (
      [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, source]])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, text.replace("\n", `\n#define PEAK ${this.field.peak.toExponential()}\n`));
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const logs = (gl.getAttachedShaders(program) || []).map((one) => gl.getShaderInfoLog(one));
      throw new CannotDraw(`The shader does not compile: ${logs.join(" ").trim()}`);
    }
    return program;
  }

  /** @param {number} unit @param {number} target @param {number} filter */
  texture(unit, target, filter) {
    const gl = this.gl, texture = gl.createTexture();
    gl.activeTexture(unit);
    gl.bindTexture(target, texture);
    for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, key, filter);
    for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(target, key, gl.CLAMP_TO_EDGE);
    return texture;
  }

  /** @param {Page[]} pages @param {number} unit @param {number} held @param {number} format */
  upload(pages, unit, held, format) {
    const gl = this.gl, target = gl.TEXTURE_2D_ARRAY;
    this.texture(unit, target, gl.LINEAR);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.texStorage3D(target, 1, held, ...this.page, pages.length);
    this.fill(pages, unit, format);
  }

  /** @param {Page[]} pages @param {number} unit @param {number} format */
  fill(pages, unit, format) {
    const {gl} = this;
    gl.activeTexture(unit);
    pages.forEach((page, layer) => gl.texSubImage3D(
      gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, ...this.page, 1, format, gl.UNSIGNED_BYTE, page));
  }

  /** @param {Uint8Array | null} map */
  fillMap(map) {
    const {gl, field} = this;
    if (!field.map || !map) return;
    gl.activeTexture(gl.TEXTURE2);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, field.map.width, field.map.height, 0, gl.RED, gl.UNSIGNED_BYTE, map);
  }

  /** Hold the second part of light, if there is one. @param {Restored | null} second */
  fillSecond(second) {
    const {gl, field} = this;
    if (!second) return;
    const held = field.peak ? gl.RGBA8 : gl.SRGB8_ALPHA8;
    if (this.hasSecond) {
      this.fill(second.colours, gl.TEXTURE6, gl.RGBA);
      this.fill(second.depths, gl.TEXTURE7, gl.RED);
    } else {
      this.upload(second.colours, gl.TEXTURE6, held, gl.RGBA);
      this.upload(second.depths, gl.TEXTURE7, gl.R8, gl.RED);
      this.hasSecond = true;
    }
  }

  /**
   * Draw another instant.
   * @param {Restored} first @param {Restored | null} second @param {Depth} depth @param {Uint8Array | null} map
   */
  swap({colours, depths}, second, depth, map) {
    const {gl} = this;
    this.fill(colours, gl.TEXTURE0, gl.RGBA);
    this.fill(depths, gl.TEXTURE3, gl.RED);
    this.fillSecond(second);
    this.fillMap(map);
    if (this.splatting) this.splatting.depth = depth;
  }

  /** Hand lists of four numbers to the shaders, 64 in a row. @param {number[][]} entries */
  table(entries) {
    const gl = this.gl, rows = Math.ceil(entries.length / 64);
    const table = new Float32Array(rows * 64 * 4);
    entries.forEach((entry, k) => table.set(entry, 4 * k));
    gl.activeTexture(gl.TEXTURE1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 64, rows, 0, gl.RGBA, gl.FLOAT, table);
  }

  /**
   * Make a program current and give it what all share.
   * @param {WebGLProgram} program @param {Entry[]} entries @param {State} state @param {number} divisor
   */
  use(program, entries, state, divisor) {
    const {gl, field} = this;
    this.table(entries.map((entry) => [entry.view, entry.s, entry.t, entry.weight]));
    gl.useProgram(program);
    this.setAll(program, {
      size: [field.width, field.height], cells: [field.atlas.across, field.atlas.down],
      pageSize: this.page, step_: divisor * field.width / pictureSize(field)[0], top: this.top, gain: gain(field, state),
      disparity: state.d * field.scale, tilt: [state.tx * field.scale, state.ty * field.scale],
    }, {
      pages: 0, lens: 1, map: 2, count: entries.length, nearest: Number(state.filter === "nearest"),
      two: Number(field.specular !== null), more: field.specular ? 6 : 0,
    });
  }

  /**
   * @param {WebGLProgram} program @param {Record<string, number | number[]>} values
   * @param {Record<string, number>} whole
   */
  setAll(program, values, whole) {
    const {gl} = this;
    for (const [key, value] of Object.entries(values)) this.set(program, key, value);
    for (const [key, value] of Object.entries(whole)) gl.uniform1i(gl.getUniformLocation(program, key), value);
  }

  /** @param {WebGLProgram} program @param {string} key @param {number | number[]} value */
  set(program, key, value) {
    const place = this.gl.getUniformLocation(program, key);
    if (typeof value === "number") this.gl.uniform1f(place, value);
    else this.gl.uniform2f(place, value[0], value[1]);
  }

  /**
   * Draw a picture, some samples at a time; yields their number. The canvas changes at the end, all at once.
   * @param {State} state @param {Entry[] | Cell[]} parts @param {number} divisor
   * @param {number} most  Samples at a time.
   */
  *paint(state, parts, divisor, most) {
    const [width, height] = pictureSize(this.field).map((side) => Math.ceil(side / divisor));
    const splatting = state.depth ? null : this.splatting;
    if (splatting) yield* splatting.add(state, /** @type {Cell[]} */ (parts), divisor, most);
    else yield* this.bands(state, /** @type {Entry[]} */ (parts), divisor, width, height, most);
    const {gl, canvas} = this, beside = state.epi ? STRIP : 0;
    Object.assign(canvas, {width: width + beside, height: height + beside});
    this.top = canvas.height;
    if (splatting) splatting.compose(state);
    else {
      gl.disable(gl.SCISSOR_TEST);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.frame);
      gl.blitFramebuffer(0, 0, width, height, 0, beside, width, beside + height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
    }
    if (state.epi) this.slices(state, divisor);
  }

  /**
   * Draw a picture in bands beside the canvas.
   * @param {State} state @param {Entry[]} entries @param {number} divisor @param {number} width
   * @param {number} height @param {number} most
   */
  *bands(state, entries, divisor, width, height, most) {
    const {gl} = this, rows = Math.max(1, Math.floor(most / (width * entries.length)));
    gl.activeTexture(gl.TEXTURE5);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    for (let row = 0; row < height; row += rows) {
      const high = Math.min(rows, height - row);
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.held, 0);
      this.top = height;
      this.use(state.depth ? this.programs.map : this.programs.picture, entries, state, divisor);
      this.rectangle(0, row, width, high, width);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      yield width * high * entries.length;
    }
  }

  /** Draw the two epipolar slices: below, and on the right. @param {State} state @param {number} divisor */
  slices(state, divisor) {
    const {field, canvas} = this;
    const wide = canvas.width - STRIP, high = canvas.height - STRIP;
    const i = nearestTo(field.columns, state.x), j = nearestTo(field.rows, state.y);
    const columns = field.columns.length;
    const below = field.columns.map((s, k) => ({view: j * columns + k, s, t: field.rows[j], weight: 1}));
    const beside = field.rows.map((t, k) => ({view: k * columns + i, s: field.columns[i], t, weight: 1}));
    const at = [state.u * field.width - 0.5, state.v * field.height - 0.5];
    for (const upright of [false, true]) {
      const entries = upright ? beside : below, program = this.programs.slice;
      this.use(program, entries, state, divisor);
      this.set(program, "at", at);
      this.set(program, "origin", upright ? [wide, 0] : [0, high]);
      this.set(program, "band", STRIP / entries.length);
      this.gl.uniform1i(this.gl.getUniformLocation(program, "upright"), Number(upright));
      if (upright) this.rectangle(wide, 0, STRIP, high);
      else this.rectangle(0, high, wide, STRIP);
    }
  }

  /**
   * @param {number} x @param {number} y @param {number} width @param {number} height
   * @param {number} whole  Width of what is drawn to.
   */
  rectangle(x, y, width, height, whole = this.canvas.width) {
    const {gl, top} = this;
    gl.viewport(0, 0, whole, top);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, top - y - height, width, height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Wait until all is drawn. */
  finish() {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
}

/** Width and height of a picture, pixels. @param {Field} field @returns {[number, number]} */
function pictureSize(field) {
  return field.depth ? field.depth.size : [field.width, field.height];
}

/** The factor of light that is shown. @param {Field} field @param {State} state */
function gain(field, state) { return field.white * 2 ** state.ev; }

/** Pixels of a view from one sample to the next. @param {Field} field @param {number} divisor */
function stride(field, divisor) {
  // Views of a file with depth are finer than its pictures: a coarse picture needs one ray per pixel.
  return divisor === 1 ? 1 : divisor * Math.max(1, Math.floor(field.width / pictureSize(field)[0]));
}

/** @param {number[]} places @param {number} at */
function nearestTo(places, at) {
  return places.reduce((best, place, k) => Math.abs(place - at) < Math.abs(places[best] - at) ? k : best, 0);
}
