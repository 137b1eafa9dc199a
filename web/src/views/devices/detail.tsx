/** Page of a device. */

import { useSignal } from "@preact/signals";
import type { Connection } from "../../connection.ts";
import { shortened } from "../../logic/format.ts";
import { stateTone } from "../../logic/device_state.ts";
import { Chip, Segmented } from "../../parts/common.tsx";
import type { Device, Greeting } from "../../remote.ts";
import { useResource } from "../../resource.ts";
import { text } from "../../strings.ts";
import { Emergencies } from "./emergencies.tsx";
import { Identity } from "./identity.tsx";
import { LiveValues } from "./live_values.tsx";
import { Objects } from "./objects.tsx";
import { Ports } from "./ports.tsx";
import { Simulation } from "./simulation.tsx";
import { StateControl } from "./state_control.tsx";

type Tab = "identity" | "live" | "objects" | "emergencies";

export interface DetailProps {
  connection: Connection;
  device: Device;
  reload: () => Promise<void>;
}

export function DeviceDetail(props: DetailProps) {
  const { connection, device } = props;
  const tab = useSignal<Tab>("identity");
  const greeting = useResource<Greeting>(connection, "hello").value.value;
  const names = text.devices.tabs;
  return (
    <section class="panel" aria-label={device.name}>
      <header>
        <h2 class="two-lines" title={device.name}>
          <span class="mono muted">{device.position}</span> {shortened(device.name)}
        </h2>
        <Chip tone={stateTone(device)}>
          {device.state === "" ? text.devices.noAnswer : device.state}
        </Chip>
        <span class="right">
          <Segmented
            label={text.devices.sections}
            options={[
              ["identity", names.identity],
              ["live", names.live],
              ["objects", names.objects],
              ["emergencies", names.emergencies],
            ]}
            value={tab.value}
            onChange={(value) => (tab.value = value)}
          />
        </span>
      </header>
      {tab.value === "identity" && (
        <div class="body stack">
          <Identity device={device} />
          <StateControl {...props} />
          <Ports {...props} />
          {greeting?.virtual === true && <Simulation {...props} />}
        </div>
      )}
      {tab.value === "live" && <LiveValues connection={connection} device={device} />}
      {tab.value === "objects" && <Objects connection={connection} device={device} />}
      {tab.value === "emergencies" && <Emergencies connection={connection} device={device} />}
    </section>
  );
}
