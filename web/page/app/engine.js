// A worker with hydroid in it. A panic or a lack of memory ends the worker; the next call begins with a new one, in which `prepare`
// has called what it needs.
class Engine {
  constructor(prepare) {
    this.prepare = prepare;
    this.ready = null;
    this.url = null;
    this.worker = null;
    this.waiting = new Map();
    this.next = 1;
  }

  start() {
    if (!this.url) {
      // In the single file the text of the worker is in the page; a blob inherits the policy of the page.
      const inside = document.getElementById("worker");
      const text = inside ? inside.textContent : `importScripts(${JSON.stringify(new URL("worker.js", location.href).href)});`;
      this.url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    }
    this.worker = new Worker(this.url);
    this.worker.onmessage = ({ data }) => this.answer(data);
    this.worker.onerror = (event) => {
      event.preventDefault();
      this.end(new Error(TEXT.lost));
    };
  }

  answer({ id, result, error, fatal, stage, done }) {
    const call = this.waiting.get(id);
    if (!call) return;
    if (stage !== undefined) {
      if (call.told) call.told(stage, done);
      return;
    }
    this.waiting.delete(id);
    if (error === undefined) call.resolve(result);
    else call.reject(new Error(fatal ? TEXT.lost : error));
    if (fatal) this.end(new Error(TEXT.lost));
  }

  /// Ends the worker; what it holds is lost.
  end(reason) {
    if (this.worker) this.worker.terminate();
    this.worker = null;
    const waiting = [...this.waiting.values()];
    this.waiting.clear();
    for (const call of waiting) call.reject(reason);
  }

  async call(name, args = [], told = null) {
    if (!this.worker) {
      this.start();
      this.ready = this.prepare((...call) => this.send(...call));
      this.ready.catch((error) => this.end(error));
    }
    await this.ready;
    return this.send(name, args, told);
  }

  send(name, args = [], told = null) {
    if (!this.worker) return Promise.reject(new Error(TEXT.lost));
    const id = this.next++;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject, told });
      // Contents of files move to the worker: a copy takes as much memory again.
      this.worker.postMessage({ id, call: name, args }, args.filter((arg) => arg instanceof ArrayBuffer));
    });
  }
}
