// The surface of a sketch: its triangles in the view's units, with normals that are smooth between creases.

// Numbers of one kind from base64, little-endian as all browsers are.
function numbersOf(text, kind) {
  return new kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

// What surfaces/on_page.py of the package wrote, moved and scaled as readSketch does it; null of null.
function readSurface(data, { middle, radius }) {
  if (!data) return null;
  const steps = numbersOf(data.points, Uint16Array);
  const points = Float32Array.from(steps, (step, i) => (data.low[i % 3] + step * data.step - middle[i % 3]) / radius);
  const faces = numbersOf(data.faces, data.wide ? Uint32Array : Uint16Array);
  const creases = numbersOf(data.creases, Uint32Array);
  const { convex, closed, rings, least_run: leastRun } = data;
  const normals = smoothNormals(points, faces);
  const places = placesOf(steps);
  return { points, faces, normals, places, creases, convex, closed, rings, leastRun, near: data.near / radius };
}

// Corners in one place have one number, whichever side of a crease they are on.
function placesOf(steps) {
  const known = new Map();
  return Uint32Array.from({ length: steps.length / 3 }, (_, i) => {
    const key = (steps[3 * i] * 65536 + steps[3 * i + 1]) * 65536 + steps[3 * i + 2];
    if (!known.has(key)) known.set(key, known.size);
    return known.get(key);
  });
}

// At each corner the mean of the faces there, weighted by their angles, as TriangleMesh.corner_normals has it.
function smoothNormals(points, faces) {
  const sums = new Float64Array(points.length);
  for (let face = 0; face < faces.length; face += 3) {
    const corners = [0, 1, 2].map((k) => pointAt(points, faces[face + k]));
    const normal = unit(cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))) ?? [0, 0, 0];
    for (let k = 0; k < 3; k++) {
      const [one, other] = [1, 2].map((step) => minus(corners[(k + step) % 3], corners[k]));
      const angle = Math.atan2(Math.hypot(...cross(one, other)), dot(one, other));
      for (let i = 0; i < 3; i++) sums[3 * faces[face + k] + i] += angle * normal[i];
    }
  }
  const normals = new Float32Array(points.length);
  for (let i = 0; i < points.length; i += 3) normals.set(unit(Array.from(sums.subarray(i, i + 3))) ?? [0, 0, 0], i);
  return normals;
}

function pointAt(points, index) {
  return [points[3 * index], points[3 * index + 1], points[3 * index + 2]];
}

// Where a surface is seen first in pixels of a picture: points, with their depths and the normal there, or null.
function surfaceUnder({ points, faces }, camera, size, pixels) {
  const axes = axesOf(camera);
  const [near] = depthsOf(camera);
  const seen = Float64Array.from({ length: points.length });
  for (let i = 0; i < points.length; i += 3) {
    const { x, y, depth } = projected(camera, axes, size, [points[i], points[i + 1], points[i + 2]]);
    seen.set([x, y, depth], i);
  }
  const [left, top, right, bottom] = [[Math.min, 0], [Math.min, 1], [Math.max, 0], [Math.max, 1]].map(([pick, axis]) =>
    pixels.reduce((bound, pixel) => pick(bound, pixel[axis]), pick === Math.min ? Infinity : -Infinity),
  );
  const found = pixels.map(() => ({ depth: Infinity, face: -1 }));
  for (let face = 0; face < faces.length; face += 3) {
    const [a, b, c] = [3 * faces[face], 3 * faces[face + 1], 3 * faces[face + 2]];
    if (Math.min(seen[a + 2], seen[b + 2], seen[c + 2]) <= near) continue;
    if (Math.max(seen[a], seen[b], seen[c]) < left || Math.min(seen[a], seen[b], seen[c]) > right) continue;
    if (Math.max(seen[a + 1], seen[b + 1], seen[c + 1]) < top || Math.min(seen[a + 1], seen[b + 1], seen[c + 1]) > bottom) continue;
    pixels.forEach((pixel, i) => {
      const depth = depthIn(seen, a, b, c, pixel, camera.orthographic);
      if (depth < found[i].depth) found[i] = { depth, face };
    });
  }
  return found.map(({ depth, face }, i) => {
    if (face < 0) return null;
    const { from, along } = rayAt(camera, axes, size, ...pixels[i]);
    const [a, b, c] = [0, 1, 2].map((k) => pointAt(points, faces[face + k]));
    return { place: plus(from, along, depth), depth, normal: unit(cross(minus(b, a), minus(c, a))) };
  });
}

// The depth of a triangle in a pixel; infinite beside it. Depths are linear in the picture, with perspective their inverses.
function depthIn(seen, a, b, c, [x, y], orthographic) {
  const side = (i, j) => (seen[i] - x) * (seen[j + 1] - y) - (seen[j] - x) * (seen[i + 1] - y);
  const shares = [side(b, c), side(c, a), side(a, b)];
  const area = shares[0] + shares[1] + shares[2];
  if (area === 0 || shares.some((share) => share * area < 0)) return Infinity;
  const depths = [seen[a + 2], seen[b + 2], seen[c + 2]];
  const sum = shares.reduce((total, share, k) => total + (share / area) * (orthographic ? depths[k] : 1 / depths[k]), 0);
  return orthographic ? sum : 1 / sum;
}
