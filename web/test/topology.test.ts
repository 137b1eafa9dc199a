import assert from "node:assert/strict";
import { test } from "node:test";
import { layout, openLinks, type Wired } from "../src/logic/topology.ts";

function device(position: number, parent: number | null, parent_port: number | null = 1): Wired {
  const ports = [0, 1].map((port) => ({ port, link: port === 0, loop_closed: port !== 0 }));
  return { position, parent, parent_port, ports };
}

test("a line has one column", () => {
  const nodes = layout([device(0, null), device(1, 0), device(2, 1)]);
  assert.deepEqual(
    nodes.map(({ position, row, column }) => [position, row, column]),
    [[0, 0, 0], [1, 1, 0], [2, 2, 0]],
  );
});

test("a branch before the last one has a column of its own, in the order of the ports", () => {
  const nodes = layout([device(0, null), device(1, 0, 1), device(2, 1), device(3, 0, 2)]);
  assert.deepEqual(
    nodes.map(({ position, column, parent }) => [position, column, parent]),
    [[0, 0, null], [1, 1, 0], [2, 1, 1], [3, 0, 0]],
  );
});

test("port 3 comes before port 1", () => {
  const nodes = layout([device(0, null), device(1, 0, 1), device(2, 0, 3)]);
  assert.deepEqual(
    nodes.map(({ position }) => position),
    [0, 2, 1],
  );
});

test("a device with an unknown parent is at the MainDevice", () => {
  assert.equal(layout([device(4, 3)])[0]?.parent, null);
});

test("devices of a cycle of parents do not hang the page", () => {
  assert.deepEqual(layout([device(0, 1), device(1, 0)]), []);
});

test("the last port of a ring is a redundant line", () => {
  const last = device(1, 0);
  const ring = { ...last, ports: last.ports.map((port) => ({ ...port, link: true, loop_closed: false })) };
  assert.deepEqual(openLinks(ring, [device(0, null), ring]), [1]);
  assert.deepEqual(openLinks(last, [device(0, null), last]), []);
});
