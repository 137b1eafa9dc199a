/** Distributed clocks. */

import type { Connection } from "../../connection.ts";
import { duration } from "../../logic/format.ts";
import { Chip, Failure, Panel } from "../../parts/common.tsx";
import type { Clock, Clocks as ClocksResult } from "../../remote.ts";
import { useResource } from "../../resource.ts";
import { text } from "../../strings.ts";

const INTERVAL = 2000; // [ms]
const t = text.overview;

export function Clocks({ connection }: { connection: Connection }) {
  const { value, error } = useResource<ClocksResult>(connection, "clocks", {}, INTERVAL);
  const clocks = value.value?.clocks ?? [];
  const locked = value.value?.locked ?? false;
  return (
    <Panel
      title={t.clocks}
      actions={
        clocks.length > 0 && (
          <Chip tone={locked ? "ok" : "warn"}>{locked ? t.locked : t.unlocked}</Chip>
        )
      }
    >
      {clocks.length > 0 ? (
        <Table clocks={clocks} />
      ) : error.value !== null ? (
        <Failure error={error.value} />
      ) : (
        <p class="empty">{t.clocksNone}</p>
      )}
    </Panel>
  );
}

function Table({ clocks }: { clocks: Clock[] }) {
  return (
    <div class="scroll-x live">
      <table>
        <thead>
          <tr>
            {t.clockColumns.map((column, at) => (
              <th key={column} class={at === 2 ? "number" : ""}>
                {column}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {clocks.map(({ position, name, reference, difference }) => (
            <tr key={position}>
              <td class="mono">{position}</td>
              <td>
                {name} {reference && <Chip tone="info">{t.reference}</Chip>}
              </td>
              <td class="number mono">{duration(difference)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
