/** Identity of a device. */

import { hex } from "../../logic/format.ts";
import type { Device } from "../../remote.ts";
import { text } from "../../strings.ts";

export function Identity({ device }: { device: Device }) {
  const names = text.devices.identity;
  const rows: [string, string][] = [
    [names.vendor, hex(device.vendor, 8)],
    [names.product, hex(device.product, 8)],
    [names.revision, hex(device.revision, 8)],
    [names.serial, String(device.serial)],
    [names.alias, String(device.alias)],
    [names.group, device.group],
    [names.network, String(device.network)],
    [names.mailbox, device.coe ? text.common.yes : text.common.no],
    [names.axes, device.axes.join(", ") || text.common.none],
  ];
  return (
    <>
      <dl class="identity">
        {rows.map(([label, value]) => (
          <div key={label}>
            <dt>{label}</dt>
            <dd class="mono">{value}</dd>
          </div>
        ))}
      </dl>
      {device.al_status_code !== 0 && (
        <p class="bad-text">
          {names.status} {hex(device.al_status_code, 4)}: {device.al_status_text}
        </p>
      )}
    </>
  );
}
