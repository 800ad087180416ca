// Editing: what keys, buttons and drags do to the document that the page shows.

// Of the sketch's radius, how far a key moves a point, and with shift; times wider.
const [NUDGE, NUDGE_FAR, WIDER] = [0.01, 0.05, 1.15];
// CSS pixels that points of a line that is drawn lie from each other.
const LINE_STEP = 2;

const KEYS = {
  a: "draw", b: "box", c: "duplicate", e: "extrude", j: "join", k: "split", l: "fix", m: "mirror", u: "smooth",
  x: "x", y: "y", z: "z", "[": "thinner", "]": "thicker", Delete: "remove", Backspace: "remove", "?": "help",
};
const CONTROL_KEYS = { z: "undo", Z: "redo", y: "redo", s: "save", a: "all", d: "duplicate" };

let edits = historyOf(documentOf(JSON.parse(document.getElementById("sketch").textContent)));
let shownDoc = edits.now.doc;
let savedDoc = edits.now.doc;
let [axis, tool, drag, lastEdit] = [null, null, null, ""];

// Another sketch to edit, which is what the file has.
function openSketch(data) {
  edits = historyOf(documentOf(data));
  [shownDoc, savedDoc, drag, lastEdit] = [edits.now.doc, edits.now.doc, null, ""];
  showState();
}

function isUnsaved() {
  return edits.now.doc !== savedDoc;
}

// Shows a document; what was hidden of it stays so. Strokes that are the same ones are not read again.
function showDoc(doc, indices) {
  const shown = new Map(shownDoc.strokes.map(({ id }, i) => [id, sketch.strokes[i].shown]));
  const known = new Map(shownDoc.strokes.map((stroke, i) => [stroke, sketch.strokes[i]]));
  const others = doc.strokes.filter((stroke) => !known.has(stroke));
  const read = readSketch(dataOf({ ...doc, strokes: others }), start);
  read.strokes.forEach((stroke, i) => {
    stroke.shown = shown.get(others[i].id) ?? true;
    known.set(others[i], stroke);
  });
  shownDoc = doc;
  sketch = { ...read, strokes: doc.strokes.map((stroke) => known.get(stroke)) };
  setLevels(sketch.strokes);
  camera = { ...camera, reach: sketch.strokes.reduce((most, { reach }) => Math.max(most, reach), reachOf(start)) };
  chosen = indices.filter((index) => index < doc.strokes.length);
  selected = chosen.at(-1) ?? null;
  listStrokes();
  refreshInks();
  showState();
}

// One edit: it can be undone. One of the same name as the last goes on with it.
function commit(doc, indices, text, name = "") {
  edits = edited(edits, doc, indices, name !== "" && name === lastEdit);
  lastEdit = name;
  showDoc(doc, indices);
  say(text);
  keepSoon();
}

// An edit of all that is selected, or a sentence where it cannot be.
function attempt(made, text, refusal) {
  if (made) commit(made.doc ?? made, made.chosen ?? chosen, text);
  else say(refusal);
}

function goTo(other, text) {
  if (!other) return say(`Nothing to ${text.toLowerCase()}`);
  edits = other;
  lastEdit = "";
  showDoc(edits.now.doc, edits.now.chosen);
  say(`${text}: ${edits.now.doc.strokes.length} strokes`);
  return keepSoon();
}

function showState() {
  const save = document.querySelector('[data-edit="save"]');
  save.textContent = isUnsaved() ? "Save •" : "Save";
  save.setAttribute("aria-label", isUnsaved() ? "Save, there are unsaved edits" : "Save");
  document.querySelector('[data-edit="undo"]').disabled = !edits.past.length;
  document.querySelector('[data-edit="redo"]').disabled = !edits.future.length;
  showChosen();
}

function showChosen() {
  const stroke = selected === null ? null : shownDoc.strokes[selected];
  const [width, ink] = ["width", "ink"].map((id) => document.getElementById(id));
  width.disabled = ink.disabled = !stroke;
  if (stroke && document.activeElement !== width) width.value = Number(widestOf(stroke).toPrecision(4));
  if (stroke && document.activeElement !== ink) ink.value = hexOf(sketch.strokes[selected].color);
  listHandles();
}

// Looks

function changeChosen(change, indices = chosen) {
  const doc = edits.now.doc;
  return withStrokes(doc, doc.strokes.map((stroke, i) => (indices.includes(i) ? change(stroke) : stroke)));
}

function recolor(indices, color) {
  commit(changeChosen((stroke) => ({ ...stroke, color }), indices), chosen, "Colour changed", `colour ${indices}`);
}

function scaleWidths(factor) {
  const scaled = (width) => (Array.isArray(width) ? width.map(scaled) : width * factor);
  attempt(chosen.length ? changeChosen((stroke) => ({ ...stroke, width: scaled(stroke.width) })) : null,
    factor > 1 ? "Wider" : "Thinner", "Select a stroke first");
}

function setWidth(value) {
  const width = Number(value);
  if (!chosen.length || value === "" || !(width >= 0 && width <= 3e38)) return say("A width is a number, at least 0");
  const { doc } = edits.now;
  return commit(changeChosen((stroke) => ({ ...stroke, width: widthsOf(doc, stroke.segments, width) })), chosen, "Width changed");
}

function fixChosen() {
  const fixed = !chosen.every((index) => edits.now.doc.strokes[index].fixed);
  attempt(chosen.length ? changeChosen((stroke) => ({ ...stroke, fixed })) : null,
    fixed ? "Marked as fixed" : "No longer fixed", "Select a stroke first");
}

// Commands, by keys and buttons

function command(name) {
  const { doc } = edits.now;
  const first = "Select a stroke first";
  const commands = {
    undo: () => goTo(undone(edits), "Undo"),
    redo: () => goTo(redone(edits), "Redo"),
    save: () => save(),
    all: () => choose(doc.strokes.map((_, i) => i)),
    draw: () => takeTool("draw"),
    box: () => takeTool("box"),
    remove: () => attempt(without(doc, chosen), "Deleted", first),
    duplicate: () => attempt(duplicated(doc, chosen, besides()), "Duplicated", first),
    mirror: () => attempt(mirrored(doc, chosen, axis ?? 0, mirrorPlace(doc, axis ?? 0)), `Mirrored across ${"xyz"[axis ?? 0]}`, first),
    join: () => attempt(joinedStrokes(doc, chosen), "Joined", "Select open strokes to join, or one to close"),
    split: () => attempt(selected === null ? null : cutAt(doc, cutPlace(doc)), "Split", "Select a stroke, and a point between its ends"),
    smooth: () => attempt(smoothed(doc, chosen), "Smoothed", "There is no corner in what is selected"),
    extrude: () => extrude(doc),
    fix: fixChosen,
    thinner: () => scaleWidths(1 / WIDER),
    thicker: () => scaleWidths(WIDER),
    help: () => {
      document.getElementById("editing").open = true;
      document.getElementById("help").toggleAttribute("hidden");
    },
  };
  if ("xyz".includes(name)) takeAxis("xyz".indexOf(name));
  else commands[name]();
}

function takeAxis(index) {
  axis = axis === index ? null : index;
  [..."xyz"].forEach((name, i) => document.querySelector(`[data-edit="${name}"]`).setAttribute("aria-pressed", axis === i));
  say(axis === null ? "Points move in the plane of the view" : `Points move along ${"xyz"[axis]}`);
}

function takeTool(name) {
  tool = tool === name ? null : name;
  for (const each of ["draw", "box"]) {
    document.querySelector(`[data-edit="${each}"]`).setAttribute("aria-pressed", tool === each);
  }
  const texts = { draw: "Draw a stroke, or press Enter for a straight one", box: "Drag a box around strokes" };
  say(texts[tool] ?? "The tool is put down");
}

// To the right and down in the view, for copies not to hide what they were made from.
function besides() {
  const { right, up } = axesOf(camera);
  return right.map((value, i) => NUDGE_FAR * start.radius * (value - up[i]));
}

// Where a stroke is cut: at the handle that has the focus, else in its middle.
function cutPlace(doc) {
  const { segments, closed } = doc.strokes[selected];
  const handle = activeHandle();
  if (handle?.kind === "bend") return handle;
  if (handle?.kind === "node") return { stroke: selected, segment: handle.segment, t: handle.control === 0 ? 0 : 1 };
  if (closed) return { stroke: selected, segment: 0, t: 0 };
  const middle = segments.length / 2;
  return { stroke: selected, segment: Math.floor(middle), t: middle % 1 };
}

function extrude(doc) {
  const handle = activeHandle();
  const stroke = selected === null ? null : doc.strokes[selected];
  if (!stroke || stroke.closed) return say("Select an open stroke first");
  const atEnd = !(handle?.kind === "node" && handle.segment === 0 && handle.control === 0);
  const { points } = atEnd ? stroke.segments.at(-1) : stroke.segments[0];
  const [end, before] = atEnd ? [points.at(-1), points.at(-2)] : [points[0], points[1]];
  const along = unit(minus(end, before)) ?? axesOf(camera).right;
  const delta = along.map((value) => value * 2 * NUDGE_FAR * start.radius);
  commit(extruded(doc, selected, atEnd, delta), chosen, "Extruded");
  const name = atEnd ? "End" : "Start";
  return handles.children[listed.findIndex((other) => other.name === name)].focus();
}

// Keys

// Whether a key edits.
function editKeyed(event) {
  if (!drawing || event.altKey || event.target.closest("input, select, dialog")) return false;
  const name = event.ctrlKey || event.metaKey ? CONTROL_KEYS[event.key] : KEYS[event.key];
  if (name) command(event.shiftKey && name === "undo" ? "redo" : name);
  else if (event.ctrlKey || event.metaKey) return false;
  else if (event.key === "." || event.key === ",") focusHandle(event.key === "." ? 1 : -1);
  else if (event.key === "Enter" && tool === "draw" && !event.target.closest("button")) drawStraight();
  else if (event.key === "Escape") return escape();
  else if (event.key in STEPS && activeHandle()) nudge(activeHandle(), event);
  else return false;
  return true;
}

function escape() {
  if (drag) {
    drag = null;
    showDoc(edits.now.doc, chosen);
  } else if (tool) takeTool(tool);
  else if (activeHandle()) canvas.focus();
  else return false;
  return true;
}

function nudge(handle, event) {
  const [right, down] = STEPS[event.key];
  const far = (event.shiftKey ? NUDGE_FAR : NUDGE) * start.radius;
  const axes = axesOf(camera);
  const delta = [0, 1, 2].map((i) => far * (axis === null ? right * axes.right[i] - down * axes.up[i] : i === axis ? right - down : 0));
  commit(movedHandle(edits.now.doc, handle, delta), chosen, `${handle.name} moved`, event.repeat ? lastEdit : `nudge ${performance.now()}`);
}

// Pointers

function placeIn(event) {
  const box = canvas.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

// Whether a press on the drawing begins an edit: a line or a box of a tool, or bending the stroke that is selected.
function editPressed(event) {
  if (drag) return true;
  if (!drawing || fingers.size || event.button !== 0 || event.shiftKey) return false;
  const [x, y] = placeIn(event);
  if (tool) drag = { pointer: event.pointerId, tool, line: [[x, y]] };
  else {
    if (chosen.length !== 1 || strokeAt(x * pixelRatio(), y * pixelRatio()) !== selected) return false;
    beginDrag(event, nearestOf(selected, [x, y]));
  }
  canvas.setPointerCapture(event.pointerId);
  return true;
}

// Where on a stroke the place nearest to a pixel is.
function nearestOf(stroke, pixel) {
  let best = { away: Infinity };
  edits.now.doc.strokes[stroke].segments.forEach((_, segment) => {
    for (let i = 0; i <= 64; i++) {
      const handle = { kind: "bend", name: "Stroke", stroke, segment, t: i / 64 };
      const { x, y } = onScreen(placeOf(edits.now.doc, handle));
      const away = distance([x, y], pixel);
      if (away < best.away) best = { away, handle };
    }
  });
  return best.handle;
}

function beginDrag(event, handle) {
  drag = { pointer: event.pointerId, handle, from: [event.clientX, event.clientY], place: placeOf(edits.now.doc, handle), made: null };
}

function handlePressed(event) {
  if (event.button !== 0 || drag) return;
  event.preventDefault();
  event.currentTarget.focus({ preventScroll: true });
  event.currentTarget.setPointerCapture(event.pointerId);
  beginDrag(event, listed[[...handles.children].indexOf(event.currentTarget)]);
}

function dragged(event) {
  if (drag?.pointer !== event.pointerId) return;
  if (drag.line) {
    const place = placeIn(event);
    if (distance(place, drag.line.at(-1)) < LINE_STEP) return;
    drag.line = drag.tool === "box" ? [drag.line[0], place] : [...drag.line, place];
    showLine(drag);
    return;
  }
  const [right, down] = [event.clientX - drag.from[0], event.clientY - drag.from[1]];
  // A press that hardly moves on a stroke is a click.
  if (!drag.made && drag.handle.name === "Stroke" && Math.hypot(right, down) < NEARBY) return;
  drag.made = movedHandle(edits.now.doc, drag.handle, worldDelta(drag.place, right, down, axis));
  showDoc(drag.made, chosen);
}

function dropped(event) {
  if (drag?.pointer !== event.pointerId) return;
  const { made, line, handle, tool: used } = drag;
  drag = null;
  if (event.type === "pointercancel") showDoc(edits.now.doc, chosen);
  else if (used === "box") boxed(line);
  else if (line) drawnLine(line);
  else if (made) commit(made, chosen, `${handle.name} moved`);
  if (line) placeHandles();
}

function showLine({ tool: used, line }) {
  const [[x, y], [u, v]] = [line[0], line.at(-1)];
  const box = { x: Math.min(x, u), y: Math.min(y, v), width: Math.abs(u - x), height: Math.abs(v - y) };
  sketching.replaceChildren(used === "box" ? svgElement("rect", box) : svgElement("polyline", { points: line.join(" ") }));
}

function boxed([from, to = from]) {
  takeTool("box");
  refreshChords();
  const { values } = sketch.chords;
  const axes = axesOf(camera);
  const [low, high] = [0, 1].map((i) => (i ? Math.max : Math.min)).map((pick) => [0, 1].map((i) => pick(from[i], to[i]) * pixelRatio()));
  const found = new Set();
  for (let i = 0; i < values.length; i += CHORD) {
    for (const end of [i, i + 3]) {
      const { x, y, depth } = projected(camera, axes, size(), Array.from(values.subarray(end, end + 3)));
      const inside = x >= low[0] && x <= high[0] && y >= low[1] && y <= high[1] && depth > 0;
      if (inside && isDrawn(sketch.strokes[values[i + 8]])) found.add(values[i + 8]);
    }
  }
  choose([...found].sort((a, b) => a - b));
}

document.getElementById("editing").addEventListener("click", (event) => {
  const name = event.target.dataset.edit;
  if (name && drawing) command(name);
});
document.getElementById("width").addEventListener("change", (event) => setWidth(event.target.value));
document.getElementById("ink").addEventListener("input", (event) => recolor(chosen, rgbOf(event.target.value)));
for (const place of [canvas, handles]) {
  place.addEventListener("pointermove", dragged);
  for (const name of ["pointerup", "pointercancel"]) place.addEventListener(name, dropped);
}
painters.push((from) => from === 0 && placeHandles());
showState();
