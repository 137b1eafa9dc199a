import assert from "node:assert/strict";
import { test } from "node:test";
import {
  columnsOf,
  decades,
  difference,
  height,
  place,
  scaleOf,
  type Bucket,
} from "../src/logic/histogram.ts";
import { LossHistory, SECONDS } from "../src/logic/losses.ts";

const BUCKETS: Bucket[] = [
  [1.2e-6, 1.3e-6, 900],
  [5e-6, 5.1e-6, 99],
  [2.1e-4, 2.2e-4, 1],
];

test("the axis consists of whole decades", () => {
  const scale = scaleOf(BUCKETS);
  assert.ok(Math.abs(scale.low - 1e-6) < 1e-12);
  assert.ok(Math.abs(scale.high - 1e-3) < 1e-9);
  assert.equal(decades(scale).length, 4);
});

test("an empty histogram has an axis", () => assert.ok(scaleOf([]).high > scaleOf([]).low));

test("columns keep every cycle", () => {
  const columns = columnsOf(BUCKETS, scaleOf(BUCKETS), 40);
  assert.equal(
    columns.reduce((sum, n) => sum + n, 0),
    1000,
  );
  assert.equal(columns.length, 40);
});

test("times outside of the axis count in its first and last column", () => {
  const scale = { low: 1e-6, high: 1e-4 };
  const columns = columnsOf([[0, 0, 5], [1, 1.1, 7]], scale, 10);
  assert.equal(columns[0], 5);
  assert.equal(columns[9], 7);
  assert.equal(place(1e-5, scale).toFixed(3), "0.500");
});

test("a single cycle among a million is visible", () => {
  assert.ok(height(1, 1e6) > 0.1);
  assert.equal(height(1e6, 1e6), 1);
  assert.equal(height(0, 1e6), 0);
});

test("a difference has only the later cycles", () => {
  const later: Bucket[] = [[1.2e-6, 1.3e-6, 950], [5e-6, 5.1e-6, 99], [7e-6, 7.1e-6, 2]];
  assert.deepEqual(
    difference(later, BUCKETS).map(([, , n]) => n),
    [50, 0, 2],
  );
});

test("losses count in the second of their message", () => {
  const history = new LossHistory();
  history.add(10.1, { lost: 5, late: 1 });
  history.add(10.6, { lost: 7, late: 1 });
  history.add(11.2, { lost: 7, late: 4 });
  const counts = history.counts(11.5);
  assert.deepEqual(counts.at(-2), { lost: 2, late: 0 });
  assert.deepEqual(counts.at(-1), { lost: 0, late: 3 });
  assert.equal(counts.length, SECONDS);
});

test("a counter that was reset counts from zero", () => {
  const history = new LossHistory();
  history.add(1, { lost: 100, late: 0 });
  history.add(2, { lost: 3, late: 0 });
  assert.equal(history.counts(2).at(-1)?.lost, 3);
});
