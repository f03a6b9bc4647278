// Elements. Text is always text: nothing of a log becomes markup.
const $ = (id) => document.getElementById(id);

function make(tag, { text, ...properties } = {}, ...children) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  for (const [name, value] of Object.entries(properties)) {
    if (name === "data") Object.assign(element.dataset, value);
    else if (name.startsWith("aria-")) element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

function say(id, text, level = "") {
  const element = $(id);
  element.textContent = text;
  element.dataset.level = level;
}

function show(id, visible = true) {
  $(id).hidden = !visible;
}

/// A number with four digits.
function figure(x) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "-";
  const size = Math.abs(x);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return x.toExponential(3);
  return String(Number(x.toPrecision(4)));
}

function bytes(n) {
  if (n < 1e3) return `${n} B`;
  if (n < 1e6) return `${(n / 1e3).toFixed(1)} KB`;
  return `${(n / 1e6).toFixed(1)} MB`;
}

function download(name, content, type = "application/octet-stream") {
  const url = URL.createObjectURL(new Blob([content], { type }));
  const link = make("a", { href: url, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

for (const element of document.querySelectorAll("[data-text]")) element.textContent = TEXT[element.dataset.text];
