// Driving a model: commands, track, speeds, trials. `engine` has the calls of the worker; `vessel` is its description.
class DriveView {
  constructor(box, engine, vessel) {
    Object.assign(this, { box, engine, vessel });
    this.time = 0;
    this.track = [];
    this.trial = null;
    this.ahead = 0;
    this.pace = 1;
    this.running = true;
    this.busy = false;
    this.keys = { push: 0, turn: 0 };
    this.levers = { push: 0, turn: 0 };
    this.recent = { t: [], u: [], r: [] };
    this.build();
  }

  build() {
    const inputs = this.vessel.inputs;
    this.canvas = make("canvas", { className: "chart", tabIndex: 0, "aria-label": TEXT.driveHelp, role: "img" });
    this.figures = make("p", { className: "figures", role: "status" });
    const lever = (name, text) => {
      const range = make("input", { type: "range", min: -1, max: 1, step: 0.02, value: 0 });
      range.oninput = () => { this.levers[name] = Number(range.value); this.compose(); };
      this.levers[`${name}Range`] = range;
      return make("label", { className: "lever" }, make("span", { text }), range);
    };
    const pair = make("div", { className: "levers" }, lever("push", TEXT.throttle), lever("turn", TEXT.rudder));
    this.sliders = inputs.map((port) => {
      const { low, high } = port.range;
      const range = make("input", { type: "range", min: low, max: high, step: (high - low) / 200 || 1, value: Math.min(Math.max(0, low), high) });
      const value = make("output");
      range.oninput = () => { this.command = this.sliders.map((s) => Number(s.range.value)); this.show(); };
      const unit = port.channel.unit ? ` [${port.channel.unit}]` : "";
      return { range, value, label: make("label", { className: "lever" }, make("span", { text: `${port.channel.name}${unit}` }), range, value) };
    });
    this.command = this.sliders.map((s) => Number(s.range.value));
    const speed = make("input", { type: "range", min: 0, max: 2, step: 0.05, value: 0 });
    const towards = make("input", { type: "range", min: 0, max: 360, step: 5, value: 0 });
    const flow = make("output");
    const current = async () => {
      const [m, angle] = [Number(speed.value), (Number(towards.value) * Math.PI) / 180];
      flow.textContent = `${m} m/s, ${towards.value}°`;
      await this.engine.call("drive", [m * Math.cos(angle), m * Math.sin(angle)]);
      this.begin();
    };
    speed.onchange = towards.onchange = current;
    const button = (text, act) => make("button", { type: "button", text, onclick: act });
    this.pauseButton = button(TEXT.pause, () => this.pause());
    const paces = make("select", { "aria-label": TEXT.speed });
    for (const pace of [1, 2, 5, 10]) paces.append(make("option", { value: pace, text: `${pace} x` }));
    paces.onchange = () => { this.pace = Number(paces.value); };
    const trial = (text, settings) => button(text, () => this.run(settings));
    this.message = make("p", { className: "message", role: "status" });
    this.plots = make("div", { className: "pair" });
    this.results = make("table", { className: "results" });
    const driven = this.vessel.steering !== null && this.vessel.steering !== undefined;
    this.box.replaceChildren(
      make("div", { className: "helm" },
        this.canvas,
        make("div", { className: "side" },
          this.figures,
          driven ? pair : "",
          make("details", { open: !driven }, make("summary", { text: TEXT.commands }), ...this.sliders.map((s) => s.label)),
          make("details", {}, make("summary", { text: TEXT.current }),
            make("label", { className: "lever" }, make("span", { text: `${TEXT.current} [m/s]` }), speed),
            make("label", { className: "lever" }, make("span", { text: TEXT.from }), towards, flow)),
          make("p", {}, button(TEXT.restart, () => this.restart()), this.pauseButton, paces),
          driven ? make("p", {}, trial(TEXT.circle, { trials: ["turning-circle"] }), trial(TEXT.zigzag, { trials: ["zigzag"] }), trial(TEXT.stopping, { trials: ["stopping"] })) : "",
          this.message)),
      this.plots,
      make("div", { className: "scroll" }, this.results));
    this.canvas.onkeydown = (event) => this.key(event, true);
    this.canvas.onkeyup = (event) => this.key(event, false);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  key(event, down) {
    const moves = { ArrowUp: ["push", 1], ArrowDown: ["push", -1], ArrowLeft: ["turn", -1], ArrowRight: ["turn", 1] };
    if (event.key === " ") {
      event.preventDefault();
      if (down) this.set(0, 0);
    } else if (moves[event.key]) {
      event.preventDefault();
      const [name, sign] = moves[event.key];
      this.keys[name] = down ? sign : 0;
    }
  }

  set(push, turn) {
    this.levers.push = push;
    this.levers.turn = turn;
    if (this.levers.pushRange) this.levers.pushRange.value = push;
    if (this.levers.turnRange) this.levers.turnRange.value = turn;
    this.compose();
  }

  /// The command of the levers.
  async compose() {
    const command = await this.engine.call("command", [this.levers.push, this.levers.turn]);
    if (command.length !== this.sliders.length) return;
    this.command = [...command];
    this.sliders.forEach((s, i) => { s.range.value = this.command[i]; });
    this.show();
  }

  show() {
    this.sliders.forEach((s, i) => { s.value.textContent = figure(this.command[i]); });
  }

  async restart() {
    await this.engine.call("start");
    this.set(0, 0);
    this.begin();
  }

  begin() {
    this.track = [];
    this.trial = null;
    this.time = 0;
    this.recent = { t: [], u: [], r: [] };
    this.message.textContent = "";
    this.results.replaceChildren();
    this.running = true;
    this.pauseButton.textContent = TEXT.pause;
  }

  pause() {
    this.running = !this.running;
    this.pauseButton.textContent = this.running ? TEXT.pause : TEXT.goOn;
  }

  async start() {
    this.stopped = false;
    await this.engine.call("drive", [0, 0]);
    this.begin();
    await this.compose();
    let last = performance.now();
    const frame = (now) => {
      if (this.stopped) return;
      requestAnimationFrame(frame);
      const elapsed = Math.min((now - last) / 1000, 0.25);
      last = now;
      this.step(elapsed);
    };
    requestAnimationFrame(frame);
  }

  stop() {
    this.stopped = true;
  }

  gamepad() {
    const pad = [...(navigator.getGamepads ? navigator.getGamepads() : [])].find((p) => p);
    if (!pad || pad.axes.length < 2) return;
    const dead = (x) => (Math.abs(x) < 0.1 ? 0 : x);
    const [turn, push] = [dead(pad.axes[2] ?? pad.axes[0]), -dead(pad.axes[1])];
    if (turn !== this.levers.turn || push !== this.levers.push) this.set(push, turn);
  }

  async step(elapsed) {
    this.gamepad();
    const { push, turn } = this.keys;
    if (push || turn) {
      const limit = (x) => Math.max(-1, Math.min(1, x));
      this.set(limit(this.levers.push + push * elapsed * 0.5), limit(this.levers.turn + turn * elapsed));
    }
    if (!this.running || this.busy) return;
    this.ahead += elapsed * this.pace;
    const samples = Math.floor(this.ahead / this.vessel.dt);
    if (samples < 1) return;
    this.ahead -= samples * this.vessel.dt;
    this.busy = true;
    try {
      const { state, sound } = await this.engine.call("advance", [this.command, samples]);
      this.time += samples * this.vessel.dt;
      if (!sound) {
        this.message.textContent = TEXT.diverged;
        this.running = false;
      } else {
        this.take(state);
      }
    } catch (error) {
      this.message.textContent = error.message;
      this.stop();
    } finally {
      this.busy = false;
    }
  }

  take(state) {
    const [x, y, psi, u, v, r] = state;
    this.state = state;
    this.track.push([x, y, psi]);
    if (this.track.length > 20000) this.track.splice(0, 10000);
    const { recent } = this;
    recent.t.push(this.time);
    recent.u.push(u);
    recent.r.push((r * 180) / Math.PI);
    while (recent.t.length && recent.t[0] < this.time - 120) {
      recent.t.shift();
      recent.u.shift();
      recent.r.shift();
    }
    this.heading = ((((psi * 180) / Math.PI) % 360) + 360) % 360;
    this.figures.textContent = `${this.time.toFixed(1)} s · u ${u.toFixed(2)} m/s · v ${v.toFixed(2)} m/s · r ${((r * 180) / Math.PI).toFixed(1)} °/s · ${TEXT.heading} ${this.heading.toFixed(0)}°`;
    this.draw();
    if (!this.plotted || this.time - this.plotted > 0.5 || this.time < this.plotted) this.curves();
  }

  curves() {
    this.plotted = this.time;
    const { t, u, r } = this.recent;
    if (!this.charts) {
      const axis = { stroke: colour("--muted"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui" };
      this.charts = [["u [m/s]", u], ["r [°/s]", r]].map(([name, values]) => {
        const holder = make("div", { className: "canvas", role: "img", "aria-label": name });
        this.plots.append(make("div", {}, make("p", { className: "caption", text: name }), holder));
        const chart = new uPlot({
          width: holder.clientWidth || 300, height: 110, legend: { show: false }, cursor: { show: false }, scales: { x: { time: false } },
          series: [{}, { stroke: colour("--model"), width: 1.5, points: { show: false } }], axes: [{ ...axis, size: 26 }, { ...axis, size: 46 }],
        }, [t, values], holder);
        new ResizeObserver(() => chart.setSize({ width: holder.clientWidth, height: 110 })).observe(holder);
        return chart;
      });
    }
    this.charts[0].setData([t, u]);
    this.charts[1].setData([t, r]);
  }

  /// A trial, and its figures.
  async run(settings) {
    this.message.textContent = TEXT.inTrial;
    try {
      const document = await this.engine.call("trials", [settings]);
      this.message.textContent = "";
      this.trial = document.trials.map((trial) => ({ title: trial.title, tracks: trial.tracks }));
      const rows = document.trials.flatMap((trial) => trial.figures.map((f) => [trial.title, f]));
      this.results.replaceChildren(...rows.map(([title, f]) =>
        make("tr", {}, make("th", { text: title, scope: "row" }), make("td", { text: f.name ?? f.symbol ?? "" }), make("td", { text: `${figure(f.value)} ${f.unit ?? ""}` }))));
      this.running = false;
      this.pauseButton.textContent = TEXT.goOn;
      this.draw();
    } catch (error) {
      this.message.textContent = error.message;
    }
  }

  draw() {
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    if (!w || !h) return;
    if (canvas.width !== Math.round(w * ratio)) canvas.width = Math.round(w * ratio);
    if (canvas.height !== Math.round(h * ratio)) canvas.height = Math.round(h * ratio);
    const g = canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, w, h);
    const trial = this.trial ? this.trial.flatMap((t) => t.tracks.flat().map(([, x, y]) => [x, y])) : [];
    const points = this.trial ? trial : this.track.map(([x, y]) => [x, y]);
    const size = this.vessel.length ?? 3;
    let [south, north, west, east] = [-5 * size, 5 * size, -5 * size, 5 * size];
    for (const [x, y] of points) {
      south = Math.min(south, x); north = Math.max(north, x);
      west = Math.min(west, y); east = Math.max(east, y);
    }
    const scale = 0.9 * Math.min(w / (east - west), h / (north - south));
    const at = (x, y) => [w / 2 + (y - (east + west) / 2) * scale, h / 2 - (x - (north + south) / 2) * scale];
    // A grid of round numbers.
    const wide = 80 / scale;
    const ten = 10 ** Math.floor(Math.log10(wide));
    const step = [1, 2, 5, 10].map((k) => k * ten).find((k) => k >= wide);
    g.strokeStyle = colour("--grid");
    g.fillStyle = colour("--muted");
    g.font = "12px system-ui";
    g.lineWidth = 1;
    const [x0, y0] = [(north + south) / 2, (east + west) / 2];
    const [half, tall] = [w / 2 / scale, h / 2 / scale];
    for (let y = Math.ceil((y0 - half) / step) * step; y < y0 + half; y += step) {
      const [px] = at(0, y);
      g.beginPath(); g.moveTo(px, 0); g.lineTo(px, h); g.stroke();
      g.fillText(`${figure(y)} m`, px + 3, h - 4);
    }
    for (let x = Math.ceil((x0 - tall) / step) * step; x < x0 + tall; x += step) {
      const [, py] = at(x, 0);
      g.beginPath(); g.moveTo(0, py); g.lineTo(w, py); g.stroke();
    }
    g.fillText("N ↑", 6, 14);
    const line = (list, style, width) => {
      g.strokeStyle = style;
      g.lineWidth = width;
      g.beginPath();
      list.forEach(([x, y], i) => { const [px, py] = at(x, y); if (i) g.lineTo(px, py); else g.moveTo(px, py); });
      g.stroke();
    };
    if (this.trial) {
      for (const { tracks } of this.trial) for (const track of tracks) line(track.map(([, x, y]) => [x, y]), colour("--model"), 2);
      return;
    }
    line(points, colour("--model"), 2);
    if (this.state) {
      const [x, y, psi] = this.state;
      const [px, py] = at(x, y);
      const long = Math.max(size * scale, 14);
      g.save();
      g.translate(px, py);
      g.rotate(psi);
      g.fillStyle = colour("--ink");
      g.beginPath();
      g.moveTo(0, -long / 2); g.lineTo(long / 5, -long / 5); g.lineTo(long / 5, long / 2); g.lineTo(-long / 5, long / 2); g.lineTo(-long / 5, -long / 5);
      g.closePath(); g.fill();
      g.restore();
    }
  }
}
