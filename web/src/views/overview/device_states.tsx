/** Devices and their states in short. */

import { stateTone } from "../../logic/device_state.ts";
import { Failure, Panel } from "../../parts/common.tsx";
import type { Device } from "../../remote.ts";
import type { Resource } from "../../resource.ts";
import { address } from "../../route.ts";
import { text } from "../../strings.ts";

export function DeviceStates({ devices }: { devices: Resource<Device[]> }) {
  const shown = devices.value.value;
  return (
    <Panel title={text.overview.devicesTitle}>
      {shown === null ? (
        <Failure error={devices.error.value} />
      ) : (
        <ul class="device-states live">
          {shown.map((device) => (
            <li key={device.position}>
              <a href={address("devices", device.position)} class={stateTone(device)}>
                <span class="muted mono">{device.position}</span>
                <span class="cut grow">{device.name}</span>
                <strong>{device.state === "" ? text.devices.noAnswer : device.state}</strong>
              </a>
            </li>
          ))}
        </ul>
      )}
    </Panel>
  );
}
