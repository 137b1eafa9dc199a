import assert from "node:assert/strict";
import { test } from "node:test";
import { decodePoses, decodeScene } from "../src/scene/decode.ts";

const description = { bodies: ["world", "arm"], joints: ["j"], center: [0, 0, 1], extent: 2 };

function scene(): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(description));
  const length = Math.ceil(text.length / 4) * 4;
  const buffer = new ArrayBuffer(32 + length + 72 + 8 + 36 + 12);
  const view = new DataView(buffer);
  new Uint8Array(buffer).set(new TextEncoder().encode("CATSCENE"));
  [1, 2, 1, 1, length].forEach((value, index) => view.setUint32(8 + 4 * index, value, true));
  new Uint8Array(buffer, 32, length).fill(32).set(text);
  let at = 32 + length;
  [7, 1, 0, 0].forEach((value, index) => view.setUint32(at + 4 * index, value, true));
  for (let index = 0; index < 14; index++) view.setFloat32(at + 16 + 4 * index, index, true);
  at += 72;
  [3, 1].forEach((value, index) => view.setUint32(at + 4 * index, value, true));
  for (let index = 0; index < 9; index++) view.setFloat32(at + 8 + 4 * index, index / 2, true);
  [0, 1, 2].forEach((value, index) => view.setUint32(at + 44 + 4 * index, value, true));
  return buffer;
}

test("a scene has its bodies, shapes and meshes", () => {
  const data = decodeScene(scene());
  assert.deepEqual(data.bodies, ["world", "arm"]);
  assert.deepEqual(data.shapes, [{
    type: "mesh", body: 1, mesh: 0,
    size: [0, 1, 2], position: [3, 4, 5], quaternion: [6, 7, 8, 9], colour: [10, 11, 12, 13],
  }]);
  assert.deepEqual([...data.meshes[0]!.vertices], [0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4]);
  assert.deepEqual([...data.meshes[0]!.faces], [0, 1, 2]);
});

test("other or truncated data is no scene", () => {
  const other = scene();
  new Uint8Array(other)[0] = 0;
  assert.throws(() => decodeScene(other), RangeError);
  assert.throws(() => decodeScene(scene().slice(0, -8)), RangeError);
});

test("poses have actual and target rows and contacts", () => {
  const buffer = new ArrayBuffer(32 + 4 * (14 + 14 + 6));
  const view = new DataView(buffer);
  [3, 1].forEach((value, index) => view.setUint8(index, value));
  view.setUint16(2, 1, true);
  view.setUint32(4, 2, true);
  view.setFloat64(16, 12.5, true);
  for (let index = 0; index < 34; index++) view.setFloat32(32 + 4 * index, index, true);
  const poses = decodePoses(buffer);
  assert.equal(poses.time, 12.5);
  assert.equal(poses.actual[13], 13);
  assert.equal(poses.target[0], 14);
  assert.deepEqual([...poses.contacts], [28, 29, 30, 31, 32, 33]);
  assert.throws(() => decodePoses(buffer.slice(0, 64)), RangeError);
});
