/* Blocks in three dimensions: three.js draws them with one renderer for all canvases of a page. */
"use strict";

const Solid = (() => {
  const FIELD_OF_VIEW_DEG = 30;
  const HALF_TANGENT = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
  const CREASE_COSINE = Math.cos((34 * Math.PI) / 180);
  const WINDOW = 0.86;
  const MIN_DISTANCE_M = 0.48;
  const LIGHT_AZIMUTH_DEG = -40;
  const LIGHT_ELEVATION_DEG = 52;
  const GRID_M = 0.05;
  const EDGE_PX = 1.1;
  const DASH_M = 0.007;
  const BADGE_PX = 160;
  const LEAST_SEEN_PX = 10;
  const NO_BLOCKS = [];

  const kit = { shapes: {}, colors: {} };
  const waiting = new Map();
  let loading = null;
  let studio = null;

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
  ];
  const radians = (degrees) => (degrees * Math.PI) / 180;

  /** Take block shapes {type: {vertices [m], triangles}} and colors {name: [r, g, b]}. */
  function setKit(shapes, colors) {
    kit.colors = colors;
    for (const [type, { vertices, triangles }] of Object.entries(shapes)) {
      const areas = triangles.map(([a, b, c]) => cross(minus(vertices[b], vertices[a]), minus(vertices[c], vertices[a])));
      kit.shapes[type] = { vertices, triangles, areas, normals: areas.map((n) => n.map((x) => x / Math.hypot(...n))) };
    }
  }

  // ---- where blocks and the camera are

  /** R = Rz Ry Rx of extrinsic x-y-z angles [degrees], rows. */
  function rotation(angles) {
    const [a, b, c] = angles.map(radians);
    const [sa, ca, sb, cb, sc, cc] = [
      Math.sin(a), Math.cos(a), Math.sin(b), Math.cos(b), Math.sin(c), Math.cos(c),
    ];
    return [
      [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
      [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
      [-sb, cb * sa, cb * ca],
    ];
  }

  /** Corners of a block {type, color, position [m], euler [deg]} in the world. */
  function corners(block) {
    const rows = rotation(block.euler);
    return kit.shapes[block.type].vertices.map((v) => rows.map((row, i) => dot(row, v) + block.position[i]));
  }

  /** Right, up and forward of a view from azimuth and elevation [degrees]. */
  function viewAxes(azimuth, elevation) {
    const a = radians(azimuth), e = radians(elevation);
    const towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    const right = [-Math.sin(a), Math.cos(a), 0];
    return [right, cross(towards, right), towards.map((x) => -x)];
  }

  /** The closest camera that sees all of the blocks' corners inside the window. */
  function frame(blocks, [azimuth, elevation], minDistance = MIN_DISTANCE_M) {
    const axes = viewAxes(azimuth, elevation);
    const points = blocks.flatMap(corners);
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
    const middle = [0, 1].map((i) => {
      const along = points.map((point) => point[i]);
      return (Math.min(...along) + Math.max(...along)) / 2;
    });
    const reach = Math.max(...points.map((point) => Math.hypot(point[0] - middle[0], point[1] - middle[1], point[2])));
    const distance = Math.hypot(...minus([...middle, reach / 3], eye));
    return { axes, eye, azimuth, middle, reach, distance };
  }

  /** Alone on the floor, as a candidate is shown. */
  function onTheFloor(block) {
    const lifted = { ...block, position: [0, 0, 0] };
    const lowest = Math.min(...corners(lifted).map((point) => point[2]));
    return { ...lifted, position: [0, 0, -lowest] };
  }

  /** Where the middle of its box is at `center` [m]. */
  function boxedAt(block, center) {
    const points = corners({ ...block, position: [0, 0, 0] });
    const position = center.map((middle, i) => {
      const along = points.map((point) => point[i]);
      return middle - (Math.min(...along) + Math.max(...along)) / 2;
    });
    return { ...block, position };
  }

  function project(camera, size, point) {
    const from = minus(point, camera.eye);
    const scale = size / 2 / (HALF_TANGENT * dot(camera.axes[2], from));
    return [size / 2 + dot(camera.axes[0], from) * scale, size / 2 - dot(camera.axes[1], from) * scale];
  }

  // ---- the studio: one renderer, one scene, materials and geometries that are used again

  /** Bring three.js, which lies beside the page's data; the canvases that wait are drawn then. */
  function load() {
    loading = loading || new Promise((settle) => {
      const script = document.createElement("script");
      script.src = `${document.documentElement.dataset.folder}/three.js`;
      script.onload = script.onerror = settle;
      document.head.append(script);
    }).then(() => {
      studio = window.THREE ? opened() : null;
      for (const [canvas, [blocks, options]] of waiting) draw(canvas, blocks, options);
      waiting.clear();
    });
    return loading;
  }

  /** The renderer with lights and floor; null where the browser has no WebGL. */
  function opened() {
    let renderer = null;
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("webgl2", { alpha: true, antialias: true, premultipliedAlpha: true });
    if (!context) return null;
    try {
      renderer = new THREE.WebGLRenderer({ canvas, context, alpha: true, antialias: true });
    } catch {
      return null;
    }
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFShadowMap;
    renderer.setClearColor(0, 0);
    const sheet = document.createElement("canvas");
    sheet.width = sheet.height = BADGE_PX;
    const scene = new THREE.Scene();
    const key = shadowing(new THREE.DirectionalLight(0xffffff, 1.9), 3);
    // A second one from above, whose wide shadow darkens where blocks meet the floor and each other.
    const sky = shadowing(new THREE.DirectionalLight(0xffffff, 0.75), 9);
    const floor = new THREE.Mesh(new THREE.PlaneGeometry(4, 4), new THREE.ShadowMaterial({ opacity: 0.26 }));
    floor.receiveShadow = true;
    floor.position.z = -0.0004;
    scene.add(new THREE.HemisphereLight(0xffffff, 0xb9b4ad, 1.25), key, key.target, sky, sky.target, floor);
    scene.children[0].position.set(0, 0, 1);
    return {
      canvas, renderer, scene, key, sky, floor, content: null, camera: new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 20),
      rod: new THREE.CylinderGeometry(1, 1, 1, 6), cone: new THREE.ConeGeometry(1, 1, 16), materials: new Map(), geometries: new Map(),
      context: sheet.getContext("2d", { willReadFrequently: true }),
    };
  }

  function shadowing(light, radius) {
    light.castShadow = true;
    light.shadow.mapSize.set(1024, 1024);
    light.shadow.radius = radius;
    light.shadow.bias = -0.0004;
    light.shadow.normalBias = 0.0012;
    return light;
  }

  /** A geometry with normals that are smooth but at edges, and these edges as pairs of corners. */
  function geometryOf(type) {
    const known = studio.geometries.get(type);
    if (known) return known;
    const { vertices, triangles, areas, normals } = kit.shapes[type];
    const around = vertices.map(() => []);
    const beside = new Map();
    triangles.forEach((three, face) => three.forEach((a, i) => {
      const b = three[(i + 1) % 3], key = `${Math.min(a, b)},${Math.max(a, b)}`;
      around[a].push(face);
      if (beside.has(key)) beside.get(key).push(face);
      else beside.set(key, [a, b, face]);
    }));
    const positions = [], smooth = [];
    triangles.forEach((three, face) => three.forEach((corner) => {
      const near = around[corner].filter((other) => dot(normals[face], normals[other]) >= CREASE_COSINE);
      const sum = [0, 1, 2].map((i) => near.reduce((total, other) => total + areas[other][i], 0));
      positions.push(...vertices[corner]);
      smooth.push(...sum.map((x) => x / Math.hypot(...sum)));
    }));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    geometry.setAttribute("normal", new THREE.Float32BufferAttribute(smooth, 3));
    const edges = [...beside.values()].filter(([, , f, g]) => g === undefined || dot(normals[f], normals[g]) < CREASE_COSINE)
      .map(([a, b]) => [vertices[a], vertices[b]]);
    studio.geometries.set(type, { geometry, edges });
    return studio.geometries.get(type);
  }

  function material(key, make) {
    if (!studio.materials.has(key)) studio.materials.set(key, make());
    return studio.materials.get(key);
  }

  const colorOf = ([r, g, b], by = 1) => new THREE.Color().setRGB((r / 255) * by, (g / 255) * by, (b / 255) * by, THREE.SRGBColorSpace);
  const opaque = (rgb) => material(`solid ${rgb}`, () => new THREE.MeshStandardMaterial({ color: colorOf(rgb), roughness: 0.72 }));
  const line = (rgb, by = 1) => material(`line ${rgb} ${by}`, () => new THREE.MeshBasicMaterial({ color: colorOf(rgb, by) }));
  const inFront = (rgb) => material(`front ${rgb}`, () => new THREE.MeshBasicMaterial({ color: colorOf(rgb), depthTest: false, transparent: true }));
  const glass = (rgb, opacity) => material(`glass ${rgb} ${opacity}`,
    () => new THREE.MeshBasicMaterial({ color: colorOf(rgb), transparent: true, opacity, depthWrite: false }));

  function meshOf(block, look) {
    const mesh = new THREE.Mesh(geometryOf(block.type).geometry, look);
    mesh.position.set(...block.position);
    if (block.turn) mesh.quaternion.copy(block.turn);
    else mesh.quaternion.copy(turnOf(block.euler));
    return mesh;
  }

  const turnOf = ([a, b, c]) => new THREE.Quaternion().setFromEuler(new THREE.Euler(radians(a), radians(b), radians(c), "ZYX"));

  /** The edges of meshes as thin rods, `radius` [m] thick, in one draw call; `dash` breaks them. */
  function rods(meshes, look, radius, dash = false) {
    const ends = [];
    for (const mesh of meshes) {
      mesh.updateMatrixWorld();
      for (const [a, b] of geometryOf(mesh.userData.type).edges) {
        const [from, to] = [a, b].map((one) => new THREE.Vector3(...one).applyMatrix4(mesh.matrixWorld));
        const n = dash ? Math.max(1, Math.round(from.distanceTo(to) / DASH_M / 2)) : 1;
        for (let i = 0; i < n; i++) {
          ends.push(dash ? [from.clone().lerp(to, (i + 0.25) / n), from.clone().lerp(to, (i + 0.75) / n)] : [from, to]);
        }
      }
    }
    const drawn = new THREE.InstancedMesh(studio.rod, look, ends.length);
    const up = new THREE.Vector3(0, 1, 0), along = new THREE.Vector3(), turn = new THREE.Quaternion();
    const matrix = new THREE.Matrix4(), scale = new THREE.Vector3();
    ends.forEach(([from, to], i) => {
      along.subVectors(to, from);
      scale.set(radius, along.length() + (dash ? 0 : radius), radius);
      turn.setFromUnitVectors(up, along.normalize());
      drawn.setMatrixAt(i, matrix.compose(from.clone().add(to).multiplyScalar(0.5), turn, scale));
    });
    return drawn;
  }

  /** An arrow from one point to another [m], in front of everything. */
  function arrow({ from, to }, look, radius) {
    const group = new THREE.Group();
    const [a, b] = [from, to].map((one) => new THREE.Vector3(...one));
    const along = b.clone().sub(a), length = along.length();
    const head = Math.min(length * 0.5, radius * 9);
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.clone().normalize());
    for (const [geometry, start, span, width] of [[studio.rod, 0, length - head, radius * 1.6], [studio.cone, length - head, head, radius * 4.5]]) {
      const part = new THREE.Mesh(geometry, look);
      part.position.copy(a).addScaledVector(along.clone().normalize(), start + span / 2);
      part.quaternion.copy(turn);
      part.scale.set(width, span, width);
      part.renderOrder = 5;
      group.add(part);
    }
    return group;
  }

  /** The floor's lines, every 5 cm, that fade out with the distance. */
  function gridOf(camera, rgb) {
    const [cx, cy] = camera.middle.map((x) => Math.round(x / GRID_M) * GRID_M);
    const n = Math.max(5, Math.ceil((camera.reach * 1.6) / GRID_M));
    const points = [], colors = [], tint = colorOf(rgb);
    const vertex = (i, j) => {
      points.push(cx + i * GRID_M, cy + j * GRID_M, -0.0002);
      colors.push(tint.r, tint.g, tint.b, Math.max(0, 1 - Math.hypot(i, j) / n) * 0.8);
    };
    for (let i = -n; i <= n; i++) {
      for (let j = -n; j < n; j++) {
        for (const [s, t] of [[[i, j], [i, j + 1]], [[j, i], [j + 1, i]]]) {
          vertex(...s);
          vertex(...t);
        }
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    geometry.setAttribute("color", new THREE.Float32BufferAttribute(colors, 4));
    const look = material("grid", () => new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false }));
    const lines = new THREE.LineSegments(geometry, look);
    lines.userData.own = true;
    return lines;
  }

  function aim(light, camera, azimuth, elevation) {
    const [, , ahead] = viewAxes(azimuth, elevation);
    const [x, y] = camera.middle, reach = camera.reach * 1.25;
    light.target.position.set(x, y, camera.reach / 3);
    light.position.set(x - ahead[0], y - ahead[1], camera.reach / 3 - ahead[2]);
    Object.assign(light.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.05, far: 3 });
    light.shadow.camera.updateProjectionMatrix();
  }

  function pose(camera) {
    const [right, up, ahead] = camera.axes.map((axis) => new THREE.Vector3(...axis));
    const lens = studio.camera;
    lens.matrixAutoUpdate = false;
    lens.matrix.makeBasis(right, up, ahead.negate()).setPosition(...camera.eye);
    lens.near = Math.max(0.005, camera.distance - 3 * camera.reach - 0.05);
    lens.far = camera.distance + 8;
    lens.updateProjectionMatrix();
    lens.updateMatrixWorld(true);
  }

  /** Fill the studio with what a picture shows; the meshes of its blocks in their order. */
  function arrange(blocks, camera, size, options) {
    const { ghosts = NO_BLOCKS, fresh = null, tried = null, accent, triedColor, grid } = options;
    const pixel = (camera.distance * HALF_TANGENT * 2) / size;
    const dense = Math.max(1, size / 420);
    const width = pixel * EDGE_PX * dense * 0.5;
    const content = new THREE.Group();
    const place = (block, look) => {
      const mesh = meshOf(block, look);
      mesh.userData.type = block.type;
      content.add(mesh);
      return mesh;
    };
    const meshes = blocks.map((block) => {
      const mesh = place(block, opaque(kit.colors[block.color]));
      mesh.castShadow = mesh.receiveShadow = true;
      return mesh;
    });
    meshes.forEach((mesh, i) => {
      if (blocks[i] !== fresh) content.add(rods([mesh], line(kit.colors[blocks[i].color], 0.34), width));
    });
    const ring = meshes.filter((_, i) => blocks[i] === fresh);
    if (ring.length) content.add(rods(ring, line(accent), width * 2.6));
    if (ghosts.length) content.add(rods(ghosts.map((ghost) => place(ghost, glass(accent, 0.13))), line(accent), width * 1.3, true));
    if (tried) {
      const edges = rods([place(tried, glass(triedColor, 0.42))], inFront(triedColor), width * 2);
      edges.renderOrder = 4;
      content.add(edges);
    }
    if (options.arrow) content.add(arrow(options.arrow, inFront(triedColor), width * 2));
    if (grid) content.add(gridOf(camera, grid));
    studio.floor.visible = Boolean(grid);
    if (studio.content) {
      studio.scene.remove(studio.content);
      studio.content.traverse((one) => {
        if (one.isInstancedMesh) one.dispose();
        if (one.userData.own) one.geometry.dispose();
      });
    }
    studio.content = content;
    studio.scene.add(content);
    return meshes;
  }

  /** Where each block is seen best [px], and how much of it [px²]; null for one that is hidden. */
  function seenAt(meshes, size) {
    const { renderer, scene, camera, floor, context } = studio;
    const coded = meshes.map((_, i) => material(`code ${i}`, () => new THREE.MeshBasicMaterial({
      color: new THREE.Color().setRGB(...codeOf(i).map((x) => x / 255), THREE.LinearSRGBColorSpace) })));
    const looks = meshes.map((mesh) => mesh.material);
    const others = studio.content.children.filter((one) => !meshes.includes(one)).concat(floor);
    const were = others.map((one) => one.visible);
    const set = (key, all, values) => all.forEach((one, i) => { one[key] = values[i]; });
    set("visible", others, others.map(() => false));
    set("material", meshes, coded);
    renderer.shadowMap.enabled = false;
    renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    renderer.setViewport(0, 0, BADGE_PX, BADGE_PX);
    renderer.render(scene, camera);
    renderer.setViewport(0, 0, size, size);
    renderer.outputColorSpace = THREE.SRGBColorSpace;
    renderer.shadowMap.enabled = true;
    set("material", meshes, looks);
    set("visible", others, were);
    context.clearRect(0, 0, BADGE_PX, BADGE_PX);
    context.drawImage(studio.canvas, 0, size - BADGE_PX, BADGE_PX, BADGE_PX, 0, 0, BADGE_PX, BADGE_PX);
    const { data } = context.getImageData(0, 0, BADGE_PX, BADGE_PX);
    const found = meshes.map(() => []);
    for (let at = 0; at < data.length; at += 4) {
      // A pixel between two blocks is of neither: its parts do not belong together.
      const i = data[at] - 1;
      if (i >= 0 && i < found.length && codeOf(i).every((x, k) => x === data[at + k])) {
        found[i].push([(at / 4) % BADGE_PX, Math.floor(at / 4 / BADGE_PX)]);
      }
    }
    const scale = size / BADGE_PX;
    return found.map((pixels) => {
      if (pixels.length < LEAST_SEEN_PX) return null;
      const middle = [0, 1].map((k) => pixels.reduce((sum, pixel) => sum + pixel[k], 0) / pixels.length);
      // The middle of what is seen may lie on another block: the nearest pixel of its own does not.
      const away = (pixel) => Math.hypot(pixel[0] - middle[0], pixel[1] - middle[1]);
      const best = pixels.reduce((one, other) => (away(other) < away(one) ? other : one));
      return { at: best.map((x) => (x + 0.5) * scale), area: pixels.length * scale * scale };
    });
  }

  const codeOf = (i) => [i + 1, (i * 37 + 91) % 256, (i * 101 + 53) % 256];

  /**
   * Draw into a canvas, square, sharp on dense screens.
   *
   * `view` [azimuth, elevation]; `framed` blocks the camera is framed on; `ghosts` blocks shown as
   * glass; `fresh` the block whose edges are marked in `accent` [r, g, b]; `tried` a block that was
   * refused, in `triedColor`; `arrow` {from, to, text}; `grid` the color of the floor's lines
   * [r, g, b], or nothing for no floor; `marks` [{letter, position}]; `badges` the text on each
   * block, where it is seen. What is drawn before three.js has come waits for it.
   */
  function draw(canvas, blocks, options) {
    const { view, framed = blocks, marks = NO_BLOCKS, badges = NO_BLOCKS } = options;
    const css = options.size || canvas.clientWidth || 200;
    const size = Math.round(css * Math.max(1, window.devicePixelRatio || 1));
    canvas.width = canvas.height = size;
    if (!framed.length) return;
    if (!studio) {
      waiting.set(canvas, [blocks, options]);
      if (!loading) load();
      else loading.then(() => studio || instead(canvas, size));
      return;
    }
    const camera = frame(framed, view, options.minDistance);
    studio.renderer.setSize(size, size, false);
    const meshes = arrange(blocks, camera, size, options);
    aim(studio.key, camera, camera.azimuth + LIGHT_AZIMUTH_DEG, LIGHT_ELEVATION_DEG);
    aim(studio.sky, camera, camera.azimuth, 89);
    pose(camera);
    studio.renderer.render(studio.scene, studio.camera);
    const context = canvas.getContext("2d");
    context.drawImage(studio.canvas, 0, 0, size, size);
    for (const mark of marks) letter(context, mark.letter, project(camera, size, mark.position), size);
    if (badges.some(Boolean)) {
      seenAt(meshes, size).forEach((seen, i) => {
        if (seen && badges[i]) letter(context, badges[i], seen.at, size, Math.sqrt(seen.area) / 3.2);
      });
    }
    if (options.tried && options.triedBadge) letter(context, options.triedBadge, project(camera, size, options.tried.position), size);
    if (options.arrow?.text) label(context, options.arrow.text, project(camera, size, options.arrow.to), size);
    canvas.dataset.drawn = blocks.length;
  }

  function instead(canvas, size) {
    const context = canvas.getContext("2d");
    context.fillStyle = "#888";
    context.font = `${Math.max(11, size / 24)}px sans-serif`;
    context.textAlign = "center";
    context.fillText("No WebGL: nothing can be drawn", size / 2, size / 2);
    canvas.dataset.drawn = "no";
  }

  function letter(context, text, [x, y], size, most = Infinity) {
    const radius = Math.max(size / 60, Math.min(size * 0.029, most));
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = "#fff";
    context.fill();
    context.strokeStyle = "#111";
    context.lineWidth = Math.max(1, size / 340);
    context.stroke();
    write(context, text, [x, y + radius * 0.08], radius * 1.35);
  }

  function label(context, text, [x, y], size) {
    const high = Math.max(11, size * 0.036);
    context.font = `600 ${high}px sans-serif`;
    const wide = context.measureText(text).width + high;
    const left = Math.min(Math.max(0, x - wide / 2), size - wide);
    context.fillStyle = "rgba(255, 255, 255, 0.94)";
    context.fillRect(left, y + high * 0.7, wide, high * 1.5);
    write(context, text, [left + wide / 2, y + high * 1.5], high);
  }

  function write(context, text, [x, y], high) {
    context.fillStyle = "#111";
    context.font = `600 ${high}px sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, x, y);
  }

  /** Blocks between two states, `share` of the way: those in both move, turning the short way. */
  function between(before, after, share) {
    return after.map((block) => {
      const from = before.find((one) => one === block || (block.key !== undefined && one.key === block.key));
      if (!from || from === block || !studio) return block;
      const position = block.position.map((x, i) => from.position[i] + (x - from.position[i]) * share);
      return { ...block, position, turn: turnOf(from.euler).slerp(turnOf(block.euler), share) };
    });
  }

  return { setKit, draw, load, onTheFloor, boxedAt, between,
    get ready() {
      return Boolean(studio);
    } };
})();
