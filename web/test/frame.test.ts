import assert from "node:assert/strict";
import { test } from "node:test";
import { decodeFrame } from "../src/frame.ts";

function head(kind: number, rows: number, signals: number, bytes: number, version = 1): DataView {
  const view = new DataView(new ArrayBuffer(32 + bytes));
  view.setUint8(0, kind);
  view.setUint8(1, version);
  view.setUint16(2, 7, true);
  view.setUint32(4, rows, true);
  view.setUint32(8, signals, true);
  view.setUint32(12, 3, true);
  view.setFloat64(16, 4711, true);
  view.setFloat64(24, 0.001, true);
  return view;
}

test("a full frame has one column per signal", () => {
  const view = head(1, 2, 2, 48);
  [0.5, 0.501, 1, 2, 3, 4].forEach((value, at) => view.setFloat64(32 + 8 * at, value, true));
  const frame = decodeFrame(view.buffer as ArrayBuffer);
  assert.ok(frame.kind === 1);
  assert.deepEqual([frame.id, frame.lost, frame.first, frame.period], [7, 3, 4711, 0.001]);
  assert.deepEqual([...frame.time], [0.5, 0.501]);
  assert.deepEqual(
    frame.columns.map((column) => [...column]),
    [[1, 2], [3, 4]],
  );
});

test("a decimated frame has minimum and maximum", () => {
  const view = head(2, 1, 2, 24);
  [1, 2, 3, 4].forEach((value, at) => view.setFloat32(40 + 4 * at, value, true));
  const frame = decodeFrame(view.buffer as ArrayBuffer);
  assert.ok(frame.kind === 2);
  assert.deepEqual([frame.minimum[1]?.[0], frame.maximum[1]?.[0]], [3, 4]);
});

test("a frame that is too short, unknown or of another version is refused", () => {
  assert.throws(() => decodeFrame(head(1, 9, 9, 8).buffer as ArrayBuffer), RangeError);
  assert.throws(() => decodeFrame(head(9, 0, 0, 0).buffer as ArrayBuffer), RangeError);
  assert.throws(() => decodeFrame(head(1, 0, 0, 0, 2).buffer as ArrayBuffer), RangeError);
  assert.throws(() => decodeFrame(new ArrayBuffer(4)), RangeError);
});
