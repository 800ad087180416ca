// Drop it: files and folders, sent to the studio, which finds out what they are.

let waiting = null;

// The files of what was dropped, each with its path; folders with all that is in them.
async function filesIn(entry, path = "") {
  if (entry.isFile) return [[path + entry.name, await new Promise((done, failed) => entry.file(done, failed))]];
  const reader = entry.createReader();
  const found = [];
  // A reader gives a hundred at a time.
  for (;;) {
    const part = await new Promise((done, failed) => reader.readEntries(done, failed));
    if (!part.length) break;
    found.push(...part);
  }
  return (await Promise.all(found.map((each) => filesIn(each, `${path}${entry.name}/`)))).flat();
}

async function send(files) {
  if (!files.length) return;
  const [group, bar] = [groupName(), by("coming")];
  by("make-dropped").hidden = true;
  by("dropped").classList.remove("refused");
  by("dropped").textContent = `${files.length === 1 ? files[0][0] : `${files.length} files`} on the way …`;
  Object.assign(bar, { hidden: false, max: files.length, value: 0 });
  try {
    for (const [path, file] of files) {
      await ask(`files/${group}/${path.split("/").map(encodeURIComponent).join("/")}`, "POST", file);
      bar.value += 1;
    }
    const { what, title } = await put("dropped", { group });
    waiting = group;
    by("dropped").textContent = `${title}: ${what}.`;
    by("make-dropped").hidden = false;
    by("make-dropped").focus();
  } catch (error) {
    by("dropped").classList.add("refused");
    by("dropped").textContent = error.message;
  }
  bar.hidden = true;
}

const zone = document.body;
zone.addEventListener("dragover", (event) => {
  event.preventDefault();
  choose("drop");
  by("zone").classList.add("over");
});
zone.addEventListener("dragleave", () => by("zone").classList.remove("over"));
zone.addEventListener("drop", async (event) => {
  event.preventDefault();
  by("zone").classList.remove("over");
  const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean);
  send((await Promise.all(entries.map((entry) => filesIn(entry)))).flat());
});
for (const id of ["file", "folder"]) {
  by(id).addEventListener("change", ({ target }) => {
    send([...target.files].map((file) => [file.webkitRelativePath || file.name, file]));
    target.value = "";
  });
}
by("make-dropped").addEventListener("click", async () => {
  if (await begin({ group: waiting })) {
    by("make-dropped").hidden = true;
    by("dropped").textContent = "";
  }
});
