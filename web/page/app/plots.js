// Plots of curves, by uPlot.
function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/// A plot of one curve, with a table of its numbers for those who do not see it.
function plot(series, { height = 120 } = {}) {
  const box = make("div", { className: "plot", role: "img" });
  const known = series.y.filter((y) => y !== null);
  const low = known.reduce((a, b) => Math.min(a, b), Infinity);
  const high = known.reduce((a, b) => Math.max(a, b), -Infinity);
  const unit = series.unit ? ` [${series.unit}]` : "";
  const text = `${series.name}${unit}: ${figure(low)} to ${figure(high)}`;
  box.setAttribute("aria-label", text);
  const holder = make("div", { className: "canvas" });
  box.append(make("p", { className: "caption", text }), holder);
  const draw = () => {
    holder.replaceChildren();
    const width = holder.clientWidth || 300;
    const axis = { stroke: colour("--muted"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui" };
    new uPlot(
      {
        width, height,
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false } },
        series: [{}, { stroke: colour("--model"), width: 1.5, points: { show: false } }],
        axes: [{ ...axis, size: 26 }, { ...axis, size: 52 }],
      },
      [series.t, series.y],
      holder,
    );
  };
  new ResizeObserver(draw).observe(holder);
  return box;
}
