// On the page of a sketch of the studio: the way back, files to save, styles to look at, and the command that makes it.

const desk = made("nav", { id: "desk", "aria-label": "Studio" }, made("a", { href: "../../" }, "← Back to the studio"));

// What the page shows, for a drawing of it.
function seen() {
  const view = { azimuth: camera.azimuth.toFixed(2), elevation: camera.elevation.toFixed(2), detail };
  const hiding = document.getElementById("hiding");
  return hiding.hidden ? view : { ...view, hidden: document.getElementById("hidden").value };
}

function addressOf(key, more = {}) {
  return `download/${key}?${new URLSearchParams({ ...seen(), ...more })}`;
}

function chooser(label, choices) {
  const options = choices.map(([value, text]) => made("option", { value }, text));
  const select = made("select", {}, ...options);
  return [made("label", {}, `${label} `, select), select];
}

async function saveFile(key, looks) {
  const answer = await fetch(addressOf(key, looks), { cache: "no-store" }).catch(() => null);
  if (!answer?.ok) return notify(answer ? await answer.text() : "The studio does not answer.");
  const name = /filename="(.*)"/.exec(answer.headers.get("Content-Disposition"))?.[1] ?? key;
  const link = made("a", { href: URL.createObjectURL(await answer.blob()), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

async function layOutDesk() {
  const about = await ask("about").then((answer) => answer.json(), () => null);
  if (!about) return;
  const [styled, style] = chooser("Style", [["", "as it is"], ...about.styles.map((name) => [name, name])]);
  const [hatched, hatch] = chooser("Shadows", [["", "none"], ...about.hatches.map((name) => [name, `by ${name}`])]);
  hatched.hidden = !about.hatches.length;
  const paper = made("input", { type: "checkbox" });
  const onPaper = made("label", {}, paper, " Paper");
  const [saved, format] = chooser("Save as", about.formats.map(({ key, name }) => [key, name]));
  const purpose = made("p", { id: "purpose" });
  const explain = () => {
    purpose.textContent = about.formats.find(({ key }) => key === format.value).purpose;
  };
  format.addEventListener("change", explain);
  explain();
  const looks = () => ({
    ...(style.value && { style: style.value, ...(paper.checked && { paper: true }) }),
    ...(hatch.value && { hatch: hatch.value }),
  });
  const preview = made("img", { id: "preview", hidden: "" });
  // As soon as something is chosen, a small picture shows it.
  const show = () => {
    onPaper.hidden = !style.value;
    const chosen = looks();
    preview.hidden = !Object.keys(chosen).length;
    if (preview.hidden) return;
    preview.src = addressOf("png", chosen);
    preview.alt = `It in this look: ${[style.value, hatch.value && `shadows by ${hatch.value}`].filter(Boolean).join(", ")}`;
  };
  for (const choice of [style, hatch, paper]) choice.addEventListener("change", show);
  show();
  const look = made("button", { type: "button" }, "Look");
  look.addEventListener("click", () => enlarge(addressOf("png", looks()), style.value || "as it is"));
  const save = made("button", { type: "button" }, "Save");
  save.addEventListener("click", () => saveFile(format.value, looks()));
  desk.append(made("div", {}, styled, look), made("div", {}, hatched, onPaper), preview, made("div", {}, saved, save), purpose);
  if (about.again) {
    const again = made("button", { type: "button" }, "Make it again; fixed strokes stay");
    again.addEventListener("click", async () => {
      const answer = await fetch(`../../jobs/${about.name}/again`, { method: "PUT" }).catch(() => null);
      if (answer?.ok) location.href = "../../";
      else notify(answer ? await answer.text() : "The studio does not answer.");
    });
    desk.append(again);
  }
  if (about.line) desk.append(made("details", {}, made("summary", {}, "In a terminal"), made("code", {}, about.line)));
}

// Dark where the system is.
const wish = matchMedia("(prefers-color-scheme: dark)");

function asWished() {
  if (drawing && wish.matches !== root.classList.contains("dark")) turnGround();
}

wish.addEventListener("change", asWished);
asWished();
document.querySelector("aside").prepend(desk);
layOutDesk();
