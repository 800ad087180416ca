// Strokes that are cut, joined, smoothed, and drawn anew from a line of points.

// Of the sketch's size: ends nearer to each other than this are joined as one point.
const TOGETHER = 0.02;
// Rounds of better places along a line that is fitted, and halvings of it at most.
const [ROUNDS, DEEPEST_FIT] = [4, 6];

// A stroke cut at a point of it: in two, or open there if it was closed.
function cutAt(doc, { stroke: index, segment, t }) {
  const whole = doc.strokes[index];
  const stroke = t > 0 && t < 1 ? withNode(whole, segment, t) : whole;
  const node = t > 0 ? segment + 1 : segment;
  const count = stroke.segments.length;
  if (!stroke.closed && (node === 0 || node === count)) return null;
  const part = (from, to) => ({
    ...stroke,
    closed: false,
    segments: stroke.segments.slice(from, to),
    width: Array.isArray(stroke.width) ? stroke.width.slice(from, to) : stroke.width,
  });
  const [first, rest] = [part(0, node), part(node, count)];
  if (!stroke.closed) {
    const made = withNew(withStroke(doc, index, first), [rest]);
    return { doc: made.doc, chosen: [index, ...made.chosen] };
  }
  const { segments, width } = attached(rest, true, first.segments, doc.along && first.width);
  return { doc: withStroke(doc, index, { ...rest, segments, width }), chosen: [index] };
}

// The same stroke with a segment cut in two.
function withNode(stroke, segment, t) {
  const { points, weights } = stroke.segments[segment];
  const [left, right] = cutCurve(points.map((point, i) => homogeneous(point, weights[i])), t);
  const middle = dehomogenized(right[0]);
  const both = [segmentOf(left, points[0], middle), segmentOf(right, middle, points.at(-1))];
  const { width } = stroke;
  const widths = Array.isArray(width) && cutCurve(width[segment].map((value) => [value]), t).map((half) => half.flat());
  const put = (all, two) => [...all.slice(0, segment), ...two, ...all.slice(segment + 1)];
  return { ...stroke, segments: put(stroke.segments, both), width: widths ? put(width, widths) : width };
}

// Strokes joined at the ends that are nearest to each other, or one whose ends meet, closed.
function joinedStrokes(doc, indices) {
  const open = indices.filter((i) => !doc.strokes[i].closed);
  if (!open.length || open.length < indices.length) return null;
  const near = TOGETHER * sizeOf(doc);
  const rest = open.slice(1).map((i) => doc.strokes[i]);
  let chain = doc.strokes[open[0]];
  while (rest.length) {
    const pairs = rest.flatMap((stroke, i) => [true, false].flatMap((atEnd) => [true, false].map((itsEnd) =>
      ({ i, atEnd, itsEnd, gap: distance(endOf(chain, atEnd), endOf(stroke, itsEnd)) }))));
    const { i, atEnd, itsEnd } = pairs.reduce((best, pair) => (pair.gap < best.gap ? pair : best));
    const [next] = rest.splice(i, 1);
    const turned = atEnd === itsEnd ? reversedStroke(next) : next;
    chain = atEnd ? bridged(chain, turned, near) : { ...bridged(turned, chain, near), ...looksOf(chain) };
  }
  const alone = open.length === 1;
  if (alone || distance(endOf(chain, true), endOf(chain, false)) <= near) chain = closedStroke(chain, near);
  const kept = doc.strokes.map((stroke, i) => (i === open[0] ? chain : stroke)).filter((_, i) => !open.includes(i) || i === open[0]);
  return { doc: withStrokes(doc, kept), chosen: [kept.indexOf(chain)] };
}

function looksOf({ id, color, opacity, fixed }) {
  return { id, color, opacity, fixed };
}

function endOf({ segments }, last) {
  return last ? segments.at(-1).points.at(-1) : segments[0].points[0];
}

// One stroke and then the other, with a straight segment between them where they are apart.
function bridged(first, second, near) {
  const [end, begin] = [endOf(first, true), endOf(second, false)];
  if (distance(end, begin) > near) {
    const straight = straightBetween(end, begin, first.segments[0].points.length);
    const widths = Array.isArray(first.width) &&
      [straight.points.map((_, i) => first.width.at(-1).at(-1) * (1 - i / (straight.points.length - 1)) +
        second.width[0][0] * (i / (straight.points.length - 1)))];
    return attached(attached(first, true, [straight], widths), true, second.segments, widths && second.width);
  }
  const middle = mixed(end, begin, 0.5);
  const [a, b] = [
    nodeMovedTo(first, first.segments.length, middle), nodeMovedTo(second, 0, middle),
  ];
  if (!Array.isArray(first.width)) return attached(a, true, b.segments, false);
  const width = (first.width.at(-1).at(-1) + second.width[0][0]) / 2;
  const before = [...first.width.slice(0, -1), [...first.width.at(-1).slice(0, -1), width]];
  const after = [[width, ...second.width[0].slice(1)], ...second.width.slice(1)];
  return attached({ ...a, width: before }, true, b.segments, after);
}

function nodeMovedTo(stroke, node, point) {
  const old = node === 0 ? endOf(stroke, false) : endOf(stroke, true);
  const moved = nodeMoved(stroke, node, minus(point, old));
  const segment = node === 0 ? 0 : stroke.segments.length - 1;
  const points = [...moved.segments[segment].points];
  points[node === 0 ? 0 : points.length - 1] = point;
  return withPoints(moved, segment, points);
}

function closedStroke(stroke, near) {
  const [end, begin] = [endOf(stroke, true), endOf(stroke, false)];
  const apart = distance(end, begin) > near || stroke.segments.length === 1;
  if (apart) {
    const straight = straightBetween(end, begin, stroke.segments[0].points.length);
    const last = Array.isArray(stroke.width) && stroke.width.at(-1).at(-1);
    const first = Array.isArray(stroke.width) && stroke.width[0][0];
    const count = straight.points.length - 1;
    const widths = Array.isArray(stroke.width) && [straight.points.map((_, i) => last + (first - last) * (i / count))];
    return { ...attached(stroke, true, [straight], widths), closed: true };
  }
  const moved = nodeMovedTo(nodeMovedTo(stroke, stroke.segments.length, mixed(end, begin, 0.5)), 0, mixed(end, begin, 0.5));
  if (!Array.isArray(stroke.width)) return { ...moved, closed: true };
  const middle = (stroke.width.at(-1).at(-1) + stroke.width[0][0]) / 2;
  const width = stroke.width.map((widths) => [...widths]);
  [width[0][0], width.at(-1)[width.at(-1).length - 1]] = [middle, middle];
  return { ...moved, closed: true, width };
}

// Joints without corners: handles turned into one line, each as long as before.
function smoothed(doc, indices) {
  const made = asCubics(doc);
  let changed = false;
  const strokes = made.strokes.map((stroke, index) => {
    if (!indices.includes(index)) return stroke;
    return stroke.segments.reduce((smooth, _, node) => {
      if (isSmooth(smooth, node)) return smooth;
      const found = handlesAt(smooth, node);
      const along = found && unit(plus(found.a, found.b));
      if (!along) return smooth;
      changed = true;
      const [before, after] = [[...smooth.segments[found.before].points], [...smooth.segments[found.after].points]];
      before[2] = plus(before[3], along, -distance(before[3], before[2]));
      const turned = withPoints(smooth, found.before, before);
      const next = found.before === found.after ? [...turned.segments[found.after].points] : after;
      next[1] = plus(next[0], along, distance(next[0], next[1]));
      return withPoints(turned, found.after, next);
    }, stroke);
  });
  return changed ? { doc: withStrokes(made, strokes), chosen: indices } : null;
}

// Both parts of a Bézier curve of homogeneous points, or of widths.
function cutCurve(controls, t) {
  const [left, right] = [[], []];
  for (let row = controls; row.length; row = between(row, t)) {
    left.push(row[0]);
    right.unshift(row.at(-1));
  }
  return [left, right];
}

// Cubics along a drawn line that stay within a distance of its points (P. J. Schneider, Graphics Gems, 1990).
function fittedCubics(line, within) {
  const points = line.filter((point, i) => i === 0 || distance(point, line[i - 1]) > 0);
  if (points.length < 2) return [];
  const [begin, end] = [unit(minus(points[1], points[0])), unit(minus(points.at(-2), points.at(-1)))];
  return fittedPart(points, begin, end, within, DEEPEST_FIT);
}

function fittedPart(points, begin, end, within, depth) {
  let places = lengthsAlong(points);
  let cubic = leastSquares(points, places, begin, end);
  for (let round = 0; round < ROUNDS; round++) {
    places = points.map((point, i) => nearestPlace(cubic, point, places[i]));
    cubic = leastSquares(points, places, begin, end);
  }
  const away = points.map((point, i) => distance(point, bezierAt(cubic, places[i])));
  const worst = away.indexOf(Math.max(...away));
  if (away[worst] <= within || depth === 0 || worst < 2 || worst > points.length - 3) return [cubic];
  const along = unit(minus(points[worst - 1], points[worst + 1])) ?? begin;
  return [
    ...fittedPart(points.slice(0, worst + 1), begin, along, within, depth - 1),
    ...fittedPart(points.slice(worst), along.map((value) => -value), end, within, depth - 1),
  ];
}

function lengthsAlong(points) {
  const lengths = points.map(() => 0);
  for (let i = 1; i < points.length; i++) lengths[i] = lengths[i - 1] + distance(points[i], points[i - 1]);
  return lengths.map((length) => length / lengths.at(-1));
}

// The cubic between the first and the last point with handles in these directions.
function leastSquares(points, places, begin, end) {
  const [first, last] = [points[0], points.at(-1)];
  let [aa, ab, bb, ax, bx] = [0, 0, 0, 0, 0];
  points.forEach((point, i) => {
    const t = places[i];
    const [b0, b1, b2, b3] = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t ** 3];
    const [a, b] = [begin.map((value) => b1 * value), end.map((value) => b2 * value)];
    const rest = point.map((value, axis) => value - (b0 + b1) * first[axis] - (b2 + b3) * last[axis]);
    [aa, ab, bb, ax, bx] = [aa + dot(a, a), ab + dot(a, b), bb + dot(b, b), ax + dot(a, rest), bx + dot(b, rest)];
  });
  const determinant = aa * bb - ab * ab;
  const third = distance(first, last) / 3;
  let [alpha, beta] = [(ax * bb - bx * ab) / determinant, (aa * bx - ab * ax) / determinant];
  // Where the numbers say nothing, or turn a handle back: a third of the way.
  if (!(alpha > 1e-3 * third && beta > 1e-3 * third)) [alpha, beta] = [third, third];
  return [first, plus(first, begin, alpha), plus(last, end, beta), last];
}

// One step of Newton's method to the place on a cubic that is nearest to a point.
function nearestPlace(cubic, point, t) {
  const slopes = [1, 2, 3].map((i) => minus(cubic[i], cubic[i - 1]).map((value) => 3 * value));
  const bends = [1, 2].map((i) => minus(slopes[i], slopes[i - 1]).map((value) => 2 * value));
  const [away, slope, bend] = [minus(bezierAt(cubic, t), point), bezierAt(slopes, t), bezierAt(bends, t)];
  const change = dot(away, slope) / (dot(slope, slope) + dot(away, bend));
  return Number.isFinite(change) ? Math.min(Math.max(t - change, 0), 1) : t;
}
