import assert from "node:assert/strict";
import { test } from "node:test";
import { parseLayout, recording, signalsOf, toggled, withChart, type ScopeLayout } from "../src/scope/layout.ts";
import { tickText, TimeView, ValueRange } from "../src/scope/view.ts";

const layout: ScopeLayout = {
  charts: [{ id: 1, traces: ["a"] }],
  recorded: [],
  window: 5,
  trigger: { signal: "a", level: 0, edge: "rising", mode: "auto", pre: 0.25, window: 5 },
  triggerOn: false,
};

test("a view follows the newest sample until it is fixed", () => {
  const view = new TimeView(2);
  assert.deepEqual(view.span(10), { start: 8, end: 10 });
  view.zoom(view.span(10), 0.5, 9, 0.001, 60);
  assert.deepEqual(view.span(20), { start: 8.5, end: 9.5 });
  view.pan(view.span(20), 1);
  assert.deepEqual(view.span(30), { start: 9.5, end: 10.5 });
  view.follow();
  assert.deepEqual(view.span(30), { start: 28, end: 30 });
});

test("zooming ends at ten periods and at the history", () => {
  const view = new TimeView(1);
  view.zoom({ start: 0, end: 1 }, 1e-9, 0.5, 0.001, 60);
  assert.ok(Math.abs(view.fixed!.end - view.fixed!.start - 0.01) < 1e-12);
  view.zoom(view.fixed!, 1e9, 0.5, 0.001, 60);
  assert.ok(Math.abs(view.fixed!.end - view.fixed!.start - 60) < 1e-9);
});

test("a range of values grows at once and shrinks late", () => {
  const range = new ValueRange();
  range.include(-1, 1);
  const { low, high } = range;
  assert.ok(low < -1 && high > 1);
  range.include(-0.8, 0.8);
  assert.deepEqual([range.low, range.high], [low, high]);
  range.include(-0.1, 0.1);
  assert.ok(range.high < 0.2);
  range.include(NaN, NaN);
  assert.ok(range.high < 0.2);
});

test("a constant signal has a range", () => {
  for (const value of [0, 5, -3e-7]) {
    const range = new ValueRange();
    range.include(value, value);
    assert.ok(range.low < value && value < range.high);
  }
});

test("ticks have the digits of their distance", () => {
  assert.equal(tickText(0.8765, 0.0005), "0.8765");
  assert.equal(tickText(-2, 1), "−2");
  assert.equal(tickText(1e-18, 0.25), "0.00");
  assert.equal(tickText(3e-9, 1e-9), "3.00e−9");
});

test("a hidden trace stays in the store", () => {
  const hidden = toggled(layout, 1, "a");
  assert.deepEqual(hidden.charts[0]!.traces, []);
  assert.deepEqual(signalsOf(hidden), ["a"]);
  assert.deepEqual(signalsOf(recording(hidden, ["a"], false)), []);
});

test("more than 32 traces and 8 charts are refused", () => {
  let full = layout;
  for (let index = 0; index < 40; index++) full = toggled(full, 1, `s${index}`);
  assert.equal(full.charts[0]!.traces.length, 32);
  for (let index = 0; index < 20; index++) full = withChart(full);
  assert.equal(full.charts.length, 8);
});

test("a stored arrangement is read again; anything else is refused", () => {
  assert.deepEqual(parseLayout(JSON.stringify(layout)), layout);
  for (const text of [null, "", "{", "[]", "{}", '{"charts":[{"id":"x"}]}', JSON.stringify({ ...layout, window: 3 })]) {
    assert.equal(parseLayout(text), null);
  }
});
