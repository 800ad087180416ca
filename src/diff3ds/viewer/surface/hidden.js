// Lines that a surface hides, on the page: what becomes of them, by key and list, and the surface's contours.

// As `render --hidden` names them, in the order of the numbers that the shader knows.
const HIDDEN = ["show", "faint", "dashed", "drop"];
const CONTOUR_COLOR = [0, 0, 0];

let surface = null;
let [hidden, contoured] = ["drop", true];

// The surface of the page, read for a sketch's place and size, with the creases that another sketch than the page's
// leaves bare.
function openSurface(begun, bare = {}) {
  const data = JSON.parse(document.getElementById("surface").textContent);
  surface = readSurface(data && { ...data, ...bare }, begun);
  if (surface) document.getElementById("hiding").hidden = false;
  Object.assign(document.querySelector('#plane [value="surface"]'), { hidden: !surface, disabled: !surface });
}

function hasSurface() {
  return !document.getElementById("hiding").hidden;
}

// One for each stroke of a sketch, and one for the contours of its surface, which are drawn in place of those that were
// fitted for all sides.
function inksOf(some, solid) {
  const drawn = contoured && solid;
  const strokes = some.strokes.map((stroke) => (drawn && stroke.kind === "contour" ? { ...stroke, shown: false } : stroke));
  return [...strokes, { color: CONTOUR_COLOR, opacity: 1, shown: contoured, level: -1 }].map(inkOf);
}

// Full width of the contours in the unit of the strokes: the middle one of theirs.
function contourWidth(some) {
  const widths = some.strokes.flatMap((stroke) => stroke.widths.flat()).sort((a, b) => a - b);
  return widths.length ? widths[(widths.length - 1) >> 1] : 0.006;
}

// What a drawing must know of a surface in the view of the scene, before it draws that.
function setSurfaceView(on, some, solid, scene) {
  if (!solid) return;
  const { camera } = scene;
  const width = contourWidth(some);
  const made = contoursOf(solid, camera, width / 2, some.strokes.length);
  const isDashed = scene.hidden === HIDDEN.indexOf("dashed");
  const before = (chords) => (isDashed ? lengthsBefore(chords, camera, size()) : null);
  const pixels = some.world ? focalOf(camera, size()[1]) / (camera.orthographic ? 1 : camera.distance) : size()[1];
  on.setView(camera, { ...made, before: before(made) }, before(some.chords), GAP * size()[1] + width * pixels);
}

function hideAs(name) {
  hidden = name;
  const list = document.getElementById("hidden");
  list.value = name;
  say(`Hidden lines ${list.selectedOptions[0].textContent}`);
  refresh();
}

function hideOtherwise(step) {
  const names = [...document.getElementById("hidden").options].map(({ value }) => value);
  hideAs(names[(names.indexOf(hidden) + step + names.length) % names.length]);
}

function turnContours() {
  contoured = !contoured;
  root.querySelector('[data-key="w"]').setAttribute("aria-pressed", contoured);
  say(contoured ? "Contours drawn" : "Contours left out");
  refreshInks();
}

document.getElementById("hidden").addEventListener("change", (event) => hideAs(event.target.value));
document.getElementById("hiding").addEventListener("click", (event) => act(event.target.dataset.key, false));
