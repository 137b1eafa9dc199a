import assert from "node:assert/strict";
import { test } from "node:test";
import { RemoteError } from "../src/connection.ts";
import { OperationRequests } from "../src/operation/requests.ts";

/** Requests whose answers a test gives, and the calls that they made. */
function bench() {
  const calls: [string, object][] = [];
  const answers: { resolve: () => void; reject: (error: Error) => void }[] = [];
  const caller = {
    call: <T>(method: string, params: object) => {
      calls.push([method, params]);
      return new Promise<T>((resolve, reject) => answers.push({ resolve: () => resolve(undefined as T), reject }));
    },
  };
  return { requests: new OperationRequests(caller), calls, answers };
}

test("a mode and a preset call their methods", async () => {
  const { requests, calls, answers } = bench();
  const first = requests.request({ kind: "mode", name: "stand" });
  assert.equal(requests.waits, true);
  answers[0]?.resolve();
  await first;
  assert.deepEqual(requests.report.value, { kind: "mode", name: "stand", outcome: "accepted", reason: "" });
  void requests.request({ kind: "preset", name: "wave" });
  assert.deepEqual(calls, [["set_mode", { mode: "stand" }], ["run_preset", { preset: "wave" }]]);
});

test("an answer after the loss of the connection is ignored", async () => {
  const { requests, answers } = bench();
  const asked = requests.request({ kind: "mode", name: "balance" });
  requests.interrupt();
  assert.equal(requests.report.value?.outcome, "unanswered");
  assert.equal(requests.waits, false);
  answers[0]?.resolve();
  await asked;
  assert.equal(requests.report.value?.outcome, "unanswered");
});

test("an interruption leaves an answered request", async () => {
  const { requests, answers } = bench();
  const asked = requests.request({ kind: "mode", name: "balance" });
  answers[0]?.resolve();
  await asked;
  requests.interrupt();
  assert.equal(requests.report.value?.outcome, "accepted");
  requests.forget();
  assert.equal(requests.report.value, null);
});

test("a second request while one waits has no effect", async () => {
  const { requests, calls } = bench();
  void requests.request({ kind: "mode", name: "stand" });
  await requests.request({ kind: "mode", name: "balance" });
  assert.equal(calls.length, 1);
});

for (const [kind, outcome] of [
  ["RequestRefused", "refused"],
  ["ResponseTimeout", "unanswered"],
  ["ShareError", "failed"],
] as const) {
  test(`the error ${kind} is reported as ${outcome}`, async () => {
    const { requests, answers } = bench();
    const asked = requests.request({ kind: "mode", name: "balance" });
    answers[0]?.reject(new RemoteError({ kind, message: "the robot has fallen", hint: "" }));
    await asked;
    assert.equal(requests.report.value?.outcome, outcome);
    assert.equal(requests.report.value?.reason, "the robot has fallen");
    assert.equal(requests.waits, false);
  });
}

test("a lost connection is a failure", async () => {
  const { requests, answers } = bench();
  const asked = requests.request({ kind: "mode", name: "balance" });
  answers[0]?.reject(new TypeError("Failed to fetch"));
  await asked;
  assert.equal(requests.report.value?.outcome, "failed");
});
