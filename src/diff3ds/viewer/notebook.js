// The widget of a notebook: a page in a frame, of which only the sketch changes when the notebook has another one.

const STYLE = "width: 100%; height: 480px; min-height: 200px; border: 0; display: block; resize: vertical;";

// Sketch and start of a page, and the creases that the sketch leaves bare, as its showSketch wants them.
function dataOf(page) {
  const parsed = new DOMParser().parseFromString(page, "text/html");
  const read = (id) => JSON.parse(parsed.getElementById(id).textContent);
  const { creases, convex } = read("surface") ?? {};
  return { sketch: read("sketch"), start: read("start"), bare: { creases, convex } };
}

function render({ model, el }) {
  const frame = document.createElement("iframe");
  // null until the frame can be told anything.
  let shown = null;
  const follow = () => {
    const page = model.get("page");
    if (shown === null || shown === page) return;
    shown = page;
    // A frame that is not of the notebook's origin has no other name.
    frame.contentWindow.postMessage(dataOf(page), "*");
  };
  frame.title = "3D sketch";
  frame.style = STYLE;
  // Without the notebook's origin, so that a page cannot reach the notebook.
  frame.setAttribute("sandbox", "allow-scripts allow-downloads");
  frame.srcdoc = model.get("page");
  // Again when a notebook moves its cells: then the frame is back at its first page.
  frame.addEventListener("load", () => {
    shown = frame.srcdoc;
    follow();
  });
  model.on("change:page", follow);
  el.append(frame);
  return () => model.off("change:page", follow);
}

export default { render };
