// The sketch of the page, and its curves as chords that stay within a tolerance of them.

// Pixels that a curve may lie from its chords, and a half width from the exact one; less than an eye sees.
const TOLERANCE = 0.15;
// Halvings of a segment at most: 1024 chords.
const DEEPEST = 10;
// Numbers of a chord: its two ends, the half widths there, the stroke.
const CHORD = 9;

// A sketch.json with its middle moved to the origin and its radius made 1, so that float32 does for any place and size.
function readSketch(data, { middle, radius }) {
  const segments = data.points.map((points, row) => {
    const heaviest = Math.max(...data.weights[row]);
    return points.map((point, i) => {
      const weight = data.weights[row][i] / heaviest;
      return [...point.map((value, axis) => ((value - middle[axis]) / radius) * weight), weight];
    });
  });
  const counts = data.segments ?? data.points.map(() => 1);
  const unit = data.width_space === "world" ? 1 / radius : 1;
  let first = 0;
  const strokes = counts.map((count, stroke) => {
    const rows = Array.from({ length: count }, (_, i) => first + i);
    first += count;
    return {
      segments: rows.map((row) => segments[row]),
      widths: rows.map((row) => {
        const width = data.width[Array.isArray(data.width[0]) ? row : stroke];
        return (Array.isArray(width) ? width : segments[row].map(() => width)).map((value) => value * unit);
      }),
      closed: data.closed?.[stroke] ?? false,
      fixed: data.fixed?.[stroke] ?? false,
      color: data.color[stroke].map((value) => Math.min(Math.max(value, 0), 1)),
      opacity: data.opacity[stroke],
      importance: data.importance?.[stroke] ?? null,
      kind: data.kinds?.[stroke] ?? "",
      shown: true,
      reach: Math.max(0, ...rows.flatMap((row) => segments[row].map((point) => Math.hypot(...dehomogenized(point))))),
    };
  });
  setLevels(strokes);
  return { strokes, world: data.width_space === "world" };
}

// Chords of all strokes. pixelsAt(middle, radius) says how many pixels a unit of length takes at most in such a ball,
// pixelsOfWidth how many a unit of width does where widths are those of the image. Strokes keep theirs for as long as
// `zoom`, which stands for both, is the same one.
function chordsOf(sketch, zoom, pixelsAt, pixelsOfWidth) {
  const first = [0];
  for (const stroke of sketch.strokes) {
    if (stroke.zoom !== zoom) {
      const chords = chordsOfStroke(stroke, pixelsAt, sketch.world ? null : pixelsOfWidth);
      Object.assign(stroke, { zoom, chords: new Float32Array(chords) });
    }
    first.push(first.at(-1) + stroke.chords.length / CHORD);
  }
  const values = new Float32Array(first.at(-1) * CHORD);
  sketch.strokes.forEach(({ chords }, index) => {
    values.set(chords, first[index] * CHORD);
    for (let i = first[index]; i < first[index + 1]; i++) values[i * CHORD + 8] = index;
  });
  return { values, first };
}

// Those of one stroke; its number is left 0.
function chordsOfStroke({ segments, widths }, pixelsAt, pixelsOfWidth) {
  const chords = [];
  segments.forEach((segment, i) => {
    const points = segment.map(dehomogenized);
    const middle = [0, 1, 2].map((axis) => points.reduce((sum, p) => sum + p[axis], 0) / points.length);
    const pixels = pixelsAt(middle, Math.max(...points.map((p) => distance(p, middle))));
    flatten(segment, widths[i], pixels, pixelsOfWidth ?? pixels, DEEPEST, (a, b, wa, wb) =>
      chords.push(...a, ...b, wa / 2, wb / 2, 0),
    );
  });
  return chords;
}

// Hands the chords of a segment on, halved until they are near enough.
function flatten(segment, widths, pixels, pixelsOfWidth, depth, emit) {
  const points = segment.map(dehomogenized);
  const [start, end] = [points[0], points.at(-1)];
  if (depth === 0 || (isFlat(points, pixels) && isEven(segment, widths, pixelsOfWidth))) {
    emit(start, end, widths[0], widths.at(-1));
    return;
  }
  const [left, right] = halves(segment);
  const [leftWidths, rightWidths] = halves(widths.map((width) => [width]));
  flatten(left, leftWidths.flat(), pixels, pixelsOfWidth, depth - 1, emit);
  flatten(right, rightWidths.flat(), pixels, pixelsOfWidth, depth - 1, emit);
}

// With positive weights a curve lies in the convex hull of its control points: where they are near the chord, it is.
function isFlat(points, pixels) {
  const [start, end] = [points[0], points.at(-1)];
  return points.slice(1, -1).every((p) => distance(p, mixed(start, end, placeOn(p, start, end))) * pixels <= TOLERANCE);
}

// Whether half widths change along the chord as they do along the curve, asked at three places.
function isEven(segment, widths, pixels) {
  if (widths.every((width) => width === widths[0])) return true;
  const [start, end] = [dehomogenized(segment[0]), dehomogenized(segment.at(-1))];
  return [0.25, 0.5, 0.75].every((t) => {
    const place = placeOn(dehomogenized(bezierAt(segment, t)), start, end);
    const [width] = bezierAt(widths.map((value) => [value]), t);
    const along = widths[0] + place * (widths.at(-1) - widths[0]);
    return (Math.abs(width - along) * pixels) / 2 <= TOLERANCE;
  });
}

// de Casteljau: both halves of a Bézier curve, of homogeneous points or of widths.
function halves(controls) {
  const [left, right] = [[], []];
  for (let row = controls; row.length; row = between(row, 0.5)) {
    left.push(row[0]);
    right.unshift(row.at(-1));
  }
  return [left, right];
}

function bezierAt(controls, t) {
  let row = controls;
  while (row.length > 1) row = between(row, t);
  return row[0];
}

function between(row, t) {
  return row.slice(1).map((value, i) => mixed(row[i], value, t));
}

function mixed(a, b, t) {
  return a.map((value, axis) => value + t * (b[axis] - value));
}

function dehomogenized([x, y, z, w]) {
  return [x / w, y / w, z / w];
}

function distance(a, b) {
  return Math.hypot(...a.map((value, axis) => value - b[axis]));
}

// Where on a chord, 0 to 1, the place nearest to a point is.
function placeOn(point, start, end) {
  const along = end.map((value, axis) => value - start[axis]);
  const length2 = along.reduce((sum, value) => sum + value * value, 0);
  const dot = along.reduce((sum, value, axis) => sum + value * (point[axis] - start[axis]), 0);
  return length2 > 0 ? Math.min(Math.max(dot / length2, 0), 1) : 0;
}
