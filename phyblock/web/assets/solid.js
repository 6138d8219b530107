/* Blocks drawn in software: triangles into a depth buffer, edges over them, no WebGL, no pictures. */
"use strict";

const Solid = (() => {
  const HALF_TANGENT = Math.tan((15 * Math.PI) / 180);
  const SHARP_COSINE = Math.cos((30 * Math.PI) / 180);
  const WINDOW = 0.86;
  const MIN_DISTANCE_M = 0.48;
  const LIGHT_AZIMUTH_DEG = -18;
  const LIGHT_ELEVATION_DEG = 46;
  const AMBIENT = 0.55;
  const DIFFUSE = 0.55;
  const EDGE = [14, 14, 16];
  const EDGE_BIAS = 1.004;
  const GHOST_ALPHA = 0.2;
  const NO_BLOCKS = [];
  let kit = null;

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
  ];
  const unit = (a) => a.map((x) => x / Math.hypot(...a));

  /** Take block shapes {type: {vertices [m], triangles}} and colors {name: [r, g, b]}. */
  function setKit(shapes, colors) {
    kit = { shapes: {}, colors };
    for (const [type, { vertices, triangles }] of Object.entries(shapes)) {
      const normals = triangles.map(([a, b, c]) =>
        unit(cross(minus(vertices[b], vertices[a]), minus(vertices[c], vertices[a]))));
      kit.shapes[type] = { vertices, triangles, normals, edges: sharpEdges(triangles, normals) };
    }
  }

  /** Edges between faces that differ by 30 degrees: [corner, corner, face, face]. */
  function sharpEdges(triangles, normals) {
    const beside = new Map();
    triangles.forEach((corners, face) => {
      for (let i = 0; i < 3; i++) {
        const a = corners[i], b = corners[(i + 1) % 3];
        const key = Math.min(a, b) * 1000 + Math.max(a, b);
        if (beside.has(key)) beside.get(key).push(face);
        else beside.set(key, [a, b, face]);
      }
    });
    return [...beside.values()].filter(([, , f, g]) => dot(normals[f], normals[g]) < SHARP_COSINE);
  }

  /** R = Rz Ry Rx of extrinsic x-y-z angles [degrees], rows. */
  function rotation([roll, pitch, yaw]) {
    const [a, b, c] = [roll, pitch, yaw].map((deg) => (deg * Math.PI) / 180);
    const [sa, ca, sb, cb, sc, cc] = [
      Math.sin(a), Math.cos(a), Math.sin(b), Math.cos(b), Math.sin(c), Math.cos(c),
    ];
    return [
      [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
      [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
      [-sb, cb * sa, cb * ca],
    ];
  }

  /** A block {type, color, position [m], euler [deg]} in the world: corners and face normals. */
  function placed(block) {
    const shape = kit.shapes[block.type];
    const rows = rotation(block.euler);
    const turn = (v) => rows.map((row) => dot(row, v));
    const points = shape.vertices.map((v) => turn(v).map((x, i) => x + block.position[i]));
    return { shape, points, normals: shape.normals.map(turn), color: kit.colors[block.color] };
  }

  /** Right, up and forward of a view from azimuth and elevation [degrees]. */
  function viewAxes(azimuth, elevation) {
    const a = (azimuth * Math.PI) / 180, e = (elevation * Math.PI) / 180;
    const towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    const right = [-Math.sin(a), Math.cos(a), 0];
    return [right, cross(towards, right), towards.map((x) => -x)];
  }

  /** The closest camera that sees all of the blocks' corners inside the window. */
  function frame(blocks, [azimuth, elevation], minDistance = MIN_DISTANCE_M) {
    const axes = viewAxes(azimuth, elevation);
    const points = blocks.flatMap((block) => placed(block).points);
    const slope = WINDOW * HALF_TANGENT;
    let depth = Infinity;
    const spans = [0, 1].map((axis) => {
      let most = -Infinity, least = Infinity;
      for (const point of points) {
        const across = dot(axes[axis], point), ahead = dot(axes[2], point);
        most = Math.max(most, across - slope * ahead);
        least = Math.min(least, across + slope * ahead);
      }
      depth = Math.min(depth, (least - most) / (2 * slope));
      return [most, least];
    });
    for (const point of points) depth = Math.min(depth, dot(axes[2], point) - minDistance);
    const center = [...spans.map(([most, least]) => (most + least) / 2), depth];
    const eye = [0, 1, 2].map((i) => axes.reduce((sum, axis, k) => sum + axis[i] * center[k], 0));
    return { axes, eye, azimuth };
  }

  /** Alone on the floor, as a candidate is shown. */
  function onTheFloor(block) {
    const lifted = { ...block, position: [0, 0, 0] };
    const lowest = Math.min(...placed(lifted).points.map((point) => point[2]));
    return { ...lifted, position: [0, 0, -lowest] };
  }

  /** Where the middle of its box is at `center` [m]. */
  function boxedAt(block, center) {
    const { points } = placed({ ...block, position: [0, 0, 0] });
    const position = center.map((middle, i) => {
      const along = points.map((point) => point[i]);
      return middle - (Math.min(...along) + Math.max(...along)) / 2;
    });
    return { ...block, position };
  }

  function project(camera, size, point) {
    const from = minus(point, camera.eye);
    const depth = dot(camera.axes[2], from);
    const scale = size / 2 / (HALF_TANGENT * depth);
    return [
      size / 2 + dot(camera.axes[0], from) * scale, size / 2 - dot(camera.axes[1], from) * scale,
      1 / depth,
    ];
  }

  function light(camera) {
    const a = ((camera.azimuth + LIGHT_AZIMUTH_DEG) * Math.PI) / 180;
    const e = (LIGHT_ELEVATION_DEG * Math.PI) / 180;
    return [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  }

  class Buffer {
    constructor(size) {
      this.size = size;
      this.image = new ImageData(size, size);
      this.pixels = new Uint32Array(this.image.data.buffer);
      this.near = new Float32Array(size * size);
    }

    clear() {
      this.pixels.fill(0);
      this.near.fill(0);
    }

    /** Fill a triangle of projected corners; `alpha` under 1 is mixed in and leaves depth alone. */
    fill([a, b, c], [red, green, blue], alpha = 1) {
      const area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
      if (!area) return;
      const { size, pixels, near } = this;
      const top = Math.max(0, Math.ceil(Math.min(a[1], b[1], c[1]) - 0.5));
      const bottom = Math.min(size - 1, Math.floor(Math.max(a[1], b[1], c[1]) - 0.5));
      const left = Math.max(0, Math.ceil(Math.min(a[0], b[0], c[0]) - 0.5));
      const right = Math.min(size - 1, Math.floor(Math.max(a[0], b[0], c[0]) - 0.5));
      const solid = (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0;
      for (let y = top; y <= bottom; y++) {
        for (let x = left, at = y * size + left; x <= right; x++, at++) {
          const px = x + 0.5, py = y + 0.5;
          const u = ((b[0] - px) * (c[1] - py) - (b[1] - py) * (c[0] - px)) / area;
          const v = ((c[0] - px) * (a[1] - py) - (c[1] - py) * (a[0] - px)) / area;
          const w = 1 - u - v;
          if (u < 0 || v < 0 || w < 0) continue;
          const depth = u * a[2] + v * b[2] + w * c[2];
          if (depth <= near[at]) continue;
          if (alpha === 1) {
            near[at] = depth;
            pixels[at] = solid;
          } else this.mix(at, [red, green, blue], alpha);
        }
      }
    }

    mix(at, color, alpha) {
      const data = this.image.data, i = at * 4;
      const under = (data[i + 3] / 255) * (1 - alpha), whole = alpha + under;
      for (let k = 0; k < 3; k++) {
        data[i + k] = (color[k] * alpha + data[i + k] * under) / whole;
      }
      data[i + 3] = 255 * whole;
    }

    /** A line `width` pixels thick, where nothing nearer hides it. */
    line(a, b, [red, green, blue], width, dash = 0) {
      const { size, pixels, near } = this;
      const steps = Math.max(1, Math.ceil(Math.hypot(b[0] - a[0], b[1] - a[1])));
      const solid = (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0;
      const low = -Math.floor((width - 1) / 2), high = low + width;
      for (let i = 0; i <= steps; i++) {
        if (dash && Math.floor(i / dash) % 2) continue;
        const t = i / steps;
        const depth = (a[2] + (b[2] - a[2]) * t) * EDGE_BIAS;
        const x0 = Math.floor(a[0] + (b[0] - a[0]) * t), y0 = Math.floor(a[1] + (b[1] - a[1]) * t);
        for (let y = Math.max(0, y0 + low); y < Math.min(size, y0 + high); y++) {
          for (let x = Math.max(0, x0 + low); x < Math.min(size, x0 + high); x++) {
            const at = y * size + x;
            if (depth >= near[at]) pixels[at] = solid;
          }
        }
      }
    }
  }

  const buffers = new Map();
  let scratch = null;

  function bufferOf(size) {
    if (!buffers.has(size)) {
      if (buffers.size > 3) buffers.clear();
      buffers.set(size, new Buffer(size));
    }
    const buffer = buffers.get(size);
    buffer.clear();
    return buffer;
  }

  function isSeen(solid, face, camera) {
    const corner = solid.points[solid.shape.triangles[face][0]];
    return dot(solid.normals[face], minus(corner, camera.eye)) < 0;
  }

  function paint(buffer, solid, camera, style) {
    const toLight = light(camera), size = buffer.size;
    const seen = solid.points.map((point) => project(camera, size, point));
    solid.shape.triangles.forEach((corners, face) => {
      if (!isSeen(solid, face, camera)) return;
      const lit = Math.min(1, AMBIENT + DIFFUSE * Math.max(0, dot(solid.normals[face], toLight)));
      const color = solid.color.map((value) => Math.round(value * lit));
      buffer.fill(corners.map((i) => seen[i]), color, style.alpha);
    });
    for (const [a, b, f, g] of solid.shape.edges) {
      if (!isSeen(solid, f, camera) && !isSeen(solid, g, camera)) continue;
      buffer.line(seen[a], seen[b], style.edge, style.width, style.dash);
    }
  }

  /** The floor: a grid of 5 cm that fades out, and the shadow of the blocks. */
  function ground(context, solids, camera, size, grid) {
    const at = (x, y) => project(camera, size, [x, y, 0]);
    const points = solids.flatMap((solid) => solid.points);
    const mid = [0, 1].map((i) => {
      const values = points.map((point) => point[i]);
      return (Math.min(...values) + Math.max(...values)) / 2;
    });
    const [cx, cy] = mid.map((value) => Math.round(value / 0.05) * 0.05);
    context.lineWidth = Math.max(1, size / 500);
    const reach = 5;
    for (let i = -reach; i <= reach; i++) {
      for (let j = -reach; j < reach; j++) {
        const fade = 1 - Math.hypot(i, j + 0.5) / reach;
        if (fade <= 0) continue;
        context.strokeStyle = grid;
        context.globalAlpha = fade * 0.55;
        const [s, t, u] = [i * 0.05, j * 0.05, (j + 1) * 0.05];
        for (const ends of [[[s, t], [s, u]], [[t, s], [u, s]]]) {
          const [from, to] = ends.map(([x, y]) => at(cx + x, cy + y));
          context.beginPath();
          context.moveTo(from[0], from[1]);
          context.lineTo(to[0], to[1]);
          context.stroke();
        }
      }
    }
  }

  function shadow(context, solids, camera, size) {
    const toLight = light(camera);
    context.beginPath();
    for (const solid of solids) {
      const flat = solid.points.map(([x, y, z]) => {
        const t = z / toLight[2];
        return project(camera, size, [x - toLight[0] * t, y - toLight[1] * t, 0]);
      });
      solid.shape.triangles.forEach((corners, face) => {
        if (dot(solid.normals[face], toLight) <= 0) return;
        const [a, b, c] = corners.map((i) => flat[i]);
        context.moveTo(a[0], a[1]);
        context.lineTo(b[0], b[1]);
        context.lineTo(c[0], c[1]);
        context.closePath();
      });
    }
    context.globalAlpha = 0.16;
    context.fillStyle = "#000";
    context.fill();
    context.globalAlpha = 1;
  }

  /**
   * Draw into a canvas, square, sharp on dense screens.
   *
   * `view` [azimuth, elevation]; `framed` blocks the camera is framed on; `ghosts` blocks shown as
   * glass; `fresh` the block whose edges are marked in `accent` [r, g, b]; `grid` a CSS color, or
   * nothing for no floor; `marks` [{letter, position}].
   */
  function draw(canvas, blocks, options) {
    const { view, framed = blocks, ghosts = NO_BLOCKS, fresh = null, marks = NO_BLOCKS } = options;
    const css = options.size || canvas.clientWidth || 200;
    const size = Math.round(css * Math.max(1, window.devicePixelRatio || 1));
    canvas.width = canvas.height = size;
    const context = canvas.getContext("2d");
    if (!framed.length) return;
    const camera = frame(framed, view, options.minDistance);
    const large = Math.min(2 * size, 1600);
    const buffer = bufferOf(large);
    const edge = { alpha: 1, edge: EDGE, width: Math.max(2, Math.round(large / 340)), dash: 0 };
    const solids = blocks.map(placed);
    for (const [i, solid] of solids.entries()) {
      const isFresh = blocks[i] === fresh;
      paint(buffer, solid, camera, isFresh ? { ...edge, edge: options.accent, width: edge.width * 2 } : edge);
    }
    for (const ghost of ghosts) {
      const style = { alpha: GHOST_ALPHA, edge: options.accent, width: edge.width, dash: large / 90 };
      paint(buffer, placed(ghost), camera, style);
    }
    if (options.grid) ground(context, framed.map(placed), camera, size, options.grid);
    context.globalAlpha = 1;
    if (options.grid && solids.length) shadow(context, solids, camera, size);
    stamp(context, buffer, size);
    for (const mark of marks) letter(context, mark, camera, size);
  }

  function stamp(context, buffer, size) {
    scratch = scratch || document.createElement("canvas");
    scratch.width = scratch.height = buffer.size;
    scratch.getContext("2d").putImageData(buffer.image, 0, 0);
    context.imageSmoothingQuality = "high";
    context.drawImage(scratch, 0, 0, size, size);
  }

  function letter(context, mark, camera, size) {
    const [x, y] = project(camera, size, mark.position);
    const radius = size * 0.032;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = "#fff";
    context.fill();
    context.strokeStyle = "#111";
    context.lineWidth = Math.max(1, size / 300);
    context.stroke();
    context.fillStyle = "#111";
    context.font = `600 ${radius * 1.4}px sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(mark.letter, x, y + radius * 0.08);
  }

  return { setKit, draw, onTheFloor, boxedAt };
})();
