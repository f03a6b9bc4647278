// What came out: grades, models, driving, downloads.

/** Identified models, the latest first; a class compares them. */
const MOST_TRIES = 12;

/** What the page calls a model. */
const called = (name) => (Object.hasOwn(TEXT.stages, name) ? TEXT.stages[name] : name);

const mean = (list) => (list && list.length ? list.reduce((a, b) => a + b, 0) / list.length : null);

/** Takes a result into the list of models. */
function keepTry(result, learnt) {
  const onLogs = Boolean(result.summary.models[0]?.test);
  const fresh = result.models.map((model) => ({ ...model, learnt, onLogs, bytes: result.files.find((file) => file.name === model.name).bytes }));
  fresh.sort((a, b) => Number(b.best) - Number(a.best));
  // The same model again replaces the earlier one.
  const key = (one) => JSON.stringify([one.name, one.learnt, one.horizon_s, one.channels, one.judged]);
  const keys = fresh.map(key);
  state.tries = [...fresh, ...state.tries.filter((one) => !keys.includes(key(one)))].slice(0, MOST_TRIES);
}

async function showResult() {
  const { summary, report, models } = state.result;
  show("report");
  const best = models.find((model) => model.best) ?? models[0];
  const errors = summary.models.find((model) => model.name === best?.name);
  const judged = errors && (errors.test ?? errors.validation);
  const tiles = (summary.verdicts ?? []).map((verdict) => tile(verdict, judged));
  $("verdicts").replaceChildren(...tiles);
  $("ahead").replaceChildren(...(best && best.horizon_s ? explained(TEXT.ahead(figure(best.horizon_s, 3))) : []));
  listTries();
  $("page").srcdoc = report;
  const tab = $("report-tab");
  if (tab.href) URL.revokeObjectURL(tab.href);
  tab.href = URL.createObjectURL(new Blob([report], { type: "text/html" }));
  if (best) await open(`${best.name}.safetensors`, state.result.files.find((file) => file.name === best.name).bytes, state.tries.find((one) => one.best)?.learnt);
}

function tile({ channel, grade, nrmse, persistence, reason }, judged) {
  const place = judged ? judged.channels.indexOf(channel) : -1;
  const [factor, unit] = shown(place < 0 ? "" : judged.units[place] ?? "");
  const rmse = place < 0 ? null : judged.rmse[judged.rmse.length - 1]?.[place];
  const bar = (name, value) => {
    const fill = make("span", { className: "fill" });
    fill.style.width = `${Math.min(100, (100 * value) / 1.5)}%`;
    return make("div", { className: "bar" }, make("span", {}, ...explained(name)), make("span", { className: "track" }, fill), make("b", { text: figure(value, 2) }));
  };
  return make("li", { className: `tile ${grade}` }, make("p", {}, make("b", { text: channel }), ` ${TEXT.grades[grade] ?? grade}`),
    bar(TEXT.modelError, nrmse), bar(TEXT.lastValue, persistence), ...(reason ? [make("p", { className: "caption", text: reason })] : []), make("p", { className: "caption", text: rmse ? `± ${figure(rmse * factor, 2)} ${unit}` : "" }));
}

function listTries() {
  const rows = state.tries.map((one) => {
    const drive = make("button", { type: "button", text: TEXT.driveThis, onclick: () => open(`${one.name}.safetensors`, one.bytes, one.learnt).then(() => lead("drive")).catch(failed) });
    drive.setAttribute("aria-label", `${TEXT.driveThis}: ${called(one.name)}, ${one.learnt}`);
    const [own, fresh] = [one.fitted, one.judged].map(mean);
    return make("tr", {}, make("th", { scope: "row", text: `${called(one.name)}${one.best ? ` (${TEXT.best})` : ""}` }),
      ...[String(one.weights), one.learnt, `${figure(one.horizon_s, 3)} s: ${one.channels.join(", ")}`, figure(own, 2), `${one.diverged ? "∞" : figure(fresh, 2)}${one.onLogs ? "" : ` ${TEXT.leftOutParts}`}`].map((text, i) => make("td", { text, data: { label: TEXT.tryHeads[i + 1] } })), make("td", {}, drive));
  });
  $("tries").replaceChildren(make("thead", {}, make("tr", {}, ...TEXT.tryHeads.map((text) => make("th", { text, scope: "col" })))), make("tbody", {}, ...rows));
}

/** A model, to be driven. */
async function open(name, content, learnt = "") {
  const vessel = await helm.call("vessel", [name, content]);
  state.vessel = { name, bytes: content, learnt };
  driven = vessel;
  show("drive");
  show("save");
  downloads(vessel);
  if (view) view.stop();
  view = null;
  $("drive-name").textContent = `${called(vessel.name)}: ${learnt || vessel.title}`;
  if (vessel.motion === null) $("driving").replaceChildren(make("p", { className: "message", text: plain(vessel.not_driven) }));
  else {
    view = new DriveView($("driving"), vessel, trialButtons(vessel));
    if (vessel.map && pushed(vessel.map)) view.trials.append(approachChoice());
    view.start();
  }
  say("drive-message", vessel.not_steered && vessel.motion ? plain(vessel.not_steered) : vessel.notes.join(" "));
  await remember();
}

function trialButtons(vessel) {
  const simulated = (text, trial) => ({ text, run: () => simulate(trial, vessel) });
  const list = vessel.map ? [simulated(TEXT.circle, "turning-circle"), simulated(TEXT.zigzag, "zigzag")] : [];
  if (vessel.map && pushed(vessel.map)) list.push(simulated(TEXT.stopping, "stopping"));
  if (state.result) list.push({ text: TEXT.inLogs, run: measured });
  return list;
}

/** Shares of full propulsion for the approach to a trial [%], from that of the test speed of the IMO down. */
const SHARES = [85, 60, 40, 25];

/** A trial from a steady approach with the chosen share of the propulsion, or with the highest one that has a steady approach. A
 * vessel that no input pushes has one approach. */
async function simulate(trial, vessel) {
  let highest = null;
  const chosen = state.propulsion ? [state.propulsion] : SHARES;
  for (const propulsion of pushed(vessel.map) ? chosen : [null]) {
    try {
      return trialsShown(await helm.call("trials", [{ trials: [trial], propulsion }]), vessel);
    } catch (error) {
      highest ??= error;
    }
  }
  throw new Error(`${plain(highest.message)}. ${TEXT.otherApproach}`);
}

/** The propulsion of the approach. */
function approachChoice() {
  const option = (value, text) => make("option", { value, text, selected: value === (state.propulsion ?? 0) });
  const select = make("select", {}, option(0, TEXT.highest(SHARES[0])), ...SHARES.map((value) => option(value, `${value} %`)));
  select.onchange = () => { state.propulsion = Number(select.value); };
  return make("label", { className: "choice" }, make("span", { text: TEXT.approach }), select);
}

/** Trials in the logs: a button for each. */
async function measured() {
  const [own, { name, bytes: content }] = [view, state.vessel];
  const names = state.files.map((file) => file.name).filter((file) => state.parts.get(file) !== "unused");
  const found = await bench.call("compare", [name, content, names]);
  if (!found.length) throw new Error(TEXT.noTrials);
  own.addTrials(found.map((one) => ({ text: one.title, run: () => comparisonShown(one) })), TEXT.inLogs);
  return comparisonShown(found[0]);
}

/** The settings as a file of the command. */
function settings() {
  const value = (item) => {
    if (Array.isArray(item)) return `[${item.map(value).join(", ")}]`;
    if (typeof item === "object") return `{ ${Object.entries(item).map(([key, of]) => `${key} = ${value(of)}`).join(", ")} }`;
    return JSON.stringify(item);
  };
  const lines = ["[log]"];
  const { request } = state.result;
  const { sensors: own, ...log } = request.config.log;
  for (const [key, item] of Object.entries(log)) lines.push(`${key} = ${value(item)}`);
  if (own) {
    lines.push("", "[log.sensors]");
    for (const [key, item] of Object.entries(own)) if (["string", "number"].includes(typeof item) || Array.isArray(item)) lines.push(`${key} = ${value(item)}`);
  }
  for (const [name, { found, ...input }] of Object.entries(request.config.boat?.inputs ?? {})) {
    lines.push("", `[boat.inputs.${value(name)}]`, ...Object.entries(input).map(([key, item]) => `${key} = ${value(item)}`));
    // What only the values tell does not become a statement.
    if (found?.neutral?.log) lines.push(`found = { neutral = { log = ${value(found.neutral.log)} } }`);
  }
  lines.push("", "[split]");
  for (const part of ["train", "validate", "test"]) if (request[part].length) lines.push(`${part} = ${value(request[part])}`);
  lines.push("", "[identify]", ...Object.entries(request.config.identify).map(([key, item]) => `${key} = ${value(item)}`));
  return `${lines.join("\n")}\n`;
}

function downloads(vessel) {
  const failed = (error) => say("save-message", plain(error.message), "error");
  const button = (text, act) => make("button", { type: "button", text, onclick: () => Promise.resolve().then(act).catch(failed) });
  const keep = (name, content, type) => {
    download(name, content, type);
    say("save-message", TEXT.kept(name));
  };
  const list = [button(TEXT.downloads.model, () => keep(state.vessel.name, state.vessel.bytes))];
  if (state.result) {
    list.push(button(TEXT.downloads.report, () => keep("report.html", state.result.report, "text/html")));
    list.push(button(TEXT.downloads.summary, () => keep("identify.json", JSON.stringify(state.result.summary, null, 2), "application/json")));
    list.push(button(TEXT.downloads.config, () => keep("hydroid.toml", settings(), "text/plain")));
  }
  if (hasRole("input")) {
    for (const { name } of state.files) {
      list.push(button(TEXT.downloads.table(name), async () => keep(`${name.replace(/\.[^.]*$/, "")}-prepared.csv`, await bench.call("converted", [name, { log: logSection(), boat: boatSection() }]), "text/csv")));
    }
  }
  $("downloads").replaceChildren(...list);
  $("exports").replaceChildren(...Object.entries(TEXT.exports).map(([format, text]) => button(text, async () => {
    const files = await helm.call("exported", [format, vessel.name]);
    for (const file of files) download(file.name, file.bytes);
    say("save-message", files.map((f) => TEXT.kept(f.name)).join(", "));
  })));
}
