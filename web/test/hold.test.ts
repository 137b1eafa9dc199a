import assert from "node:assert/strict";
import { test } from "node:test";
import { Hold, HOLD_TIME } from "../src/logic/hold.ts";

/** Hold with timers that a test advances, and the targets whose action began. */
function bench() {
  const acted: string[] = [];
  const timers = new Map<number, { action: () => void; due: number }>();
  let now = 0;
  let next = 1;
  let changes = 0;
  const hold = new Hold<string>((target) => acted.push(target), () => (changes += 1), {
    start: (action, time) => {
      timers.set(next, { action, due: now + time });
      return next++;
    },
    cancel: (timer) => void timers.delete(timer),
  });
  const pass = (time: number) => {
    now += time;
    for (const [timer, { action, due }] of [...timers]) {
      if (due <= now && timers.delete(timer)) action();
    }
  };
  return { hold, acted, pass, changes: () => changes };
}

test("a complete hold begins one action", () => {
  const { hold, acted, pass } = bench();
  hold.begin("stand");
  assert.equal(hold.held, "stand");
  pass(HOLD_TIME);
  pass(10 * HOLD_TIME);
  assert.deepEqual(acted, ["stand"]);
  assert.equal(hold.held, null);
});

test("an earlier release cancels the action", () => {
  const { hold, acted, pass } = bench();
  hold.begin("stand");
  pass(HOLD_TIME - 1);
  hold.end();
  pass(HOLD_TIME);
  assert.deepEqual(acted, []);
});

test("another button cancels the first hold and begins from zero", () => {
  const { hold, acted, pass } = bench();
  hold.begin("stand");
  pass(HOLD_TIME - 1);
  hold.begin("balance");
  pass(HOLD_TIME - 1);
  assert.deepEqual(acted, []);
  pass(1);
  assert.deepEqual(acted, ["balance"]);
});

test("each change is reported once", () => {
  const { hold, changes } = bench();
  hold.end();
  assert.equal(changes(), 0);
  hold.begin("stand");
  hold.end();
  hold.end();
  assert.equal(changes(), 2);
});
