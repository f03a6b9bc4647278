// The way through the page: logs, columns, identification, report, driving, downloads.
const bench = new Engine();
const helm = new Engine();
// Names of files and columns are keys of maps: as names of properties, some would change the program.
const state = { files: [], looks: new Map(), roles: new Map(), parts: new Map(), methods: ["committee", "sindy"], result: null, vessel: null };
let view = null;

const ROLES = ["none", "output", "input", "time", "heading"];
const LARGEST = 2e9;
const isModel = (name) => /\.(safetensors|toml)$/i.test(name);

async function remember() {
  const { files, roles, parts, methods, result, vessel } = state;
  await store.save("state", { files, roles, parts, methods, result, vessel });
}

/// Files that were dropped or chosen.
async function take(list) {
  for (const file of list) {
    if (file.size > LARGEST) {
      say("files-message", TEXT.tooLarge(file.name), "error");
      continue;
    }
    try {
      if (isModel(file.name)) {
        await open(file.name, new Uint8Array(await file.arrayBuffer()));
        continue;
      }
      say("files-message", `${TEXT.reading} ${file.name}`);
      await bench.call("add", [file.name, await file.arrayBuffer()]);
      state.files = state.files.filter((f) => f.name !== file.name);
      state.files.push({ name: file.name, file });
      if (!state.parts.has(file.name)) state.parts.set(file.name, "train");
      await look(file.name);
      say("files-message", "");
    } catch (error) {
      say("files-message", `${file.name}: ${error.message}`, "error");
    }
  }
  listFiles();
  await remember();
}

async function look(name) {
  const seen = await bench.call("inspect", [name, {}]);
  state.looks.set(name, seen);
  propose(seen);
}

/// Files again after a worker has ended.
async function refill() {
  for (const { name, file } of state.files) await bench.call("add", [name, await file.arrayBuffer()]);
}

function listFiles() {
  $("file-list").replaceChildren(...state.files.map(({ name, file }) => {
    const seen = state.looks.get(name) ?? {};
    const rows = seen.inspection ? `${seen.inspection.rows} rows` : seen.survey ? `${seen.survey.format}, ${seen.survey.topics.length} topics` : "";
    const remove = make("button", { type: "button", text: "✕", "aria-label": `remove ${name}`, onclick: () => forgetFile(name) });
    const error = seen.error && !seen.inspection && !seen.survey ? make("p", { className: "message", data: { level: "error" }, text: seen.error }) : "";
    return make("li", {}, make("b", { text: name }), make("span", { text: ` ${bytes(file.size)} ${rows} ` }), remove, error);
  }));
  const usable = state.files.some(({ name }) => columnsOf(state.looks.get(name)).length > 0);
  show("columns", usable);
  if (usable) listColumns();
}

async function forgetFile(name) {
  state.files = state.files.filter((f) => f.name !== name);
  state.looks.delete(name);
  await bench.call("remove", [name]).catch(() => {});
  listFiles();
  await remember();
}

/// Columns of a file: name, unit, range, missing.
function columnsOf(seen) {
  if (!seen) return [];
  if (seen.survey) {
    return seen.survey.topics.flatMap((topic) => topic.fields.map((f) => ({ name: f.column, unit: f.unit, low: f.low, high: f.high, missing: f.missing, rows: topic.rows })));
  }
  if (!seen.inspection) return [];
  return seen.inspection.columns.map((c) => ({ name: c.name, unit: c.unit, low: c.min, high: c.max, missing: c.missing, rows: seen.inspection.rows }));
}

/// Roles of the columns by the proposal of hydroid, and by the names that the inspection recognises.
function propose(seen) {
  const set = (column, role, name) => {
    if (!state.roles.has(column)) state.roles.set(column, { role, name: name ?? column, sign: 1 });
  };
  const take = (specs, role) => {
    for (const spec of specs ?? []) {
      // NAME=COLUMN [unit] * scale
      const [name, ...rest] = spec.split("=");
      const source = rest.length ? rest.join("=") : name;
      set(source.replace(/ \[[^\]]*\].*$/, "").replace(/ \* [-\d.e]+$/, ""), role, name);
    }
  };
  const selection = (seen.proposal && seen.proposal.selection) ?? {};
  state.sensors = selection.sensors ?? state.sensors ?? null;
  take(selection.outputs, "output");
  take(selection.inputs, "input");
  if (!seen.inspection) return;
  const known = [[/^u([_ ]|$)|surge/i, "u"], [/^v([_ ]|$)|sway/i, "v"], [/^r([_ ]|$)|yaw_?rate|^rot\b/i, "r"]];
  for (const [pattern, name] of known) {
    if ([...state.roles.values()].some((own) => own.role === "output" && own.name === name)) continue;
    const column = seen.inspection.columns.find((c) => pattern.test(c.name) && !/true|cmd/i.test(c.name));
    if (column) set(column.name, "output", name);
  }
  for (const input of seen.inspection.inputs) if (seen.inspection.columns.some((c) => c.name === input.name)) set(input.name, "input");
}

function listColumns() {
  const all = new Map();
  for (const { name } of state.files) for (const column of columnsOf(state.looks.get(name))) if (!all.has(column.name)) all.set(column.name, column);
  const head = make("tr", {}, ...[TEXT.column, TEXT.unit, TEXT.range, TEXT.missing, TEXT.role, TEXT.name, TEXT.sign].map((text) => make("th", { text, scope: "col" })));
  const rows = [...all.values()].map((column) => {
    if (!state.roles.has(column.name)) state.roles.set(column.name, { role: "none", name: column.name, sign: 1 });
    const own = state.roles.get(column.name);
    const role = make("select", { "aria-label": `${TEXT.role}: ${column.name}` }, ...ROLES.map((r) => make("option", { value: r, text: TEXT[r], selected: own.role === r })));
    const name = make("input", { type: "text", value: own.name, "aria-label": `${TEXT.name}: ${column.name}`, size: 8, maxLength: 40 });
    const unit = make("input", { type: "text", value: own.unit ?? column.unit ?? "", "aria-label": `${TEXT.unit}: ${column.name}`, size: 5, maxLength: 20 });
    unit.onchange = () => { own.unit = unit.value.trim() === (column.unit ?? "") ? undefined : unit.value.trim(); remember(); };
    const sign = make("select", { "aria-label": `${TEXT.sign}: ${column.name}` }, make("option", { value: "1", text: "+" }), make("option", { value: "-1", text: "−", selected: own.sign < 0 }));
    role.onchange = () => { own.role = role.value; if (own.role !== "none") name.focus(); remember(); };
    name.onchange = () => { own.name = name.value.trim() || column.name; remember(); };
    sign.onchange = () => { own.sign = Number(sign.value); remember(); };
    return make("tr", {}, make("th", { text: column.name, scope: "row" }), make("td", {}, unit),
      make("td", { text: `${figure(column.low)} to ${figure(column.high)}` }),
      make("td", { text: column.rows ? `${Math.round((100 * (column.missing ?? 0)) / column.rows)} %` : "" }),
      make("td", {}, role), make("td", {}, name), make("td", {}, sign));
  });
  $("column-table").replaceChildren(make("thead", {}, head), make("tbody", {}, ...rows));
}

/// The section [log] of hydroid.toml.
function logSection() {
  const of = (role) => [...state.roles]
    .filter(([column, own]) => own.role === role && hasColumn(column))
    // The first sign of equality ends the name of the channel.
    .map(([column, own]) => `${own.name.replaceAll("=", " ").trim() || "x"}=${column}${own.unit ? ` [${own.unit}]` : ""}${own.sign < 0 ? " * -1" : ""}`);
  const log = { outputs: of("output"), inputs: of("input") };
  const time = [...state.roles].find(([column, own]) => own.role === "time" && hasColumn(column));
  const heading = of("heading")[0];
  if (time) log.time = time[0];
  if (heading) log.heading = heading;
  if (!log.outputs.length && state.sensors) log.sensors = state.sensors;
  return log;
}

function hasColumn(column) {
  return state.files.some(({ name }) => columnsOf(state.looks.get(name)).some((c) => c.name === column));
}

/// Reads the logs with the chosen columns, and shows what becomes of them.
async function check() {
  say("columns-message", TEXT.reading);
  $("check").disabled = true;
  const boxes = [];
  const notes = [];
  let usable = false;
  try {
    for (const { name } of state.files) {
      const seen = await bench.call("inspect", [name, logSection()]);
      for (const note of [...(seen.reading ?? []), ...((seen.inspection && seen.inspection.notes) ?? [])]) notes.push(note);
      if (seen.error) notes.push({ level: "error", text: seen.error });
      for (const run of seen.runs ?? []) {
        usable = true;
        const list = [...run.outputs, ...run.inputs];
        boxes.push(make("details", { open: boxes.length === 0 }, make("summary", { text: `${run.name}: ${run.samples} samples of ${figure(run.dt)} s` }), make("div", { className: "plots" }, ...list.map((s) => plot(s)))));
      }
    }
    say("columns-message", usable ? "" : TEXT.noCurves, usable ? "" : "error");
  } catch (error) {
    say("columns-message", error.message, "error");
  }
  $("check").disabled = false;
  $("notes").replaceChildren(...notes.map((note) => make("li", { className: note.level ?? "info", text: note.remedy ? `${note.text ?? note.message}: ${note.remedy}` : note.text ?? note.message ?? String(note) })));
  $("curves").replaceChildren(...boxes);
  show("identify", usable);
  if (usable) options();
  await remember();
}

function options() {
  const boxes = Object.entries(TEXT.kinds).map(([method, text]) => {
    const box = make("input", { type: "checkbox", checked: state.methods.includes(method) });
    box.onchange = () => { state.methods = box.checked ? [...state.methods, method] : state.methods.filter((m) => m !== method); remember(); };
    return make("label", { className: "choice" }, box, make("span", { text }));
  });
  $("methods").replaceChildren(make("legend", { text: TEXT.methods }), ...boxes);
  const rows = state.files.map(({ name }) => {
    const select = make("select", {}, ...["train", "validate", "test", "unused"].map((part) => make("option", { value: part, text: TEXT[part], selected: state.parts.get(name) === part })));
    select.onchange = () => { state.parts.set(name, select.value); remember(); };
    return make("label", { className: "choice" }, make("span", { text: name }), select);
  });
  $("parts").replaceChildren(make("legend", { text: TEXT.parts }), ...rows);
}

/// Identifies in the worker; the page stays free.
async function identify() {
  const of = (part) => state.files.map((f) => f.name).filter((name) => state.parts.get(name) === part);
  const request = { train: of("train"), validate: of("validate"), test: of("test"), methods: state.methods, config: { log: logSection() }, title: of("train")[0] ?? "" };
  say("identify-message", "");
  show("progress");
  show("cancel");
  $("run").disabled = true;
  const bar = $("progress").firstElementChild;
  try {
    state.result = await bench.call("identify", [request], (stage, done) => {
      bar.value = done;
      $("stage").textContent = `${TEXT[stage] ?? stage}, ${Math.round(100 * done)} %`;
    });
    await showResult();
    await remember();
  } catch (error) {
    say("identify-message", error.message, "error");
  }
  show("progress", false);
  show("cancel", false);
  $("run").disabled = false;
}

async function cancel() {
  bench.end(new Error(TEXT.cancelled));
  await refill();
}

async function showResult() {
  const { summary, report, files } = state.result;
  show("report");
  const tiles = (summary.verdicts ?? []).map((v) => make("li", { className: `tile ${v.grade ?? ""}` }, make("b", { text: v.channel ?? v.name ?? "" }), make("span", { text: ` ${v.grade ?? ""}` }), make("p", { text: `NRMSE ${figure(v.nrmse)}`, title: TEXT.glossary.NRMSE })));
  $("verdicts").replaceChildren(...tiles);
  $("page").srcdoc = report;
  if (files.length) await open(`${files[0].name}.safetensors`, files[0].bytes);
}

/// A model, to be driven.
async function open(name, content) {
  state.vessel = { name, bytes: content };
  const vessel = await helm.call("vessel", [name, content]);
  show("drive");
  show("save");
  downloads(vessel);
  if (view) view.stop();
  view = new DriveView($("driving"), helm, vessel);
  if (vessel.not_driven) $("driving").append(make("p", { className: "message", text: vessel.not_driven }));
  await view.start();
  await remember();
}

/// The settings as a file of the command.
function settings() {
  const list = (items) => `[${items.map((item) => JSON.stringify(item)).join(", ")}]`;
  const lines = ["[log]"];
  const log = logSection();
  for (const [key, value] of Object.entries(log)) {
    if (Array.isArray(value)) lines.push(`${key} = ${list(value)}`);
    else if (typeof value === "string") lines.push(`${key} = ${JSON.stringify(value)}`);
  }
  if (log.sensors) {
    lines.push("", "[log.sensors]");
    for (const [key, value] of Object.entries(log.sensors)) if (typeof value === "string") lines.push(`${key} = ${JSON.stringify(value)}`);
  }
  lines.push("", "[split]");
  for (const part of ["train", "validate", "test"]) {
    const names = state.files.map((f) => f.name).filter((name) => state.parts.get(name) === part);
    if (names.length) lines.push(`${part} = ${list(names)}`);
  }
  return `${lines.join("\n")}\n`;
}

function downloads(vessel) {
  const button = (text, act) => make("button", { type: "button", text, onclick: () => act().catch((error) => say("save-message", error.message, "error")) });
  const list = [button(TEXT.model, async () => download(state.vessel.name, state.vessel.bytes))];
  if (state.result) {
    list.push(button(TEXT.reportFile, async () => download("report.html", state.result.report, "text/html")));
    list.push(button(TEXT.config, async () => download("hydroid.toml", settings(), "text/plain")));
    list.push(button(TEXT.summary, async () => download("identify.json", JSON.stringify(state.result.summary, null, 2), "application/json")));
  }
  for (const [format, text] of Object.entries(TEXT.exports)) {
    list.push(button(text, async () => {
      const files = await helm.call("exported", [format, vessel.name]);
      for (const file of files) download(file.name, file.bytes);
      say("save-message", files.map((f) => TEXT.kept(f.name)).join(", "));
    }));
  }
  $("downloads").replaceChildren(...list);
}

const drop = $("drop");
for (const name of ["dragenter", "dragover"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.dataset.over = "1"; });
for (const name of ["dragleave", "drop"]) drop.addEventListener(name, (event) => { event.preventDefault(); delete drop.dataset.over; });
drop.addEventListener("drop", (event) => take([...event.dataTransfer.files]));
$("choose").onchange = () => take([...$("choose").files]);
$("check").onclick = check;
$("run").onclick = identify;
$("cancel").onclick = cancel;
$("example").onclick = () => open("example.toml", new TextEncoder().encode(EXAMPLE)).catch((error) => say("files-message", error.message, "error"));
$("forget").onclick = async () => { await store.clear(); location.reload(); };

(async () => {
  const kept = await store.load("state");
  if (!kept) return;
  Object.assign(state, kept);
  for (const { name, file } of state.files) {
    try {
      await bench.call("add", [name, await file.arrayBuffer()]);
      await look(name);
    } catch (error) {
      say("files-message", `${name}: ${error.message}`, "error");
    }
  }
  listFiles();
  say("files-message", TEXT.restored);
  if (logSection().inputs.length) await check();
  if (state.result) await showResult();
  else if (state.vessel) await open(state.vessel.name, state.vessel.bytes);
})();
