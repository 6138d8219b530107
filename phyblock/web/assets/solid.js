/* Blocks in three dimensions: three.js draws them with one renderer for all canvases of a page; where
   the browser has no WebGL, their faces are painted from the farthest to the nearest. */
"use strict";

const Solid = (() => {
  const FIELD_OF_VIEW_DEG = 30;
  const HALF_TANGENT = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
  const CREASE_DEG = 34;
  const WINDOW = 0.86;
  const MIN_DISTANCE_M = 0.48;
  const LIGHT_AZIMUTH_DEG = -40;
  const LIGHT_ELEVATION_DEG = 52;
  const GRID_M = 0.05;
  const EDGE_PX = 1.1;
  const DASH_M = 0.007;
  const MOST_RAYS = 8;

  const kit = { shapes: {}, colors: {} };
  const waiting = new Map();
  let loading = null;
  let studio = null;

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
  ];
  const unit = (a) => a.map((x) => x / Math.hypot(...a));
  const middleOf = (points) => [0, 1, 2].map((i) => {
    const along = points.map((point) => point[i]);
    return (Math.min(...along) + Math.max(...along)) / 2;
  });
  const radians = (degrees) => (degrees * Math.PI) / 180;

  /** Take block shapes {type: {vertices [m], triangles}} and colors {name: [r, g, b]}. */
  function setKit(shapes, colors) {
    Object.assign(kit, { shapes, colors });
  }

  // ---- where blocks and the camera are

  /** R = Rz Ry Rx of extrinsic x-y-z angles [degrees], rows. */
  function rotation(angles) {
    const [[sa, ca], [sb, cb], [sc, cc]] = angles.map(radians).map((a) => [Math.sin(a), Math.cos(a)]);
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
    let depth = Math.min(...points.map((point) => dot(axes[2], point) - minDistance));
    const center = [0, 1].map((axis) => {
      const most = Math.max(...points.map((point) => dot(axes[axis], point) - slope * dot(axes[2], point)));
      const least = Math.min(...points.map((point) => dot(axes[axis], point) + slope * dot(axes[2], point)));
      depth = Math.min(depth, (least - most) / (2 * slope));
      return (most + least) / 2;
    });
    center.push(depth);
    const eye = [0, 1, 2].map((i) => axes.reduce((sum, axis, k) => sum + axis[i] * center[k], 0));
    const [x, y] = middleOf(points);
    const reach = Math.max(...points.map((point) => Math.hypot(point[0] - x, point[1] - y, point[2])));
    const distance = Math.hypot(...minus([x, y, reach / 3], eye));
    return { axes, eye, azimuth, middle: [x, y], reach, distance };
  }

  /** Alone on the floor, as a candidate is shown. */
  function onTheFloor(block) {
    const lifted = { ...block, position: [0, 0, 0] };
    return { ...lifted, position: [0, 0, -Math.min(...corners(lifted).map((point) => point[2]))] };
  }

  /** With the middle of its box at `center` [m]. */
  const boxedAt = (block, center) =>
    ({ ...block, position: minus(center, middleOf(corners({ ...block, position: [0, 0, 0] }))) });

  function project(camera, size, point) {
    const from = minus(point, camera.eye);
    const scale = size / 2 / (HALF_TANGENT * dot(camera.axes[2], from));
    return [size / 2 + dot(camera.axes[0], from) * scale, size / 2 - dot(camera.axes[1], from) * scale];
  }

  // ---- the studio: one renderer, one scene, materials and geometries that are used again

  /** Load three.js, which lies beside the page's data; the canvases that wait are drawn then. */
  function load() {
    loading = loading || new Promise((settle) => {
      const script = document.createElement("script");
      script.src = `${document.documentElement.dataset.folder}/three.js`;
      script.onload = script.onerror = settle;
      document.head.append(script);
    }).then(() => {
      studio = (window.THREE && opened()) || { painted: true };
      for (const [canvas, [blocks, options]] of waiting) draw(canvas, blocks, options);
      waiting.clear();
    });
    return loading;
  }

  /** The renderer with lights and floor; null where the browser has no WebGL. */
  function opened() {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("webgl2", { alpha: true, antialias: true, premultipliedAlpha: true });
    if (!context) return null;
    let renderer = null;
    try {
      renderer = new THREE.WebGLRenderer({ canvas, context, alpha: true, antialias: true });
    } catch {
      return null;
    }
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFShadowMap;
    renderer.setClearColor(0, 0);
    const scene = new THREE.Scene();
    const key = shadowing(new THREE.DirectionalLight(0xffffff, 1.9), 3);
    // A second one from above, whose wide shadow darkens where blocks meet the floor and each other.
    const sky = shadowing(new THREE.DirectionalLight(0xffffff, 0.75), 9);
    const floor = new THREE.Mesh(new THREE.PlaneGeometry(4, 4), new THREE.ShadowMaterial({ opacity: 0.26 }));
    floor.receiveShadow = true;
    floor.position.z = -0.0004;
    scene.add(new THREE.HemisphereLight(0xffffff, 0xb9b4ad, 1.25), key, key.target, sky, sky.target, floor);
    scene.children[0].position.set(0, 0, 1);
    const camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 20);
    const rod = new THREE.CylinderGeometry(1, 1, 1, 6), cone = new THREE.ConeGeometry(1, 1, 16);
    const [materials, geometries] = [new Map(), new Map()];
    return { canvas, renderer, scene, key, sky, floor, camera, rod, cone, materials, geometries, content: null };
  }

  function shadowing(light, radius) {
    light.castShadow = true;
    light.shadow.mapSize.set(1024, 1024);
    Object.assign(light.shadow, { radius, bias: -0.0004, normalBias: 0.0012 });
    return light;
  }

  /** A geometry with normals that are smooth but at edges, and these edges as pairs of corners. */
  function geometryOf(type) {
    const known = studio.geometries.get(type);
    if (known) return known;
    const { vertices, triangles } = kit.shapes[type];
    const areas = triangles.map(([a, b, c]) => cross(minus(vertices[b], vertices[a]), minus(vertices[c], vertices[a])));
    const normals = areas.map(unit), crease = Math.cos(radians(CREASE_DEG));
    const smooth = triangles.flatMap((three, face) => three.flatMap((corner) => {
      const near = triangles.flatMap((other, n) => (other.includes(corner) && dot(normals[face], normals[n]) >= crease ? [n] : []));
      return unit([0, 1, 2].map((i) => near.reduce((total, n) => total + areas[n][i], 0)));
    }));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(triangles.flat().flatMap((n) => vertices[n]), 3));
    geometry.setAttribute("normal", new THREE.Float32BufferAttribute(smooth, 3));
    const ends = new THREE.EdgesGeometry(geometry, CREASE_DEG).attributes.position;
    const edges = Array.from({ length: ends.count / 2 }, (_, n) =>
      [2 * n, 2 * n + 1].map((i) => new THREE.Vector3().fromBufferAttribute(ends, i)));
    studio.geometries.set(type, { geometry, edges });
    return studio.geometries.get(type);
  }

  function material(key, make) {
    if (!studio.materials.has(key)) studio.materials.set(key, make());
    return studio.materials.get(key);
  }

  const colorOf = ([r, g, b], by = 1) =>
    new THREE.Color().setRGB((r / 255) * by, (g / 255) * by, (b / 255) * by, THREE.SRGBColorSpace);
  const opaque = (rgb) => material(`solid ${rgb}`,
    () => new THREE.MeshStandardMaterial({ color: colorOf(rgb), roughness: 0.72 }));
  const line = (rgb, by = 1) => material(`line ${rgb} ${by}`,
    () => new THREE.MeshBasicMaterial({ color: colorOf(rgb, by) }));
  const inFront = (rgb) => material(`front ${rgb}`,
    () => new THREE.MeshBasicMaterial({ color: colorOf(rgb), depthTest: false, transparent: true }));
  const glass = (rgb, opacity) => material(`glass ${rgb} ${opacity}`,
    () => new THREE.MeshBasicMaterial({ color: colorOf(rgb), transparent: true, opacity, depthWrite: false }));

  const turnOf = ([a, b, c]) =>
    new THREE.Quaternion().setFromEuler(new THREE.Euler(radians(a), radians(b), radians(c), "ZYX"));

  /** The edges of meshes as thin rods, `radius` [m] thick, in one draw call; `dash` breaks them. */
  function rods(meshes, look, radius, dash = false) {
    const ends = [];
    for (const mesh of meshes) {
      mesh.updateMatrixWorld();
      for (const edge of geometryOf(mesh.userData.type).edges) {
        const [from, to] = edge.map((one) => one.clone().applyMatrix4(mesh.matrixWorld));
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
    const start = new THREE.Vector3(...from), along = new THREE.Vector3(...to).sub(start);
    const length = along.length(), head = Math.min(length * 0.5, radius * 9);
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
    const parts = [[studio.rod, 0, length - head, 1.6], [studio.cone, length - head, head, 4.5]];
    for (const [geometry, at, span, width] of parts) {
      const part = new THREE.Mesh(geometry, look);
      part.position.copy(start).addScaledVector(along, at + span / 2);
      part.quaternion.copy(turn);
      part.scale.set(width * radius, span, width * radius);
      part.renderOrder = 5;
      group.add(part);
    }
    return group;
  }

  /** The floor's lines, every 5 cm, that fade out towards their ends. */
  function gridOf(camera, rgb) {
    const [cx, cy] = camera.middle.map((x) => Math.round(x / GRID_M) * GRID_M);
    const n = Math.max(5, Math.ceil((camera.reach * 1.6) / GRID_M));
    const points = [], colors = [], tint = colorOf(rgb);
    for (let i = -n; i <= n; i++) {
      for (let j = -n; j < n; j++) {
        for (const [x, y] of [[i, j], [i, j + 1], [j, i], [j + 1, i]]) {
          points.push(cx + x * GRID_M, cy + y * GRID_M, -0.0002);
          colors.push(tint.r, tint.g, tint.b, Math.max(0, 1 - Math.hypot(x, y) / n) * 0.8);
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

  /** Fill the studio with the content of a picture; the meshes of its blocks in their order. */
  function arrange(blocks, camera, size, options) {
    const { ghosts = [], fresh, tried, accent, triedColor, grid } = options;
    const pixel = (camera.distance * HALF_TANGENT * 2) / size;
    const width = pixel * EDGE_PX * Math.max(1, size / 420) * 0.5;
    const content = new THREE.Group();
    const place = (block, look) => {
      const mesh = new THREE.Mesh(geometryOf(block.type).geometry, look);
      mesh.position.set(...block.position);
      mesh.quaternion.copy(block.turn || turnOf(block.euler));
      mesh.userData.type = block.type;
      content.add(mesh);
      return mesh;
    };
    const meshes = blocks.map((block) => {
      const mesh = place(block, opaque(kit.colors[block.color]));
      mesh.castShadow = mesh.receiveShadow = true;
      content.add(block === fresh ? rods([mesh], line(accent), width * 2.6)
        : rods([mesh], line(kit.colors[block.color], 0.34), width));
      return mesh;
    });
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

  /** Faces of blocks in the world, as their three corners, with normal and area. */
  const facesOf = (block) => {
    const points = corners(block);
    return kit.shapes[block.type].triangles.map((three) => {
      const at = three.map((n) => points[n]);
      const span = cross(minus(at[1], at[0]), minus(at[2], at[0]));
      const center = [0, 1, 2].map((i) => (at[0][i] + at[1][i] + at[2][i]) / 3);
      return { at, normal: unit(span), area: Math.hypot(...span), center };
    });
  };

  /** Where each block is seen [m], at one of its largest faces; null for one that is hidden. */
  function seenAt(meshes, blocks, camera) {
    const ray = new THREE.Raycaster(), eye = new THREE.Vector3(...camera.eye);
    return blocks.map((block, n) => {
      const towards = (face) => -dot(face.normal, unit(minus(face.center, camera.eye))) * face.area;
      const faces = facesOf(block).sort((a, b) => towards(b) - towards(a)).slice(0, MOST_RAYS);
      return faces.map(({ center }) => center).find((center) => {
        ray.set(eye, new THREE.Vector3(...center).sub(eye).normalize());
        return ray.intersectObjects(meshes, false)[0]?.object === meshes[n];
      }) || null;
    });
  }

  /** Paint without WebGL: blocks, and the outlines of what else there is. */
  function paint(context, camera, size, blocks, { ghosts = [], fresh, tried, accent, triedColor }) {
    const light = viewAxes(camera.azimuth + LIGHT_AZIMUTH_DEG, LIGHT_ELEVATION_DEG)[2];
    const far = (face) => dot(camera.axes[2], minus(face.center, camera.eye));
    const others = [...ghosts.map((one) => [one, accent, 0.12]), ...(tried ? [[tried, triedColor, 0.4]] : [])];
    const faces = [...blocks.map((one) => [one, kit.colors[one.color], 1]), ...others].flatMap(([block, color, opacity]) =>
      facesOf(block).filter(({ normal, center }) => dot(normal, minus(center, camera.eye)) < 0)
        .map((face) => ({ ...face, color, opacity, isFresh: block === fresh })));
    for (const { at, normal, color, opacity, isFresh } of faces.sort((a, b) => far(b) - far(a))) {
      const bright = opacity < 1 ? 1 : 0.62 + 0.38 * Math.max(0, -dot(normal, light));
      context.beginPath();
      at.forEach((point) => context.lineTo(...project(camera, size, point)));
      context.closePath();
      context.fillStyle = `rgba(${color.map((x) => x * bright).join(",")},${opacity})`;
      context.strokeStyle = isFresh ? `rgb(${accent})` : context.fillStyle;
      context.fill();
      context.stroke();
    }
  }

  /**
   * Draw into a canvas, square, sharp on dense screens.
   *
   * `view` [azimuth, elevation]; `framed` blocks the camera is framed on; `ghosts` blocks shown as
   * glass; `fresh` the block whose edges are marked in `accent` [r, g, b]; `tried` a block that was
   * refused, in `triedColor`; `arrow` {from, to, text}; `grid` the color of the floor's lines
   * [r, g, b], or nothing for no floor; `marks` [{letter, position}]; `badges` the text on each
   * block, where it is seen. A canvas that is drawn before three.js is loaded waits for it.
   */
  function draw(canvas, blocks, options) {
    const { view, framed = blocks, marks = [], badges = [], tried } = options;
    const size = Math.round((canvas.clientWidth || 200) * Math.max(1, window.devicePixelRatio || 1));
    canvas.width = canvas.height = size;
    if (!framed.length) return;
    if (!studio) {
      waiting.set(canvas, [blocks, options]);
      load();
      return;
    }
    const camera = frame(framed, view, options.minDistance);
    const context = canvas.getContext("2d");
    canvas.dataset.drawn = studio.painted ? "painted" : blocks.length;
    let seen = blocks.map((block) => block.position);
    if (studio.painted) paint(context, camera, size, blocks, options);
    else {
      studio.renderer.setSize(size, size, false);
      const meshes = arrange(blocks, camera, size, options);
      aim(studio.key, camera, camera.azimuth + LIGHT_AZIMUTH_DEG, LIGHT_ELEVATION_DEG);
      aim(studio.sky, camera, camera.azimuth, 89);
      pose(camera);
      studio.renderer.render(studio.scene, studio.camera);
      context.drawImage(studio.canvas, 0, 0, size, size);
      if (badges.some(Boolean)) seen = seenAt(meshes, blocks, camera);
    }
    const put = (text, point) => text && point && letter(context, text, project(camera, size, point), size);
    for (const mark of marks) put(mark.letter, mark.position);
    seen.forEach((point, i) => put(badges[i], point));
    if (tried) put(options.triedBadge, tried.position);
    if (options.arrow) label(context, options.arrow.text, project(camera, size, options.arrow.to), size);
  }

  function letter(context, text, [x, y], size) {
    const radius = size * 0.027;
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
      if (!from || from === block) return block;
      const position = block.position.map((x, i) => from.position[i] + (x - from.position[i]) * share);
      return { ...block, position, turn: turnOf(from.euler).slerp(turnOf(block.euler), share) };
    });
  }

  return { setKit, draw, load, onTheFloor, boxedAt, between,
    get ready() {
      return Boolean(studio && !studio.painted);
    } };
})();
