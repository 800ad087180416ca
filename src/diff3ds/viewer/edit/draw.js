// New strokes: what is drawn on a plane, or on the surface, becomes cubics.

// CSS pixels that a stroke may lie from the line that was drawn.
const FIT_WITHIN = 1.5;
// Of the view's height: a stroke that is added by a key, and points of it that are looked for on a surface.
const [ADDED, ADDED_POINTS] = [0.25, 33];

// What is drawn on where these pixels are, in the view's units: a plane, or the surface, beside which a line goes on
// where it comes back. Null where it cannot be drawn on, with a sentence.
function drawnOn(line) {
  const plane = document.getElementById("plane").value;
  const pixels = line.map((place) => place.map((value) => value * pixelRatio()));
  if (plane === "surface") {
    const places = surfaceUnder(surface, camera, size(), pixels).filter(Boolean).map(({ place }) => place);
    if (places.length > 1) return places;
    say("The surface is not there: draw over it, or on a plane");
    return null;
  }
  const points = pixels.map((pixel) => planePoint(plane, pixel));
  if (!points.includes(null)) return points;
  say("The plane to draw on is seen from its edge there: turn the view, or draw facing you");
  return null;
}

// A place on a plane; null where it is seen from its edge.
function planePoint(plane, pixel) {
  const { doc } = edits.now;
  const axes = axesOf(camera);
  const center = chosen.length ? toView(middleOf(chosen.map((index) => doc.strokes[index]))) : [...camera.target];
  const normal = plane === "view" ? axes.forward : [0, 1, 2].map((i) => (i === Number(plane) ? 1 : 0));
  if (plane === "2" && doc.strokes.length) {
    const heights = doc.strokes.flatMap((stroke) => stroke.segments.flatMap(({ points }) => points.map((point) => point[2])));
    center[2] = (heights.reduce((a, b) => Math.min(a, b)) - start.middle[2]) / start.radius;
  }
  const { from, along } = rayAt(camera, axes, size(), ...pixel);
  const slope = dot(normal, along) / Math.hypot(...along);
  const far = dot(normal, minus(center, from)) / dot(normal, along);
  return Math.abs(slope) < ALONG_SIGHT || !(far > 0) ? null : plus(from, along, far);
}

function drawnLine(line) {
  const points = line.length < 2 ? null : drawnOn(line);
  if (!points) return;
  const pixels = projected(camera, axesOf(camera), size(), points[0]).scale / pixelRatio();
  // What is drawn on the surface lies on it all along.
  const within = document.getElementById("plane").value === "surface" ? surface.near / 2 : Infinity;
  addStroke(fittedCubics(points, Math.min(FIT_WITHIN / pixels, within)));
}

function drawStraight() {
  const box = canvas.getBoundingClientRect();
  const half = (ADDED * box.height) / 2;
  const across = (share) => [box.width / 2 + half * (2 * share - 1), box.height / 2];
  if (document.getElementById("plane").value === "surface") {
    drawnLine(Array.from({ length: ADDED_POINTS }, (_, i) => across(i / (ADDED_POINTS - 1))));
    return;
  }
  const ends = drawnOn([across(0), across(1)]);
  if (ends) addStroke([straightBetween(...ends, 4).points]);
}

function addStroke(cubics) {
  const { doc } = edits.now;
  const made = withDrawn(doc, cubics.map((points) => points.map(toWorld)), doc.strokes[selected] ?? doc.strokes.at(-1));
  commit(made.doc, made.chosen, "Stroke added");
}
