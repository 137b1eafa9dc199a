import assert from "node:assert/strict";
import { test } from "node:test";
import { isPowered } from "../src/logic/axis_state.ts";

test("a jogged axis is powered, although it does not follow the application", () => {
  assert.ok(isPowered({ state: "OPERATION_ENABLED", enabled: false, jogged: true }));
  assert.ok(isPowered({ state: "OPERATION_ENABLED", enabled: false, jogged: false }));
  assert.ok(!isPowered({ state: "SWITCHED_ON", enabled: false, jogged: false }));
});
