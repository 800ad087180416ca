// The page: what mouse, touch, keys and the list of strokes do to the camera and the strokes.

const GROUNDS = { light: [1, 1, 1], dark: [0x15 / 255, 0x17 / 255, 0x1b / 255] };
const ACCENTS = { light: [0x0a / 255, 0x6c / 255, 0xd6 / 255], dark: [0x62 / 255, 0xae / 255, 1] };
// Around a selected stroke, CSS pixels; how far from a stroke a click may be; degrees a key and a pixel; zoom a step.
const [HALO, NEARBY, KEY_TURN, DRAG_TURN, ZOOM] = [3, 6, 5, 0.4, 1.15];
// Milliseconds that a frame may take while the view moves, and when it stands still; pictures drawn in one at most.
const [MOVING, STILL, MOST] = [30, 120, 16];
// Chords are made for this many times more zoom than there is, and anew once there is that much more or less.
const SPARE = 1.5;

const canvas = document.getElementById("view");
let start = JSON.parse(document.getElementById("start").textContent);
let sketch = readSketch(JSON.parse(document.getElementById("sketch").textContent), start);
const root = document.documentElement;
// What else is drawn whenever the view is: called with the pictures from..to that are added, and the scene.
const painters = [];
// Indices of the strokes that are selected, the last of which is `selected`.
let chosen = [];
let [drawing, camera, selected, samples, drawn, madeFor, lastFrame, due] = [null, null, null, 0, 0, null, 0, false];
// The distance at which the sketch fills the canvas; 0 once somebody has looked from elsewhere.
let fitted = 0;

function pixelRatio() {
  return Math.min(window.devicePixelRatio || 1, 3);
}

function size() {
  return [canvas.width, canvas.height];
}

function ground() {
  return root.classList.contains("dark") ? "dark" : "light";
}

// What is about as dark as a dark ground is drawn light there: lightness turned over, hue kept.
function inkOf(stroke) {
  const { color, opacity } = stroke;
  const turn = 1 - Math.max(...color) - Math.min(...color);
  const visible = ground() === "light" || 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2] > 0.25;
  return [...(visible ? color : color.map((value) => value + turn)), isDrawn(stroke) ? opacity : 0];
}

function refreshInks() {
  drawing.setInks(inksOf(sketch, surface));
  refresh();
}

function refreshChords() {
  const zoom = { camera, scale: size()[1] / camera.distance };
  const ratio = madeFor ? zoom.scale / madeFor.scale : 0;
  const moved = madeFor ? distance(camera.target, madeFor.camera.target) > 0.2 * camera.distance : true;
  const lens = camera.orthographic === madeFor?.camera.orthographic;
  const isFit = !moved && ratio < SPARE && ratio > 1 / SPARE ** 2 && lens;
  if (isFit && sketch.chords) return;
  if (!isFit) madeFor = zoom;
  sketch.chords = chordsFor(sketch);
  drawing.setChords(sketch.chords);
}

// The chords of a sketch for the zoom that all chords are made for.
function chordsFor(some) {
  const made = madeFor.camera;
  const pixels = (middle, radius) => SPARE * pixelsAtMost(made, size()[1], middle, radius + 0.2 * made.distance);
  return chordsOf(some, madeFor, pixels, size()[1]);
}

// Draws the view anew, more finely with every frame until nothing changes any more.
function refresh() {
  samples = 0;
  canvas.removeAttribute("data-settled");
  if (!due) {
    due = true;
    requestAnimationFrame(drawFrame);
  }
}

function drawFrame(now) {
  due = false;
  const each = lastFrame ? (now - lastFrame) / drawn : MOVING / 4;
  drawn = Math.min(Math.max(Math.floor((samples ? STILL : MOVING) / each), 1), MOST, SAMPLES - samples);
  refreshChords();
  const accent = ACCENTS[ground()];
  const scene = {
    camera, chosen, accent, world: sketch.world, ground: GROUNDS[ground()], haloPixels: HALO * pixelRatio(),
    hidden: HIDDEN.indexOf(hidden),
  };
  if (samples === 0) setSurfaceView(drawing, sketch, surface, scene);
  drawing.show(samples, samples + drawn, scene);
  painters.forEach((paint) => paint(samples, samples + drawn, scene));
  samples += drawn;
  if (samples < SAMPLES) {
    due = true;
    lastFrame = now;
    requestAnimationFrame(drawFrame);
  } else {
    lastFrame = 0;
    canvas.dataset.settled = "true";
  }
}

// Another sketch in place of this one, seen from where one looks.
function showSketch(data, begun, bare) {
  if (sketch.strokes.length) camera = sameView(camera, start, begun);
  else if (camera) camera = startAgain(begun);
  start = begun;
  openSurface(start, bare);
  sketch = readSketch(data, start);
  chosen = chosen.filter((index) => index < sketch.strokes.length);
  selected = chosen.at(-1) ?? null;
  madeFor = null;
  listStrokes();
  openSketch(data);
  if (drawing) {
    drawing.setSurface(surface);
    refreshInks();
  }
}

// As at first, but for the lens, and for what edits have drawn farther out.
function startAgain(begun) {
  const first = startCamera(begun, size());
  return { ...first, orthographic: camera.orthographic, reach: Math.max(first.reach, camera.reach) };
}

function fitCanvas() {
  const box = canvas.getBoundingClientRect();
  canvas.width = Math.max(Math.round(box.width * pixelRatio()), 1);
  canvas.height = Math.max(Math.round(box.height * pixelRatio()), 1);
  const begun = startCamera(start, size());
  if (!camera) camera = begun;
  // A frame may get its size after its page: until then nobody has seen what fills it.
  else camera = { ...camera, near: begun.near, distance: camera.distance * (fitted ? begun.distance / fitted : 1) };
  if (fitted || camera === begun) fitted = begun.distance;
  refresh();
}

function look(changed) {
  [camera, fitted] = [changed, 0];
  root.querySelector('[data-key="o"]').setAttribute("aria-pressed", camera.orthographic);
  refresh();
  clearTimeout(look.later);
  look.later = setTimeout(() => {
    const lens = camera.orthographic ? ", orthographic" : "";
    say(`Seen from azimuth ${Math.round(camera.azimuth)}°, elevation ${Math.round(camera.elevation)}°${lens}`);
  }, 400);
}

function say(text) {
  document.getElementById("said").textContent = text;
}

// Strokes

function nameOf(index) {
  const { segments, closed } = sketch.strokes[index];
  const kept = sketch.strokes[index].fixed ? ", fixed" : "";
  const parts = segments.length > 1 ? `, ${segments.length} segments` : "";
  return `Stroke ${index}${parts}${closed ? ", closed" : ""}${kept}`;
}

function listStrokes() {
  const list = document.getElementById("strokes");
  const count = sketch.strokes.length;
  const drawn = sketch.strokes.filter(isAtLevel).length;
  document.getElementById("count").textContent = `Strokes (${drawn < count ? `${drawn} of ` : ""}${count})`;
  offerDetail(sketch);
  while (list.children.length > count) list.lastChild.remove();
  while (list.children.length < count) list.append(listItem(list.children.length));
  sketch.strokes.forEach((stroke, index) => {
    const [box, button, color] = list.children[index].children;
    const isChosen = String(chosen.includes(index));
    list.children[index].classList.toggle("out", !isAtLevel(stroke));
    if (button.getAttribute("aria-pressed") !== isChosen) button.setAttribute("aria-pressed", isChosen);
    // Nothing else of a stroke changes: another one takes its place.
    if (stroke.button === button) return;
    button.textContent = nameOf(index);
    box.checked = stroke.shown;
    color.value = hexOf(stroke.color);
    Object.assign(stroke, { button, box });
  });
}

function listItem(index) {
  const [item, button, color, shown] = ["li", "button", "input", "input"].map((tag) => document.createElement(tag));
  button.addEventListener("click", (event) => {
    const more = isMore(event);
    select(selected === index && !more ? null : index, more);
  });
  color.type = "color";
  color.setAttribute("aria-label", `Colour of stroke ${index}`);
  color.addEventListener("input", () => recolor([index], rgbOf(color.value)));
  Object.assign(shown, { type: "checkbox", checked: true });
  shown.setAttribute("aria-label", `Show stroke ${index}`);
  shown.addEventListener("change", () => setShown(index, shown.checked));
  item.append(shown, button, color);
  return item;
}

function hexOf(color) {
  return `#${color.map((value) => Math.round(value * 255).toString(16).padStart(2, "0")).join("")}`;
}

function rgbOf(hex) {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
}

// Whether a click or a key adds to the strokes that are chosen.
function isMore(event) {
  return event.shiftKey || event.ctrlKey || event.metaKey;
}

function select(index, more = false) {
  if (!more || index === null) choose(index === null ? [] : [index]);
  else choose(chosen.includes(index) ? chosen.filter((other) => other !== index) : [...chosen, index]);
}

function choose(indices) {
  chosen = indices.filter((index) => index < sketch.strokes.length);
  selected = chosen.at(-1) ?? null;
  sketch.strokes.forEach(({ button }, index) => button.setAttribute("aria-pressed", chosen.includes(index)));
  if (selected !== null) sketch.strokes[selected].button.scrollIntoView({ block: "nearest" });
  const names = chosen.length > 3 ? `${chosen.length} strokes` : chosen.map(nameOf).join("; ");
  say(chosen.length ? `${names} selected` : "No stroke selected");
  showChosen();
  refresh();
}

function setShown(index, shown) {
  Object.assign(sketch.strokes[index], { shown });
  sketch.strokes[index].box.checked = shown;
  say(`${nameOf(index)} ${shown ? "shown" : "hidden"}`);
  refreshInks();
}

// The depth behind which strokes are hidden at a place of the canvas: that of the surface, and what lies on it.
function depthBehind(x, y) {
  const [hit] = surfaceUnder(surface, camera, size(), [[x, y]]);
  if (!hit) return Infinity;
  const { along } = rayAt(camera, axesOf(camera), size(), x, y);
  const slack = surface.near + NEARBY * pixelRatio() / projected(camera, axesOf(camera), size(), hit.place).scale;
  return hit.depth + slack / Math.max(Math.abs(dot(hit.normal ?? along, along)) / Math.hypot(...along), ALONG_SIGHT);
}

// The shown stroke under a place of the canvas, in its pixels: of those that reach it the nearest to the eye.
function strokeAt(x, y) {
  refreshChords();
  const axes = axesOf(camera);
  const [near] = depthsOf(camera);
  const { values } = sketch.chords;
  let [found, best] = [null, hidden === "drop" && surface ? depthBehind(x, y) : Infinity];
  for (let i = 0; i < values.length; i += CHORD) {
    const stroke = values[i + 8];
    const [a, b] = [0, 3].map((j) => projected(camera, axes, size(), Array.from(values.subarray(i + j, i + j + 3))));
    if (!isDrawn(sketch.strokes[stroke]) || Math.min(a.depth, b.depth) <= near) continue;
    const place = placeOn([x, y], [a.x, a.y], [b.x, b.y]);
    const away = distance([x, y], mixed([a.x, a.y], [b.x, b.y], place));
    const half = (values[i + 6] + place * (values[i + 7] - values[i + 6])) * (sketch.world ? a.scale : size()[1]);
    const depth = a.depth + place * (b.depth - a.depth);
    if (away <= half + NEARBY * pixelRatio() && depth <= best) [found, best] = [stroke, depth];
  }
  return found;
}

// Mouse and touch

const fingers = new Map();
let travelled = 0;

function middleAndSpread() {
  const all = [...fingers.values()];
  const middle = ["x", "y"].map((axis) => all.reduce((sum, finger) => sum + finger[axis], 0) / all.length);
  return { middle, spread: all.length > 1 ? Math.hypot(all[0].x - all[1].x, all[0].y - all[1].y) : 0 };
}

function pressed(event) {
  if (editPressed(event)) return;
  canvas.setPointerCapture(event.pointerId);
  if (!fingers.size) travelled = 0;
  fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
}

function moved(event) {
  if (!fingers.has(event.pointerId)) return;
  const before = middleAndSpread();
  fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  const after = middleAndSpread();
  const [right, down] = after.middle.map((value, axis) => value - before.middle[axis]);
  travelled += Math.hypot(right, down) + Math.abs(after.spread - before.spread);
  if (fingers.size === 1 && !event.shiftKey && !(event.buttons & 6)) {
    look(turned(camera, -DRAG_TURN * right, DRAG_TURN * down));
    return;
  }
  const shifted = panned(camera, right * pixelRatio(), down * pixelRatio(), size()[1]);
  look(before.spread > 0 && after.spread > 0 ? zoomed(shifted, after.spread / before.spread) : shifted);
}

function released(event) {
  if (!fingers.delete(event.pointerId) || fingers.size || travelled > NEARBY || event.type !== "pointerup") return;
  const box = canvas.getBoundingClientRect();
  select(strokeAt((event.clientX - box.left) * pixelRatio(), (event.clientY - box.top) * pixelRatio()), isMore(event));
}

// Keys

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const VIEWS = { f: [0, 0], s: [-90, 0], t: [-90, 90] };

// What a key does, or a button that stands for it; whether it does anything.
function act(key, shift) {
  if (key in STEPS) {
    const [right, down] = STEPS[key].map((step) => step * (shift ? 0.04 * size()[1] : KEY_TURN));
    look(shift ? panned(camera, right, down, size()[1]) : turned(camera, -right, down));
  } else if (key in VIEWS) look({ ...camera, azimuth: VIEWS[key][0], elevation: VIEWS[key][1] });
  else if (key === "+" || key === "=") look(zoomed(camera, ZOOM));
  else if (key === "-") look(zoomed(camera, 1 / ZOOM));
  else if (key === "0") look(startAgain(start));
  else if (key === "o") look({ ...camera, orthographic: !camera.orthographic });
  else if (key === "d") turnGround();
  else if ("vV".includes(key) && hasSurface()) hideOtherwise(key === "V" ? -1 : 1);
  else if (key === "w" && hasSurface()) turnContours();
  else if ("npNP".includes(key)) selectNext(key.toLowerCase() === "n" ? 1 : -1, shift);
  else if (key === "h" && selected !== null) {
    const shown = !sketch.strokes[selected].shown;
    chosen.forEach((index) => setShown(index, shown));
  }
  else if (key === "Escape") select(null);
  else return false;
  return true;
}

function turnGround() {
  root.querySelector('[data-key="d"]').setAttribute("aria-pressed", root.classList.toggle("dark"));
  refreshInks();
}

function selectNext(step, more) {
  const count = sketch.strokes.length;
  if (!count) return;
  const next = selected === null ? (step > 0 ? 0 : count - 1) : (selected + step + count) % count;
  choose(more ? [...chosen.filter((index) => index !== next), next] : [next]);
}

function keyed(event) {
  if (editKeyed(event)) {
    event.preventDefault();
    return;
  }
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, summary")) return;
  if (act(event.key, event.shiftKey)) event.preventDefault();
}

function begin() {
  drawing = makeDrawing(canvas);
  if (!drawing) {
    const fault = document.getElementById("fault");
    fault.textContent = "This browser has no WebGL 2 to draw with: turn on its hardware acceleration, or try another.";
    fault.hidden = false;
    return;
  }
  drawing.setSurface(surface);
  madeFor = null;
  fitCanvas();
  refreshInks();
}

openSurface(start);
listStrokes();
begin();
if (drawing) {
  new ResizeObserver(fitCanvas).observe(canvas);
  canvas.addEventListener("pointerdown", pressed);
  canvas.addEventListener("pointermove", moved);
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, released);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", begin);
  const onWheel = (event) => {
    event.preventDefault();
    look(zoomed(camera, Math.exp(-Math.min(Math.max(event.deltaY, -200), 200) / 500)));
  };
  canvas.addEventListener("wheel", onWheel, { passive: false });
  document.addEventListener("keydown", keyed);
  document.getElementById("views").addEventListener("click", (event) => act(event.target.dataset.key, false));
  document.getElementById("all").addEventListener("click", () => {
    sketch.strokes.forEach((stroke) => (Object.assign(stroke, { shown: true }).box.checked = true));
    refreshInks();
  });
}
