// The columns of the logs: what they are, as proposed and as corrected.
const ROLES = ["none", "output", "input", "time", "heading", "windSpeed", "windDirection"];

/** Columns of a file: name, unit, range, missing values. */
function columnsOf(seen) {
  if (!seen) return [];
  if (seen.survey && seen.survey.topics.length) {
    return seen.survey.topics.flatMap((topic) => topic.fields.map((f) => ({ name: f.column, unit: f.unit, low: f.low, high: f.high, missing: f.missing, rows: topic.rows })));
  }
  if (!seen.inspection) return [];
  return seen.inspection.columns.map((c) => ({ name: c.name, unit: c.unit, low: c.min, high: c.max, missing: c.missing, rows: seen.inspection.rows }));
}

/** The columns of all logs. */
function allColumns() {
  const all = new Map();
  for (const { name } of state.files) for (const column of columnsOf(state.looks.get(name))) if (!all.has(column.name)) all.set(column.name, column);
  return all;
}

/** Roles of the columns by the proposal of hydroid, and by the names that the inspection recognises. */
function propose(seen) {
  const boat = seen.proposal?.boat?.inputs ?? {};
  const set = (column, role, name = column) => {
    if (state.roles.has(column)) return;
    // Neutral value, limits and scale that hydroid found.
    const input = role === "input" && boat[name] ? { input: boat[name], zero: boat[name].neutral ?? 0 } : {};
    state.roles.set(column, { role, name, sign: 1, ...input });
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
  take(selection.outputs, "output");
  take(selection.inputs, "input");
  if (!seen.inspection) return;
  const { columns, inputs } = seen.inspection;
  const present = new Set([...state.looks.values()].flatMap(columnsOf).map((column) => column.name));
  const time = columns.find((c) => /^(t|time|t_s|timestamp|time_s)$/i.test(c.name));
  if (time) set(time.name, "time");
  const known = [[/^u([_ ]|$)|surge/i, "u"], [/^vm?([_ ]|$)|sway/i, "v"], [/^r([_ ]|$)|yaw_?rate|^rot\b/i, "r"]];
  for (const [pattern, name] of known) {
    if ([...state.roles].some(([column, own]) => present.has(column) && own.role === "output" && own.name === name)) continue;
    const column = columns.find((c) => pattern.test(c.name) && !/true|cmd/i.test(c.name));
    if (column) set(column.name, "output", name);
  }
  for (const input of inputs) if (columns.some((c) => c.name === input.name)) set(input.name, "input");
}

/** A name for a new output: the first of u, v, r of its unit that is free. */
function outputName(column) {
  const taken = new Set([...state.roles.values()].filter((own) => own.role === "output").map((own) => own.name));
  const fits = /rad|deg|°/.test(column.unit ?? "") || /rate/i.test(column.name) ? ["r"] : ["u", "v"];
  return fits.find((name) => !taken.has(name)) ?? column.name;
}

function columnRow(column) {
  if (!state.roles.has(column.name)) state.roles.set(column.name, { role: "none", name: column.name, sign: 1 });
  const own = state.roles.get(column.name);
  const changed = () => { outdate(); remember(); };
  const field = (text, properties) => make("input", { type: "text", "aria-label": `${text}: ${column.name}`, ...properties });
  const role = make("select", { "aria-label": `${TEXT.role}: ${column.name}` }, ...ROLES.map((r) => make("option", { value: r, text: TEXT[r], selected: own.role === r })));
  const name = field(TEXT.name, { value: own.name, size: 8, maxLength: 40 });
  const unit = field(TEXT.unit, { value: own.unit ?? column.unit ?? "", size: 5, maxLength: 20 });
  const zero = field(TEXT.zero, { value: own.zero || "", size: 5, maxLength: 12, inputMode: "decimal", placeholder: "0" });
  const sign = make("select", { "aria-label": `${TEXT.sign}: ${column.name}` }, make("option", { value: "1", text: "+" }), make("option", { value: "-1", text: "−", selected: own.sign < 0 }));
  unit.onchange = () => { own.unit = unit.value.trim() === (column.unit ?? "") ? undefined : unit.value.trim(); changed(); };
  zero.onchange = () => {
    const value = Number(zero.value.replace(",", ".").replace("−", "-"));
    own.zero = Number.isFinite(value) ? value : 0;
    zero.value = own.zero || "";
    changed();
  };
  role.onchange = () => {
    own.role = role.value;
    if (own.role === "output" && own.name === column.name) name.value = own.name = outputName(column);
    changed();
  };
  name.onchange = () => { own.name = name.value.trim() || column.name; changed(); };
  sign.onchange = () => { own.sign = Number(sign.value); changed(); };
  const share = column.rows ? `${Math.round((100 * (column.missing ?? 0)) / column.rows)} %` : "";
  const cell = (label, ...content) => make("td", { data: { label } }, ...content);
  return make("tr", {}, make("th", { text: column.name, scope: "row" }), cell(TEXT.unit, unit), cell(TEXT.range, `${figure(column.low)} ${TEXT.to} ${figure(column.high)}`),
    cell(TEXT.missing, share), cell(TEXT.role, role), cell(TEXT.name, name), cell(TEXT.zero, zero), cell(TEXT.sign, sign));
}

/** The table of the columns: those in use first. Those of a recording that are not used are folded, for they are many. */
function listColumns() {
  const all = [...allColumns().values()];
  const used = (column) => (state.roles.get(column.name)?.role ?? "none") !== "none";
  const heads = [TEXT.column, TEXT.unit, TEXT.range, TEXT.missing, TEXT.role, TEXT.name, TEXT.zero, TEXT.sign];
  const table = (columns, id) => make("table", { id, className: "column-table" },
    make("thead", {}, make("tr", {}, ...heads.map((text) => make("th", { text, scope: "col" })))), make("tbody", {}, ...columns.map(columnRow)));
  const folded = all.length > 20 ? all.filter((column) => !used(column)) : [];
  const open = all.filter((column) => !folded.includes(column));
  const parts = [make("div", { className: "scroll" }, table(open, "column-table"))];
  if (folded.length) {
    parts.push(make("details", {}, make("summary", { text: TEXT.unusedColumns(folded.length) }), make("div", { className: "scroll" }, table(folded, "unused-table"))));
  }
  $("column-tables").replaceChildren(...parts);
  const columns = hasRole("output") ? [] : Object.values(sensors() ?? {}).filter((value) => typeof value === "string");
  say("sensors", columns.length ? TEXT.computed(columns.join(", ")) : "");
}

/** The sensors of the first recording, from which velocities are computed. */
const sensors = () => [...state.looks.values()].map((seen) => seen.proposal?.selection?.sensors).find(Boolean) ?? null;

const hasRole = (role) => [...state.roles].some(([column, own]) => own.role === role && allColumns().has(column));

/** The section [log] of hydroid.toml. */
function logSection() {
  const columns = allColumns();
  const of = (role) => [...state.roles].filter(([column, own]) => own.role === role && columns.has(column)).map(([column, own]) => specification(column, own));
  const log = { outputs: of("output"), inputs: of("input") };
  const time = [...state.roles].find(([column, own]) => own.role === "time" && columns.has(column));
  const heading = of("heading")[0];
  if (time) log.time = time[0];
  // What is computed from sensors has a heading of its own.
  if (heading && (log.outputs.length || !sensors())) log.heading = heading;
  const wind = [of("windSpeed")[0], of("windDirection")[0]];
  if (wind[0] && wind[1]) log.wind = { speed: wind[0], direction: wind[1] };
  if (!log.outputs.length && sensors()) log.sensors = sensors();
  const { dt, maxGap, delay, between, exclude, where } = state.options;
  if (dt) log.dt = dt;
  if (maxGap) log.max_gap = maxGap;
  if (delay) log.input_delay = `${delay}s`;
  if (between) log.between = between;
  if (exclude) log.exclude = exclude;
  if (where) log.where = where;
  return log;
}

/** The section [boat] of hydroid.toml: what is known of the inputs. Zero and sign are those of the table. */
function boatSection() {
  const columns = allColumns();
  const inputs = {};
  for (const [column, own] of state.roles) {
    if (own.role !== "input" || !own.input || !columns.has(column)) continue;
    const input = { ...own.input };
    const found = { ...input.found };
    if (own.unit) input.unit = own.unit;
    if (input.scale) {
      if (own.zero !== input.neutral) delete found.neutral;
      Object.assign(input, { neutral: own.zero, scale: own.sign * input.scale });
    }
    inputs[channelOf(own)] = { ...input, found };
  }
  return { inputs };
}

/** The name of a channel: the first sign of equality of a specification ends it. */
const channelOf = ({ name }) => name.replaceAll("=", " ").trim() || "x";

/** A channel and its column: `NAME=(COLUMN [unit] - 1500) * -1`. Of an input with a scale the boat has the formula. */
function specification(column, own) {
  const { unit, zero, sign } = own;
  const channel = channelOf(own);
  const source = `${column}${unit ? ` [${unit}]` : ""}`;
  if (own.role === "input" && own.input?.scale) return `${channel}=${source}`;
  const shifted = zero ? `${source} ${zero > 0 ? "-" : "+"} ${Math.abs(zero)}` : source;
  const open = sign < 0 && zero;
  return `${channel}=${open ? `(${shifted})` : shifted}${sign < 0 ? " * -1" : ""}`;
}

/** Columns without a role that are named like a command. */
function likeCommands() {
  const words = /prop|thr|rudder|rpm|pwm|servo|motor|engine|cmd|command|steer|(^|_)n(_|\d|$)|delta/i;
  return [...allColumns().keys()].filter((name) => words.test(name) && state.roles.get(name)?.role === "none");
}
