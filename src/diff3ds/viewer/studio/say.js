// Say it: a phrase, and what is understood of it while it is typed.

// Milliseconds without a letter after which the server is asked.
const TYPED = 150;
let understanding = 0;

async function understand() {
  const phrase = by("phrase").value;
  const mine = ++understanding;
  const found = await ask(`said?phrase=${encodeURIComponent(phrase)}`).catch((error) => ({ refused: error.message }));
  if (mine !== understanding) return;
  const place = by("understood");
  place.classList.toggle("refused", Boolean(found.refused));
  place.replaceChildren();
  if (found.instead) {
    const better = made("button", { type: "button" }, found.instead);
    better.onclick = () => {
      by("phrase").value = found.instead;
      by("phrase").focus();
      understand();
    };
    place.append("I do not know all of this. Say instead: ", better);
  } else if (found.refused) place.append("I do not know this yet.");
  if (found.refused) place.append(made("details", {}, made("summary", {}, "Why"), found.refused));
  else if (found.things.length) {
    place.append("That is ", made("strong", {}, found.things.join("; ")), ".");
    for (const note of found.notes) place.append(` ${note}.`);
  }
}

by("phrase").addEventListener("input", () => {
  clearTimeout(understand.later);
  understand.later = setTimeout(understand, TYPED);
});

by("panel-say").addEventListener("submit", async (event) => {
  event.preventDefault();
  const phrase = by("phrase").value.trim();
  if (!phrase) return by("phrase").focus();
  if (await begin({ phrase })) {
    by("phrase").value = "";
    understand();
  }
});
