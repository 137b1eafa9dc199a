import assert from "node:assert/strict";
import { test } from "node:test";
import { measure } from "../src/scope/measurements.ts";
import { RingStore } from "../src/scope/store.ts";
import { Trigger, type TriggerSettings } from "../src/scope/trigger.ts";

const PERIOD = 0.001;
const settings: TriggerSettings = {
  signal: "a", level: 0.5, edge: "rising", mode: "normal", pre: 0.25, window: 0.1,
};

function append(store: RingStore, count: number, value: (row: number) => number): void {
  const first = store.end;
  const time = Float64Array.from({ length: count }, (_, index) => (first + index) * PERIOD);
  const values = Float64Array.from({ length: count }, (_, index) => value(first + index));
  store.append({ time, names: ["a"], values: [values], lost: 0 });
}

function store(): RingStore {
  const empty = new RingStore(10, PERIOD);
  empty.add("a");
  return empty;
}

function close(value: number, expected: number): void {
  assert.ok(Math.abs(value - expected) < 1e-9, `${value} instead of ${expected}`);
}

test("the capture surrounds the crossing with the pre-trigger share", () => {
  const data = store();
  const trigger = new Trigger(settings, data);
  let complete = 0;
  for (let frame = 0; frame < 40; frame++) {
    append(data, 10, (row) => (row >= 200 ? 1 : 0));
    if (trigger.step(data)) complete++;
  }
  assert.equal(complete, 1);
  close(trigger.capture!.trigger, 0.1995);
  close(trigger.capture!.start, 0.1745);
  close(trigger.capture!.end, 0.2745);
  assert.equal(trigger.state, "armed");
});

test("an edge at the border of two frames triggers", () => {
  const data = store();
  const trigger = new Trigger(settings, data);
  append(data, 100, () => 0);
  assert.equal(trigger.step(data), false);
  append(data, 200, () => 1);
  assert.equal(trigger.step(data), true);
});

test("falling edges trigger only where requested", () => {
  for (const edge of ["rising", "falling", "either"] as const) {
    const data = store();
    const trigger = new Trigger({ ...settings, edge }, data);
    append(data, 400, (row) => (row < 100 ? 1 : 0));
    assert.equal(trigger.step(data), edge !== "rising");
  }
});

test("single captures once, normal again", () => {
  for (const mode of ["single", "normal"] as const) {
    const data = store();
    const trigger = new Trigger({ ...settings, mode }, data);
    let complete = 0;
    for (let frame = 0; frame < 100; frame++) {
      append(data, 10, (row) => (Math.floor(row / 100) % 2));
      if (trigger.step(data)) complete++;
    }
    assert.equal(complete, mode === "single" ? 1 : 5);
    assert.equal(trigger.state === "complete", mode === "single");
  }
});

test("auto runs freely without an edge, normal waits", () => {
  for (const mode of ["auto", "normal"] as const) {
    const data = store();
    const trigger = new Trigger({ ...settings, mode }, data);
    append(data, 10, () => 0);
    trigger.step(data);
    append(data, 1000, () => 0);
    trigger.step(data);
    assert.equal(trigger.state, mode === "auto" ? "free" : "armed");
  }
});

test("measurements ignore missing values", () => {
  const data = store();
  append(data, 100, (row) => (row === 50 ? NaN : row % 2 === 0 ? 3 : -3));
  const result = measure(data, "a", 0, 100);
  assert.equal(result.count, 99);
  assert.equal(result.minimum, -3);
  assert.equal(result.maximum, 3);
  close(result.rms, 3);
  close(result.mean, -3 / 99);
  assert.equal(measure(data, "b", 0, 100).count, 0);
});

test("the rise time of a ramp is 80 % of it", () => {
  const data = store();
  append(data, 500, (row) => Math.min(Math.max((row - 100) / 200, 0), 1));
  close(measure(data, "a", 0, 500).rise, 0.16);
  assert.ok(Number.isNaN(measure(data, "a", 320, 500).rise));
});

test("the rise time of a step of one sample is 80 % of the period", () => {
  const data = store();
  append(data, 100, (row) => (row < 50 ? 0 : 1));
  close(measure(data, "a", 0, 100).rise, 0.0008);
});
