// The surface of a sketch: its triangles in the view's units, with normals that are smooth between creases.

// Numbers of one kind from base64, little-endian as all browsers are.
function numbersOf(text, kind) {
  return new kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

// What surface_on_page of the package wrote, moved and scaled as readSketch does it; null of null.
function readSurface(data, { middle, radius }) {
  if (!data) return null;
  const steps = numbersOf(data.points, Uint16Array);
  const points = Float32Array.from(steps, (step, i) => (data.low[i % 3] + step * data.step - middle[i % 3]) / radius);
  const faces = numbersOf(data.faces, data.wide ? Uint32Array : Uint16Array);
  const creases = numbersOf(data.creases, Uint32Array);
  const { convex, closed } = data;
  const normals = smoothNormals(points, faces);
  return { points, faces, normals, places: placesOf(steps), creases, convex, closed, near: data.near / radius };
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
