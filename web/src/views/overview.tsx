/** Overview: state of the bus, timing, events, and checks. */

import type { Connection } from "../connection.ts";
import { OperationPanel } from "../operation/panel.tsx";
import type { Device } from "../remote.ts";
import { useResource } from "../resource.ts";
import { Clocks } from "./overview/clocks.tsx";
import { DeviceStates } from "./overview/device_states.tsx";
import { Events } from "./overview/events.tsx";
import { Health } from "./overview/health.tsx";
import { Losses } from "./overview/losses.tsx";
import { Summary } from "./overview/summary.tsx";
import { TimingPanel } from "./overview/timing.tsx";

const DEVICES_INTERVAL = 1000; // [ms]

export function Overview({ connection }: { connection: Connection }) {
  const devices = useResource<Device[]>(connection, "devices", {}, DEVICES_INTERVAL);
  return (
    <div class="overview">
      <OperationPanel connection={connection} />
      <Summary connection={connection} devices={devices.value.value} />
      <div class="overview-columns">
        <div class="stack">
          <TimingPanel connection={connection} />
          <Losses connection={connection} />
          <Clocks connection={connection} />
        </div>
        <div class="stack">
          <DeviceStates devices={devices} />
          <Events connection={connection} />
          <Health connection={connection} />
        </div>
      </div>
    </div>
  );
}
