// Draw it: a canvas for pen, finger and mouse, and what the drawing may be, asked for after every stroke.

// Milliseconds after a stroke until the server is asked; pixels of the canvas that the pen is wide.
const DRAWN = 120;
const PEN = 7;
const canvas = by("canvas");
const ink = canvas.getContext("2d");
let strokes = [];
let current = null;
let [guessing, chosen] = [0, null];

function placeOf(event) {
  const box = canvas.getBoundingClientRect();
  const scale = canvas.width / box.width;
  return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
}

function drawStroke(points) {
  ink.beginPath();
  ink.moveTo(...points[0]);
  for (const point of points) ink.lineTo(...point);
  ink.stroke();
}

function redraw() {
  ink.clearRect(0, 0, canvas.width, canvas.height);
  Object.assign(ink, { lineWidth: PEN, lineCap: "round", lineJoin: "round", strokeStyle: "#1c1e22" });
  strokes.forEach(drawStroke);
  if (current) drawStroke(current);
  by("make-drawing").disabled = !strokes.length;
}

function changed() {
  redraw();
  chosen = null;
  clearTimeout(guess.later);
  guess.later = setTimeout(guess, DRAWN);
}

async function guess() {
  const mine = ++guessing;
  if (!strokes.length) {
    by("guesses").replaceChildren();
    by("guessed").textContent = "Draw one thing, as large as you like.";
    return;
  }
  const found = await put("drawn", { strokes }).catch((error) => ({ guesses: [], why: error.message }));
  if (mine !== guessing) return;
  const sure = found.taken ? "It looks like this. Is it something else? Choose:" : "What is it? Choose, or draw more:";
  by("guessed").textContent = found.guesses.length ? sure : found.why;
  by("guesses").replaceChildren(...found.guesses.map(({ caption, picture }, i) => {
    const pressed = found.taken && i === 0;
    const button = made("button", { type: "button", "aria-pressed": pressed }, made("img", { src: picture, alt: "" }), caption);
    button.addEventListener("click", () => pick(button, caption));
    if (pressed) chosen = caption;
    return button;
  }));
}

function pick(button, caption) {
  chosen = caption;
  for (const each of by("guesses").children) each.setAttribute("aria-pressed", each === button);
}

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  current = [placeOf(event)];
  redraw();
});
canvas.addEventListener("pointermove", (event) => {
  if (!current) return;
  // Pens tell more places than there are events.
  const events = event.getCoalescedEvents?.() ?? [];
  for (const each of events.length ? events : [event]) current.push(placeOf(each));
  redraw();
});
for (const end of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(end, () => {
    if (!current) return;
    strokes.push(current);
    current = null;
    changed();
  });
}

by("undo").addEventListener("click", () => {
  strokes.pop();
  changed();
});
by("clear").addEventListener("click", () => {
  strokes = [];
  changed();
});
by("make-drawing").addEventListener("click", async () => {
  const content = { strokes, group: groupName(), ...(chosen ? { shows: chosen } : {}) };
  if (await begin(content)) by("clear").click();
});
redraw();
