// Shows the values of the curves under the pointer. Figures give frame and ranges of their panels in data-panels.
document.querySelectorAll("svg[data-panels]").forEach(function (svg) {
  const panels = svg.dataset.panels.split(";").map(function (panel) { return panel.split(",").map(Number); });
  const curves = new Map();
  svg.querySelectorAll("polyline").forEach(function (line) {
    const colour = line.getAttribute("stroke");
    if (["#E3E7EB", "#A9B2BA"].includes(colour)) return; // grid and axes
    const points = line.getAttribute("points").trim().split(/\s+/).map(function (p) { return p.split(",").map(Number); });
    if (!curves.has(colour)) curves.set(colour, []);
    curves.get(colour).push(points);
  });
  const tip = document.createElement("div");
  tip.className = "tip";
  svg.parentNode.appendChild(tip);
  const text = function (share, low, high, logarithmic) {
    const value = low + share * (high - low);
    return String(Number((logarithmic ? Math.pow(10, value) : value).toPrecision(3)));
  };
  // Height of a curve at x; gaps between dashes, of up to 6 px, are bridged.
  const height = function (lines, x, top, bottom) {
    let found, near = 60;
    lines.forEach(function (points) {
      points.forEach(function (b, i) {
        const a = points[i ? i - 1 : 0];
        const away = Math.max(a[0] - x, x - b[0], 0);
        if (Math.min(a[1], b[1]) >= top && bottom >= Math.max(a[1], b[1]) && near > away) {
          near = away;
          const share = b[0] > a[0] ? Math.min(Math.max((x - a[0]) / (b[0] - a[0]), 0), 1) : 1;
          found = a[1] + share * (b[1] - a[1]);
        }
      });
    });
    return found;
  };
  svg.addEventListener("pointerleave", function () { tip.style.display = "none"; });
  svg.addEventListener("pointermove", function (event) {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    const panel = panels.find(function (p) { return at.x >= p[0] && p[2] >= at.x && at.y >= p[1] && p[3] >= at.y; });
    tip.style.display = panel ? "block" : "none";
    if (!panel) return;
    tip.textContent = text((at.x - panel[0]) / (panel[2] - panel[0]), panel[4], panel[5], panel[8]);
    curves.forEach(function (lines, colour) {
      const y = height(lines, at.x, panel[1] - 5, panel[3] + 5);
      if (y === undefined) return;
      const value = document.createElement("span");
      value.style.color = colour;
      value.textContent = text((panel[3] - y) / (panel[3] - panel[1]), panel[6], panel[7], panel[9]);
      tip.append(" ", value);
    });
    const box = svg.parentNode.getBoundingClientRect();
    tip.style.left = Math.min(event.clientX - box.left + 12, box.width - tip.offsetWidth) + "px";
    tip.style.top = event.clientY - box.top + 16 + "px";
  });
});
