// A study: each participant is asked about every sketch, in an order of their own, and gets a file of the answers.
const data = JSON.parse(document.getElementById("data").textContent);
const part = id => document.getElementById(id);
const names = Object.keys(data.questions);

// A number below n, all alike.
function below(n) {
  const limit = Math.floor(2 ** 32 / n) * n, box = new Uint32Array(1);
  do crypto.getRandomValues(box); while (box[0] >= limit);
  return box[0] % n;
}

function shuffled(list) {
  const all = [...list];
  for (let i = all.length - 1; i > 0; i--) {
    const j = below(i + 1);
    [all[i], all[j]] = [all[j], all[i]];
  }
  return all;
}

// Tasks in random order, and within each its sketches.
function fresh() {
  const id = [...crypto.getRandomValues(new Uint8Array(8))].map(b => b.toString(16).padStart(2, "0")).join("");
  const order = shuffled(data.tasks).flatMap(task => shuffled(task.sketches).map(sketch => sketch.code));
  return { participant: id, order, marks: {}, at: -1 };
}

// What was answered before the page was closed; some browsers keep nothing for files.
function kept() {
  try {
    return JSON.parse(localStorage.getItem(`study ${data.study}`));
  } catch {
    return null;
  }
}

function keep() {
  try {
    localStorage.setItem(`study ${data.study}`, JSON.stringify(state));
  } catch { /* answers last as long as the page */ }
}

const state = kept() ?? fresh();
const shown = new Map(data.tasks.flatMap(task => task.sketches.map(sketch => [sketch.code, { task, sketch }])));

for (const name of names) {
  const set = document.createElement("fieldset"), legend = document.createElement("legend");
  const marks = document.createElement("div");
  legend.textContent = data.questions[name];
  marks.className = "marks";
  marks.append("bad");
  for (let mark = data.least; mark <= data.most; mark++) {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, { type: "radio", name, value: mark });
    input.addEventListener("change", () => {
      (state.marks[state.order[state.at]] ??= {})[name] = mark;
      keep();
      allow();
    });
    label.append(input, String(mark));
    marks.append(label);
  }
  marks.append("very good");
  set.append(legend, marks);
  part("questions").append(set);
}

const answered = code => names.every(name => state.marks[code]?.[name]);
const allow = () => { part("next").disabled = !answered(state.order[state.at]); };

function show() {
  const at = state.at, ended = at >= state.order.length;
  part("start").hidden = at >= 0;
  part("ask").hidden = at < 0 || ended;
  part("end").hidden = !ended;
  if (ended) return finish();
  if (at < 0) return;
  const code = state.order[at], { task, sketch } = shown.get(code);
  part("place").textContent = `Sketch ${at + 1} of ${state.order.length}`;
  part("asked").textContent = task.asked ? `“${task.asked}”` : "This picture, as a sketch:";
  part("picture").hidden = !task.picture;
  if (task.picture) part("picture").src = task.picture;
  part("sketch").src = sketch.image;
  for (const input of part("questions").querySelectorAll("input")) {
    input.checked = state.marks[code]?.[input.name] === Number(input.value);
  }
  part("back").disabled = at === 0;
  allow();
}

function finish() {
  const answers = state.order.map(code => ({ sketch: code, ...state.marks[code] }));
  const text = JSON.stringify({ study: data.study, participant: state.participant, answers }, null, 1);
  URL.revokeObjectURL(part("save").href);
  part("save").href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  part("save").download = `answers-${state.participant}.json`;
  part("save").dataset.text = text;
}

function go(step) {
  state.at += step;
  keep();
  show();
  scrollTo(0, 0);
}

part("count").textContent = state.order.length;
part("begin").addEventListener("click", () => go(1));
part("back").addEventListener("click", () => go(-1));
part("again").addEventListener("click", () => go(-1));
part("ask").addEventListener("submit", event => {
  event.preventDefault();
  if (answered(state.order[state.at])) go(1);
});
show();
document.body.dataset.settled = "";
