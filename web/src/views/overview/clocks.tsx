/** Distributed clocks. */

import type { Connection } from "../../connection.ts";
import { duration, fixed } from "../../logic/format.ts";
import { Failure, Panel } from "../../parts/common.tsx";
import { useResource } from "../../resource.ts";
import { text } from "../../strings.ts";
import { spaced } from "./events.tsx";

const INTERVAL = 2000; // [ms]

type Row = Record<string, unknown>;

export function Clocks({ connection }: { connection: Connection }) {
  const clocks = useResource<unknown>(connection, "clocks", {}, INTERVAL);
  const rows = rowsOf(clocks.value.value);
  const columns = [...new Set(rows.flatMap(Object.keys))];
  return (
    <Panel title={text.overview.clocks}>
      {rows.length === 0 ? (
        clocks.error.value === null ? (
          <p class="empty">{text.overview.clocksNone}</p>
        ) : (
          <Failure error={clocks.error.value} />
        )
      ) : (
        <div class="scroll-x live">
          <table>
            <thead>
              <tr>
                {columns.map((column) => (
                  <th key={column}>{headingOf(column)}</th>
                ))}
              </tr>
            </thead>
            <tbody>
              {rows.map((row, at) => (
                <tr key={at}>
                  {columns.map((column) => (
                    <td key={column} class="mono">
                      {shown(column, row[column])}
                    </td>
                  ))}
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Panel>
  );
}

function rowsOf(value: unknown): Row[] {
  if (Array.isArray(value)) return value as Row[];
  if (typeof value !== "object" || value === null) return [];
  const inner = Object.values(value).find(Array.isArray);
  return inner === undefined ? [value as Row] : (inner as Row[]);
}

function headingOf(column: string): string {
  return spaced(column.replace(/_ns$/, "").replaceAll("_", " "));
}

function shown(column: string, value: unknown): string {
  if (typeof value === "number" && column.endsWith("_ns")) return duration(value * 1e-9);
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : fixed(value, 3);
  if (typeof value === "boolean") return value ? text.common.yes : text.common.no;
  return value === null || value === undefined ? "" : String(value);
}
