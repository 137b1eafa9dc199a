import assert from "node:assert/strict";
import { test } from "node:test";
import { signal } from "@preact/signals";
import type { Connection } from "../src/connection.ts";
import type { Frame } from "../src/frame.ts";
import { Acquisition } from "../src/scope/acquisition.ts";

const PERIOD = 0.001;
type Hello = NonNullable<Connection["hello"]["value"]>;

function hello(run: string): Hello {
  const fields = ["a", "b"].map((name) => ({ name, unit: "", shape: [], per_axis: false }));
  const layout = { fields, axes: [], period: PERIOD, clock: "monotonic" as const, utc_offset_ns: 0 };
  const none = { reason_no_jog: null, program: "", remote: false, modes: [], presets: [] };
  return { op: "hello", share: "arm", run, layout, role: "viewer", ...none };
}

/** A connection whose frames the test sends. */
class FakeConnection {
  readonly hello = signal<Hello | null>(hello("1"));
  readonly subscriptions = new Map<number, { signals: string[]; callback: (frame: Frame) => void }>();
  private next = 1;

  subscribe(signals: string[], _options: object, callback: (frame: Frame) => void): () => void {
    const id = this.next++;
    this.subscriptions.set(id, { signals, callback });
    return () => void this.subscriptions.delete(id);
  }

  send(id: number, first: number, rows: number): void {
    const { signals, callback } = this.subscriptions.get(id)!;
    const time = Float64Array.from({ length: rows }, (_, index) => (first + index) * PERIOD);
    const columns = signals.map(() => Float64Array.from({ length: rows }, (_, index) => first + index));
    callback({ kind: 1, id, rows, lost: 0, first, period: PERIOD, time, columns });
  }
}

function recording(...signals: string[]): [FakeConnection, Acquisition] {
  const connection = new FakeConnection();
  const acquisition = new Acquisition(connection);
  acquisition.record(signals);
  return [connection, acquisition];
}

test("a new subscription continues the old one without a gap", () => {
  const [connection, acquisition] = recording("a");
  connection.send(1, 0, 10);
  acquisition.record(["a", "b"]);
  connection.send(2, 15, 5);
  connection.send(1, 10, 8);
  assert.equal(acquisition.store.end, 18);
  connection.send(2, 20, 5);
  assert.deepEqual([...connection.subscriptions.keys()], [2]);
  assert.equal(acquisition.store.end, 25);
  assert.equal(acquisition.store.gaps.length, 0);
  for (let row = 0; row < 25; row++) assert.equal(acquisition.store.value("a", row), row);
  assert.equal(acquisition.store.value("b", 24), 24);
});

test("rows that are missing after a reconnection are lost", () => {
  const [connection, acquisition] = recording("a");
  connection.send(1, 0, 10);
  connection.hello.value = hello("1");
  connection.send(1, 30, 10);
  assert.equal(acquisition.store.lost, 20);
  assert.equal(acquisition.store.gaps.length, 1);
});

test("rows that are missing after a pause are a gap, but not lost", () => {
  const [connection, acquisition] = recording("a");
  connection.send(1, 0, 10);
  acquisition.paused.value = true;
  connection.send(1, 10, 10);
  acquisition.paused.value = false;
  connection.send(1, 20, 10);
  assert.equal(acquisition.store.lost, 0);
  assert.equal(acquisition.store.gaps.length, 1);
});

test("another run begins with an empty store", () => {
  const [connection, acquisition] = recording("a");
  connection.send(1, 0, 10);
  connection.hello.value = hello("2");
  assert.equal(acquisition.store.end, 0);
  assert.equal(acquisition.generation.value, 2);
});
