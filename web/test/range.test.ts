import assert from "node:assert/strict";
import { test } from "node:test";
import { fraction, positionRange, signedRange } from "../src/logic/range.ts";

test("limits of an axis are the ends of its bar", () => {
  assert.deepEqual(positionRange(-1, 2, 0, 1), { low: -1, high: 2, limited: true });
  assert.deepEqual(signedRange(3, 0, 1), { low: -3, high: 3, limited: true });
});

test("a bar without limits contains the value", () => {
  for (const value of [0, 0.5, 1, 7, -1000]) {
    const range = positionRange(null, null, value, 1);
    assert.ok(range.low <= value && value <= range.high && !range.limited);
  }
  assert.equal(signedRange(Infinity, 3, 1).high, 4);
});

test("a place is clamped to the bar", () => {
  const range = signedRange(2, 0, 1);
  assert.equal(fraction(-9, range), 0);
  assert.equal(fraction(0, range), 0.5);
  assert.equal(fraction(9, range), 1);
  assert.equal(fraction(NaN, range), 0);
});
