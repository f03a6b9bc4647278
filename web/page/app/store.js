// The state of the page in the browser, so that it survives a reload.
const STORE = "hydroid";

function database() {
  return new Promise((resolve, reject) => {
    const request = indexedDB.open(STORE, 1);
    request.onupgradeneeded = () => request.result.createObjectStore("state");
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

async function transact(mode, act) {
  const db = await database();
  try {
    return await new Promise((resolve, reject) => {
      const transaction = db.transaction("state", mode);
      const request = act(transaction.objectStore("state"));
      transaction.oncomplete = () => resolve(request.result);
      transaction.onerror = transaction.onabort = () => reject(transaction.error);
    });
  } finally {
    db.close();
  }
}

// A browser that keeps nothing (private windows) is not an error.
const store = {
  save: (key, value) => transact("readwrite", (s) => s.put(value, key)).catch(() => {}),
  load: (key) => transact("readonly", (s) => s.get(key)).catch(() => undefined),
  clear: () => transact("readwrite", (s) => s.clear()).catch(() => {}),
};
