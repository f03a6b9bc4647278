// Runs hydroid. A message {id, call, args} is answered by {id, result} or {id, error}; long work tells {id, stage, done}.
let api = null;
const held = { files: null, identified: null, vessel: null, drive: null };

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

const ready = (async () => {
  await wasm_bindgen({ module_or_path: await inflate(HYDROID_WASM) });
  api = wasm_bindgen;
  held.files = new api.Files();
})();

function replace(name, value) {
  if (held[name]) held[name].free();
  held[name] = value;
  return value;
}

const calls = {
  add: (id, name, content) => held.files.add(name, new Uint8Array(content)),
  remove: (id, name) => held.files.remove(name),
  inspect: (id, name, log) => JSON.parse(held.files.inspect(name, JSON.stringify(log))),
  identify(id, request) {
    let last = 0;
    const told = (stage, done) => {
      const now = Date.now();
      if (now - last < 50 && done < 1) return;
      last = now;
      postMessage({ id, stage, done });
    };
    const found = replace("identified", held.files.identify(JSON.stringify(request), told));
    const models = found.models();
    const files = models.map((name) => ({ name, bytes: found.file(name) }));
    return { summary: JSON.parse(found.summary()), report: found.report(), files };
  },
  vessel(id, name, bytes) {
    const vessel = replace("vessel", api.Vessel.read(name, new Uint8Array(bytes)));
    return JSON.parse(vessel.describe());
  },
  trials: (id, settings) => JSON.parse(held.vessel.trials(JSON.stringify(settings))),
  exported(id, format, name) {
    const list = held.vessel.export(format, name);
    const files = [];
    for (let i = 0; i < list.length; i += 2) files.push({ name: list[i], bytes: list[i + 1] });
    return files;
  },
  drive(id, north, east) {
    replace("drive", held.vessel.drive(north, east));
    return held.drive.state();
  },
  start: () => { held.drive.start(); return held.drive.state(); },
  command: (id, push, turn) => held.drive.command(push, turn),
  advance(id, command, samples) {
    held.drive.advance(command, samples);
    return { state: held.drive.state(), sound: held.drive.is_sound() };
  },
};

onmessage = async ({ data: { id, call, args } }) => {
  try {
    await ready;
    postMessage({ id, result: calls[call](id, ...args) });
  } catch (error) {
    postMessage({ id, error: String((error && error.message) || error), fatal: error instanceof WebAssembly.RuntimeError });
  }
};
