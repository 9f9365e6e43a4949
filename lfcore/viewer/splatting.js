// Pictures of a file with depth: each ray is spread over the box that its part of the lens sweeps, in layers
// from the nearest to the farthest, and no layer takes more of a pixel than those before it have left. As
// lfcore/refocus/kernels/depth/, but in floating point, with fewer layers, and what a pixel lacks is given to
// the last layer. Of light in two parts, the second is added as lfcore/refocus/two_parts.py does.

const RAYS = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2DArray;
uniform sampler2DArray pages, depths, present;
uniform vec2 size, target, ends;   // pixels of a view and of the layers; disparities of depth's codes
uniform ivec2 cells;
uniform int view, stride, parts, sparse;
uniform float ratio, least, disparity, follow, share, margin, bounds[5];
uniform vec2 picture, tilt, lens, centre, side, displaced;
flat out vec4 box, light;
${DECODE}
void main() {
  int across = int(size.x) / stride;
  ivec2 p = ivec2(gl_VertexID % across, gl_VertexID / across) * stride + stride / 2;
  int cell = view % (cells.x * cells.y);
  ivec3 at = ivec3(ivec2(cell % cells.x, cell / cells.x) * ivec2(size) + p, view / (cells.x * cells.y));
  gl_Position = vec4(2.0, 2.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  if (sparse > 0 && texelFetch(present, at, 0).r == 0.0) return;
  float own = mix(ends.x, ends.y, texelFetch(depths, at, 0).r);
  vec2 x = vec2(p) + displaced - 0.5 * (size - 1.0) + (lens - centre) * own;
  // On a tilted plane the disparity in focus depends on where the ray falls.
  float focus = (disparity + dot(tilt, x)) / (1.0 - follow * dot(tilt, centre));
  float move = (focus - own) * ratio;
  x = (x + follow * centre * focus) * ratio + 0.5 * picture;
  vec2 reach = 0.5 * max(abs(move) * side, least);
  if (any(lessThanEqual(x + reach, vec2(0.0))) || any(greaterThanEqual(x - reach, picture))) return;
  int beyond = 0;
  for (int k = 0; k < parts; k++) beyond += int(abs(move) >= bounds[k]);
  int layer = move < 0.0 ? parts - beyond : parts + beyond;
  x += vec2(layer & 1, layer >> 1) * (picture + 2.0 * margin) + margin;
  box = vec4(x - reach, x + reach);
  vec2 low = floor(box.xy), wide = ceil(box.zw) - low;
  gl_PointSize = max(wide.x, wide.y);
  gl_Position = vec4((low + 0.5 * gl_PointSize) / target * 2.0 - 1.0, 0.0, 1.0);
  light = vec4(decoded(texelFetch(pages, at, 0).rgb), 1.0) * share / (4.0 * reach.x * reach.y);
}`;

const BOX = `#version 300 es
precision highp float;
flat in vec4 box, light;
out vec4 colour;
void main() {
  vec2 held = min(box.zw, gl_FragCoord.xy + 0.5) - max(box.xy, gl_FragCoord.xy - 0.5);
  if (held.x <= 0.0 || held.y <= 0.0) discard;
  colour = light * held.x * held.y;
}`;

const LAYERS = `${COMMON}
#define HOLE 16  // pixels
uniform highp sampler2D sums, shownSums, imageSums;
uniform int count, layers, behind;
uniform float ratio, stride, disparity, margin;
uniform vec2 picture, tilt;
void main() {
  vec2 at = vec2(gl_FragCoord.x, top - gl_FragCoord.y) - 0.5;
  float focus = disparity + dot(tilt, (at + 0.5 - 0.5 * picture) / ratio);
  float left = 0.0;          // the weight of all rays that fall into the pixel when nothing is spread
  for (int k = 0; k < count; k++) {
    vec4 place = texelFetch(lens, ivec2(2 * k & 63, 2 * k >> 6), 0);
    float share = texelFetch(lens, ivec2((2 * k + 1) & 63, (2 * k + 1) >> 6), 0).x;
    vec2 low = (place.zw - 0.5 * size + place.xy * focus) * ratio + 0.5 * picture;
    vec2 held = clamp(min(low + size * ratio, at + 1.0) - max(low, at), 0.0, 1.0);
    left += share * held.x * held.y / (ratio * ratio * stride * stride);
  }
  vec4 sum = vec4(0.0), last = vec4(0.0), covered = vec4(0.0), shownLast = vec4(0.0);
  for (int layer = 0; layer < layers; layer++) {
    vec2 corner = vec2(layer & 1, layer >> 1) * (picture + 2.0 * margin) + margin;
    vec4 found = texelFetch(sums, ivec2(corner + at), 0);
    float used = min(found.w, left);
    if (used <= 0.0) continue;
    sum += found * (used / found.w);
    left -= used;
    last = found;
    if (two == 0) continue;
    shownLast = texelFetch(shownSums, ivec2(corner + at), 0);
    covered += shownLast * (used / found.w);
  }
  if (behind > 0 && last.w > 0.0) {
    sum += last * (left / last.w);
    covered += shownLast * (left / last.w);
  }
  // A pixel that no view sees gets the farthest surface around it.
  for (int r = 1; behind > 0 && sum.w <= 0.0 && r <= HOLE; r++) {
    for (int layer = layers - 1; layer >= 0 && sum.w <= 0.0; layer--) {
      vec2 corner = vec2(layer & 1, layer >> 1) * (picture + 2.0 * margin) + margin;
      for (int k = 0; k < 9; k++) {
        vec2 there = at + float(r) * vec2(k % 3 - 1, k / 3 - 1);
        if (clamp(there, vec2(0.0), picture - 1.0) != there) continue;
        sum += texelFetch(sums, ivec2(corner + there), 0);
        if (two > 0) covered += texelFetch(shownSums, ivec2(corner + there), 0);
      }
    }
  }
  vec3 total = sum.w > 0.0 ? sum.rgb / sum.w : vec3(0.0);
  if (covered.w > 0.0) {
    vec4 image = texelFetch(imageSums, ivec2(margin + at), 0);
    total += (image.w > 0.0 ? image.rgb / image.w : covered.rgb / covered.w) * (covered.w / sum.w);
  }
  colour = vec4(shown(total), 1.0);
}`;

const BOUNDS = [0.5, 2];      // sweeps between layers, pixels
const POINT_LAYERS = 6;       // of what is seen from a point: lfcore.refocus.free_views.LAYERS

/** @typedef {{texture: WebGLTexture | null, frame: WebGLFramebuffer | null}} Sums */

class Splatting {
  /** @param {Drawing} drawing @param {Depth} depth @param {Page[]} depths */
  constructor(drawing, depth, depths) {
    const gl = drawing.gl;
    if (!gl.getExtension("EXT_color_buffer_float") || !gl.getExtension("EXT_float_blend")) {
      throw new CannotDraw("This browser's graphics card does not add up in floating point");
    }
    this.gl = gl;
    this.drawing = drawing;
    this.depth = depth;
    this.most = gl.getParameter(gl.ALIASED_POINT_SIZE_RANGE)[1];
    this.rays = drawing.program(BOX, RAYS);
    this.layers = drawing.program(LAYERS);
    drawing.upload(depths, gl.TEXTURE3, gl.R8, gl.RED);
    /** Of all light or the first part, of the second at the depth of surfaces, and at its own. @type {Sums[]} */
    this.sums = [];
    this.held = "";
    /** @type {Cell[]} */ this.cells = [];
  }

  /**
   * Add up the rays of the cells, some at a time; yields how many. compose() then gives the picture.
   * @param {State} state @param {Cell[]} cells @param {number} divisor @param {number} most  Rays at a time.
   */
  *add(state, cells, divisor, most) {
    const {gl, drawing, depth} = this, {field} = drawing;
    const picture = depth.size.map((side) => Math.ceil(side / divisor));
    const ratio = Math.max(...depth.size) / divisor / Math.max(field.width, field.height);
    const pitch = field.views / field.columns.length, scale = field.scale;
    const [far, near] = depth.ends, disparity = state.single ? far : state.d * scale, {specular} = field;
    const tilt = state.single ? [0, 0] : [state.tx * scale / field.width, state.ty * scale / field.height];
    const apart = Math.max(...[...depth.ends, ...(specular ? specular.ends : [])].map((end) => Math.abs(disparity - end)))
      + 0.5 * field.width * (Math.abs(tilt[0]) + Math.abs(tilt[1]));
    const step = stride(field, divisor);
    const least = (step === 1 ? Math.min(0.5, 2 / field.columns.length) : 1) * ratio * step;
    const widest = Math.max(least, ...cells.map((cell) => Math.max(cell.wide, cell.tall) * apart * ratio));
    const margin = Math.min(Math.ceil(widest) + 2, this.most);
    const bounds = state.single
      ? Array.from({length: POINT_LAYERS - 1}, (_, k) => (k + 1) / POINT_LAYERS * (near - far) * ratio)
      : BOUNDS.map((bound) => bound / pitch);
    const target = [2 * (picture[0] + 2 * margin), 3 * (picture[1] + 2 * margin)];
    const passes = [{pages: 0, depths: 3, present: 3, sparse: 0, of: depth, bounds}];
    if (specular) {
      passes.push({pages: 6, depths: 3, present: 7, sparse: 1, of: depth, bounds},
        {pages: 6, depths: 7, present: 7, sparse: 1, of: specular, bounds: []});
    }
    this.resize(target, passes.length);
    /** @type {Record<string, number | number[]>} */
    this.common = {
      size: [field.width, field.height], ratio, disparity, tilt, margin, picture,
    };
    this.count = {
      stride: step, layers: state.single ? POINT_LAYERS : 2 * BOUNDS.length + 1, behind: state.single ? 1 : 0,
    };
    this.cells = cells;
    let waiting = 0;
    for (const [number, cell] of cells.entries()) {
      for (const [place, {of, bounds: between, ...units}] of passes.entries()) {
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.sums[place].frame);
        gl.viewport(0, 0, target[0], target[1]);
        gl.disable(gl.SCISSOR_TEST);
        if (!number) gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
        gl.useProgram(this.rays);
        drawing.setAll(this.rays, {
          ...this.common, target, ends: [of.low, of.low + 255 * of.step], least, follow: state.single ? 0 : 1,
          share: cell.share, lens: [cell.s, cell.t], centre: [cell.x, cell.y], side: [cell.wide, cell.tall],
          displaced: cell.displaced,
        }, {
          ...units, view: cell.view, stride: step, parts: between.length,
        });
        gl.uniform2i(gl.getUniformLocation(this.rays, "cells"), field.atlas.across, field.atlas.down);
        if (between.length) gl.uniform1fv(gl.getUniformLocation(this.rays, "bounds"), between);
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.ONE, gl.ONE);
        const rays = Math.floor(field.width / step) * Math.floor(field.height / step);
        gl.drawArrays(gl.POINTS, 0, rays);
        gl.disable(gl.BLEND);
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        waiting += rays;
      }
      if (waiting >= most || number === cells.length - 1) {
        yield waiting;
        waiting = 0;
      }
    }
  }

  /** @param {number[]} target @param {number} passes */
  resize([width, height], passes) {
    const {gl, drawing} = this, size = `${width} x ${height} x ${passes}`;
    if (this.held === size) return;
    this.held = size;
    for (const [place, unit] of [gl.TEXTURE4, gl.TEXTURE8, gl.TEXTURE9].slice(0, passes).entries()) {
      if (!this.sums[place]) {
        this.sums[place] = {texture: drawing.texture(unit, gl.TEXTURE_2D, gl.NEAREST), frame: gl.createFramebuffer()};
      }
      const {texture, frame} = this.sums[place];
      gl.activeTexture(unit);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, null);
      gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** Draw the picture of the rays that were added. @param {State} state */
  compose(state) {
    const {drawing, layers} = this, [width, height] = /** @type {number[]} */ (this.common?.picture);
    const {cells} = this, two = Number(drawing.field.specular !== null);
    // The picture of a point moves with the point.
    drawing.table(cells.flatMap((cell) => [
      [...(state.single ? [cell.s - cell.x, cell.t - cell.y] : [cell.s, cell.t]), ...cell.displaced],
      [cell.share, 0, 0, 0],
    ]));
    this.gl.useProgram(layers);
    drawing.setAll(layers, {
      ...this.common, stride: this.count?.stride || 1, top: drawing.canvas.height, gain: gain(drawing.field, state),
    }, {
      pages: 0, lens: 1, sums: 4, two, shownSums: two ? 8 : 4, imageSums: two ? 9 : 4, layers: this.count?.layers || 0, behind: this.count?.behind || 0, count: cells.length,
    });
    drawing.rectangle(0, 0, width, height);
  }
}
