// Handles of the selected strokes: buttons over the drawing that are dragged, or moved by arrow keys where the focus is.

// CSS pixels by which the handle of all strokes stands above their middle, so that it hides none of theirs.
const ABOVE = 26;
// An axis that is seen shorter than this share of its length is looked along: a pointer cannot say how far along it.
const ALONG_SIGHT = 0.05;

const handles = document.getElementById("handles");
const sketching = document.getElementById("sketching");
let listed = [];

// Handles of the strokes chosen, in the order of the keys.
function handlesOf(doc) {
  const all = chosen.length ? [{ kind: "all", name: chosen.length > 1 ? "Move strokes" : "Move stroke" }] : [];
  if (chosen.length !== 1) return all;
  const [stroke] = chosen;
  const { segments, closed } = doc.strokes[stroke];
  const last = segments[0].points.length - 1;
  segments.forEach((_, segment) => {
    for (let control = 0; control < last; control++) {
      if (control === 1) all.push({ kind: "bend", stroke, segment, t: 0.5, name: `Bend segment ${segment}` });
      const kind = control ? "between" : "node";
      const node = segment || closed ? `Joint ${segment}` : "Start";
      all.push({ kind, stroke, segment, control, name: control ? `Control point ${control} of segment ${segment}` : node });
    }
    if (last === 1) all.push({ kind: "bend", stroke, segment, t: 0.5, name: `Bend segment ${segment}` });
  });
  if (!closed) all.push({ kind: "node", stroke, segment: segments.length - 1, control: last, name: "End" });
  return all;
}

// Where a handle is, in the world.
function placeOf(doc, { kind, stroke, segment, control, t }) {
  if (kind === "all") return middleOf(chosen.map((index) => doc.strokes[index]));
  const { points, weights } = doc.strokes[stroke].segments[segment];
  if (kind !== "bend") return points[control];
  return dehomogenized(bezierAt(points.map((point, i) => homogeneous(point, weights[i])), t));
}

function middleOf(strokes) {
  const points = strokes.flatMap((stroke) => stroke.segments.flatMap((segment) => segment.points));
  return [0, 1, 2].map((axis) => {
    const [low, high] = points.reduce(([l, h], point) => [Math.min(l, point[axis]), Math.max(h, point[axis])], [Infinity, -Infinity]);
    return (low + high) / 2;
  });
}

// A document with a handle moved.
function movedHandle(doc, handle, delta) {
  if (handle.kind === "all") return withStrokesMoved(doc, chosen, delta);
  return handle.kind === "bend" ? bent(doc, handle, delta) : withPointMoved(doc, handle, delta);
}

// Makes a button for each handle; those that stay keep the focus.
function listHandles() {
  listed = drawing ? handlesOf(shownDoc) : [];
  while (handles.children.length > listed.length) handles.lastChild.remove();
  while (handles.children.length < listed.length) {
    const button = document.createElement("button");
    button.addEventListener("pointerdown", handlePressed);
    handles.append(button);
  }
  listed.forEach(({ kind, name }, i) => {
    handles.children[i].dataset.kind = kind;
    handles.children[i].setAttribute("aria-label", name);
  });
  placeHandles();
}

function placeHandles() {
  const axes = axesOf(camera);
  const [near] = depthsOf(camera);
  const places = listed.map((handle) => onScreen(placeOf(shownDoc, handle), axes));
  places.forEach((place, i) => {
    const { style } = handles.children[i];
    style.visibility = place.depth > near ? "visible" : "hidden";
    style.left = `${place.x}px`;
    style.top = `${place.y - (listed[i].kind === "all" ? ABOVE : 0)}px`;
  });
  if (drag?.line) return;
  const lines = listed.flatMap(({ kind, control, segment, stroke }) => {
    if (kind !== "between") return [];
    const { points } = shownDoc.strokes[stroke].segments[segment];
    const nodes = points.length === 3 ? [0, 2] : [control === 1 ? 0 : 3];
    return nodes.map((node) => [points[control], points[node]].map((point) => onScreen(point, axes)));
  });
  sketching.replaceChildren(...lines.map((line) => svgElement("polyline", { points: line.map(({ x, y }) => `${x},${y}`).join(" ") })));
}

function svgElement(tag, attributes) {
  const element = document.createElementNS(sketching.namespaceURI, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

// A point of the world in CSS pixels of the drawing, with its depth and the pixels of the canvas that a unit takes.
function onScreen(point, axes = axesOf(camera)) {
  const found = projected(camera, axes, size(), toView(point));
  return { ...found, x: found.x / pixelRatio(), y: found.y / pixelRatio() };
}

// Places of the world are seen moved and scaled to a ball of radius 1.
function toView(point) {
  return point.map((value, i) => (value - start.middle[i]) / start.radius);
}

function toWorld(point) {
  return point.map((value, i) => value * start.radius + start.middle[i]);
}

// How far in the world so many CSS pixels are at a place, in the plane of the view or along an axis.
function worldDelta(place, right, down, axis) {
  const axes = axesOf(camera);
  const here = onScreen(place, axes);
  const unitPixels = here.scale / pixelRatio();
  if (axis === null) {
    return axes.right.map((value, i) => ((value * right - axes.up[i] * down) * start.radius) / unitPixels);
  }
  // The slope, of a step that is small against the distance.
  const step = 1e-4;
  const there = onScreen(place.map((value, i) => value + (i === axis ? step * start.radius : 0)), axes);
  const [x, y] = [(there.x - here.x) / step, (there.y - here.y) / step];
  const seen = Math.hypot(x, y);
  const far = seen > ALONG_SIGHT * unitPixels ? (right * x + down * y) / seen ** 2 : 0;
  return [0, 1, 2].map((i) => (i === axis ? far * start.radius : 0));
}

function activeHandle() {
  const index = [...handles.children].indexOf(document.activeElement);
  return index < 0 ? null : listed[index];
}

function focusHandle(step) {
  if (!listed.length) return;
  const index = [...handles.children].indexOf(document.activeElement);
  const next = index < 0 ? (step > 0 ? 0 : listed.length - 1) : (index + step + listed.length) % listed.length;
  handles.children[next].focus();
}
