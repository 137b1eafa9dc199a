/** Emergency messages of a device. */

import type { Connection } from "../../connection.ts";
import { hex } from "../../logic/format.ts";
import { Failure } from "../../parts/common.tsx";
import type { Device, Emergency } from "../../remote.ts";
import { useResource } from "../../resource.ts";
import { text } from "../../strings.ts";

const INTERVAL = 2000; // [ms]

export function Emergencies({ connection, device }: { connection: Connection; device: Device }) {
  const { position } = device;
  const emergencies = useResource<Emergency[]>(connection, "emergencies", { position }, INTERVAL);
  const shown = emergencies.value.value ?? [];
  if (emergencies.error.value !== null) return <Failure error={emergencies.error.value} />;
  if (shown.length === 0) return <p class="empty">{text.devices.emergencies.none}</p>;
  return (
    <ol class="events">
      {shown.map((emergency, at) => (
        <li key={at}>
          <span class="mono">{hex(emergency.error_code, 4)}</span> {emergency.text}
          <span class="muted small">
            {" "}
            {text.devices.emergencies.register} {hex(emergency.error_register, 2)}
          </span>
        </li>
      ))}
    </ol>
  );
}
