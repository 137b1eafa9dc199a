import assert from "node:assert/strict";
import { test } from "node:test";
import { familyOf, parseValue, rangeOf, type ValueType } from "../src/logic/values.ts";

const UINT: ValueType = { type: "UINT", bits: 16 };
const SINT: ValueType = { type: "SINT", bits: 8 };

test("integers are decimal, hexadecimal or binary", () => {
  for (const [text, value] of [["31", 31], ["0x1F", 31], ["0b11111", 31], [" 31 ", 31]] as const) {
    assert.deepEqual(parseValue(text, UINT), { value, error: null });
  }
  assert.deepEqual(parseValue("−5", SINT), { value: -5, error: null });
});

test("integers outside of the type are refused", () => {
  assert.equal(parseValue("65536", UINT).error, "range");
  assert.equal(parseValue("-1", UINT).error, "range");
  assert.equal(parseValue("128", SINT).error, "range");
  assert.equal(parseValue("-128", SINT).error, null);
});

test("limits of the object apply in addition", () => {
  const limited = { ...UINT, minimum: 10, maximum: 20 };
  assert.equal(parseValue("9", limited).error, "range");
  assert.equal(parseValue("20", limited).value, 20);
  assert.equal(rangeOf(limited), "10 to 20");
});

test("text that is not an integer is refused", () => {
  for (const text of ["", "1.5", "12a", "0x", "1e3"]) assert.equal(parseValue(text, UINT).error, "integer");
});

test("an integer that JSON would round is refused", () => {
  const large: ValueType = { type: "ULINT", bits: 64 };
  assert.equal(parseValue("9007199254740993", large).error, "exact");
  assert.equal(parseValue("9007199254740991", large).value, 9007199254740991);
});

test("numbers accept a decimal comma and exponents", () => {
  const real: ValueType = { type: "REAL", bits: 32 };
  assert.equal(parseValue("1,5", real).value, 1.5);
  assert.equal(parseValue("-2e-3", real).value, -0.002);
  for (const text of ["", "nan", "Infinity"]) assert.equal(parseValue(text, real).error, "number");
});

test("booleans are words or digits", () => {
  const type: ValueType = { type: "BOOLEAN", bits: 1 };
  assert.equal(parseValue("TRUE", type).value, true);
  assert.equal(parseValue("0", type).value, false);
  assert.equal(parseValue("2", type).error, "boolean");
});

test("the length of a text counts in bytes", () => {
  const type: ValueType = { type: "VISIBLE_STRING", bits: 32 };
  assert.equal(parseValue("abcd", type).value, "abcd");
  assert.equal(parseValue("äöü", type).error, "long");
});

test("bytes are pairs of hexadecimal digits", () => {
  const type: ValueType = { type: "OCTET_STRING", bits: 24 };
  assert.equal(parseValue("01 02:FF", type).value, "0102ff");
  assert.equal(parseValue("012", type).error, "hex");
  assert.equal(parseValue("01020304", type).error, "long");
});

test("both families of names are known", () => {
  assert.equal(familyOf("UNSIGNED32"), "unsigned");
  assert.equal(familyOf("INTEGER16"), "signed");
  assert.equal(familyOf("BITARR8"), "unsigned");
  assert.equal(familyOf("LREAL"), "real");
  assert.equal(familyOf("DOMAIN"), "bytes");
});
