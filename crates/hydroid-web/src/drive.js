// Driving a model: commands, chart, speeds, trials.

/** Seconds of the plots. */
const DRIVE_PAST = 120;

/**
 * The driving view in an element. `vessel` is the document that hydroid writes of a model. `trials` are buttons: each has a `text`
 * and a function `run` that gives, now or later, what it shows: `{tracks, heads, rows, note}`. A track is `{name, colour, points}`
 * with rows `[t, north, east, u, v, r]`.
 */
class DriveView {
  constructor(box, vessel, trials = []) {
    Object.assign(this, { box, vessel, plant: new Plant(vessel) });
    Object.assign(this, { ahead: 0, pace: 1, running: true, stopped: false, trial: null, keys: { push: 0, turn: 0 }, levers: { push: 0, turn: 0 } });
    Plots.readColours();
    this.build(trials);
    this.restart();
  }

  // ---- Elements ----

  build(trials) {
    const { map } = this.vessel;
    const button = (text, act) => make("button", { type: "button", text, onclick: act });
    this.canvas = make("canvas", { className: "chart", tabIndex: 0, role: "application", "aria-label": `${DRIVE_TEXT.chart}. ${map ? DRIVE_TEXT.help : ""}` });
    this.canvas.onkeydown = (event) => this.key(event, true);
    this.canvas.onkeyup = (event) => this.key(event, false);
    this.canvas.onblur = () => { this.keys = { push: 0, turn: 0 }; };
    this.chart = new Plots.Chart(this.canvas);
    this.figures = make("dl", { className: "figures" });
    this.values = ["time", "surge", "sway", "rate", "speed", "heading"].map((name) => {
      const value = make("dd");
      this.figures.append(make("div", {}, make("dt", { text: DRIVE_TEXT[name] }), value));
      return value;
    });
    this.message = make("p", { className: "message", role: "status" });
    this.pauseButton = button(DRIVE_TEXT.pause, () => this.pause());
    const pace = make("select", { "aria-label": DRIVE_TEXT.pace, title: DRIVE_TEXT.pace }, ...[1, 2, 5, 10].map((x) => make("option", { value: x, text: `${x} ×` })));
    pace.onchange = () => { this.pace = Number(pace.value); };
    const follow = make("input", { type: "checkbox" });
    follow.onchange = () => { this.follow = follow.checked; };
    this.results = make("div", { className: "scroll" });
    this.trials = make("div", { className: "trials" });
    this.addTrials(trials);
    this.plots = this.curves();
    this.box.classList.add("driving");
    this.box.replaceChildren(
      make("div", { className: "helm" },
        make("div", { className: "map" }, this.canvas, make("p", { className: "hint", text: `${map ? DRIVE_TEXT.help : ""}${this.vessel.length_m ? "" : ` ${DRIVE_TEXT.scale}`}` })),
        make("div", { className: "side" },
          this.figures,
          map ? make("div", {}, pushed(map) ? this.lever("push", DRIVE_TEXT.propulsion) : "", this.lever("turn", DRIVE_TEXT.steering)) : "",
          make("details", { open: !map }, make("summary", { text: DRIVE_TEXT.commands }), ...this.inputs()),
          make("details", {}, make("summary", { text: DRIVE_TEXT.water }), ...this.water()),
          make("p", {}, button(DRIVE_TEXT.restart, () => { this.restart(); this.canvas.focus({ preventScroll: true }); }), this.pauseButton, pace, make("label", { className: "check" }, follow, DRIVE_TEXT.follow))),
        make("div", { className: "below" }, this.trials, this.message, this.results)),
      make("div", { className: "pair" }, ...this.plots.map((plot) => plot.box)));
  }

  /** Buttons of trials, under a title if there is one. They replace those that had the title before. */
  addTrials(trials, title = "") {
    for (const old of this.trials.querySelectorAll("p")) if (old.dataset.title === title) old.remove();
    const buttons = trials.map(({ text, run }) => make("button", { type: "button", text, onclick: () => this.show(run) }));
    this.trials.append(make("p", { data: { title } }, title ? make("span", { className: "caption", text: `${title}: ` }) : "", ...buttons));
  }

  /** A slider with its value. */
  slider(text, { low, high, value = 0, step = (high - low) / 200 || 1, unit = "" }, act) {
    const range = make("input", { type: "range", min: low, max: high, step, value });
    const output = make("output");
    const set = (x) => { range.value = x; output.textContent = `${figure(x, 3)} ${unit}`.trim(); };
    range.oninput = () => { set(Number(range.value)); act(Number(range.value)); };
    set(value);
    return { set, label: make("label", { className: "lever" }, make("span", { text }), range, output) };
  }

  lever(name, text) {
    const lever = this.slider(text, { low: -100, high: 100, step: 2, unit: "%" }, (value) => { this.levers[name] = value / 100; this.compose(); });
    this.levers[`${name}Slider`] = lever;
    return lever.label;
  }

  /** Sliders of the inputs, but for the wind. */
  inputs() {
    this.sliders = this.vessel.inputs.map(({ channel, range }, i) => {
      if (this.winds().includes(i)) return null;
      const [factor, unit] = shown(channel.unit);
      const slider = this.slider(channel.name, { low: range.low * factor, high: range.high * factor, unit }, (x) => { this.command[i] = x / factor; });
      return { label: slider.label, set: (x) => slider.set(x * factor) };
    });
    return this.sliders.filter(Boolean).map((slider) => slider.label);
  }

  /** Places of the inputs `wind_x = U² cos(direction)` and `wind_y = U² sin(direction)` of a model that was identified with wind. */
  winds() {
    const place = (name) => this.vessel.inputs.findIndex(({ channel }) => channel.name === name && channel.unit === "m^2/s^2");
    const both = [place("wind_x"), place("wind_y")];
    return both.includes(-1) ? [] : both;
  }

  water() {
    let [speed, towards] = [0, 0];
    const flow = () => { this.plant.current = [Math.cos(towards), Math.sin(towards)].map((x) => speed * x); };
    const all = [
      this.slider(DRIVE_TEXT.current, { low: 0, high: 2, step: 0.05 }, (x) => { speed = x; flow(); }),
      this.slider(DRIVE_TEXT.towards, { low: 0, high: 355, step: 5 }, (x) => { towards = (x * Math.PI) / 180; flow(); }),
    ];
    const winds = this.winds();
    if (winds.length) {
      this.wind = [0, 0];
      let [strength, direction] = [0, 0];
      const blow = () => {
        this.wind = [Math.cos(direction), Math.sin(direction)].map((x) => strength ** 2 * x);
        this.blow();
      };
      const reach = Math.max(...winds.map((i) => this.vessel.inputs[i].range).flatMap(({ low, high }) => [-low, high]), 0);
      all.push(
        this.slider(DRIVE_TEXT.wind, { low: 0, high: Math.sqrt(reach) }, (x) => { strength = x; blow(); }),
        this.slider(DRIVE_TEXT.from, { low: 0, high: 355, step: 5 }, (x) => { direction = (x * Math.PI) / 180; blow(); }));
    }
    return all.map((slider) => slider.label);
  }

  curves() {
    this.recent = { t: [], u: [], v: [], r: [] };
    const names = this.vessel.motion[1] === null ? ["u", "r"] : ["u", "v", "r"];
    return names.map((name) => {
      const holder = make("div", { className: "canvas", role: "img", "aria-label": DRIVE_TEXT.plots[name] });
      const box = make("div", {}, make("p", { className: "caption", text: DRIVE_TEXT.plots[name] }), holder);
      const least = name === "r" ? 2 : 0.2;
      const range = (_, low, high) => {
        if (low === null || high === null) return [-least, least];
        const room = Math.max(0.1 * (high - low), (least - (high - low)) / 2);
        return [low - room, high + room];
      };
      const scales = { x: { time: false, range: (_, low, high) => [low ?? 0, Math.max(high ?? 0, (low ?? 0) + 10)] }, y: { range } };
      return { name, box, plot: Plots.plot(holder, { scales, series: [{}, Plots.curve("model", 2)] }, [[], []]) };
    });
  }

  // ---- Commands ----

  key(event, down) {
    if (!this.vessel.map) return;
    const moves = { ArrowUp: ["push", 1], ArrowDown: ["push", -1], ArrowLeft: ["turn", -1], ArrowRight: ["turn", 1] };
    const move = Object.hasOwn(moves, event.key) ? moves[event.key] : null;
    if (!move && event.key !== " ") return;
    event.preventDefault();
    if (move && down && !event.repeat) this.nudge(...move);
    if (move) this.keys[move[0]] = down ? move[1] : 0;
    else if (down) this.set(0, 0);
  }

  /** A key that is pressed shortly is a step. */
  nudge(name, sign) {
    const { push, turn } = this.levers;
    this.set(push + (name === "push" ? 0.1 * sign : 0), turn + (name === "turn" ? 0.1 * sign : 0));
  }

  /** Propulsion and steering between -1 and 1. */
  set(push, turn) {
    for (const [name, value] of [["push", push], ["turn", turn]]) {
      this.levers[name] = Plots.bounded(value, -1, 1);
      this.levers[`${name}Slider`]?.set(100 * this.levers[name]);
    }
    this.compose();
  }

  /** The command of the levers. */
  compose() {
    const { push, turn } = this.levers;
    this.command = this.vessel.map ? this.plant.command(push, turn) : [...this.vessel.neutral];
    this.blow();
    this.sliders.forEach((slider, i) => slider?.set(this.command[i]));
  }

  blow() {
    this.winds().forEach((i, k) => { this.command[i] = this.wind[k]; });
  }

  steer(elapsed) {
    if (!this.vessel.map) return;
    const { push, turn } = this.keys;
    if (push || turn) this.set(this.levers.push + 0.5 * push * elapsed, this.levers.turn + turn * elapsed);
    const pads = navigator.getGamepads ? [...navigator.getGamepads()] : [];
    const pad = pads.find((one) => one && one.axes.length > 1);
    if (!pad) return;
    // Sticks at rest have small values.
    const stick = (x) => (Math.abs(x) < 0.1 ? 0 : x);
    const asked = [-stick(pad.axes[1]), stick(pad.axes[2] ?? pad.axes[0])];
    // A gamepad that is not touched leaves the levers to others.
    if (asked.join() !== (this.asked ?? [0, 0]).join()) this.set(...asked);
    this.asked = asked;
  }

  // ---- Time ----

  restart() {
    this.plant.start();
    this.before = this.plant.eta;
    this.track = [[0, 0]];
    for (const list of Object.values(this.recent)) list.length = 0;
    this.message.textContent = "";
    this.drive();
    this.set(0, 0);
  }

  /** Leaves a trial. */
  drive() {
    this.shownTrial = null;
    this.trial = null;
    this.results.replaceChildren();
    this.chart.scale = undefined;
    this.run(true);
  }

  run(running) {
    this.running = running;
    if (running) this.told = undefined;
    this.pauseButton.textContent = running ? DRIVE_TEXT.pause : this.trial ? DRIVE_TEXT.back : DRIVE_TEXT.goOn;
  }

  pause() {
    if (this.trial) this.drive();
    else this.run(!this.running);
    this.canvas.focus({ preventScroll: true });
  }

  start() {
    let last = performance.now();
    const frame = (now) => {
      if (this.stopped) return;
      requestAnimationFrame(frame);
      this.frame(Math.min((now - last) / 1000, 0.25), now);
      last = now;
    };
    requestAnimationFrame(frame);
  }

  stop() {
    this.stopped = true;
  }

  frame(elapsed, now) {
    this.steer(elapsed);
    if (this.running) this.advance(elapsed);
    this.draw();
    // Figures that change ten times a second cannot be read.
    if (!(now - this.told < 200)) {
      this.told = now;
      this.tell();
    }
  }

  /** The samples that are due, as far as half of the time suffices, so that the page stays free. */
  advance(elapsed) {
    const { dt } = this.vessel;
    const end = performance.now() + 500 * elapsed;
    this.ahead += elapsed * this.pace;
    let slow = false;
    while (this.ahead >= dt) {
      this.before = this.plant.eta;
      this.plant.advance(this.command);
      this.ahead -= dt;
      if (!this.plant.sound()) {
        this.message.textContent = DRIVE_TEXT.diverged;
        this.run(false);
        return;
      }
      this.record();
      if (performance.now() > end && this.ahead >= dt) {
        this.ahead = 0;
        slow = true;
      }
    }
    this.slow = slow;
  }

  record() {
    const { plant, recent, track } = this;
    track.push(plant.eta.slice(0, 2));
    if (track.length > 20000) this.track = track.filter((_, i) => i > 15000 || i % 2);
    const [u, v, r] = plant.over_ground();
    for (const [list, x] of [[recent.t, plant.time], [recent.u, u], [recent.v, v], [recent.r, (r * 180) / Math.PI]]) {
      list.push(x);
      if (list.length > DRIVE_PAST / this.vessel.dt + 1) list.shift();
    }
  }

  // ---- Display ----

  tell() {
    const [u, v, r] = this.plant.over_ground();
    const degrees = (rad) => (rad * 180) / Math.PI;
    const heading = ((degrees(this.plant.eta[2]) % 360) + 360) % 360;
    const fixed = (x, digits, unit) => `${Plots.fixed(x, digits)} ${unit}`;
    const sway = this.vessel.motion[1] === null ? "–" : fixed(v, 2, "m/s");
    const texts = [fixed(this.plant.time, 1, "s"), fixed(u, 2, "m/s"), sway, fixed(degrees(r), 1, "°/s"), fixed(Math.hypot(u, v), 2, "m/s"), `${Math.round(heading) % 360}°`];
    texts.forEach((text, i) => { this.values[i].textContent = this.trial ? "–" : text; });
    const past = this.trial ? this.trial.past : this.recent;
    for (const { name, plot } of this.plots) plot.setData([past.t, past[name]]);
    if (!this.trial) this.warn();
  }

  /** Says where the model extrapolates, or the device is too slow. */
  warn() {
    const beyond = this.vessel.outputs.filter(({ range, training_range }, i) => {
      const { low, high } = training_range ?? range;
      const room = 0.1 * (high - low);
      return this.plant.y[i] < low - room || this.plant.y[i] > high + room;
    });
    const text = beyond.length ? DRIVE_TEXT.extrapolates(beyond.map(({ channel }) => channel.name).join(", ")) : this.slow ? DRIVE_TEXT.slow : "";
    if (this.plant.sound() && this.message.textContent !== text) this.message.textContent = text;
  }

  draw() {
    const { chart, trial, track } = this;
    if (!chart.begin()) return;
    const { colours } = Plots;
    if (trial) {
      const points = trial.tracks.flatMap((one) => one.points.map(([, north, east]) => [north, east]));
      chart.fit(points, { reach: this.reach() / 4 });
      chart.grid();
      for (const { colour, points: of } of trial.tracks) chart.line(of.map(([, north, east]) => [north, east]), colours[colour], 2.5);
      const named = trial.tracks.filter(({ name }) => name);
      named.forEach(({ name, colour }, i) => chart.label(name, 12, 40 + 18 * i, "left", colours[colour]));
      chart.frame();
      return;
    }
    if (!this.plant.sound()) {
      chart.fit(track, { reach: this.reach() });
      chart.grid();
      chart.line(track, colours.model, 2.5);
      chart.frame();
      return;
    }
    // Between two samples the vessel is shown on the way.
    const share = Plots.bounded(this.ahead / this.vessel.dt, 0, 1);
    const [x, y, psi] = this.plant.eta.map((after, i) => this.before[i] + share * (after - this.before[i]));
    chart.fit(this.follow ? [[x, y]] : [...track, [x, y]], { centre: this.follow ? [x, y] : null, reach: this.reach() });
    chart.grid();
    chart.line([...track.slice(0, -1), [x, y]], colours.model, 2.5);
    chart.vessel([x, y], psi, Math.max((this.vessel.length_m ?? 0) * chart.scale, 18));
    chart.frame();
  }

  /** Least half width of the chart: the way of ten seconds at the highest speed of the logs. */
  reach() {
    const { low, high } = this.vessel.outputs[this.vessel.motion[0]].range;
    return Math.max(10 * Math.max(-low, high), 2 * (this.vessel.length_m ?? 0), 0.1);
  }

  /** A trial: its tracks on the chart, and its figures in a table. */
  async show(run) {
    // Driving, or another trial, may begin before this one is computed.
    const own = {};
    this.shownTrial = own;
    this.run(false);
    this.trial ??= { tracks: [], past: { t: [], u: [], v: [], r: [] } };
    this.results.replaceChildren();
    this.message.textContent = DRIVE_TEXT.computing;
    try {
      const { tracks, heads, rows, note } = await run();
      if (this.shownTrial !== own) return;
      this.message.textContent = note ?? "";
      const [points] = tracks.map((track) => track.points);
      const column = (i, factor = 1) => points.map((row) => (row[i] === null ? null : row[i] * factor));
      this.trial = { tracks, past: { t: column(0), u: column(3), v: column(4), r: column(5, 180 / Math.PI) } };
      this.told = undefined;
      this.chart.scale = undefined;
      this.run(false);
      const cells = (list, tag) => list.map((text, i) => make(i === 0 ? "th" : tag, { text, ...(i === 0 ? { scope: "row" } : {}) }));
      this.results.replaceChildren(make("table", { className: "results" },
        make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { text, scope: "col" })))),
        make("tbody", {}, ...rows.map((row) => make("tr", {}, ...cells(row, "td"))))));
      this.canvas.scrollIntoView({ block: "nearest" });
    } catch (error) {
      if (this.shownTrial !== own) return;
      this.drive();
      this.run(false);
      this.message.textContent = error.message;
      // Driving goes on when the message is read.
      this.told = Infinity;
    }
  }
}

/** Whether an input pushes the vessel. */
function pushed(map) {
  return map.push.some((share) => share !== 0);
}

/** What trials of the document of `hydroid manoeuvre` show, side by side. */
function trialsShown(trials, vessel) {
  const colours = ["model", "alarm", "ink", "command"];
  const tracks = trials.map(({ title, track }, i) => ({ name: title, colour: colours[i % colours.length], points: track }));
  const lasts = Math.max(...trials.map(({ track }) => track[track.length - 1][0]));
  const { judged_s } = vessel;
  const { approach_m_s, approach_percent } = trials[0];
  const notes = [approach_percent === null ? DRIVE_TEXT.ownSpeed(figure(approach_m_s, 3)) : DRIVE_TEXT.approach(figure(approach_m_s, 3), figure(approach_percent, 3))];
  if (judged_s && lasts > judged_s) notes.push(DRIVE_TEXT.beyond(figure(lasts, 2), figure(judged_s, 2)));
  for (const { title, not_valid } of trials) if (not_valid) notes.push(DRIVE_TEXT.notValid(title, not_valid));
  if (trials.some(({ figures }) => figures.some((one) => one.interval))) notes.push(DRIVE_TEXT.members);
  if (trials.some(({ figures }) => figures.some((one) => one.extrapolated))) notes.push(DRIVE_TEXT.outside);
  const value = (one) => (one ? one.value === null ? one.missing : `${quantity(one.value, one.unit)}${one.extrapolated ? " *" : ""}${one.interval ? ` (${one.interval.map((x) => figure(x, 3)).join(" – ")})` : ""}` : "");
  const labels = [...new Set(trials.flatMap(({ figures }) => figures.map((one) => one.label)))];
  const rows = labels.map((label) => [label, ...trials.map(({ figures }) => value(figures.find((one) => one.label === label)))]);
  return { tracks, heads: ["", ...trials.map(({ title }) => title)], rows, note: notes.join(" ") };
}

/** What a trial in a log beside its prediction shows. */
function comparisonShown({ title, figures, tracks: [measured, predicted], note }) {
  const columns = ["measured", "predicted"].map((name) => [name, (one) => quantity(one[name], one.unit)]);
  if (figures.some((one) => one.interval)) columns.push(["interval", (one) => (one.interval ? one.interval.map((x) => figure(x, 3)).join(" – ") : "")]);
  const tracks = [{ name: DRIVE_TEXT.predicted, colour: "model", points: predicted }, { name: DRIVE_TEXT.measured, colour: "ink", points: measured }];
  return { tracks, heads: [title, ...columns.map(([name]) => DRIVE_TEXT[name])], rows: figures.map((one) => [one.label, ...columns.map(([, text]) => text(one))]), note };
}
