// Runs hydroid. A message {id, call, args} is answered by {id, result} or {id, error}; long work tells {id, stage, done}.
let api = null;
const held = { files: null, vessel: null };

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

/// Tells the page what is done, at most twenty times a second.
function teller(id) {
  let last = 0;
  return (stage, done) => {
    const now = Date.now();
    if (now - last < 50 && done < 1) return;
    last = now;
    postMessage({ id, stage, done });
  };
}

const calls = {
  add: (id, name, content) => held.files.add(name, new Uint8Array(content)),
  remove: (id, name) => held.files.remove(name),
  inspect: (id, name, config) => JSON.parse(held.files.inspect(name, JSON.stringify(config), teller(id))),
  converted: (id, name, config) => held.files.converted(name, JSON.stringify(config)),
  identify(id, request) {
    const found = held.files.identify(JSON.stringify(request), teller(id));
    const models = JSON.parse(found.models());
    const files = models.map(({ name }) => ({ name, bytes: found.file(name) }));
    const result = { summary: JSON.parse(found.summary()), report: found.report(), models, files };
    found.free();
    return result;
  },
  compare(id, name, bytes, names) {
    const vessel = api.Vessel.read(name, new Uint8Array(bytes));
    try {
      return JSON.parse(held.files.compare(vessel, names));
    } finally {
      vessel.free();
    }
  },
  vessel(id, name, bytes) {
    const vessel = api.Vessel.read(name, new Uint8Array(bytes));
    if (held.vessel) held.vessel.free();
    held.vessel = vessel;
    return JSON.parse(vessel.describe());
  },
  trials: (id, settings) => JSON.parse(held.vessel.trials(JSON.stringify(settings))),
  exported(id, format, name) {
    const list = held.vessel.export(format, name);
    const files = [];
    for (let i = 0; i < list.length; i += 2) files.push({ name: list[i], bytes: list[i + 1] });
    return files;
  },
  simulate(id, name, bytes, seconds, seed) {
    const vessel = api.Vessel.read(name, new Uint8Array(bytes));
    try {
      return vessel.simulate(seconds, seed);
    } finally {
      vessel.free();
    }
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
