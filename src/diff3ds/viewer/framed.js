// A page in the frame of a notebook's widget, which tells it of other sketches.

window.addEventListener("message", ({ source, data }) => {
  if (source !== window.parent) return;
  const change = () => showSketch(data.sketch, data.start, data.bare);
  if (!isUnsaved()) change();
  else notify("The notebook has another sketch. Your edits are still here.", ["Download", () => download(edits.now.doc)], ["Show the other", change]);
});
