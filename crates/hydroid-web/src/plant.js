// A model that runs freely: the functions that `hydroid-export` writes as JSON, and the pose.

/**
 * Functions of vectors. Each node of a function is a vector in its own memory, computed from those before it; a vector of one number
 * stands for all elements.
 */
const Functions = (() => {
  const logistic = (x) => 1 / (1 + Math.exp(-x));
  const UNARY = {
    neg: (x) => -x, abs: Math.abs, sign: (x) => (x === 0 ? 0 : Math.sign(x)), exp: Math.exp, ln: Math.log, sin: Math.sin, cos: Math.cos,
    sqrt: Math.sqrt, tanh: Math.tanh, logistic,
  };
  // As in IEEE 754, the smaller one of a number and NaN is the number.
  const BINARY = {
    add: (a, b) => a + b, sub: (a, b) => a - b, mul: (a, b) => a * b, div: (a, b) => a / b,
    min: (a, b) => (a < b || b !== b ? a : b), max: (a, b) => (a > b || b !== b ? a : b),
  };
  const TESTS = { less: (a, b) => a < b, less_or_equal: (a, b) => a <= b, is_number: (a) => a === a };
  const numbers = (list) => Float64Array.from(list, Number);

  /** Writes `W x + b` to `out`. */
  function affine({ rows, columns, numbers: list }, bias) {
    const [w, b] = [numbers(list), numbers(bias)];
    return (x, out) => {
      for (let i = 0, k = 0; i < rows; i += 1) {
        let sum = 0;
        for (let j = 0; j < columns; j += 1, k += 1) sum += w[k] * x[j];
        out[i] = sum + b[i];
      }
    };
  }

  /** Both products of a recurrent cell, in PyTorch's order of the gates. */
  function gates({ weight_ih, weight_hh, bias_ih, bias_hh }) {
    const [a, b] = [new Float64Array(weight_ih.rows), new Float64Array(weight_hh.rows)];
    const [of_x, of_h] = [affine(weight_ih, bias_ih), affine(weight_hh, bias_hh)];
    return { a, b, compute(x, h) { of_x(x, a); of_h(h, b); } };
  }

  /** The weighted median: half of the votes are below it, half above. What is not a number counts as infinite. */
  function median(values, votes) {
    const order = values.map((x, i) => [x === x ? x : Infinity, votes[i]]).sort((p, q) => (p[0] < q[0] ? -1 : p[0] > q[0] ? 1 : 0));
    const all = votes.reduce((sum, vote) => sum + vote, 0);
    let below = 0;
    for (let i = 0; i < order.length; i += 1) {
      below += order[i][1];
      if (2 * below > all) return order[i][0];
      if (2 * below === all) return i + 1 < order.length ? 0.5 * (order[i][0] + order[i + 1][0]) : order[i][0];
    }
    return NaN;
  }

  /** Computes the vector `out` of a node from the vectors `at` before it. */
  const OPERATIONS = {
    slice: ({ of, start }, at, out) => { const x = at[of].subarray(start, start + out.length); return () => out.set(x); },
    concat({ of }, at, out) {
      return () => { let k = 0; for (const id of of) { out.set(at[id], k); k += at[id].length; } };
    },
    affine({ weights, bias, x }, at, out) { const compute = affine(weights, bias); return () => compute(at[x], out); },
    select({ test, a, b, then, otherwise }, at, out) {
      const holds = TESTS[test];
      const [va, vb, vt, vo] = [a, b, then, otherwise].map((id) => at[id]);
      const of = (v, i) => v[v.length === 1 ? 0 : i];
      return () => { for (let i = 0; i < out.length; i += 1) out[i] = of(holds(of(va, i), of(vb, i)) ? vt : vo, i); };
    },
    median({ of, votes }, at, out) {
      return () => { for (let i = 0; i < out.length; i += 1) out[i] = median(of.map((id) => at[id][at[id].length === 1 ? 0 : i]), votes); };
    },
    call({ function: index, of }, at, out, functions) {
      return () => out.set(functions[index](...of.map((id) => at[id])));
    },
    repeat({ function: index, times, of }, at, out, functions) {
      const [first, ...others] = of;
      return () => {
        out.set(at[first]);
        for (let k = 0; k < times; k += 1) out.set(functions[index](out, ...others.map((id) => at[id])));
      };
    },
    gru({ cell, x, h }, at, out) {
      const { a, b, compute } = gates(cell);
      const n = out.length;
      return () => {
        compute(at[x], at[h]);
        for (let i = 0; i < n; i += 1) {
          const [reset, update] = [logistic(a[i] + b[i]), logistic(a[n + i] + b[n + i])];
          const fresh = Math.tanh(a[2 * n + i] + reset * b[2 * n + i]);
          out[i] = fresh + update * (at[h][i] - fresh);
        }
      };
    },
    lstm({ cell, x, c, h }, at, out) {
      const { a, b, compute } = gates(cell);
      const n = at[c].length;
      return () => {
        compute(at[x], at[h]);
        for (let i = 0; i < n; i += 1) {
          const gate = (k) => a[k * n + i] + b[k * n + i];
          out[i] = logistic(gate(1)) * at[c][i] + logistic(gate(0)) * Math.tanh(gate(2));
          out[n + i] = logistic(gate(3)) * Math.tanh(out[i]);
        }
      };
    },
  };

  function operation(node, at, out, functions) {
    const { op } = node;
    if (Object.hasOwn(UNARY, op)) {
      const [f, x] = [UNARY[op], at[node.x]];
      return () => { for (let i = 0; i < out.length; i += 1) out[i] = f(x[i]); };
    }
    if (Object.hasOwn(BINARY, op)) {
      const [f, a, b] = [BINARY[op], at[node.a], at[node.b]];
      const [i1, j1] = [a.length === 1 ? 0 : 1, b.length === 1 ? 0 : 1];
      return () => { for (let i = 0; i < out.length; i += 1) out[i] = f(a[i * i1], b[i * j1]); };
    }
    if (!Object.hasOwn(OPERATIONS, op)) throw new Error(`unknown operation '${op}'`);
    return OPERATIONS[op](node, at, out, functions);
  }

  /** A function of its arguments. Its result is valid until the next call. */
  function compile({ arguments: lengths, nodes, result }, functions) {
    const given = lengths.map((length) => new Float64Array(length));
    const at = [];
    const work = [];
    for (const node of nodes) {
      if (node.op === "argument") at.push(given[node.index]);
      else if (node.op === "constant") at.push(numbers(node.values));
      else {
        const out = new Float64Array(node.len);
        work.push(operation(node, at, out, functions));
        at.push(out);
      }
    }
    return (...values) => {
      values.forEach((value, i) => given[i].set(value));
      for (const compute of work) compute();
      return at[result];
    };
  }

  return function ({ functions, start, step, output }) {
    const made = [];
    for (const one of functions) made.push(compile(one, made));
    return { start: made[start], step: made[step], output: made[output] };
  };
})();

/**
 * A vessel in motion. The motion is relative to the water, which moves with the velocity `current` (north, east, in m/s). The pose
 * `eta` is north, east in metres and the heading in radians, clockwise from north and not wrapped.
 */
class Plant {
  /** `vessel`: the document that hydroid writes of a model. */
  constructor(vessel) {
    Object.assign(this, { vessel, functions: Functions(vessel.functions), current: [0, 0] });
    this.start();
  }

  /** Places the vessel at the origin, at rest under neutral commands, and heading north. */
  start() {
    const { rest, neutral } = this.vessel;
    this.eta = [0, 0, 0];
    this.x = Float64Array.from(this.functions.start(rest, neutral));
    this.y = Float64Array.from(rest);
    this.time = 0;
  }

  /** Holds a command for a sample. The vessel moves on an arc with the means of the velocities at its ends. */
  advance(command) {
    const { dt } = this.vessel;
    const before = this.nu();
    this.x.set(this.functions.step(this.x, command));
    this.y.set(this.functions.output(this.x));
    const [u, v, r] = this.nu().map((after, i) => 0.5 * (before[i] + after));
    const half = 0.5 * r * dt;
    const length = dt * (Math.abs(half) < 1e-6 ? 1 : Math.sin(half) / half);
    const [x, y, psi] = this.eta;
    const [sin, cos] = [Math.sin(psi + half), Math.cos(psi + half)];
    this.eta = [
      x + length * (u * cos - v * sin) + this.current[0] * dt,
      y + length * (u * sin + v * cos) + this.current[1] * dt,
      psi + 2 * half,
    ];
    this.time += dt;
  }

  /** Surge, sway and yaw rate through the water, in m/s and rad/s; no sway where the model has none. */
  nu() {
    return this.vessel.motion.map((place) => (place === null ? 0 : this.y[place]));
  }

  /** As `nu`, over ground. */
  over_ground() {
    const [u, v, r] = this.nu();
    const [north, east] = this.current;
    const [sin, cos] = [Math.sin(this.eta[2]), Math.cos(this.eta[2])];
    return [u + north * cos + east * sin, v - north * sin + east * cos, r];
  }

  /** Whether the motion is finite. */
  sound() {
    return [...this.y, ...this.eta].every(Number.isFinite);
  }

  /** The command for propulsion and steering between -1 and 1, within the limits. */
  command(push, turn) {
    const { map, neutral } = this.vessel;
    return neutral.map((zero, c) => {
      const [low, high] = map.limits[c];
      return Math.min(Math.max(zero + push * map.push[c] + turn * map.turn[c], low), high);
    });
  }
}
