import assert from "node:assert/strict";
import { test } from "node:test";
import type { Frame } from "../src/frame.ts";
import { storeOf } from "../src/recordings/window_store.ts";
import { Envelope, envelope, range } from "../src/scope/decimation.ts";

const head = { id: 0, lost: 0, first: 0, period: 0.001 };

test("a window of samples has every sample, and gaps at jumps of the time", () => {
  const time = Float64Array.of(5, 5.001, 5.002, 5.01, 5.011);
  const frame: Frame = { ...head, kind: 1, rows: 5, time, columns: [Float64Array.of(1, 2, 3, 4, 5)] };
  const store = storeOf(frame, ["a"], 0.001);
  const rows = Array.from({ length: store.end }, (_, row) => store.value("a", row));
  assert.deepEqual(rows, [1, 2, 3, NaN, 4, 5]);
  assert.equal(store.gaps.length, 1);
});

test("a window of intervals keeps their extremes", () => {
  const time = Float64Array.of(0, 1, 2);
  const minimum = [Float32Array.of(-1, -9, -3)];
  const maximum = [Float32Array.of(1, 2, 7)];
  const store = storeOf({ ...head, kind: 2, rows: 3, time, minimum, maximum }, ["a"], 0.001);
  const out = new Envelope();
  envelope(store, store.columns.get("a")!, 0, store.end, 1, out);
  assert.deepEqual(range(out), [-9, 7]);
  assert.equal(store.end, 6);
});

test("an empty window has no rows", () => {
  const store = storeOf({ ...head, kind: 2, rows: 0, time: new Float64Array(0), minimum: [], maximum: [] }, ["a"], 0.001);
  assert.equal(store.end, 0);
});
