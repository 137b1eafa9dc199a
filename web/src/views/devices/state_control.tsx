/** Buttons for the state of a device. */

import { notifyError } from "../../notices.ts";
import { confirmed } from "../../parts/confirm.tsx";
import { text } from "../../strings.ts";
import type { DetailProps } from "./detail.tsx";

const STATES = ["INIT", "PRE-OP", "SAFE-OP", "OP"] as const;

export function StateControl({ connection, device, reload }: DetailProps) {
  const operator = connection.role.value === "operator";
  const run = async (method: string, params: object) => {
    await connection.call(method, params).catch(notifyError);
    await reload();
  };
  const request = async (state: string) => {
    const question = {
      title: `${device.name}: ${state}?`,
      body: text.devices.stateBody,
      action: `${text.devices.setState} ${state}`,
    };
    if (await confirmed(question)) {
      await run("set_state", { position: device.position, state, force: true });
    }
  };
  return (
    <div class="row wrap" role="group" aria-label={text.devices.state}>
      <h3>{text.devices.state}</h3>
      {STATES.map((state) => (
        <button
          key={state}
          type="button"
          class={device.state === state ? "button small primary" : "button small"}
          aria-pressed={device.state === state}
          disabled={!operator}
          onClick={() => void request(state)}
        >
          {state}
        </button>
      ))}
      <button
        type="button"
        class="button small"
        disabled={!operator || !device.error}
        onClick={() => void run("reset_error", { position: device.position })}
      >
        {text.devices.resetError}
      </button>
    </div>
  );
}
