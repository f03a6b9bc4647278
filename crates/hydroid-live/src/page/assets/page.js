// Page of `hydroid live`. Chart and plots are those of `hydroid-web` (`Plots`). Texts from the server are shown by textContent only,
// and every number is checked before use.

const $ = (id) => document.getElementById(id);
const { bounded, colours, readColours } = Plots;
const SILENT_MS = 2000; // the picture counts as old after this time without a new state
const WINDOW_S = 60; // shown past of the speeds
const calm = matchMedia("(prefers-reduced-motion: reduce)");

// ---- Values and texts ----

const DASH = "–";
const list = (x) => (Array.isArray(x) ? x : []);
const fields = (x) => (x !== null && typeof x === "object" ? x : {});
const finite = (x) => (Number.isFinite(x) ? x : null);
// Larger numbers are faults and would break the scales of the drawings.
const number = (x) => (Number.isFinite(x) && Math.abs(x) < 1e7 ? x : null);
// A plain look-up would also find "constructor" and the like.
const pick = (table, key) => (Object.hasOwn(table, String(key)) ? table[key] : undefined);
/** The result of `run`, or undefined where it fails. */
function attempt(run) {
  try {
    return run();
  } catch {
    return undefined;
  }
}

function words(x) {
  if (x === null || x === undefined || x === "") return DASH;
  return (typeof x === "object" ? JSON.stringify(x) : String(x)).slice(0, 300);
}

function figure(x, digits = 2, unit = "") {
  if (!Number.isFinite(x)) return DASH;
  const text = Math.abs(x) < 1e6 ? x.toFixed(digits) : x.toExponential(2);
  return text.replace(/^-(?=[0.]+$)/, "").replace("-", "−") + (unit && "\u00a0" + unit);
}

function duration(s) {
  if (!Number.isFinite(s)) return DASH;
  const [total, two] = [Math.max(0, Math.floor(s)), (x) => String(x).padStart(2, "0")];
  if (total < 60) return `${total}\u00a0s`;
  if (total > 360000) return figure(s / 3600, 0, "h");
  if (total < 3600) return `${Math.floor(total / 60)}\u00a0min ${two(total % 60)}\u00a0s`;
  return `${Math.floor(total / 3600)}\u00a0h ${two(Math.floor(total / 60) % 60)}\u00a0min`;
}

const bearing = (rad) => {
  const degrees = Math.round(((((rad * 180) / Math.PI) % 360) + 360) % 360) % 360;
  return Number.isFinite(degrees) ? String(degrees).padStart(3, "0") + "°" : DASH;
};

function clockTime(s) {
  const date = new Date(s * 1000);
  return Number.isFinite(s) && !isNaN(date) ? date.toLocaleTimeString("en-GB") : DASH;
}

// ---- Elements ----

function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function make(tag, className = "", ...children) {
  const element = document.createElement(tag);
  element.className = className;
  element.append(...children);
  return element;
}

/** Gives `parent` one child per item: `build` makes it once, `fill` updates it. */
function each(parent, items, build, fill) {
  const shown = items.slice(0, 100);
  while (parent.children.length > shown.length) parent.lastElementChild.remove();
  shown.forEach((item, i) => fill(parent.children[i] ?? parent.appendChild(build()), item));
}

function progress(element, share) {
  if (number(share) === null) element.removeAttribute("value");
  else element.value = bounded(share, 0, 1);
}

// ---- Data from the server ----

let state = {};
let track = []; // [t, north, east]
let series = []; // {t, at: Map of output -> [measured, predicted, band]}
let said = []; // newest first
let alive = { steady: performance.now(), wall: Date.now() };
let lastTime;
let source = null;
let opened = 0;
let patience = 5000;
let queued = 0;

// The steady clock stands still while a computer sleeps, the wall clock can be set: the larger time counts.
const silence = () => Math.max(performance.now() - alive.steady, Date.now() - alive.wall);
const connected = () => silence() < SILENT_MS && state.time !== undefined;

function connect() {
  source?.close();
  opened = performance.now();
  source = new EventSource("events");
  const on = (name, use) =>
    source.addEventListener(name, (event) => {
      const data = attempt(() => JSON.parse(event.data));
      if (data !== undefined) use(fields(data));
    });
  on("history", takeHistory);
  on("state", takeState);
  on("said", takeSaid);
}

function takeHistory(history) {
  track = list(history.track).filter((row) => finite(row?.[0]) !== null).map((row) => row.slice(0, 3));
  const names = list(history.series?.names).map(words);
  series = list(history.series?.rows)
    .filter((row) => finite(row?.[0]) !== null)
    .map((row) => ({ t: row[0], at: new Map(names.map((name, i) => [name, [row[1 + i], row[1 + names.length + i], null]])) }));
  said = [];
  $("said").replaceChildren();
  list(history.said).sort((a, b) => a?.time - b?.time).forEach(takeSaid);
  lastTime = undefined;
}

function takeState(s) {
  state = { ...s, time: s.time ?? null };
  // A server that repeats one state is as silent as none.
  if (state.time === null || state.time !== lastTime) {
    alive = { steady: performance.now(), wall: Date.now() };
    patience = 5000;
  }
  lastTime = state.time;
  const [t, motion, last] = [finite(s.time), fields(s.motion), track[track.length - 1]];
  if (t !== null) {
    const [north, east] = [number(motion.north), number(motion.east)];
    const moved = !last || Math.hypot(north - last[1], east - last[2]) > 0.2 || Math.abs(t - last[0]) > 2;
    if (north !== null && east !== null && moved) track.push([t, north, east]);
    if (track.length > 6000) track = track.filter((_, i) => i > 4000 || i % 2);
    // uPlot needs ascending times: rows from before a clock was set back are dropped.
    while (series.length && series[series.length - 1].t >= t) series.pop();
    const row = (o) => [words(o?.name), [o?.measured, o?.predicted, o?.band_95]];
    series.push({ t, at: new Map(list(s.outputs).map(row)) });
    while (series[0].t < t - WINDOW_S - 5) series.shift();
  }
  queued ||= requestAnimationFrame(draw);
}

function takeSaid(entry) {
  if (entry?.id !== undefined && said.some((other) => other.id === entry.id)) return;
  const level = ["warning", "error"].includes(entry?.level) ? entry.level : "info";
  const item = make("li", "", make("time"), make("b"), make("span"));
  item.dataset.level = level;
  item.children[0].textContent = clockTime(entry?.time);
  item.children[1].textContent = level;
  item.children[2].textContent = words(entry?.text);
  said.unshift({ id: entry?.id, level, time: entry?.time, text: words(entry?.text) });
  $("said").prepend(item);
  if (said.length > 200) {
    said.pop();
    $("said").lastElementChild.remove();
  }
}

// ---- Warnings and status ----

const failed = new Set(); // parts of the page that could not be drawn

function warnings() {
  const [all, s] = [[], state];
  const warn = (level, text, count = "") => all.push({ level, text, count });
  const [link, recording] = [fields(s.link), fields(s.recording)];
  if (!connected()) {
    const old = state.time === undefined ? "" : " What is shown is old.";
    warn("error", `No connection to hydroid.${old}`, `for ${duration(silence() / 1000)}`);
  }
  if (finite(link.lost_s) !== null) warn("error", "Link to the autopilot is lost.", `for ${duration(link.lost_s)}`);
  if (recording.trouble) warn("error", `Recording: ${words(recording.trouble)}`);
  if (recording.lost > 0) warn("warning", "Rows are missing in the recording:", figure(recording.lost, 0));
  const silent = list(s.sensors).filter(stale).map((sensor) => words(sensor?.name));
  if (silent.length) warn("warning", `No fresh data from: ${silent.slice(0, 5).join(", ")}${silent.length > 5 ? ", …" : ""}.`);
  for (const entry of said.slice(0, 5))
    if (entry.level !== "info" && Math.abs(s.time - entry.time) < 30) warn(entry.level, entry.text, clockTime(entry.time));
  if (failed.size) warn("error", `This page cannot show: ${[...failed].join(", ")}.`);
  each(
    $("warnings"),
    all,
    () => make("li", "", make("span"), make("small")),
    (item, { level, text, count }) => {
      item.dataset.level = level;
      set(item.firstElementChild, text);
      item.lastElementChild.ariaHidden = "true"; // a counter would be read out each second
      set(item.lastElementChild, count);
    },
  );
  document.body.classList.toggle("old", !connected());
}

/** Shows [id, name, text, detail, level of the text] as a list of names and texts. */
function pairs(parent, items) {
  const build = () => make("div", "", make("dt"), make("dd"), make("dd", "more"));
  each(parent, items, build, (box, [id, name, text, more = "", level = ""]) => {
    const [term, value, detail] = box.children;
    box.id = id;
    box.title = more ? `${text}; ${more}` : text; // long texts are cut off
    value.dataset.level = level;
    set(term, name);
    set(value, text);
    set(detail, more);
  });
}

function status(s) {
  const [link, recording, model, helm] = [s.link, s.recording, s.model, s.helm].map(fields);
  const lost = finite(link.lost_s);
  const trouble = recording.trouble || recording.lost > 0;
  const learning = pick({ true: "learning", false: "frozen" }, model.learning) ?? DASH;
  const offset = finite(link.clock_offset_s);
  const commanding = helm.state && helm.state !== "off";
  pairs($("status"), [
    ["s-helm", "Helm", words(helm.state).toUpperCase(), helm.state === "off" ? "hydroid does not command" : "", commanding ? "active" : ""],
    [
      "s-link", "Link", lost !== null ? `LOST ${duration(lost)}` : link.autopilot ? "connected" : link.address ? "waiting" : DASH,
      `${words(link.address)}, ${figure(link.damaged, 0)} damaged, ${figure(link.dropped, 0)} dropped`, lost !== null ? "error" : link.autopilot ? "good" : "",
    ],
    ["s-autopilot", "Autopilot", words(link.autopilot)],
    ["s-mode", "Mode", words(link.mode)],
    ["s-armed", "Armed", pick({ true: "ARMED", false: "disarmed" }, link.armed) ?? DASH],
    [
      "s-recording", "Recording", s.recording ? duration(recording.seconds) : "off",
      s.recording ? `${words(recording.path).replace(/^.*[\\/]/, "")}, ${figure(recording.lost, 0)} lost` : "", trouble ? "error" : finite(recording.seconds) !== null ? "good" : "",
    ],
    [
      "s-model", "Model", s.model ? words(model.name).split(/[\\/]/).slice(-2).join("/").replace(/\.safetensors$/, "") : "none",
      s.model ? `${learning}, guard ${words(model.guard)}${model.predicted_by ? `, predicts: ${words(model.predicted_by)} model` : ""}` : "",
    ],
    ["s-clock", "Clock", offset === null ? DASH : figure(offset * 1000, 0, "ms"), `offset; round trip ${figure(link.round_trip_ms, 1, "ms")}`],
  ]);
}

// ---- Chart ----

let follow = false;
const map = new Plots.Chart($("chart"));

const place = (north, east) => (number(north) === null || number(east) === null ? null : [north, east]);

/** Where the boat is with respect to the geofence. */
function margin(fence) {
  const m = (x) => figure(x, 0);
  const [left, reached] = [number(fence.margin), number(fence.reached_s)];
  if (left === null) return "";
  if (left < 0) return ` The boat is ${m(-left)} m OUTSIDE of it.`;
  return reached === null ? ` The boat is ${m(left)} m inside.` : ` The boat is ${m(left)} m inside, and leaves it in ${m(reached)} s on this course.`;
}

/** Outline and description of the geofence. */
function fenceOf(s) {
  const fence = fields(s.fence);
  const m = (x) => figure(x, 0);
  if (number(fence.radius) > 0) {
    const [n, e, r] = [number(fence.north) ?? 0, number(fence.east) ?? 0, fence.radius];
    const outline = Array.from({ length: 73 }, (_, i) => [n + r * Math.cos((i * Math.PI) / 36), e + r * Math.sin((i * Math.PI) / 36)]);
    return { outline, text: `Geofence: radius ${m(r)} m around north ${m(n)} m, east ${m(e)} m.${margin(fence)}` };
  }
  const sides = [...list(fence.north).slice(0, 2), ...list(fence.east).slice(0, 2)].map(number);
  if (sides.length < 4 || sides.includes(null)) return { outline: [], text: s.fence ? "The geofence cannot be shown." : "No geofence is set." };
  const [south, north, west, east] = sides;
  const outline = [[south, west], [north, west], [north, east], [south, east], [south, west]];
  return { outline, text: `Geofence: north ${m(south)} to ${m(north)} m, east ${m(west)} to ${m(east)} m.` };
}

function chart(s) {
  if (!map.begin()) return;
  const motion = fields(s.motion);
  const boat = place(motion.north, motion.east);
  const ahead = fields(s.prediction);
  const predicted = list(ahead.seconds)
    .map((t, i) => ({ t, at: place(list(ahead.north)[i], list(ahead.east)[i]), radius: number(list(ahead.position_95)[i]) }))
    .filter((point) => point.at);
  const path = list(s.path).map((point) => place(point?.[0], point?.[1])).filter(Boolean);
  const fence = fenceOf(s).outline;
  const sailed = track.map((row) => place(row[1], row[2]));
  // A model that diverges must not shrink the boat and its surroundings to a point.
  const close = predicted.filter(({ at }) => !boat || Math.hypot(at[0] - boat[0], at[1] - boat[1]) < 300);
  const ends = close.flatMap(({ at, radius }) => [-1, 1].map((side) => at.map((x) => x + side * bounded(radius, 0, 50))));
  const near = boat ? [...ends, boat] : ends;
  const shown = follow && boat ? near : [...near, ...sailed.filter(Boolean), ...path, ...fence];
  map.fit(shown, follow && boat ? { centre: boat, reach: 25 } : {});

  const { g, width, height, scale } = map;
  map.grid();

  map.line(fence, colours.alarm, 2.5, [10, 6]);
  if (path.length) {
    map.line(path, colours.command, 3, [2, 5]);
    for (const [point, name] of [[path[0], "start"], [path[path.length - 1], "end"]]) {
      map.disc(point, 4);
      g.fillStyle = colours.command;
      g.fill();
      map.label(name, map.x(point[1]) + 7, map.y(point[0]) - 6);
    }
  }
  // A gap in time is not a straight line on the water.
  const parts = sailed.map((point, i) => (i && track[i][0] - track[i - 1][0] > 5 ? [null, point] : [point]));
  const recent = track.findIndex((row) => row[0] > track[track.length - 1][0] - WINDOW_S);
  map.line(parts.slice(0, recent + 1).flat(), colours.muted, 1.2);
  map.line([...parts.slice(recent).flat(), boat], colours.ink, 2.5);
  Object.assign(g, { fillStyle: colours.band, strokeStyle: colours.model, lineWidth: 1 });
  for (const point of predicted) {
    if (!(point.radius > 0)) continue;
    map.disc(point.at, point.radius * scale);
    g.fill();
    g.stroke();
  }
  map.line([boat, ...predicted.map((point) => point.at)].filter(Boolean), colours.model, 3);
  for (const point of predicted) {
    map.disc(point.at, 3);
    g.fillStyle = colours.model;
    g.fill();
  }
  if (boat) map.vessel(boat, number(motion.psi));
  else map.label("no position", width / 2, height / 2, "center", colours.alarm);
  const last = predicted[predicted.length - 1];
  const side = boat && last?.at[1] < boat[1] ? -9 : 9; // away from the boat
  if (last) map.label(`in ${figure(last.t, 0)} s`, map.x(last.at[1]) + side, map.y(last.at[0]) + 5, side < 0 ? "right" : "left");
  map.frame();
}

function motionFigures(s) {
  const motion = fields(s.motion);
  const speed = finite(motion.u) !== null && finite(motion.v) !== null ? Math.hypot(motion.u, motion.v) : null;
  const current = place(...list(motion.current));
  const flow = current && Math.hypot(...current);
  const drift = current && figure(flow, 2, "m/s") + (flow < 0.005 ? "" : ` to\u00a0${bearing(Math.atan2(current[1], current[0]))}`);
  pairs($("figures"), [
    ["m-north", "North", figure(motion.north, 1, "m")], ["m-east", "East", figure(motion.east, 1, "m")],
    ["m-deviation", "Position std. dev.", figure(motion.position_deviation, 2, "m")], ["m-heading", "Heading", bearing(finite(motion.psi) ?? NaN)],
    ["m-speed", "Speed over ground", figure(speed, 2, "m/s")], ["m-current", "Current", drift ?? DASH],
  ]);
  set($("m-note"), motion.provisional ? "Provisional: the statistics of the sensors are not identified yet." : s.motion ? "" : "No estimate of the motion yet.");
}

// ---- Speeds and errors ----

const NAMES = { u: "surge u", v: "sway v", r: "yaw rate r" };
let plots = [];

/** Factor and unit of an output for display. */
const display = (output) => (output?.unit === "rad/s" ? [180 / Math.PI, "deg/s"] : [1, words(output?.unit)]);

function buildPlots(outputs) {
  $("outputs").replaceChildren();
  const { curve } = Plots;
  const dots = (colour) => ({ points: { show: true, size: 8, width: 2, stroke: () => colours[colour], fill: () => colours[colour === "muted" ? "surface" : colour] } });
  plots = outputs.map((output) => {
    const [factor, unit] = display(output);
    const name = words(output?.name);
    const heading = make("h3");
    heading.textContent = `${pick(NAMES, name) ?? name} [${unit}]`;
    const box = make("div", "output", make("div", "head", heading, make("p", "now")), make("div", "pair", make("div"), make("div")));
    $("outputs").append(box);
    const [left, right] = box.lastElementChild.children;
    left.role = right.role = "img";
    left.ariaLabel = `${name}, measured and predicted, last ${WINDOW_S} s`;
    right.ariaLabel = `${name}, error by horizon, frozen and adapted model`;
    const least = unit === "deg/s" ? 2 : 0.1;
    const range = (_, low, high) => {
      if (low === null || high === null) return [-least, least];
      const room = Math.max(0.1 * (high - low), (least - (high - low)) / 2);
      return [low - room, high + room];
    };
    const plot = { name, factor, unit, box, horizon: 10 };
    plot.past = Plots.plot(left, {
      axes: Plots.axes("now"), // a 0 beside that of the other axis reads as 0.00
      scales: { x: { time: false, range: () => [-WINDOW_S, plot.horizon] }, y: { range } },
      series: [{}, curve("band", 0), curve("band", 0), curve("model", 3.5), curve("ink", 1.3)],
      bands: [{ series: [2, 1], fill: () => colours.band }],
      hooks: {
        draw: [(u) => {
          const px = Math.round(u.valToPos(0, "x", true));
          u.ctx.fillStyle = colours.muted;
          u.ctx.fillRect(px, u.bbox.top, Math.max(1, window.devicePixelRatio || 1), u.bbox.height);
        }],
      },
    }, [[], [], [], [], []]);
    plot.error = Plots.plot(right, {
      axes: Plots.axes(""),
      scales: { x: { time: false, range: (_, low, high) => [0, (high ?? 10) * 1.06] }, y: { range: (_, low, high) => [0, high > 0 ? 1.15 * high : 1] } },
      series: [{}, curve("muted", 2, { dash: [4, 4], ...dots("muted") }), curve("model", 2.4, dots("model"))],
    }, [[], [], []]);
    return plot;
  });
}

function speeds(s) {
  const outputs = list(s.outputs).slice(0, 12);
  $("outputs-none").hidden = outputs.length > 0;
  const key = JSON.stringify(outputs.map((output) => [words(output?.name), words(output?.unit)]));
  if (key !== $("outputs").dataset.key) {
    $("outputs").dataset.key = key;
    buildPlots(outputs);
  }
  const now = series.length ? series[series.length - 1].t : 0;
  const rows = series.filter((row) => row.t >= now - WINDOW_S);
  outputs.forEach((output, index) => {
    const { name, factor, unit, box, past, error } = plots[index];
    const scaled = (x) => (number(x) === null ? null : x * factor);
    const edge = (at, sign) => (number(at?.[1]) === null || number(at?.[2]) === null ? null : (at[1] + sign * at[2]) * factor);
    const ahead = horizons(s.prediction, (p) => [fields(p.outputs)[name], fields(p.bands_95)[name]]);
    plots[index].horizon = bounded(ahead.seconds[ahead.seconds.length - 1] ?? 10, 5, 30);
    const all = [
      ...rows.map((row) => ({ t: row.t - now, measured: row.at.get(name)?.[0], at: row.at.get(name) })),
      ...ahead.seconds.map((t, i) => ({ t, measured: null, at: [null, ahead.columns[0][i], ahead.columns[1][i]] })),
    ];
    past.setData([
      all.map((row) => row.t), all.map((row) => edge(row.at, -1)), all.map((row) => edge(row.at, 1)),
      all.map((row) => scaled(row.at?.[1])), all.map((row) => scaled(row.measured)),
    ]);
    const errors = horizons(s.errors, (e) => [fields(e.frozen)[name], fields(e.adapted)[name]]);
    error.setData([errors.seconds, ...errors.columns.map((column) => column.map(scaled))]);
    const digits = unit === "deg/s" ? 1 : 2;
    const value = (x, more = "") => figure(Number.isFinite(x) ? x * factor : null, digits, more);
    set(box.querySelector(".now"), `measured ${value(output?.measured)}, predicted ${value(output?.predicted)} ± ${value(output?.band_95)} ${unit}`);
    const end = errors.seconds.length - 1;
    const [frozen, adapted] = errors.columns.map((column) => value(column[end]));
    error.root.parentElement.ariaLabel = end < 0 ? `${name}: no errors by horizon yet` : `${name}, error after ${errors.seconds[end]} s: frozen ${frozen}, adapted ${adapted} ${unit}`;
  });
}

/** The positive, ascending horizons and, of the same length, two columns that `columns` selects. */
function horizons(source, columns) {
  const both = columns(fields(source)).map(list);
  const order = list(fields(source).seconds).map((t, i) => [t, i]).filter(([t]) => number(t) > 0).sort((a, b) => a[0] - b[0]);
  return { seconds: order.map(([t]) => t), columns: both.map((column) => order.map(([, i]) => number(column[i]))) };
}

// ---- Tables and lists ----

const stale = (sensor) => finite(sensor?.age_s) === null || sensor.age_s > Math.max(1, sensor.rate_hz > 0 ? 5 / sensor.rate_hz : 1);

function sensors(s) {
  const build = () => make("tr", "", make("th", "", make("span"), make("small")), ...Array.from({ length: 5 }, () => make("td")));
  each($("sensors"), list(s.sensors), build, (row, sensor) => {
    const old = stale(sensor);
    row.className = old || sensor?.contradicts ? "stale" : "";
    row.firstElementChild.scope = "row";
    set(row.firstElementChild.firstElementChild, words(sensor?.name));
    set(row.firstElementChild.lastElementChild, words(sensor?.column));
    const outliers = finite(sensor?.outliers);
    const cells = [figure(sensor?.rate_hz, 1), figure(sensor?.age_s, sensor?.age_s > 10 ? 0 : 2), figure(sensor?.latency_ms, 0), figure(outliers === null ? null : 100 * outliers, 1), old ? "✕ stale" : sensor?.contradicts ? "✕ contradicts the gyro" : "✓ ok"];
    cells.forEach((text, i) => set(row.children[i + 1], text));
  });
}

function excitation(s) {
  const e = fields(s.excitation);
  set($("excitation-seconds"), `${e.sufficient ? "✓ sufficient" : "not sufficient yet"}: ${figure(e.seconds, 0)} of ${figure(e.needed_seconds, 0)} s`);
  progress($("excitation-progress"), e.needed_seconds > 0 ? (finite(e.seconds) ?? 0) / e.needed_seconds : 0);
  set($("excitation-text"), words(e.text));
  const build = () => make("div", "input", make("p"), make("div", "histogram"), make("p", "ends", make("span"), make("span")));
  each($("inputs"), list(e.inputs), build, (box, input) => {
    const shares = list(input?.histogram).map((share) => bounded(number(share) ?? 0, 0, 1));
    const top = Math.max(...shares, 1e-9);
    set(box.children[0], `${words(input?.name)}: share of time (highest bar ${figure(shares.length ? 100 * Math.max(...shares) : null, 0, "%")})`);
    each(box.children[1], shares, () => make("span"), (bar, share) => (bar.style.height = `${(100 * share) / top}%`));
    box.children[1].ariaHidden = "true";
    set(box.children[2].firstElementChild, figure(input?.low, 1));
    set(box.children[2].lastElementChild, figure(input?.high, 1));
  });
}

const STATUSES = {
  tracking: "the command is within its limits", rate_limited: "a command is at its rate limit", saturated: "a command is at its limit", lost: "far from the path",
  singular: "too little control authority", blind: "motion or reference are not known", arrived: "the end is reached",
  stopped: "the boat does not come to its path",
};

function helm(s) {
  const h = fields(s.helm);
  const meaning = { off: "Off: hydroid does not command the boat.", experiment: "EXPERIMENT: hydroid commands the boat.", preparing: "PREPARING the controller: hydroid commands the boat as soon as it is ready.", steering: "STEERING: hydroid commands the boat." };
  set($("helm-state"), pick(meaning, h.state) ?? words(h.state));
  $("helm-state").classList.toggle("active", Boolean(h.state) && h.state !== "off");
  const build = () => make("li", "", make("span"), make("div", "bar", make("span"), make("i")), make("b"));
  each($("commands"), list(h.commands), build, (row, command) => {
    const [low, high, value] = [command?.low, command?.high, command?.value].map(number);
    set(row.children[0], words(command?.name));
    set(row.children[2], figure(command?.value));
    const known = low !== null && high > low;
    const at = (x) => (100 * (bounded(x, low, high) - low)) / (high - low);
    const zero = known ? at(0) : 0;
    const to = known && value !== null ? at(value) : zero;
    const [fill, mark] = row.children[1].children;
    Object.assign(fill.style, { left: `${Math.min(zero, to)}%`, width: `${Math.abs(to - zero)}%` });
    mark.style.left = `${zero}%`;
    row.children[1].title = known ? `${figure(low, 1)} to ${figure(high, 1)}` : "";
  });
  const from = number(h.distance) === null ? "" : `${figure(h.distance, 1, "m")} from the reference`;
  set($("helm-note"), [from, pick(STATUSES, h.status) ?? ""].filter(Boolean).join("; "));
  $("refusals-head").hidden = !list(h.refusals).length;
  each($("refusals"), list(h.refusals), () => make("li"), (row, text) => set(row, words(text)));
  set($("fence"), fenceOf(s).text);
  const now = fields(s.experiment);
  $("experiment-now").hidden = !s.experiment;
  set($("experiment-name"), words(now.name));
  set($("experiment-left"), `${figure(number(now.progress) === null ? null : 100 * now.progress, 0, "%")}, at most ${duration(now.remaining_s)} left`);
  set($("experiment-text"), words(now.text));
  progress($("experiment-progress"), now.progress);
}

function model(s) {
  const offered = fields(s.offered);
  set($("offered"), s.offered ? `Offered: ${words(offered.name)}. ${words(offered.text)}` : "No model is offered.");
  const identifying = fields(s.identifying);
  $("identifying").hidden = !s.identifying;
  const share = number(identifying.progress) === null ? "" : figure(100 * identifying.progress, 0, "%");
  set($("identifying-text"), `Identifying a model: ${[identifying.text && words(identifying.text), share].filter(Boolean).join(", ") || "this takes minutes"}`);
  progress($("identifying-progress"), identifying.progress);
}

// ---- Actions ----

const busy = new Set();
const possible = (action) => connected() && !busy.has(action) && list(state.actions).includes(action) && (action !== "experiment" || $("experiment").value !== "");

function controls(s) {
  const select = $("experiment");
  const names = list(s.experiments).map(words);
  if (select.dataset.key !== JSON.stringify(names)) {
    const before = select.value;
    select.dataset.key = JSON.stringify(names);
    select.replaceChildren(...names.slice(0, 100).map((name) => new Option(name, name)));
    if (names.includes(before)) select.value = before;
  }
  for (const button of document.querySelectorAll("[data-action]")) button.disabled = !possible(button.dataset.action);
  $("no-token").hidden = token !== "";
  $("confirm-yes").disabled = !possible($("confirm-yes").dataset.for);
}

let hiding = 0;
function result(text, level) {
  clearTimeout(hiding);
  $("result").dataset.level = level;
  $("result").textContent = text;
  // Errors stay until the next action.
  if (level === "good") hiding = setTimeout(() => ($("result").textContent = ""), 8000);
}

let token = "";
function keepToken(text) {
  token = text;
  attempt(() => sessionStorage.setItem("hydroid-token", text)); // without storage the token is kept until the next reload
}

function takeToken() {
  const found = /^#token=(.+)$/.exec(location.hash);
  if (!found) return;
  keepToken(tokenOf(location.hash));
  history.replaceState(null, "", location.pathname + location.search);
}

/** The token in an entry that is a token or a whole address. */
function tokenOf(entry) {
  const text = entry.trim().replace(/^.*#token=/, "");
  return attempt(() => decodeURIComponent(text)) ?? text;
}

let question = null; // {dialog, about, answer}

/** Opens a dialog about an action; true if it is confirmed. */
function ask(dialog, about) {
  if (question?.about === "stop") return Promise.resolve(false);
  close(false);
  return new Promise((answer) => {
    question = { dialog, about, answer };
    dialog.append($("stop")); // a modal dialog blocks everything outside of it, and STOP must work
    dialog.showModal();
  });
}

function close(confirmed) {
  const open = question;
  question = null;
  document.body.append($("stop"));
  open?.dialog.close();
  open?.answer(confirmed);
}

async function askToken(action, why) {
  set($("token-why"), why);
  if (!(await ask($("token"), action))) return false;
  keepToken(tokenOf($("token-field").value));
  $("token-field").value = "";
  return true;
}

const label = (body) => (body.action === "stop" ? "STOP" : body.action === "experiment" ? `experiment ${body.name}` : body.action);

async function act(body) {
  const name = label(body);
  let why = `“${name}” needs the token.`;
  busy.add(body.action);
  controls(state);
  try {
    for (let trial = 1; ; ) {
      if (!token && !(await askToken(body.action, why))) return result(`${name}: not sent, the token is missing.`, "error");
      if (trial === 1) result(`${name}: sent, no answer yet.`, "");
      let response, answer;
      try {
        response = await fetch("action", {
          method: "POST",
          headers: { Authorization: `Bearer ${token}`, "Content-Type": "application/json" },
          body: JSON.stringify(body),
          signal: AbortSignal.timeout?.(body.action === "stop" ? 3000 : 20000),
        });
        answer = fields(await response.json().catch(() => null));
      } catch {
        if (body.action !== "stop") return result(`${name}: hydroid does not answer. Look at the state before trying again.`, "error");
        if (trial === 20) return result("STOP did not reach hydroid. Take the boat over with the remote control.", "error");
        result(`STOP has not reached hydroid. Trying again (${trial}). Take the boat over with the remote control.`, "error");
        trial += 1;
        await new Promise((done) => setTimeout(done, 500));
        continue;
      }
      if (response.status === 401) {
        keepToken("");
        why = `“${name}” was not accepted: ${words(answer.error)}`;
        continue;
      }
      if (response.ok) return result(`${name}: ${words(answer.done)}`, "good");
      return result(`${name}: ${words(answer.error ?? `status ${response.status}`)}`, "error");
    }
  } finally {
    busy.delete(body.action);
    controls(state);
  }
}

function halt() {
  // A dialog that already asks for the token of STOP stays.
  if (question?.about === "stop") return;
  close(false);
  act({ action: "stop" });
}

async function confirmed(body) {
  const link = fields(state.link);
  const commands = list(fields(state.helm).commands).map((command) => words(command?.name)).join(", ");
  const path = list(state.path).map((point) => place(point?.[0], point?.[1])).filter(Boolean);
  const length = path.slice(1).reduce((sum, p, i) => sum + Math.hypot(p[0] - path[i][0], p[1] - path[i][1]), 0);
  const experiment = body.action === "experiment";
  set($("confirm-title"), experiment ? `Run experiment ${body.name}?` : "Steer along the path?");
  const lines = [
    `hydroid takes the helm${commands && ` and commands ${commands}`}. The boat will move.`,
    ...(experiment ? [] : [path.length ? `The path has ${path.length} points and a length of ${figure(length, 0)} m.` : "The path is that of the settings (section [control]). It is drawn as soon as the controller is ready, and steering begins at once."]),
    fenceOf(state).text,
    `Autopilot: mode ${words(link.mode)}, ${pick({ true: "armed", false: "disarmed" }, link.armed) ?? "armed or not is unknown"}.`,
    "STOP or the key Escape releases the helm at once.",
  ];
  each($("confirm-text"), lines, () => make("li"), (row, text) => set(row, text));
  set($("confirm-yes"), experiment ? `Run ${body.name}` : "Steer");
  $("confirm-yes").dataset.for = body.action;
  controls(state);
  return ask($("confirm"), body.action);
}

async function press(action) {
  if (!possible(action)) return;
  result("", ""); // the answer before covers what the operator looks at now
  const body = action === "experiment" ? { action, name: $("experiment").value } : { action };
  const moves = action === "experiment" || action === "steer";
  if (!moves || (await confirmed(body))) act(body);
}

// ---- Drawing and start ----

const PARTS = [
  // part, function, least time between two drawings in ms (figures that change ten times a second cannot be read)
  ["warnings", warnings, 0], ["buttons", controls, 0], ["status", status, 200], ["chart", chart, 90], ["position", motionFigures, 200],
  ["speeds", speeds, 240], ["helm", helm, 90], ["model", model, 200], ["sensors", sensors, 480], ["excitation", excitation, 480],
].map(([name, run, period]) => ({ name, run, period, last: -Infinity }));

function draw() {
  queued = 0;
  const now = performance.now();
  for (const part of PARTS) {
    if (now - part.last < (calm.matches ? Math.max(1000, part.period) : part.period)) continue;
    part.last = now;
    try {
      part.run(state);
      failed.delete(part.name);
    } catch (error) {
      failed.add(part.name); // the other parts go on
      console.error(part.name, error);
    }
  }
}

function redraw() {
  readColours();
  for (const part of PARTS) part.last = -Infinity;
  draw();
}

function watch() {
  const waited = performance.now() - opened;
  // A connection can hang without an error, for example after a loss of the radio link.
  if (!document.hidden && ((silence() > patience && waited > patience) || (source?.readyState === 2 && waited > 2000))) {
    patience = Math.min(2 * patience, 30000);
    connect();
  }
  warnings();
  controls(state);
}

takeToken();
token ||= attempt(() => sessionStorage.getItem("hydroid-token")) ?? "";
addEventListener("hashchange", takeToken);
addEventListener("keydown", (event) => {
  if (event.key !== "Escape") return;
  event.preventDefault(); // the browser would close the dialog that asks for the token
  if (!event.repeat) halt();
}, true);
$("stop").addEventListener("click", halt);
$("give-token").addEventListener("click", async () => (await askToken("", "")) && result("The token is kept for this tab.", "good"));
for (const button of document.querySelectorAll("[data-action]")) button.addEventListener("click", () => press(button.dataset.action));
for (const button of document.querySelectorAll("[data-cancel]")) button.addEventListener("click", () => close(false));
for (const dialog of document.querySelectorAll("dialog")) dialog.addEventListener("close", () => question?.dialog === dialog && !dialog.open && close(false));
$("confirm-yes").addEventListener("click", () => close(true));
$("token-form").addEventListener("submit", (event) => {
  event.preventDefault();
  close(true);
});
for (const [id, followed] of [["view-fit", false], ["view-follow", true]])
  $(id).addEventListener("click", () => {
    follow = followed;
    map.scale = undefined;
    for (const other of ["view-fit", "view-follow"]) $(other).setAttribute("aria-pressed", String(other === id));
    redraw();
  });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
new ResizeObserver(redraw).observe($("outputs"));
new ResizeObserver(redraw).observe($("chart"));
// A browser allows six connections to a server: hidden tabs give theirs up, or an action would have to wait.
document.addEventListener("visibilitychange", () => {
  if (document.hidden) source?.close();
  else connect();
  watch();
});
addEventListener("pageshow", (event) => event.persisted && connect());
readColours();
connect();
setInterval(watch, 250);
