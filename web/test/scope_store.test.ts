import assert from "node:assert/strict";
import { test } from "node:test";
import { Envelope, envelope, groupSize, range } from "../src/scope/decimation.ts";
import { RingStore, type Rows } from "../src/scope/store.ts";

const PERIOD = 0.001;

function rows(first: number, values: number[], lost = 0): Rows {
  const time = Float64Array.from(values, (_, index) => (first + index) * PERIOD);
  return { time, names: ["a"], values: [Float64Array.from(values)], lost };
}

function filled(count: number, value: (row: number) => number): RingStore {
  const store = new RingStore(1, PERIOD);
  store.add("a");
  for (let row = 0; row < count; row += 7) {
    const size = Math.min(7, count - row);
    store.append(rows(row, Array.from({ length: size }, (_, index) => value(row + index))));
  }
  return store;
}

test("the store keeps the last second and every value of it", () => {
  const store = filled(5003, (row) => row);
  assert.equal(store.end, 5003);
  assert.equal(store.begin, 4003);
  for (let row = store.begin; row < store.end; row++) assert.equal(store.value("a", row), row);
  assert.ok(Math.abs(store.timeOf(4500) - 4.5) < 1e-9);
  assert.equal(store.rowAt(4.5), 4500);
  assert.equal(store.rowAt(99), store.end);
});

test("rows that are known already are not appended again", () => {
  const store = filled(21, (row) => row);
  store.append(rows(14, Array.from({ length: 14 }, (_, index) => 14 + index)));
  assert.equal(store.end, 28);
  assert.equal(store.value("a", 27), 27);
});

test("lost rows leave one marker row without a value", () => {
  const store = filled(14, (row) => row);
  store.append(rows(20, [20, 21], 6));
  assert.equal(store.lost, 6);
  assert.deepEqual(store.gaps, [{ row: 14, rows: 6 }]);
  assert.ok(Number.isNaN(store.value("a", 14)));
  assert.equal(store.value("a", 15), 20);
});

test("a signal that a frame does not contain has no value there", () => {
  const store = filled(10, (row) => row);
  store.add("b");
  store.append({ ...rows(10, [5]), names: ["b"] });
  assert.equal(store.value("b", 10), 5);
  assert.ok(Number.isNaN(store.value("b", 9)));
  assert.ok(Number.isNaN(store.value("a", 10)));
});

test("time that runs backwards begins a new history", () => {
  const store = filled(5000, (row) => row);
  store.append(rows(0, [1, 2, 3]));
  assert.equal(store.end, 3);
  assert.equal(store.value("a", 0), 1);
});

test("the envelope equals the minimum and maximum of every group", () => {
  const store = filled(4021, (row) => Math.sin(row * 1.7) * (row % 97));
  const out = new Envelope();
  for (const groups of [2000, 300, 100, 10, 1]) {
    for (const from of [store.begin, store.begin + 5, store.begin + 123]) {
      const to = store.end - 11;
      envelope(store, store.columns.get("a")!, from, to, groups, out);
      assert.ok(out.count <= groups + 1);
      check(store, out);
    }
  }
});

function check(store: RingStore, out: Envelope): void {
  for (let index = 0; index < out.count; index++) {
    const start = Math.max(out.first + index * out.step, store.begin);
    const end = Math.min(out.first + (index + 1) * out.step, store.end);
    let low = Infinity;
    let high = -Infinity;
    for (let row = start; row < end; row++) {
      low = Math.min(low, store.value("a", row));
      high = Math.max(high, store.value("a", row));
    }
    assert.equal(out.low[index], low);
    assert.equal(out.high[index], high);
  }
}

test("a peak of one sample stays visible in 60 s", () => {
  const store = new RingStore(60, PERIOD);
  store.add("a");
  for (let first = 0; first < 70_000; first += 1000) {
    const values = new Array<number>(1000).fill(0);
    if (first === 33_000) values[777] = 9;
    store.append(rows(first, values));
  }
  const out = new Envelope();
  envelope(store, store.columns.get("a")!, store.begin, store.end, 800, out);
  assert.deepEqual(range(out), [0, 9]);
});

test("groups are powers of two", () => {
  assert.equal(groupSize(100, 800), 1);
  assert.equal(groupSize(60_000, 800), 128);
});
