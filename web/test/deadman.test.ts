import assert from "node:assert/strict";
import { test } from "node:test";
import { Deadman, TOKEN_LIFE } from "../src/logic/deadman.ts";

const JOG = { velocity: 0.5, distance: null, acceleration: null };

/** Dead-man control with a clock of its own, and the messages that it sent. */
function bench({ connected = true } = {}) {
  const sent: string[] = [];
  const clock = { now: 1000 };
  let presses = 0;
  const output = {
    press: (axis: number, _: typeof JOG, token: string) => {
      if (!connected) return null;
      presses += 1;
      sent.push(`press ${axis} ${token}`);
      return presses;
    },
    beat: (axis: number, press: number, token: string) => sent.push(`beat ${axis} ${press} ${token}`),
    release: (axis: number, press: number) => sent.push(`release ${axis} ${press}`),
  };
  return { deadman: new Deadman(output, () => clock.now), sent, clock };
}

test("a press sends the newest token, and each later token is echoed once", () => {
  const { deadman, sent, clock } = bench();
  deadman.receiveToken("a");
  assert.equal(deadman.press(2, JOG), null);
  clock.now += 50;
  deadman.receiveToken("b");
  clock.now += 50;
  deadman.receiveToken("c");
  assert.deepEqual(sent, ["press 2 a", "beat 2 1 b", "beat 2 1 c"]);
});

test("a press without a token is refused", () => {
  const { deadman, sent } = bench();
  assert.equal(deadman.press(0, JOG), "no_token");
  assert.deepEqual(sent, []);
});

test("a press with an old token is refused", () => {
  const { deadman, clock } = bench();
  deadman.receiveToken("a");
  clock.now += TOKEN_LIFE + 1;
  assert.equal(deadman.press(0, JOG), "no_token");
});

test("nothing is echoed after a release", () => {
  const { deadman, sent } = bench();
  deadman.receiveToken("a");
  deadman.press(0, JOG);
  deadman.release();
  deadman.receiveToken("b");
  deadman.release();
  assert.deepEqual(sent, ["press 0 a", "release 0 1"]);
});

test("a second press is refused while one is held", () => {
  const { deadman } = bench();
  deadman.receiveToken("a");
  deadman.press(0, JOG);
  assert.equal(deadman.press(1, JOG), "busy");
});

test("tokens after a gap release the jog instead of continuing it", () => {
  const { deadman, sent, clock } = bench();
  deadman.receiveToken("a");
  deadman.press(0, JOG);
  clock.now += TOKEN_LIFE + 1; // a frozen page, then a burst
  deadman.receiveToken("b");
  deadman.receiveToken("c");
  assert.deepEqual(sent, ["press 0 a", "release 0 1"]);
  assert.equal(deadman.held, null);
});

test("a touch needs the enabling touch, and its end releases", () => {
  const { deadman, sent } = bench();
  deadman.receiveToken("a");
  assert.equal(deadman.press(0, JOG, { touch: true }), "not_enabled");
  deadman.enable(true);
  assert.equal(deadman.press(0, JOG, { touch: true }), null);
  deadman.enable(false);
  assert.deepEqual(sent, ["press 0 a", "release 0 1"]);
});

for (const status of ["STOPPING", "DONE", "RELEASED", "EXPIRED", "REFUSED_MODE"]) {
  test(`the answer ${status} ends the beats`, () => {
    const { deadman, sent } = bench();
    deadman.receiveToken("a");
    deadman.press(0, JOG);
    deadman.receiveStatus(1, status);
    deadman.receiveToken("b");
    assert.deepEqual(sent, ["press 0 a"]);
  });
}

test("the answer to another press changes nothing", () => {
  const { deadman, sent } = bench();
  deadman.receiveToken("a");
  deadman.press(0, JOG);
  deadman.receiveStatus(7, "DONE");
  deadman.receiveToken("b");
  assert.deepEqual(sent, ["press 0 a", "beat 0 1 b"]);
});

test("a lost connection ends the jog, and requires a new token", () => {
  const { deadman, sent } = bench();
  deadman.receiveToken("a");
  deadman.press(0, JOG);
  deadman.disconnect();
  assert.equal(deadman.press(0, JOG), "no_token");
  deadman.receiveToken("b");
  assert.deepEqual(sent, ["press 0 a"]);
});

test("a press without a connection is refused", () => {
  const { deadman } = bench({ connected: false });
  deadman.receiveToken("a");
  assert.equal(deadman.press(0, JOG), "no_connection");
  assert.equal(deadman.held, null);
});

test("after a reconnection, the enabling touch must be renewed", () => {
  const { deadman } = bench();
  deadman.enable(true);
  deadman.disconnect();
  deadman.receiveToken("a");
  assert.equal(deadman.press(0, JOG, { touch: true }), "not_enabled");
});
