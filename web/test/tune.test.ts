import assert from "node:assert/strict";
import { test } from "node:test";
import { RingStore } from "../src/scope/store.ts";
import { Draft, type Parameters, sliderRange } from "../src/tune/draft.ts";
import { stepFigures } from "../src/tune/step_response.ts";

const parameters: Parameters = {
  gain: { value: 2, minimum: 0, maximum: 10, unit: "1/s" },
  damping: { value: [1, 2, 3], minimum: null, maximum: null, unit: "" },
};

test("edited parameters are applied together, arrays as a whole", () => {
  const draft = new Draft(parameters);
  draft.set("gain", 0, 3);
  draft.set("damping", 1, 5);
  assert.equal(draft.edited, 2);
  assert.deepEqual(draft.changes(), { gain: 3, damping: [1, 5, 3] });
});

test("an edit back to the present value is not an edit", () => {
  const draft = new Draft(parameters);
  draft.set("gain", 0, 3);
  draft.set("gain", 0, 2);
  assert.equal(draft.edited, 0);
  assert.deepEqual(draft.changes(), {});
});

test("values outside of the limits and missing numbers are not valid", () => {
  for (const value of [-1, 11, NaN]) {
    const draft = new Draft(parameters);
    draft.set("gain", 0, value);
    assert.equal(draft.isValid(), false);
  }
  const draft = new Draft(parameters);
  draft.set("damping", 0, -1e9);
  assert.equal(draft.isValid(), true);
});

test("undo returns the values before each application, the newest first", () => {
  const draft = new Draft(parameters);
  draft.set("gain", 0, 3);
  draft.applied(draft.changes());
  draft.update({ ...parameters, gain: { ...parameters.gain!, value: 3 } });
  draft.set("gain", 0, 4);
  draft.applied(draft.changes());
  assert.deepEqual(draft.lastValues(), { gain: 3 });
  draft.undone();
  assert.deepEqual(draft.lastValues(), { gain: 2 });
  draft.undone();
  assert.equal(draft.canUndo, false);
});

test("a slider without limits surrounds the value", () => {
  assert.deepEqual(sliderRange(parameters.gain!, 2), [0, 10]);
  assert.deepEqual(sliderRange(parameters.damping!, -3), [-12, 12]);
});

function response(position: (time: number) => number): RingStore {
  const store = new RingStore(2, 0.001);
  store.add("command");
  store.add("position");
  const time = Float64Array.from({ length: 1000 }, (_, row) => row * 0.001);
  const command = time.map((each) => (each < 0.1 ? 1 : 1.5));
  const values = [command, time.map((each) => 1 + 0.5 * position(each - 0.1))];
  store.append({ time, names: ["command", "position"], values, lost: 0 });
  return store;
}

test("a first-order response rises in 2.2 time constants without overshoot", () => {
  const store = response((time) => (time < 0 ? 0 : 1 - Math.exp(-time / 0.05)));
  const figures = stepFigures(store, "command", "position")!;
  assert.ok(Math.abs(figures.size - 0.5) < 1e-12);
  assert.ok(Math.abs(figures.rise - 0.05 * Math.log(9)) < 1e-4);
  assert.equal(figures.overshoot, 0);
  assert.ok(Math.abs(figures.settling - 0.05 * Math.log(50)) < 2e-3);
  assert.ok(Math.abs(figures.error) < 1e-6);
});

test("a second-order response has its overshoot", () => {
  const [damping, rate] = [0.3, 60];
  const damped = rate * Math.sqrt(1 - damping ** 2);
  const store = response((time) => (time < 0 ? 0
    : 1 - Math.exp(-damping * rate * time) * (Math.cos(damped * time) + (damping * rate / damped) * Math.sin(damped * time))));
  const figures = stepFigures(store, "command", "position")!;
  assert.ok(Math.abs(figures.overshoot - Math.exp((-Math.PI * damping) / Math.sqrt(1 - damping ** 2))) < 1e-3);
});

test("a command at rest has no response", () => {
  const store = new RingStore(1, 0.001);
  store.add("command");
  store.append({ time: Float64Array.of(0, 0.001), names: ["command"], values: [Float64Array.of(1, 1)], lost: 0 });
  assert.equal(stepFigures(store, "command", "position"), null);
});
