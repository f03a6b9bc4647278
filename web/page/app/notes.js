// Messages of hydroid in the words of the page.

/** A message without commands. */
function plain(text) {
  return String(text).replace(/`hydroid [^`]*`/g, "the command");
}

/** A remedy, or nothing if it can be followed with the command alone. */
function remedyOf(note) {
  const text = note.remedy ? plain(note.remedy) : "";
  return text.includes("the command") ? "" : text;
}

/** Notes as a list: those of several files once, the serious ones first. */
function listNotes(notes) {
  const order = ["error", "warning", "info"];
  const all = new Map();
  for (const { file, note } of notes) {
    const text = note.message ?? note.text ?? String(note);
    const body = text.startsWith(`${file}: `) ? text.slice(file.length + 2) : text;
    const level = note.severity ?? note.level ?? "info";
    const known = all.get(body) ?? { level, body, files: [], remedy: remedyOf(note) };
    if (!known.files.includes(file)) known.files.push(file);
    all.set(body, known);
  }
  const sorted = [...all.values()].sort((a, b) => order.indexOf(a.level) - order.indexOf(b.level));
  return sorted.map(({ level, body, files, remedy }) => {
    const text = plain(body);
    return make("li", { className: level }, make("b", { text: `${files.join(", ")}: ` }), remedy ? `${text}: ${remedy}` : text);
  });
}
