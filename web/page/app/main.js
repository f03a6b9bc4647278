// The way through the page: logs, columns, identification, report, driving, downloads.
const bench = new Engine(async (send) => {
  for (const { name, file } of state.files) {
    const content = await file.arrayBuffer().catch(() => null);
    // A file that has changed on the disk cannot be read any more: the next use of it says so.
    if (content) await send("add", [name, content]);
  }
});
const helm = new Engine(async (send) => {
  if (state.vessel) await send("vessel", [state.vessel.name, state.vessel.bytes]);
});
// Names of files and columns are keys of maps: as names of properties, some would change the program.
const state = {
  files: [], looks: new Map(), roles: new Map(), parts: new Map(), methods: ["committee", "sindy"], options: {}, stale: false, result: null, tries: [], vessel: null,
};
let view = null;
/** The description of the model that is driven. */
let driven = null;

const LARGEST = 2e9;
const BUDGETS = [30, 120, 600];
const isModel = (name) => /\.(safetensors|toml)$/i.test(name);

async function remember() {
  const { looks, files, ...kept } = state;
  await store.save("state", kept);
}

/** Logs are large, and are written only when they change. */
async function rememberFiles() {
  await store.save("files", state.files);
  await remember();
}

/** Number of changes of logs and settings. */
let changes = 0;

/** What was identified belongs to earlier logs or settings from now on. */
function outdate() {
  changes += 1;
  state.stale = Boolean(state.result);
  tellAge();
}

function tellAge() {
  say("report-stale", state.stale ? TEXT.stale : "", "warning");
}

/** Files that were dropped or chosen, after those before them: their messages and lists do not mix. */
function take(list) {
  taken = taken.then(() => takeFiles(list)).catch(failed);
  return taken;
}

let taken = Promise.resolve();

async function takeFiles(list) {
  const messages = [];
  for (const file of list) {
    if (file.size > LARGEST) {
      messages.push(TEXT.tooLarge(file.name));
      continue;
    }
    try {
      if (isModel(file.name)) {
        await open(file.name, new Uint8Array(await file.arrayBuffer()));
        continue;
      }
      say("files-message", `${TEXT.reading} ${file.name}`);
      await bench.call("add", [file.name, await file.arrayBuffer()]);
      if (state.files.some((f) => f.name === file.name)) messages.push(TEXT.replaced(file.name));
      state.files = state.files.filter((f) => f.name !== file.name);
      const seen = await look(file.name);
      if (!columnsOf(seen).length) {
        // What cannot be read is not kept.
        await bench.call("remove", [file.name]);
        state.looks.delete(file.name);
        messages.push(plain(seen.error ?? file.name));
        continue;
      }
      state.files.push({ name: file.name, file });
      if (!state.parts.has(file.name)) state.parts.set(file.name, "train");
      outdate();
    } catch (error) {
      messages.push(`${file.name}: ${plain(error.message)}`);
    }
  }
  say("files-message", messages.join("\n"), messages.length ? "error" : "");
  listFiles();
  await rememberFiles();
}

async function look(name) {
  const seen = await bench.call("inspect", [name, {}]);
  state.looks.set(name, seen);
  propose(seen);
  return seen;
}

function listFiles() {
  $("file-list").replaceChildren(...state.files.map(({ name, file }) => {
    const seen = state.looks.get(name) ?? {};
    const rows = seen.inspection ? `${seen.inspection.rows} ${TEXT.rows}` : seen.survey ? `${seen.survey.format}, ${seen.survey.topics.length} ${TEXT.topics}` : "";
    const remove = make("button", { type: "button", text: "✕", "aria-label": TEXT.remove(name), onclick: () => forgetFile(name) });
    return make("li", {}, make("b", { text: name }), make("span", { text: ` ${bytes(file.size)} ${rows} ` }), remove);
  }));
  if (driven) downloads(driven);
  const usable = state.files.some(({ name }) => columnsOf(state.looks.get(name)).length > 0);
  show("columns", usable);
  if (!usable) return;
  listColumns();
  $("column-options").replaceChildren(make("summary", { text: TEXT.options }), numberField("dt", TEXT.dt), numberField("maxGap", TEXT.maxGap), numberField("delay", TEXT.delay, { negative: true }),
    textField("between", TEXT.between, "120:480, 600:"), textField("exclude", TEXT.exclude, "day1.csv=310:540"), textField("where", TEXT.where, "armed && speed > 0.3"));
}

/** A field of a text in the options, which hydroid reads as on the command line. */
function textField(key, text, placeholder) {
  const field = make("input", { type: "text", size: 22, maxLength: 500, value: state.options[key] ?? "", placeholder });
  field.onchange = () => {
    state.options[key] = field.value.trim() || undefined;
    outdate();
    remember();
  };
  return make("label", { className: "choice" }, make("span", { text }), field);
}

/** A field of a number in the options; empty is the default of hydroid. */
function numberField(key, text, { negative = false } = {}) {
  const field = make("input", { type: "text", inputMode: "decimal", size: 8, value: state.options[key] ?? "", placeholder: TEXT.automatic });
  field.onchange = () => {
    const value = Number(field.value.replace(",", "."));
    const good = field.value.trim() !== "" && Number.isFinite(value) && (negative ? value !== 0 : value > 0);
    state.options[key] = good ? value : undefined;
    field.value = state.options[key] ?? "";
    outdate();
    remember();
  };
  return make("label", { className: "choice" }, make("span", { text }), field);
}

async function forgetFile(name) {
  state.files = state.files.filter((f) => f.name !== name);
  state.looks.delete(name);
  await bench.call("remove", [name]).catch(() => {});
  outdate();
  listFiles();
  if ($("parts").children.length) options();
  await rememberFiles();
}

/** Long work with progress and a button that cancels it. */
async function work(place, button, act) {
  const bar = make("progress", { max: 1, value: 0, "aria-label": TEXT.reading });
  const stage = make("span", { role: "status" });
  const end = make("button", { type: "button", text: TEXT.cancel, className: "cancel", onclick: cancel });
  const box = make("div", { className: "progress" }, bar, stage, end);
  const begun = performance.now();
  let part = 0;
  $(`${place}-progress`).replaceChildren(box);
  $(button).disabled = true;
  end.focus();
  try {
    return await act((name, done) => {
      bar.value = Math.max(part, done);
      part = bar.value;
      const [elapsed, text] = [(performance.now() - begun) / 1000, TEXT.stages[name] ?? TEXT[name] ?? name];
      stage.textContent = `${text}, ${Math.round(100 * part)} %${elapsed > 3 && part > 0.1 ? `, ${TEXT.remaining((elapsed * (1 - part)) / part)}` : ""}`;
    });
  } finally {
    $(`${place}-progress`).replaceChildren();
    $(button).disabled = false;
    if (document.activeElement === document.body) $(button).focus();
  }
}

function cancel() {
  bench.end(new Error(TEXT.cancelled));
}

/** Reads the logs with the chosen columns, and shows what becomes of them. */
async function check({ leads = true } = {}) {
  if ($("check").disabled) return;
  const missing = !hasRole("input") ? TEXT.noInput : !hasRole("output") && !sensors() ? TEXT.noOutput : "";
  say("columns-message", missing, "error");
  if (missing) return;
  const [boxes, notes] = [[], []];
  let usable = false;
  try {
    await work("columns", "check", async (told) => {
      for (const [i, { name }] of state.files.entries()) {
        const seen = await bench.call("inspect", [name, { log: logSection(), boat: boatSection() }], (stage, done) => told(stage, (i + done) / state.files.length));
        for (const note of [...(seen.reading ?? []), ...((seen.inspection && seen.inspection.notes) ?? [])]) notes.push({ file: name, note });
        if (seen.error) notes.push({ file: name, note: { severity: "error", message: seen.error } });
        for (const run of seen.runs ?? []) {
          usable = true;
          const plots = make("div", { className: "plots" });
          const box = make("details", {}, make("summary", { text: `${run.name}: ${run.samples} × ${figure(run.dt)} s` }), plots);
          const fill = () => { if (box.open && !plots.children.length) plots.append(...[...run.outputs, ...run.inputs].map(curveBox)); };
          box.ontoggle = fill;
          box.open = boxes.length === 0;
          boxes.push(box);
        }
      }
    });
    say("columns-message", usable ? "" : TEXT.noCurves, usable ? "" : "error");
  } catch (error) {
    say("columns-message", plain(error.message), "error");
  }
  $("notes").replaceChildren(...listNotes(notes));
  $("advice").replaceChildren(...advice());
  $("curves").replaceChildren(...boxes);
  show("identify", usable);
  if (usable) {
    options();
    // The curves and messages stay in view.
    if (leads) lead("identify", { preventScroll: true });
  }
  await remember();
}

/** What the user could change: columns that were left out. */
function advice() {
  const left = likeCommands();
  return left.length && left.length <= 20 ? [make("p", { className: "message", data: { level: "warning" }, text: TEXT.leftOut(left.join(", ")) })] : [];
}

function options() {
  const boxes = Object.entries(TEXT.kinds).map(([method, text]) => {
    const box = make("input", { type: "checkbox", checked: state.methods.includes(method) });
    box.onchange = () => { state.methods = box.checked ? [...state.methods, method] : state.methods.filter((m) => m !== method); outdate(); remember(); };
    return make("label", { className: "choice" }, box, make("span", { text }));
  });
  const budget = make("select", {}, ...BUDGETS.map((s) => make("option", { value: s, text: TEXT.seconds(s), selected: (state.options.budget ?? 120) === s })));
  budget.onchange = () => { state.options.budget = Number(budget.value); outdate(); remember(); };
  $("methods").replaceChildren(make("legend", { text: TEXT.methods }), ...boxes, make("label", { className: "choice" }, make("span", { text: TEXT.budget }), budget));
  const rows = state.files.map(({ name }) => {
    const select = make("select", {}, ...["train", "validate", "test", "unused"].map((part) => make("option", { value: part, text: TEXT[part], selected: state.parts.get(name) === part })));
    select.onchange = () => { state.parts.set(name, select.value); outdate(); remember(); };
    return make("label", { className: "choice" }, make("span", { text: name }), select);
  });
  $("parts").replaceChildren(make("legend", { text: TEXT.parts }), ...rows, numberField("first", TEXT.first), numberField("horizon", TEXT.horizon));
}

/** Identifies in the worker; the page stays free. */
async function identify() {
  const of = (part) => state.files.map((f) => f.name).filter((name) => state.parts.get(name) === part);
  const { first, horizon, budget } = state.options;
  const config = { log: logSection(), boat: boatSection(), identify: { budget: `${budget ?? 120}s`, ...(horizon ? { horizon: `${horizon}s` } : {}) } };
  const request = { train: of("train"), validate: of("validate"), test: of("test"), methods: state.methods, config, title: of("train").join(", "), first_s: first ?? null };
  say("identify-message", "");
  const before = changes;
  try {
    const result = await work("identify", "run", (told) => bench.call("identify", [request], told));
    state.result = { ...result, request };
    keepTry(state.result, `${request.train.join(", ")}${first ? `, ${first} s` : ""}`);
    state.stale = changes !== before;
    tellAge();
    await showResult();
    lead("report");
  } catch (error) {
    say("identify-message", plain(error.message), "error");
  }
  await remember();
}

/** Logs of a simulated boat: a short one and a long one to learn from, and one to judge. */
async function exampleLogs() {
  const content = new TextEncoder().encode(EXAMPLE);
  const logs = [];
  for (const [name, seconds, part] of [["short.csv", 60, "train"], ["long.csv", 600, "unused"], ["new.csv", 300, "test"]]) {
    logs.push(new File([await helm.call("simulate", ["example.toml", content, seconds, logs.length + 1])], name));
    state.parts.set(name, part);
  }
  // The neutral position of the pulse widths of the example.
  for (const name of ["pwm_left", "pwm_right"]) state.roles.set(name, { role: "input", name, sign: 1, zero: 1500 });
  // Both logs to learn from are long enough for it.
  state.options.horizon = 5;
  await take(logs);
  await check();
}

const drop = $("drop");
for (const name of ["dragenter", "dragover"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.dataset.over = "1"; });
for (const name of ["dragleave", "drop"]) drop.addEventListener(name, (event) => { event.preventDefault(); delete drop.dataset.over; });
drop.addEventListener("drop", (event) => take([...event.dataTransfer.files]));
$("choose").onchange = () => {
  const files = [...$("choose").files];
  // The same file can be chosen again.
  $("choose").value = "";
  take(files);
};
$("check").onclick = () => check();
$("run").onclick = identify;
const failed = (error) => say("files-message", plain(error.message), "error");
$("example").onclick = () => open("example.toml", new TextEncoder().encode(EXAMPLE)).then(() => lead("drive")).catch(failed);
$("example-logs").onclick = () => exampleLogs().catch(failed);
$("forget").onclick = async () => {
  if ($("forget").textContent !== TEXT.reallyForget) {
    $("forget").textContent = TEXT.reallyForget;
    return;
  }
  await store.clear();
  location.reload();
};

(async () => {
  const kept = await store.load("state");
  if (!kept) return;
  Object.assign(state, kept, { files: (await store.load("files")) ?? [] });
  for (const { name } of state.files) {
    try {
      await look(name);
    } catch (error) {
      say("files-message", `${name}: ${plain(error.message)}`, "error");
    }
  }
  listFiles();
  say("files-message", TEXT.restored);
  if (hasRole("input")) await check({ leads: false });
  tellAge();
  const { vessel } = state;
  if (state.result) await showResult();
  if (vessel) await open(vessel.name, vessel.bytes, vessel.learnt);
})().catch(failed);
