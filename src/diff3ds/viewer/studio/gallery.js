// What was made and what is being made: cards, the latest first.

// Milliseconds between looks while something is made, and else.
const [BUSY, IDLE] = [1000, 3000];
// Milliseconds in which a second click deletes.
const SURE = 4000;
const WORDS = { waiting: "Waiting in line", done: "", stopped: "Stopped", failed: "It did not work" };
// What commands call their stages, for everybody.
const STAGES = { starting: "getting ready", distill: "drawing", redraw: "drawing anew", strokes: "drawing strokes", drawings: "drawing views", turntable: "drawing the turn", "read photographs": "looking at the photographs", cameras: "finding where they were taken from", edges: "finding edges", calibration: "measuring edges", fit: "drawing", outlines: "drawing outlines", bodies: "looking at the parts" };
let entries = [];

function duration(seconds) {
  return seconds < 90 ? `${Math.ceil(seconds)} s` : `${Math.ceil(seconds / 60)} min`;
}

// Of all stages, where something was made alike before; else since when, and how long this part takes.
function timeOf({ spent, stage, all }) {
  if (all !== null) return `about ${duration(all)} left`;
  return `${duration(spent)} so far${stage === null ? "" : `, this part about ${duration(stage)} more`}`;
}

function stateOf({ state, stage, done, total, left, message }) {
  if (state === "failed") return `${WORDS.failed}: ${message}`;
  if (state !== "running") return WORDS[state];
  return `${STAGES[stage] ?? stage}${total ? ` ${done} of ${total}` : ""}, ${timeOf(left)}`;
}

async function act(name, how) {
  try {
    await ask(`jobs/${name}/${how}`, "PUT");
    fail(null);
  } catch (error) {
    fail(error);
  }
  await refresh();
}

function button(label, click) {
  const element = made("button", { type: "button" }, label);
  element.addEventListener("click", () => click(element));
  return element;
}

function remover(name) {
  return button("Delete", (element) => {
    if (element.dataset.sure) return act(name, "delete");
    element.dataset.sure = "yes";
    element.textContent = "Really delete?";
    setTimeout(() => {
      delete element.dataset.sure;
      element.textContent = "Delete";
    }, SURE);
  });
}

function buttonsOf({ name, state, sketch }) {
  if (["waiting", "running"].includes(state)) return [button("Stop", () => act(name, "stop"))];
  const more = state === "done" ? [] : [button("Go on", () => act(name, "resume"))];
  if (sketch) more.push(button("Duplicate", () => act(name, "duplicate")));
  return [...more, remover(name)];
}

// A card is made anew when the look of it changes, and told the rest.
function cardOf(entry, before) {
  const look = JSON.stringify([entry.title, entry.state, entry.face, entry.sketch]);
  if (before?.dataset.look === look) return before;
  const card = made("li", { "data-name": entry.name, "data-state": entry.state, "data-look": look });
  const address = `runs/${entry.name}/`;
  if (entry.face) {
    const face = made("img", { src: address + entry.face, alt: "" });
    card.append(made("a", { class: "face", href: address, tabindex: "-1", "aria-hidden": "true" }, face));
  }
  const named = entry.sketch || entry.state === "running" ? made("a", { href: address }, entry.title) : entry.title;
  card.append(made("h3", {}, named), made("p", { class: "state" }));
  if (entry.state === "running") card.append(made("progress", { "aria-label": `Steps of ${entry.title}` }));
  card.append(made("p", { class: "said" }), made("div", { class: "row" }, ...buttonsOf(entry)));
  if (entry.line) {
    const copy = button("Copy", () => navigator.clipboard?.writeText(entry.line).then(() => tell("copied")));
    card.append(made("details", {}, made("summary", {}, "In a terminal"), made("code", {}, entry.line), copy));
  }
  return card;
}

function show() {
  const words = by("search").value.toLowerCase().trim();
  const shown = entries.filter(({ title, command }) => !words || `${title} ${command}`.toLowerCase().includes(words));
  const before = new Map([...by("cards").children].map((card) => [card.dataset.name, card]));
  const cards = shown.map((entry) => {
    const card = cardOf(entry, before.get(entry.name));
    card.querySelector(".state").textContent = stateOf(entry);
    card.querySelector(".said").textContent = entry.state === "running" ? entry.said : "";
    const bar = card.querySelector("progress");
    if (bar && entry.total) Object.assign(bar, { max: entry.total, value: entry.done });
    return card;
  });
  // Only where something changed, so that what has the focus keeps it.
  const same = cards.length === by("cards").children.length && cards.every((card, i) => card === by("cards").children[i]);
  if (!same) by("cards").replaceChildren(...cards);
  by("nothing").hidden = entries.length > 0;
}

async function refresh() {
  entries = await ask("state");
  show();
  document.body.dataset.settled = "yes";
}

let gone = false;

async function follow() {
  try {
    await refresh();
    if (gone) fail(null);
    gone = false;
  } catch (error) {
    gone = true;
    fail(error);
  }
  const busy = entries.some(({ state }) => ["waiting", "running"].includes(state));
  setTimeout(follow, busy ? BUSY : IDLE);
}

by("search").addEventListener("input", show);
follow();
