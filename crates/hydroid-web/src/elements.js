// Elements of a page, and numbers as text. Text is always text: nothing of a log or of a model becomes markup.

/** An element with properties, attributes `aria-..`, data, a text, and children. */
function make(tag, { text, data, ...properties } = {}, ...children) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  Object.assign(element.dataset, data);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("aria-")) element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

/** A number with `digits` significant digits; a dash for none. */
function figure(x, digits = 4) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  const size = Math.abs(x);
  const text = size !== 0 && (size < 1e-3 || size >= 1e6) ? x.toExponential(digits - 1) : String(Number(x.toPrecision(digits)));
  return text.replace("-", "−");
}

/** A number with its unit. */
const quantity = (x, unit) => (Number.isFinite(x) ? `${figure(x)} ${unit}`.trim() : figure(null));

/** Factor and unit in which a quantity is shown: angles in degrees. */
function shown(unit) {
  if (unit === "rad") return [180 / Math.PI, "°"];
  if (unit === "rad/s") return [180 / Math.PI, "°/s"];
  return [1, unit === "1" ? "" : unit];
}
