import assert from "node:assert/strict";
import { test } from "node:test";
import { catalog, search } from "../src/scope/catalog.ts";
import { encodeCsv, encodeMcap, type Table } from "../src/scope/export.ts";

const table: Table = {
  topic: "/scope", names: ['=a "1"', "b"], units: ["rad", ""], rows: 3,
  time: (row) => 1 + row * 0.001,
  value: (signal, row) => (row === 1 ? NaN : signal * 10 + row),
};

test("CSV leaves missing values empty and quotes names", () => {
  const lines = encodeCsv(table).split("\n");
  assert.deepEqual(lines, [
    'time [s],"\'=a ""1"" [rad]","b"', "1.000000000,0,10", "1.001000000,,", "1.002000000,2,12", "",
  ]);
});

test("MCAP begins and ends with the magic bytes", () => {
  const data = encodeMcap(table, 5n);
  const magic = [0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a];
  assert.deepEqual([...data.slice(0, 8)], magic);
  assert.deepEqual([...data.slice(-8)], magic);
});

const layout = {
  fields: [
    { name: "position", unit: "rad", shape: [2], per_axis: true },
    { name: "lateness", unit: "s", shape: [], per_axis: false },
    { name: "wrench", unit: "N", shape: [3], per_axis: false },
  ],
  axes: ["shoulder", "elbow"], period: 0.001, clock: "monotonic" as const, utc_offset_ns: 0,
};

test("the catalogue names each element", () => {
  const signals = catalog(layout).flatMap((group) => group.signals);
  assert.deepEqual(signals.map((each) => each.id), [
    "position[0]", "position[1]", "lateness", "wrench[0]", "wrench[1]", "wrench[2]",
  ]);
  assert.equal(signals[1]!.label, "position · elbow");
});

test("a search matches all words in field, axis and unit", () => {
  const found = search(catalog(layout), "rad ELBOW").flatMap((group) => group.signals);
  assert.deepEqual(found.map((each) => each.id), ["position[1]"]);
});
