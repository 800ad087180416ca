// A page that `diff3ds view` shows: it follows its file, from where one looks.

const EVERY = 1000;
let lost = false;

function tell(text) {
  const fault = document.getElementById("fault");
  fault.textContent = text;
  fault.hidden = !text;
}

async function ask(name) {
  const answer = await fetch(name, { cache: "no-store" });
  if (!answer.ok) throw new Error(answer.statusText);
  return answer;
}

// The sketch that the file has now, or null while it has the one that is shown.
async function newSketch() {
  const version = await (await ask("version")).text();
  // While this page saves, the file has what it shows.
  return saving || [start.version, passedOver].includes(version) ? null : (await ask("sketch")).json();
}

async function follow() {
  const before = lost;
  const found = await newSketch().then((news) => [news], () => []);
  lost = !found.length;
  if (lost && !before) tell("The server does not answer: diff3ds view has ended, or is busy. This is what there was.");
  if (!lost && before) tell("");
  const [news] = found;
  if (news && (saving || news.start.version === start.version || keepsEdits(news))) passOver(news);
  else if (news && news.page === start.page) showSketch(news.sketch, news.start, news.bare);
  else if (news) {
    // What stands beside or behind the sketch is another one.
    sessionStorage.setItem("camera", JSON.stringify(camera));
    location.reload();
    return;
  }
  setTimeout(follow, EVERY);
}

const before = sessionStorage.getItem("camera");
sessionStorage.removeItem("camera");
if (before && drawing) look({ ...camera, ...JSON.parse(before) });
follow();
