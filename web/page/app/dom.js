// The page's own elements.
const $ = (id) => document.getElementById(id);

function say(id, text, level = "") {
  const element = $(id);
  element.textContent = text;
  element.dataset.level = level;
}

function show(id, visible = true) {
  $(id).hidden = !visible;
}

/** Where the next step begins: a keyboard or a screen reader goes on there. */
function lead(id, options = {}) {
  const title = $(`${id}-title`);
  title.tabIndex = -1;
  title.focus(options);
}

function bytes(n) {
  if (n < 1e3) return `${n} B`;
  if (n < 1e6) return `${(n / 1e3).toFixed(1)} KB`;
  return `${(n / 1e6).toFixed(1)} MB`;
}

function download(name, content, type = "application/octet-stream") {
  const url = URL.createObjectURL(new Blob([content], { type }));
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** A text in which the words of the glossary explain themselves. */
function explained(text) {
  const words = Object.keys(TEXT.glossary);
  const parts = text.split(new RegExp(`(${words.join("|")})`));
  return parts.map((part) => (Object.hasOwn(TEXT.glossary, part) ? make("abbr", { text: part, title: TEXT.glossary[part], tabIndex: 0 }) : part));
}

/** A curve over time, with its range in words. */
function curveBox({ name, unit, t, y }) {
  const [factor, text] = shown(unit ?? "");
  const values = y.map((x) => (x === null ? null : x * factor));
  const known = values.filter((x) => x !== null);
  const ends = known.length ? `${figure(known.reduce((a, b) => Math.min(a, b)))} ${TEXT.to} ${figure(known.reduce((a, b) => Math.max(a, b)))}` : "";
  const caption = `${name}${text ? ` [${text}]` : ""}: ${ends}`;
  const holder = make("div", { className: "canvas" });
  const box = make("div", { className: "plot", role: "img", "aria-label": caption }, make("p", { className: "caption", text: caption }), holder);
  // The place has its width once it is on the page.
  requestAnimationFrame(() => Plots.plot(holder, { scales: { x: { time: false } }, series: [{}, Plots.curve("model", 1.5)] }, [t, values]));
  return box;
}

for (const element of document.querySelectorAll("[data-text]")) element.replaceChildren(...explained(TEXT[element.dataset.text]));
Plots.readColours();
