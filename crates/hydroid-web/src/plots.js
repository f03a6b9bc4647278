// Drawing that the pages of hydroid share: a chart of positions, and plots over time by uPlot.
const Plots = (() => {
  /** Colours of the style sheet, by their names without `--`. Curves take them by functions, so that another scheme is shown at once. */
  const colours = {};
  function readColours() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ink", "muted", "grid", "surface", "model", "band", "command", "alarm"])
      colours[name] = style.getPropertyValue("--" + name).trim();
  }

  const bounded = (x, low, high) => Math.min(Math.max(x, low), high);

  /** A number with digits after the point, without a negative zero. */
  const fixed = (x, digits) => x.toFixed(digits).replace(/^-(?=[0.]+$)/, "").replace("-", "−");

  /** Digits after the point that tell numbers `step` apart: a step of 0.25 has two, since 0.3 and 0.8 would be false. */
  const places = (step) => [0, 1, 2, 3].find((d) => Math.abs(step * 10 ** d - Math.round(step * 10 ** d)) < 1e-6 && step * 10 ** d > 0.5) ?? 4;

  // ---- Chart ----

  /** A map of positions [north, east] in metres on a canvas, north up. */
  class Chart {
    constructor(canvas) {
      Object.assign(this, { canvas, scale: undefined, north: 0, east: 0, shape: "" });
    }

    /** Sizes the canvas for its place, and clears it; false where it is not visible. */
    begin() {
      const { canvas } = this;
      const [ratio, width, height] = [window.devicePixelRatio || 1, canvas.clientWidth, canvas.clientHeight];
      if (!width || !height) return false;
      const pixels = [Math.round(width * ratio), Math.round(height * ratio)];
      if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
      const g = canvas.getContext("2d");
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      g.fillStyle = colours.surface;
      g.fillRect(0, 0, width, height);
      g.font = "600 13px system-ui, sans-serif";
      g.lineJoin = "round";
      Object.assign(this, { g, width, height });
      return true;
    }

    /** Centre and scale so that all points are visible, around `centre` if there is one, and at least 2 `reach` metres. The scale
     * changes in steps, because one that creeps is hard to read. */
    fit(points, { centre = null, reach = 10 } = {}) {
      let [south, north, west, east] = [Infinity, -Infinity, Infinity, -Infinity];
      for (const [n, e] of points) {
        [south, north] = [Math.min(south, n), Math.max(north, n)];
        [west, east] = [Math.min(west, e), Math.max(east, e)];
      }
      if (south > north) [south, north, west, east] = [0, 0, 0, 0];
      if (centre) {
        const far = Math.max(reach, north - centre[0], centre[0] - south, east - centre[1], centre[1] - west);
        [south, north, west, east] = [centre[0] - far, centre[0] + far, centre[1] - far, centre[1] + far];
      }
      const { width, height } = this;
      const fit = Math.min(width / Math.max(east - west, 2 * reach), height / Math.max(north - south, 2 * reach));
      const seen = Math.max(north - this.north, this.north - south) * this.scale < height / 2 && Math.max(east - this.east, this.east - west) * this.scale < width / 2;
      const shape = `${width} ${height} ${!!centre}`;
      if (!(seen && this.shape === shape && this.scale > 0.5 * fit))
        Object.assign(this, { scale: 0.85 * fit, north: (north + south) / 2, east: (east + west) / 2, shape });
      if (centre) Object.assign(this, { north: centre[0], east: centre[1] });
    }

    x(east) { return this.width / 2 + (east - this.east) * this.scale; }
    y(north) { return this.height / 2 - (north - this.north) * this.scale; }

    /** A text with a rim, so that lines do not cross it. */
    label(text, px, py, align = "left", colour = colours.ink) {
      const { g } = this;
      Object.assign(g, { textAlign: align, lineWidth: 4, strokeStyle: colours.surface, fillStyle: colour });
      g.strokeText(text, px, py);
      g.fillText(text, px, py);
    }

    /** A line through points; a missing one is a gap. */
    line(points, colour, thick, dash = []) {
      const { g } = this;
      let pen = false;
      Object.assign(g, { strokeStyle: colour, lineWidth: thick });
      g.setLineDash(dash);
      g.beginPath();
      for (const point of points) {
        if (point) g[pen ? "lineTo" : "moveTo"](this.x(point[1]), this.y(point[0]));
        pen = Boolean(point);
      }
      g.stroke();
      g.setLineDash([]);
    }

    /** The path of a circle, to be filled or stroked. */
    disc(at, radius) {
      this.g.beginPath();
      this.g.arc(this.x(at[1]), this.y(at[0]), radius, 0, 7);
    }

    /** Lines at round numbers of metres, with their numbers. */
    grid() {
      const { width, height, scale, north, east } = this;
      const raw = 60 / scale;
      const ten = 10 ** Math.floor(Math.log10(raw));
      const step = ten * [1, 2, 5, 10].find((m) => m * ten >= raw);
      const digits = bounded(-Math.floor(Math.log10(step)), 0, 20);
      const labels = []; // drawn after the lines, which would cross them
      const spread = [Math.ceil(width / scale / step), Math.ceil(height / scale / step)];
      const first = [Math.floor((east - width / 2 / scale) / step), Math.floor((north - height / 2 / scale) / step)];
      for (let i = 0; i <= spread[0] + 1; i += 1) {
        const at = (first[0] + i) * step;
        this.line([[north + height / scale, at], [north - height / scale, at]], colours.grid, 1);
        if (this.x(at) > 50 && this.x(at) < width - 95) labels.push([fixed(at, digits), this.x(at), height - 8, "center"]);
      }
      for (let i = 0; i <= spread[1] + 1; i += 1) {
        const at = (first[1] + i) * step;
        this.line([[at, east - width / scale], [at, east + width / scale]], colours.grid, 1);
        if (this.y(at) > 45 && this.y(at) < height - 30) labels.push([fixed(at, digits), 6, this.y(at) + 4, "left"]);
      }
      for (const one of labels) this.label(...one, colours.muted);
    }

    /** The vessel: `length` pixels long, its bow at the heading `psi`; without a heading it has no bow. */
    vessel(at, psi, length = 24) {
      const { g } = this;
      const k = length / 24;
      g.save();
      g.translate(this.x(at[1]), this.y(at[0]));
      g.rotate(psi ?? 0);
      g.beginPath();
      if (psi === null) g.arc(0, 0, 8, 0, 7);
      else for (const [px, py] of [[0, -14], [6, -4], [6, 10], [-6, 10], [-6, -4]]) g.lineTo(k * px, k * py);
      g.closePath();
      Object.assign(g, { fillStyle: colours.command, strokeStyle: colours.ink, lineWidth: 2 });
      g.fill();
      g.stroke();
      g.restore();
    }

    /** Names of the axes, and the arrow to the north. */
    frame() {
      const { g, width, height } = this;
      this.label("north [m]", 6, 18, "left", colours.muted);
      this.label("east [m]", width - 6, height - 8, "right", colours.muted);
      this.label("N", width - 18, 50, "center");
      Object.assign(g, { strokeStyle: colours.ink, lineWidth: 2 });
      g.stroke(new Path2D(`M${width - 18} 36V10m-6 9l6-10 6 10`));
    }
  }

  // ---- Plots over time ----

  /** Axes of time and value. `now` is the text at time 0, if it has one. */
  function axes(now = undefined) {
    const common = { stroke: () => colours.ink, grid: { stroke: () => colours.grid, width: 1 }, ticks: { show: false }, font: "600 12px system-ui, sans-serif" };
    const seconds = (_, ticks) => ticks.map((t) => (t === 0 && now !== undefined ? now : `${fixed(t, t % 1 ? 1 : 0)}\u00a0s`));
    const digits = (_, ticks) => {
      const n = ticks.length > 1 ? places(ticks[1] - ticks[0]) : 2;
      return ticks.map((t) => (Math.abs(t) < 1e6 ? fixed(t, n) : t.toExponential(1)));
    };
    return [{ ...common, size: 24, gap: 4, values: seconds, space: 45 }, { ...common, size: 52, gap: 4, values: digits, space: 20 }];
  }

  /** A curve in a colour of the style sheet. */
  const curve = (colour, width, more = {}) => ({ stroke: () => colours[colour], width, points: { show: false }, ...more });

  const all = new Set();

  /** A plot that is as wide as its place, and changes its colours with the scheme. It ends when its place leaves the page. */
  function plot(holder, options, data) {
    const width = () => holder.clientWidth || 300;
    const base = { width: width(), height: 118, legend: { show: false }, cursor: { show: false }, padding: [6, 10, 0, 0], axes: axes() };
    const made = new uPlot({ ...base, ...options }, data, holder);
    all.add(made);
    const observer = new ResizeObserver(() => {
      if (!holder.isConnected && all.delete(made)) {
        // The page has removed it.
        observer.disconnect();
        made.destroy();
      } else if (holder.clientWidth > 0 && holder.clientWidth !== made.width) made.setSize({ width: holder.clientWidth, height: made.height });
    });
    observer.observe(holder);
    return made;
  }

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    readColours();
    for (const one of all) one.redraw();
  });

  return { colours, readColours, bounded, fixed, Chart, axes, curve, plot };
})();
