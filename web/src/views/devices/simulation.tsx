/** Cables and power of a device of a virtual segment. */

import { notifyError } from "../../notices.ts";
import { text } from "../../strings.ts";
import type { DetailProps } from "./detail.tsx";

export function Simulation({ connection, device, reload }: DetailProps) {
  const disabled = connection.role.value !== "operator";
  const { position } = device;
  const run = async (method: string, params: object) => {
    await connection.call(method, { position, ...params }).catch(notifyError);
    await reload();
  };
  return (
    <div class="simulation">
      <h3>{text.devices.simulation}</h3>
      <p class="muted small">{text.devices.simulationHint}</p>
      <div class="row wrap">
        {device.ports.map(({ port, link }) => (
          <button
            key={port}
            type="button"
            class="button small"
            disabled={disabled}
            onClick={() => void run("virtual_cable", { port, connected: !link })}
          >
            {link ? text.devices.pull : text.devices.plug} {port}
          </button>
        ))}
        <button
          type="button"
          class="button small"
          disabled={disabled}
          onClick={() => void run("virtual_power", { on: false })}
        >
          {text.devices.powerOff}
        </button>
        <button
          type="button"
          class="button small"
          disabled={disabled}
          onClick={() => void run("virtual_power", { on: true })}
        >
          {text.devices.powerOn}
        </button>
      </div>
    </div>
  );
}
