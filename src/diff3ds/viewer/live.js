// A page that `diff3ds view` shows: it is loaded anew when its file changes, and looks from where one looked before.

const EVERY = 1000;
let lost = false;

function tell(text) {
  const fault = document.getElementById("fault");
  fault.textContent = text;
  fault.hidden = !text;
}

async function follow() {
  try {
    const answer = await fetch("version", { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.statusText);
    const version = await answer.text();
    if (version !== start.version) {
      sessionStorage.setItem("camera", JSON.stringify(camera));
      location.reload();
      return;
    }
    if (lost) tell("");
    lost = false;
  } catch {
    if (!lost) tell("The server does not answer: diff3ds view has ended, or is busy. This is what there was.");
    lost = true;
  }
  setTimeout(follow, EVERY);
}

const before = sessionStorage.getItem("camera");
sessionStorage.removeItem("camera");
if (before && drawing) look({ ...camera, ...JSON.parse(before) });
follow();
