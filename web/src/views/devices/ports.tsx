/** Links and error counters of the ports of a device. */

import { notifyError } from "../../notices.ts";
import { Chip } from "../../parts/common.tsx";
import type { Port } from "../../remote.ts";
import { text } from "../../strings.ts";
import type { DetailProps } from "./detail.tsx";

export function Ports({ connection, device, reload }: DetailProps) {
  const clear = async () => {
    await connection.call("clear_counters").catch(notifyError);
    await reload();
  };
  return (
    <div>
      <div class="row">
        <h3>{text.devices.ports}</h3>
        <button
          type="button"
          class="button small right"
          disabled={connection.role.value !== "operator"}
          onClick={() => void clear()}
        >
          {text.devices.resetCounters}
        </button>
      </div>
      <div class="scroll-x">
        <table class="ports">
          <thead>
            <tr>
              {text.devices.portColumns.map((column, at) => (
                <th key={column} class={at > 1 ? "number" : ""}>
                  {column}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {device.ports.map((port) => (
              <tr key={port.port}>
                <td class="mono">{port.port}</td>
                <td>
                  <PortState port={port} />
                </td>
                {[port.rx_errors, port.forwarded_errors, port.lost_links].map((n, at) => (
                  <td key={at} class={n > 0 ? "number mono bad-text" : "number mono"}>
                    {n}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </div>
  );
}

function PortState({ port }: { port: Port }) {
  if (!port.link) return <Chip>{text.devices.portStates.down}</Chip>;
  if (port.loop_closed) return <Chip tone="warn">{text.devices.portStates.closed}</Chip>;
  return <Chip tone="ok">{text.devices.portStates.open}</Chip>;
}
