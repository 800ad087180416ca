// What can be done to strokes: functions from a document to another one, or to null where there is nothing to do.
//
// Where segments meet is one point: it moves with both, and a joint that is smooth stays so.

// Radians that a joint may turn and be smooth, as in the package; of its length, how far a straight segment may bend.
const [SMOOTH_TURN, STRAIGHT] = [1e-2, 1e-4];
// Nearer to its ends than this, 0 to 1, a segment is not bent: then its end is meant.
const BEND_FROM = 0.1;

// Nodes of a stroke are its ends and joints: 0 where its first segment begins, and so on. The segments before and after.
function around({ segments, closed }, node) {
  const count = segments.length;
  const before = node > 0 ? node - 1 : closed ? count - 1 : null;
  return { before, after: node < count ? node : closed ? 0 : null };
}

// The node at a control point; null for those between.
function nodeAt(stroke, { segment, control }) {
  const last = stroke.segments[0].points.length - 1;
  if (control === 0) return segment;
  if (control < last) return null;
  return stroke.closed && segment === stroke.segments.length - 1 ? 0 : segment + 1;
}

function withPoints(stroke, segment, points) {
  const segments = stroke.segments.map((old, i) => (i === segment ? { ...old, points } : old));
  return { ...stroke, segments };
}

// Directions of a curve into and out of a node, which its handles say; null without any.
function handlesAt(stroke, node) {
  const { before, after } = around(stroke, node);
  if (before === null || after === null) return null;
  const [into, from] = [stroke.segments[before].points, stroke.segments[after].points];
  const [a, b] = [unit(minus(into.at(-1), into.at(-2))), unit(minus(from[1], from[0]))];
  return a && b && { a, b, before, after };
}

function isSmooth(stroke, node) {
  const found = handlesAt(stroke, node);
  return found !== null && Math.acos(Math.min(dot(found.a, found.b), 1)) < SMOOTH_TURN;
}

// Moved points

function withPointMoved(doc, { stroke: index, segment, control }, delta) {
  const stroke = doc.strokes[index];
  const node = nodeAt(stroke, { segment, control });
  const moved = node === null ? handleMoved(stroke, segment, control, delta) : nodeMoved(stroke, node, delta);
  return withStroke(doc, index, moved);
}

// An end or a joint takes its handles along; a straight segment stays straight.
function nodeMoved(stroke, node, delta) {
  const { before, after } = around(stroke, node);
  let moved = stroke;
  if (before !== null) moved = withPoints(moved, before, lastMoved([...moved.segments[before].points].reverse(), delta));
  if (after !== null) moved = withPoints(moved, after, lastMoved(moved.segments[after].points, delta).reverse());
  return moved;
}

// Points with the first one moved, the other way round.
function lastMoved(points, delta) {
  const end = points.at(-1);
  const length = distance(points[0], end);
  const places = points.map((point) => placeOn(point, points[0], end));
  const straight = length > 0 && points.every((p, i) => distance(p, mixed(points[0], end, places[i])) <= STRAIGHT * length);
  const shares = points.map((_, i) => (straight ? 1 - places[i] : i === 0 || (i === 1 && points.length === 4) ? 1 : 0));
  return points.map((point, i) => (shares[i] ? plus(point, delta, shares[i]) : point)).reverse();
}

// Between ends: the handle on the other side of a smooth joint turns with this one.
function handleMoved(stroke, segment, control, delta) {
  const { points } = stroke.segments[segment];
  const moved = withPoints(stroke, segment, points.map((point, i) => (i === control ? plus(point, delta) : point)));
  if (points.length < 4) return moved;
  const node = nodeAt(stroke, { segment, control: control === 1 ? 0 : 3 });
  return isSmooth(stroke, node) ? turnedTo(moved, node, segment, control === 1) : moved;
}

// The handle of the other segment at a node turned to go on in line with this segment's.
function turnedTo(stroke, node, segment, begins) {
  const { before, after } = around(stroke, node);
  const other = begins ? before : after;
  const mine = stroke.segments[segment].points;
  const along = unit(begins ? minus(mine[0], mine[1]) : minus(mine[3], mine[2]));
  if (!along || other === segment) return stroke;
  const points = [...stroke.segments[other].points];
  const [end, handle] = begins ? [3, 2] : [0, 1];
  points[handle] = plus(points[end], along, distance(points[end], points[handle]));
  return withPoints(stroke, other, points);
}

// The point of a segment at t moved: its handles as little as does it.
function bent(doc, { stroke: index, segment, t }, delta) {
  if (t < BEND_FROM || t > 1 - BEND_FROM) {
    const control = t < BEND_FROM ? 0 : controlsOf(doc) - 1;
    return withPointMoved(doc, { stroke: index, segment, control }, delta);
  }
  const made = controlsOf(doc) < 3 ? asCubics(doc) : doc;
  const { points, weights } = made.strokes[index].segments[segment];
  const shares = sharesAt(weights, t);
  const inner = Array.from({ length: points.length - 2 }, (_, i) => i + 1);
  const all = inner.reduce((sum, i) => sum + shares[i] ** 2, 0);
  const scaled = (i) => delta.map((value) => (value * shares[i]) / all);
  const moved = inner.reduce((stroke, i) => handleMoved(stroke, segment, i, scaled(i)), made.strokes[index]);
  return withStroke(made, index, moved);
}

// How much each control point has of the point at t.
function sharesAt(weights, t) {
  const each = weights.map((weight, i) => {
    const controls = weights.map((_, j) => [i === j ? weight : 0]);
    return bezierAt(controls, t)[0];
  });
  const sum = each.reduce((total, value) => total + value, 0);
  return each.map((value) => value / sum);
}

function withStrokesMoved(doc, indices, delta) {
  return withStrokes(doc, doc.strokes.map((stroke, i) =>
    indices.includes(i) ? mapped(stroke, (point) => plus(point, delta)) : stroke));
}

function mapped(stroke, change) {
  const segments = stroke.segments.map(({ points, weights }) => ({ points: points.map(change), weights }));
  return { ...stroke, segments };
}

// More and fewer strokes: these also say which strokes are chosen then

function withNew(doc, strokes) {
  const made = withStrokes(doc, [...doc.strokes, ...strokes.map((stroke) => ({ ...stroke, id: undefined }))]);
  const first = doc.strokes.length;
  return { doc: made, chosen: strokes.map((_, i) => first + i) };
}

// A stroke of cubics, looking as another one does or, without one, black and as wide as most.
function withDrawn(doc, cubics, like) {
  const made = asCubics(doc);
  const segments = cubics.map((points) => ({ points, weights: [1, 1, 1, 1] }));
  const width = like ? widestOf(like) : doc.width_space === "world" ? 0.01 * sizeOf(doc) : 0.006;
  const { color, opacity } = like ?? { color: [0, 0, 0], opacity: 1 };
  return withNew(made, [{ segments, width: widthsOf(made, segments, width), color, opacity, closed: false, fixed: false }]);
}

// One width, as the document has it.
function widthsOf(doc, segments, width) {
  return doc.along ? segments.map(({ weights }) => weights.map(() => width)) : width;
}

function widestOf({ width }) {
  return Math.max(...[width].flat(2));
}

// Between corners of the box of all control points.
function sizeOf({ strokes }) {
  const points = strokes.flatMap((stroke) => stroke.segments.flatMap((segment) => segment.points));
  if (!points.length) return 1;
  const ends = [0, 1, 2].map((axis) => points.reduce(([low, high], point) =>
    [Math.min(low, point[axis]), Math.max(high, point[axis])], [Infinity, -Infinity]));
  return Math.hypot(...ends.map(([low, high]) => high - low));
}

function without(doc, indices) {
  if (!indices.length) return null;
  return { doc: withStrokes(doc, doc.strokes.filter((_, i) => !indices.includes(i))), chosen: [] };
}

function duplicated(doc, indices, delta) {
  if (!indices.length) return null;
  return withNew(doc, indices.map((i) => mapped(doc.strokes[i], (point) => plus(point, delta))));
}

// Copies of strokes in a mirror at right angles to an axis.
function mirrored(doc, indices, axis, place) {
  if (!indices.length) return null;
  const reflect = (point) => point.map((value, i) => (i === axis ? 2 * place - value : value));
  return withNew(doc, indices.map((i) => mapped(doc.strokes[i], reflect)));
}

// Where mirrors stand: at 0 if that is within the sketch, for most are made around it; else in its middle.
function mirrorPlace({ strokes }, axis) {
  const values = strokes.flatMap((stroke) => stroke.segments.flatMap(({ points }) => points.map((point) => point[axis])));
  const [low, high] = values.reduce(([l, h], value) => [Math.min(l, value), Math.max(h, value)], [Infinity, -Infinity]);
  return low <= 0 && high >= 0 ? 0 : (low + high) / 2;
}

// A straight segment more at an end of an open stroke.
function extruded(doc, index, atEnd, delta) {
  const stroke = doc.strokes[index];
  if (stroke.closed) return null;
  const end = atEnd ? stroke.segments.at(-1).points.at(-1) : stroke.segments[0].points[0];
  const straight = straightBetween(end, plus(end, delta), controlsOf(doc));
  const segment = atEnd ? straight : reversedSegment(straight);
  const width = doc.along ? (atEnd ? stroke.width.at(-1).at(-1) : stroke.width[0][0]) : null;
  return withStroke(doc, index, attached(stroke, atEnd, [segment], doc.along && [segment.weights.map(() => width)]));
}

function straightBetween(begin, end, controls) {
  const places = Array.from({ length: controls }, (_, i) => i / (controls - 1));
  return { points: places.map((place) => mixed(begin, end, place)), weights: places.map(() => 1) };
}

function attached(stroke, atEnd, segments, widths) {
  const both = (mine, more) => (atEnd ? [...mine, ...more] : [...more, ...mine]);
  return {
    ...stroke,
    segments: both(stroke.segments, segments),
    width: widths ? both(stroke.width, widths) : stroke.width,
  };
}

function reversedSegment({ points, weights }) {
  return { points: [...points].reverse(), weights: [...weights].reverse() };
}

function reversedStroke(stroke) {
  const { width } = stroke;
  return {
    ...stroke,
    segments: stroke.segments.map(reversedSegment).reverse(),
    width: Array.isArray(width) ? width.map((widths) => [...widths].reverse()).reverse() : width,
  };
}
