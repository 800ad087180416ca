// A second sketch beside the first one, seen by the same camera.

const beside = JSON.parse(document.getElementById("beside").textContent);
const besideCanvas = document.createElement("canvas");
const second = { sketch: null, surface: null, drawing: null, start: null, madeFor: null };

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
    second.start = null;
    refresh();
  };
  besideCanvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  besideCanvas.addEventListener("webglcontextrestored", restore);
  second.drawing = makeDrawing(besideCanvas);
}

function paintBeside(from, to, scene) {
  const [width, height] = size();
  if (besideCanvas.width !== width || besideCanvas.height !== height) Object.assign(besideCanvas, { width, height });
  if (second.start !== start) {
    const read = { sketch: readSketch(beside.sketch, start), surface: readSurface(beside.surface, start) };
    Object.assign(second, { ...read, start, madeFor: null });
    offerDetail(second.sketch);
    second.drawing.setSurface(second.surface);
  }
  if (second.madeFor !== madeFor) {
    second.madeFor = madeFor;
    second.sketch.chords = chordsFor(second.sketch);
    second.drawing.setChords(second.sketch.chords);
  }
  const own = { ...scene, chosen: [], world: second.sketch.world };
  if (from === 0) {
    second.drawing.setInks(inksOf(second.sketch, second.surface));
    setSurfaceView(second.drawing, second.sketch, second.surface, own);
  }
  second.drawing.show(from, to, own);
}

if (drawing) {
  standBeside();
  if (beside.surface) document.getElementById("hiding").hidden = false;
  painters.push(paintBeside);
  refresh();
}
