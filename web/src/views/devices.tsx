/** Devices: topology as wired, and the page of a device. */

import type { Connection } from "../connection.ts";
import { isWide } from "../media.ts";
import { Failure, Panel } from "../parts/common.tsx";
import type { Device } from "../remote.ts";
import { useResource } from "../resource.ts";
import { address, route } from "../route.ts";
import { text } from "../strings.ts";
import { DeviceDetail } from "./devices/detail.tsx";
import { Tree } from "./devices/tree.tsx";

const INTERVAL = 1000; // [ms]

export function Devices({ connection }: { connection: Connection }) {
  const devices = useResource<Device[]>(connection, "devices", {}, INTERVAL);
  const shown = devices.value.value ?? [];
  const asked = shown.find(({ position }) => String(position) === route.value[1]);
  const chosen = asked ?? (isWide.value ? shown[0] : undefined);
  return (
    <div class={chosen === undefined ? "devices" : "devices with-detail"}>
      <Panel title={text.devices.title} class="topology">
        {shown.length > 0 ? (
          <Tree devices={shown} chosen={chosen?.position} />
        ) : devices.error.value !== null ? (
          <Failure error={devices.error.value} />
        ) : (
          <p class="empty">{text.devices.none}</p>
        )}
      </Panel>
      {chosen !== undefined && (
        <div class="detail">
          <a class="button small back" href={address("devices")}>
            ‹ {text.common.back}
          </a>
          <DeviceDetail
            key={chosen.position}
            connection={connection}
            device={chosen}
            reload={devices.reload}
          />
        </div>
      )}
    </div>
  );
}
