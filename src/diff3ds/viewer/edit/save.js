// Saving: to the file that a server shows, or as a download; and keeping what is not saved through a closed page.

// Milliseconds after an edit until it is kept.
const KEEP_AFTER = 300;
const isServed = start.version !== undefined;
// A state of the file that this page was told of and does not show, since it has edits of its own.
let passedOver = "";
let [saving, keeping] = [false, null];
// Which of the pages that edit a file this one is; the same when it is loaded anew.
const pageId = pageName();

function stored(use) {
  // Pages in frames of others may be refused a store.
  try {
    return use();
  } catch {
    return null;
  }
}

function pageName() {
  const fresh = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");
  const name = stored(() => sessionStorage.getItem("page")) ?? fresh;
  stored(() => sessionStorage.setItem("page", name));
  return name;
}

function localName() {
  return `diff3ds ${location.pathname}`;
}

// A sentence with what can be done about it.
function notify(text, ...choices) {
  const notice = document.getElementById("notice");
  const buttons = [...choices, ["Close", () => {}]].map(([label, act]) => {
    const button = document.createElement("button");
    button.textContent = label;
    button.addEventListener("click", () => {
      notice.hidden = true;
      act();
    });
    return button;
  });
  const sentence = document.createElement("span");
  sentence.textContent = text;
  notice.replaceChildren(sentence, ...buttons);
  notice.hidden = false;
}

// What the server says to a request, or null where it says nothing.
async function send(method, name, doc, headers = {}) {
  const body = doc ? { body: textOf(doc) } : {};
  try {
    return await fetch(name, { method, headers: { "Content-Type": "application/json", ...headers }, ...body });
  } catch {
    return null;
  }
}

async function save() {
  const { doc } = edits.now;
  if (!isServed) {
    download(doc);
    markSaved(doc, "Saved as a download");
    return;
  }
  if (saving) return;
  saving = true;
  const answer = await send("PUT", "sketch", doc, { "If-Match": `"${start.version}"` });
  if (answer?.ok) {
    const { version, name } = await answer.json();
    start.version = version;
    markSaved(doc, `Saved as ${name}`);
  } else await refused(answer);
  saving = false;
}

async function refused(answer) {
  if (!answer) notify("Not saved: the server does not answer. Your edits stay here: save again when diff3ds view runs.", ["Download", () => download(edits.now.doc)]);
  else if (answer.status === 412) notify(await answer.text(), ["Save a copy", saveCopy], ["Load anew", loadAnew]);
  else notify(`Not saved: ${await answer.text()}`);
}

function markSaved(doc, text) {
  savedDoc = doc;
  showState();
  say(text);
  keep();
}

async function saveCopy() {
  const { doc } = edits.now;
  const answer = await send("PUT", "copy", doc);
  if (!answer?.ok) return refused(answer);
  const { name } = await answer.json();
  markSaved(doc, `Saved as ${name}`);
  return notify(`Saved as ${name}. This page still shows your edits.`, ["Load anew", loadAnew]);
}

async function loadAnew() {
  const { doc } = edits.now;
  const news = await fetch("sketch", { cache: "no-store" }).then((answer) => answer.json(), () => null);
  if (!news) return refused(null);
  // What is edited while the file is on its way stays.
  if (edits.now.doc !== doc) return keepsEdits();
  passedOver = "";
  showSketch(news.sketch, news.start);
  return keep();
}

// Whether another state of the file is not shown, since this page has edits that are not saved.
function keepsEdits() {
  if (!isUnsaved()) return false;
  notify("The file has changed elsewhere. Your edits are still here.", ["Save a copy", saveCopy], ["Load anew", loadAnew]);
  return true;
}

function passOver(news) {
  if (news.start.version !== start.version && !saving) passedOver = news.start.version;
}

function download(doc) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([textOf(doc)], { type: "application/json" }));
  link.download = `${document.querySelector("h1").textContent}.json`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// Keeping

function keepSoon() {
  clearTimeout(keeping);
  keeping = setTimeout(keep, KEEP_AFTER);
}

function keep() {
  clearTimeout(keeping);
  keeping = null;
  const kept = isUnsaved() && edits.now.doc.strokes.length ? edits.now.doc : null;
  if (!isServed) return stored(() => (kept ? localStorage.setItem(localName(), textOf(kept)) : localStorage.removeItem(localName())));
  return send(kept ? "PUT" : "DELETE", `autosave/${pageId}`, kept);
}

// Offers edits that were not saved when a page was closed.
async function offerKept() {
  if (!isServed) {
    const text = stored(() => localStorage.getItem(localName()));
    if (text && text !== textOf(edits.now.doc)) offer(async () => JSON.parse(text), () => stored(() => localStorage.removeItem(localName())));
    return;
  }
  const names = await fetch("autosaves", { cache: "no-store" }).then((answer) => answer.json(), () => []);
  if (!names.length || isUnsaved()) return;
  const [name] = names;
  const forget = () => send("DELETE", `autosave/${name}`).then(offerKept);
  offer(async () => {
    const data = await (await fetch(`autosave/${name}`, { cache: "no-store" })).json();
    if (name !== pageId) send("DELETE", `autosave/${name}`);
    return data;
  }, forget);
}

function offer(take, forget) {
  const restore = async () => {
    const data = await take().catch(() => null);
    if (data) commit(documentOf(data), [], "Unsaved edits restored");
    keep();
  };
  notify("There are edits that were not saved.", ["Restore them", restore], ["Forget them", forget]);
}

addEventListener("pagehide", () => keeping !== null && isServed && isUnsaved() && fetch(`autosave/${pageId}`, {
  method: "PUT", keepalive: true, headers: { "Content-Type": "application/json" }, body: textOf(edits.now.doc),
}).catch(() => {}));
addEventListener("pagehide", () => keeping !== null && !isServed && keep());
if (drawing) offerKept();
