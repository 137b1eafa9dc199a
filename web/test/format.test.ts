import assert from "node:assert/strict";
import { test } from "node:test";
import { count, duration, fixed, hex, MISSING, objectKey, quantity, shortened } from "../src/logic/format.ts";

test("a duration has three digits and a unit", () => {
  const cases: [number, string][] = [
    [1.23e-5, "12.3 µs"],
    [9.996e-6, "10.0 µs"],
    [9.99999e-4, "1.00 ms"],
    [0.001, "1.00 ms"],
    [1.5, "1.50 s"],
    [120, "120 s"],
    [3e-9, "3 ns"],
    [-1.4e-8, "−14 ns"],
    [0, "0 s"],
  ];
  for (const [seconds, text] of cases) assert.equal(plain(duration(seconds)), text);
});

test("a missing number is a dash", () => {
  for (const value of [null, undefined, NaN]) {
    assert.equal(fixed(value, 2), MISSING);
    assert.equal(duration(value), MISSING);
  }
});

test("a number that rounds to zero has no sign", () => {
  assert.equal(fixed(-0.0001, 2), "0.00");
  assert.equal(fixed(-0.006, 2), "−0.01");
});

test("infinity is a symbol", () => assert.equal(fixed(-Infinity, 2), "−∞"));

test("a live value has the digits of its unit", () => {
  assert.equal(quantity(1.23456789, "rad"), "1.2346");
  assert.equal(quantity(1.23456789, "rad/s"), "1.235");
});

test("a count has groups of three digits", () => {
  assert.equal(plain(count(1234567)), "1 234 567");
  assert.equal(count(999), "999");
});

test("object keys are hexadecimal", () => {
  assert.equal(objectKey(0x6064, 0), "0x6064:00");
  assert.equal(objectKey(0x1c12, 10), "0x1C12:0A");
  assert.equal(hex(2, 8), "0x00000002");
});

test("a long name keeps its begin and its end", () => {
  assert.equal(shortened("2 Catenary virtual servo 1", 20), "2 Catenary…l servo 1");
  assert.equal(shortened("2 Catenary virtual servo 1", 26), "2 Catenary virtual servo 1");
});

function plain(text: string): string {
  return text.replaceAll("\u00a0", " ");
}
