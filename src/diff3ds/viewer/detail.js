// The level of detail: which strokes are drawn, by their importance, as `Sketch.at_detail` chooses them.

// From 0, the most important stroke, to 1, all.
let detail = 1;

// Gives each stroke its level: it is drawn at details above. Strokes that are worth the same have one level.
function setLevels(strokes) {
  const worths = strokes.filter(({ importance }) => importance !== null).map(({ importance }) => importance);
  worths.sort((a, b) => b - a);
  const whole = worths.reduce((sum, worth) => sum + worth, 0);
  const levels = new Map();
  let sum = 0;
  for (const worth of worths) {
    if (!levels.has(worth)) levels.set(worth, sum && whole ? 1 - Math.cbrt(Math.max(1 - sum / whole - 1e-9, 0)) : -1);
    sum += worth;
  }
  // What somebody has drawn here is always there.
  for (const stroke of strokes) stroke.level = levels.get(stroke.importance) ?? -1;
}

function isAtLevel({ level }) {
  return detail === 1 || level < detail;
}

// Whether a stroke is drawn: at this level, and not hidden by hand.
function isDrawn(stroke) {
  return stroke.shown && isAtLevel(stroke);
}

// Shows the slider where a sketch says what its strokes are worth.
function offerDetail({ strokes }) {
  if (strokes.some(({ importance }) => importance !== null)) document.getElementById("level").hidden = false;
}

document.getElementById("detail").addEventListener("input", (event) => {
  detail = Number(event.target.value);
  listStrokes();
  refreshInks();
  say(document.getElementById("count").textContent);
});
