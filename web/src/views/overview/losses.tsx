/** Lost and late cycles of the last two minutes. */

import { useSignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { Connection } from "../../connection.ts";
import { LossHistory, SECONDS, type Counts } from "../../logic/losses.ts";
import { notifyError } from "../../notices.ts";
import { Panel } from "../../parts/common.tsx";
import { text } from "../../strings.ts";

const HEIGHT = 56;
const BAR = 5;

export function Losses({ connection }: { connection: Connection }) {
  const run = connection.hello.value?.run;
  const history = useMemo(() => new LossHistory(), [run]);
  const counts = useSignal<Counts[]>([]);
  useEffect(
    () =>
      connection.on("timing", ({ counters }) => {
        const now = performance.now() / 1000;
        history.add(now, { lost: counters["lost"] ?? 0, late: counters["late"] ?? 0 });
        counts.value = history.counts(now);
      }),
    [connection, history],
  );
  const clear = () => void connection.call("clear_counters").catch(notifyError);
  return (
    <Panel
      title={text.overview.losses}
      actions={
        <button
          type="button"
          class="button small"
          disabled={connection.role.value !== "operator"}
          onClick={clear}
        >
          {text.overview.clear}
        </button>
      }
    >
      <div class="body live">
        <Bars counts={counts.value} />
      </div>
    </Panel>
  );
}

function Bars({ counts }: { counts: Counts[] }) {
  const largest = Math.max(1, ...counts.map(({ lost, late }) => lost + late));
  const quiet = counts.every(({ lost, late }) => lost + late === 0);
  const scaled = (n: number) => (n / largest) * (HEIGHT - 4);
  return (
    <>
      <svg
        class="losses"
        viewBox={`0 0 ${SECONDS * BAR} ${HEIGHT}`}
        preserveAspectRatio="none"
        role="img"
        aria-label={text.overview.lossesLabel}
      >
        <line class="axis-line" x1={0} x2={SECONDS * BAR} y1={HEIGHT - 0.5} y2={HEIGHT - 0.5} />
        {counts.map(({ lost, late }, at) => (
          <g key={at}>
            {lost > 0 && (
              <rect class="lost" x={at * BAR} y={HEIGHT - scaled(lost)} width={BAR - 1} height={scaled(lost)} />
            )}
            {late > 0 && (
              <rect
                class="late"
                x={at * BAR}
                y={HEIGHT - scaled(lost) - scaled(late)}
                width={BAR - 1}
                height={scaled(late)}
              />
            )}
          </g>
        ))}
      </svg>
      <div class="row small muted losses-axis">
        <span>{text.overview.lossesAxis[0]}</span>
        <span class="grow losses-legend">
          {quiet ? (
            text.overview.lossesNone
          ) : (
            <>
              <span class="key lost-key" /> {text.overview.lossesLegend[0]}
              <span class="key late-key" /> {text.overview.lossesLegend[1]}
            </>
          )}
        </span>
        <span>{text.overview.lossesAxis[1]}</span>
      </div>
    </>
  );
}
