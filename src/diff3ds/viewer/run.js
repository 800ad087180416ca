// The run that a page shows the sketch of: how far it is, its losses, its pictures and its log, asked for anew and anew.

// Of the curve, in units of its own.
const [CURVE_WIDTH, CURVE_HEIGHT] = [240, 60];
// A loss that falls by more than this factor is shown as a logarithm. Seconds of silence after which it is said.
const [MANY, SILENT] = [10, 30];
const ENDS = { done: "Done", stopped: "Stopped early", failed: "Ended by an error" };

function made(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

const panel = {
  state: made("p"),
  bar: made("progress", { "aria-label": "Steps of this stage" }),
  curve: svgElement("svg", { role: "img", viewBox: `0 0 ${CURVE_WIDTH} ${CURVE_HEIGHT}` }),
  loss: made("p"),
  pictures: made("div", { id: "pictures", role: "group", "aria-label": "Pictures of the run" }),
  log: made("pre", { tabindex: "0", "aria-label": "Log" }),
  large: made("dialog", { "aria-label": "Picture" }, made("img"), made("p")),
};

function layOut() {
  const { state, bar, curve, loss, pictures, log, large } = panel;
  curve.append(svgElement("polyline", {}));
  const told = made("details", {}, made("summary", {}, "Log"), log);
  const run = made("section", { id: "run", "aria-label": "Run" }, state, bar, curve, loss, pictures, told);
  document.getElementById("head").before(run);
  document.body.append(large);
  large.addEventListener("click", () => large.close());
}

function stateOf({ stage, done, total, note, ended, silent }) {
  if (ended) return ENDS[ended] + (ended === "failed" ? `, in ${stage}` : "");
  const steps = total ? ` ${done} of ${total}` : "";
  const quiet = silent > SILENT ? `; nothing new for ${Math.round(silent)} seconds` : "";
  return `${stage}${steps}${note ? `, ${note}` : ""}${quiet}`;
}

function drawLosses({ every, values }) {
  const known = values.filter(Number.isFinite);
  const shown = known.length > 1;
  for (const part of [panel.curve, panel.loss]) part.toggleAttribute("hidden", !shown);
  if (!shown) return;
  const [least, most] = [Math.min(...known), Math.max(...known)];
  const scaled = least > 0 && most > MANY * least ? Math.log : (value) => value;
  const [low, high] = [scaled(least), scaled(most)];
  const points = values.flatMap((value, i) => {
    if (!Number.isFinite(value)) return [];
    const rise = high > low ? (scaled(value) - low) / (high - low) : 0.5;
    return [`${(CURVE_WIDTH * i) / (values.length - 1)},${CURVE_HEIGHT - 2 - (CURVE_HEIGHT - 4) * rise}`];
  });
  panel.curve.firstChild.setAttribute("points", points.join(" "));
  const logarithm = scaled === Math.log ? ", logarithmic" : "";
  const text = `Loss ${known[0].toPrecision(3)} to ${known.at(-1).toPrecision(3)} in ${every * values.length} steps${logarithm}`;
  panel.loss.textContent = text;
  panel.curve.setAttribute("aria-label", text);
}

function showPictures(pictures) {
  const shown = new Map([...panel.pictures.children].map((button) => [button.dataset.name, button]));
  const buttons = pictures.map(({ name, label, version }) => {
    const button = shown.get(name) ?? made("button", { "data-name": name }, made("img", { alt: "" }), made("span"));
    const address = `picture/${name}?${version}`;
    if (button.firstChild.getAttribute("src") !== address) button.firstChild.setAttribute("src", address);
    button.lastChild.textContent = label;
    button.onclick = () => enlarge(address, label);
    return button;
  });
  if (buttons.length !== shown.size || buttons.some((button) => !shown.has(button.dataset.name))) {
    panel.pictures.replaceChildren(...buttons);
  }
}

function enlarge(address, label) {
  const [picture, text] = panel.large.children;
  picture.src = address;
  picture.alt = label;
  text.textContent = label;
  panel.large.showModal();
}

function showRun(run) {
  panel.state.textContent = stateOf(run);
  panel.bar.hidden = Boolean(run.ended) || !run.total;
  Object.assign(panel.bar, { max: run.total || 1, value: run.done });
  drawLosses(run.losses);
  showPictures(run.pictures);
  const text = run.log.join("\n");
  if (panel.log.textContent === text) return;
  const atEnd = panel.log.scrollTop + panel.log.clientHeight >= panel.log.scrollHeight - 4;
  panel.log.textContent = text;
  if (atEnd) panel.log.scrollTop = panel.log.scrollHeight;
}

async function followRun() {
  // A server that is gone is told by what follows the sketch.
  const run = await ask("run").then((answer) => answer.json(), () => null);
  if (run) showRun(run);
  setTimeout(followRun, EVERY);
}

layOut();
followRun();
