// The sketch that is edited: strokes that are never changed in place, read from and written as a sketch.json.
//
// A stroke is { id, segments, width, color, opacity, closed, fixed, name, kind, importance }, a segment
// { points, weights }; `name`, `kind` and `importance` may be left out; `width` is a number, or a list of numbers for
// each segment where the file has them along strokes (`along`). All is in world units.

// Undone steps that are kept at most.
const STEPS_KEPT = 1000;

function documentOf(data) {
  const counts = data.segments ?? data.points.map(() => 1);
  const along = Array.isArray(data.width[0]);
  let first = 0;
  const strokes = counts.map((count, id) => {
    const rows = Array.from({ length: count }, (_, i) => first + i);
    first += count;
    return {
      id,
      segments: rows.map((row) => ({ points: data.points[row], weights: data.weights[row] })),
      width: along ? rows.map((row) => data.width[row]) : data.width[id],
      color: data.color[id],
      opacity: data.opacity[id],
      closed: data.closed?.[id] ?? false,
      fixed: data.fixed?.[id] ?? false,
      name: data.names?.[id] ?? "",
      kind: data.kinds?.[id] ?? "",
      importance: data.importance?.[id] ?? null,
    };
  });
  return { dtype: data.dtype ?? "float32", width_space: data.width_space, along, strokes, nextId: strokes.length };
}

// The other way round; keys are in the order of the file.
function dataOf({ dtype, width_space, along, strokes }) {
  const segments = strokes.flatMap((stroke) => stroke.segments);
  const plain = strokes.every((stroke) => stroke.segments.length === 1 && !stroke.closed);
  return {
    version: plain && !along ? 1 : 2,
    dtype,
    width_space,
    ...(plain ? {} : { segments: strokes.map((s) => s.segments.length), closed: strokes.map((s) => s.closed) }),
    points: segments.map((segment) => segment.points),
    weights: segments.map((segment) => segment.weights),
    width: along ? strokes.flatMap((stroke) => stroke.width) : strokes.map((stroke) => stroke.width),
    color: strokes.map((stroke) => stroke.color),
    opacity: strokes.map((stroke) => stroke.opacity),
    ...(strokes.some((stroke) => stroke.fixed) ? { fixed: strokes.map((stroke) => stroke.fixed) } : {}),
    ...textsOf(strokes, "names", "name"),
    ...textsOf(strokes, "kinds", "kind"),
    ...importanceOf(strokes),
  };
}

// A text of each stroke, where one has any.
function textsOf(strokes, key, field) {
  return strokes.some((stroke) => stroke[field]) ? { [key]: strokes.map((stroke) => stroke[field] ?? "") } : {};
}

// New strokes are worth as much as the most important one: whoever drew them wants them.
function importanceOf(strokes) {
  const known = strokes.map(({ importance }) => importance ?? null).filter((worth) => worth !== null);
  if (!known.length) return {};
  const most = known.reduce((a, b) => Math.max(a, b));
  return { importance: strokes.map(({ importance }) => importance ?? most) };
}

// The text of a sketch.json, byte for byte as the package writes it.
function textOf(doc) {
  const lines = Object.entries(dataOf(doc)).map(([key, value]) => {
    const whole = key === "version" || key === "segments";
    return `"${key}": ${valueText(value, whole)}`;
  });
  return `{\n${lines.join(",\n")}\n}\n`;
}

function valueText(value, whole) {
  if (Array.isArray(value)) return `[${value.map((item) => valueText(item, whole)).join(", ")}]`;
  return typeof value === "number" && !whole ? numberText(value) : asciiText(JSON.stringify(value));
}

// A text as Python writes it, all but printable ASCII as code units.
function asciiText(text) {
  return text.replace(/[\u007f-\uffff]/g, (unit) => `\\u${unit.charCodeAt(0).toString(16).padStart(4, "0")}`);
}

// A number as Python writes it: both languages take the fewest digits, but put them differently.
function numberText(value) {
  const [digits, exponent] = value.toExponential().split("e");
  if (value !== 0 && (exponent < -4 || exponent >= 16)) {
    return `${digits}e${exponent[0]}${exponent.slice(1).padStart(2, "0")}`;
  }
  const text = Object.is(value, -0) ? "-0" : String(value);
  return text.includes(".") ? text : `${text}.0`;
}

// The document with other strokes. What is new in them has numbers of the file's kind, 16 bits counting as 32.
function withStrokes(doc, strokes) {
  const dtype = doc.dtype === "float64" ? "float64" : "float32";
  const number = dtype === "float64" ? (value) => value : Math.fround;
  const old = new Set(doc.strokes);
  const numbers = (value) => (Array.isArray(value) ? value.map(numbers) : number(value));
  let { nextId } = doc;
  const made = strokes.map((stroke) => {
    if (old.has(stroke)) return stroke;
    return {
      ...stroke,
      id: stroke.id ?? nextId++,
      segments: stroke.segments.map(({ points, weights }) => ({ points: numbers(points), weights: numbers(weights) })),
      width: numbers(stroke.width),
      color: numbers(stroke.color),
    };
  });
  return { ...doc, dtype, strokes: made, nextId };
}

function withStroke(doc, index, stroke) {
  return withStrokes(doc, doc.strokes.map((other, i) => (i === index ? stroke : other)));
}

// How many control points a segment has in this document.
function controlsOf(doc) {
  return doc.strokes[0]?.segments[0].points.length ?? 4;
}

// All strokes as cubics; they look the same.
function asCubics(doc) {
  const more = 4 - controlsOf(doc);
  if (more <= 0) return doc;
  const strokes = doc.strokes.map((stroke) => ({
    ...stroke,
    segments: stroke.segments.map((segment) => elevated(segment, more)),
    width: doc.along ? stroke.width.map((widths) => raised(widths.map((w) => [w]), more).flat()) : stroke.width,
  }));
  return withStrokes(doc, strokes);
}

function elevated({ points, weights }, times) {
  const all = raised(points.map((point, i) => homogeneous(point, weights[i])), times);
  return segmentOf(all, points[0], points.at(-1));
}

// A Bézier curve by its control points, of a degree that is higher by so much.
function raised(controls, times) {
  if (times === 0) return controls;
  const degree = controls.length;
  const next = Array.from({ length: degree + 1 }, (_, i) => {
    if (i === 0) return controls[0];
    return i === degree ? controls.at(-1) : mixed(controls[i], controls[i - 1], i / degree);
  });
  return raised(next, times - 1);
}

function homogeneous(point, weight) {
  return [...point.map((value) => value * weight), weight];
}

// A segment of homogeneous points, which begins and ends at these points without rounding.
function segmentOf(controls, begin, end) {
  return {
    points: [begin, ...controls.slice(1, -1).map(dehomogenized), end],
    weights: controls.map((point) => point[3]),
  };
}

// Undo and redo: states before, now and after.

function historyOf(doc) {
  return { past: [], now: { doc, chosen: [] }, future: [] };
}

// After an edit; one that goes on with the last takes its place.
function edited(history, doc, chosen, goesOn = false) {
  const past = goesOn ? history.past : [...history.past, history.now].slice(-STEPS_KEPT);
  return { past, now: { doc, chosen }, future: [] };
}

function undone({ past, now, future }) {
  return past.length ? { past: past.slice(0, -1), now: past.at(-1), future: [now, ...future] } : null;
}

function redone({ past, now, future }) {
  return future.length ? { past: [...past, now], now: future[0], future: future.slice(1) } : null;
}
