// A second sketch beside the first one, seen by the same camera.

const beside = JSON.parse(document.getElementById("beside").textContent);
const besideCanvas = document.createElement("canvas");
const second = { sketch: null, drawing: null, start: null, madeFor: null };

function captionOf(title, id) {
  const caption = document.createElement("p");
  Object.assign(caption, { id, className: "caption", textContent: title });
  return caption;
}

function standBeside() {
  Object.assign(besideCanvas, { id: "other" });
  besideCanvas.setAttribute("role", "img");
  besideCanvas.setAttribute("aria-label", beside.title);
  const main = document.querySelector("main");
  main.classList.add("two");
  main.append(besideCanvas, captionOf(document.title, "first"), captionOf(beside.title, "second"));
  // What is pressed here goes on over the first sketch, whose camera it moves.
  besideCanvas.addEventListener("pointerdown", pressed);
  besideCanvas.addEventListener("contextmenu", (event) => event.preventDefault());
  const onWheel = (event) => {
    event.preventDefault();
    canvas.dispatchEvent(new WheelEvent("wheel", event));
  };
  besideCanvas.addEventListener("wheel", onWheel, { passive: false });
  const restore = () => {
    second.drawing = makeDrawing(besideCanvas);
    second.madeFor = null;
    refresh();
  };
  besideCanvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  besideCanvas.addEventListener("webglcontextrestored", restore);
  second.drawing = makeDrawing(besideCanvas);
}

function paintBeside(from, to, scene) {
  const [width, height] = size();
  if (besideCanvas.width !== width || besideCanvas.height !== height) Object.assign(besideCanvas, { width, height });
  if (second.start !== start) Object.assign(second, { sketch: readSketch(beside.sketch, start), start, madeFor: null });
  if (second.madeFor !== madeFor) {
    second.madeFor = madeFor;
    second.sketch.chords = chordsFor(second.sketch);
    second.drawing.setChords(second.sketch.chords);
  }
  if (from === 0) second.drawing.setInks(second.sketch.strokes.map(inkOf));
  second.drawing.show(from, to, { ...scene, selected: null, world: second.sketch.world });
}

if (drawing) {
  standBeside();
  painters.push(paintBeside);
  refresh();
}
