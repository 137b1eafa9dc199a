/** Histograms of the phases of the cycle, and their figures. */

import { useComputed, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Connection } from "../../connection.ts";
import { count, duration } from "../../logic/format.ts";
import { difference, type Bucket } from "../../logic/histogram.ts";
import { Panel, Segmented } from "../../parts/common.tsx";
import type { Timing } from "../../protocol.ts";
import { text } from "../../strings.ts";
import { HistogramPlot } from "./histogram_plot.tsx";

const SHOWN = ["lateness", "in_controller", "output_delay", "round_trip"];
const RECENT = 10; // messages, 2 per second

export function TimingPanel({ connection }: { connection: Connection }) {
  const span = useSignal<"all" | "recent">("all");
  const past = useRef<Timing[]>([]);
  useEffect(
    () =>
      connection.on("timing", (message) => {
        past.current = [...past.current, message].slice(-RECENT - 1);
      }),
    [connection],
  );
  const timing = connection.timing.value;
  const options = [
    ["all", text.overview.all],
    ["recent", text.overview.recent],
  ] as const;
  return (
    <Panel
      title={text.overview.timing}
      actions={
        <Segmented
          label={text.overview.timing}
          options={options}
          value={span.value}
          onChange={(value) => (span.value = value)}
        />
      }
    >
      {timing === null ? (
        <p class="empty">{text.overview.noTiming}</p>
      ) : (
        <div class="live">
          <Plots timing={timing} before={span.value === "recent" ? past.current[0] : undefined} />
          <Figures connection={connection} />
        </div>
      )}
    </Panel>
  );
}

function Plots({ timing, before }: { timing: Timing; before: Timing | undefined }) {
  const phases = SHOWN.filter((phase) => timing.histograms[phase] !== undefined);
  return (
    <div class="plots">
      {phases.map((phase) => {
        const now: readonly Bucket[] = timing.histograms[phase] ?? [];
        const earlier = before?.histograms[phase];
        const buckets = earlier === undefined ? now : difference(now, earlier);
        return <HistogramPlot key={phase} title={name(phase)} buckets={buckets} />;
      })}
    </div>
  );
}

function Figures({ connection }: { connection: Connection }) {
  const rows = useComputed(() => Object.entries(connection.timing.value?.figures ?? {}));
  return (
    <div class="scroll-x">
      <table>
        <thead>
          <tr>
            <th>{text.overview.phase}</th>
            {text.overview.figures.map((figure) => (
              <th key={figure} class="number">
                {figure}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.value.map(([phase, figures]) => (
            <tr key={phase}>
              <td>{name(phase)}</td>
              {[figures.median, figures.p99, figures.p999, figures.max].map((time, at) => (
                <td key={at} class="number mono">
                  {duration(time)}
                </td>
              ))}
              <td class="number mono">{count(figures.count)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

function name(phase: string): string {
  return text.overview.phases[phase] ?? phase;
}
