// What the parts of the studio share: asking the server, elements, what is said, and the tabs.

const by = (id) => document.getElementById(id);

function made(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

// What the server answers, as JSON; what it refuses is an error with its sentence.
async function ask(name, method = "GET", body = null) {
  let answer;
  try {
    answer = await fetch(name, { method, body, cache: "no-store" });
  } catch {
    throw new Error("The studio does not answer: it has ended, or is busy. Start it again: diff3ds studio.");
  }
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

const put = (name, content) => ask(name, "PUT", JSON.stringify(content));

function fail(error) {
  by("fault").textContent = error ? error.message : "";
  by("fault").hidden = !error;
}

function tell(text) {
  by("told").textContent = text;
}

// A name for what belongs together.
function groupName() {
  return Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

// Puts something into the line, and shows it.
async function begin(content) {
  try {
    const entry = await put("jobs", content);
    fail(null);
    tell(`${entry.title}: ${entry.state === "done" ? "there it is" : "in the line"}`);
    await refresh();
    return true;
  } catch (error) {
    fail(error);
    return false;
  }
}

const TABS = ["say", "draw", "drop"];

function choose(name, focused = false) {
  for (const each of TABS) {
    by(`tab-${each}`).setAttribute("aria-selected", each === name);
    by(`tab-${each}`).tabIndex = each === name ? 0 : -1;
    by(`panel-${each}`).hidden = each !== name;
  }
  if (focused) by(`tab-${name}`).focus();
}

TABS.forEach((name, i) => {
  by(`tab-${name}`).addEventListener("click", () => choose(name));
  by(`tab-${name}`).addEventListener("keydown", ({ key }) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[key];
    if (step) choose(TABS[(i + step + TABS.length) % TABS.length], true);
  });
});
