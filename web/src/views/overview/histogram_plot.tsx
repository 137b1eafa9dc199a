/** Histogram of times as SVG. */

import { count, duration } from "../../logic/format.ts";
import { columnsOf, decades, height, place, scaleOf, type Bucket } from "../../logic/histogram.ts";
import { text } from "../../strings.ts";

const WIDTH = 300;
const HEIGHT = 92;
const BOTTOM = 14; // of the labels of the axis
const COLUMNS = 100;

export function HistogramPlot({ title, buckets }: { title: string; buckets: readonly Bucket[] }) {
  const scale = scaleOf(buckets);
  const counts = columnsOf(buckets, scale, COLUMNS);
  const largest = Math.max(...counts);
  const base = HEIGHT - BOTTOM;
  const bars = counts
    .map((n, at) => ({ at, size: height(n, largest) * (base - 4) }))
    .filter(({ size }) => size > 0);
  const path = bars
    .map(({ at, size }) => `M${at * 3} ${base}v${-Math.max(size, 1.5).toFixed(1)}h2.4v${Math.max(size, 1.5).toFixed(1)}z`)
    .join("");
  const total = buckets.reduce((sum, [, , n]) => sum + n, 0);
  return (
    <figure class="plot">
      <figcaption>
        {title} <span class="muted small">{count(total)}</span>
      </figcaption>
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={`${title}. ${text.overview.histogram}`}>
        {decades(scale).map((time) => {
          const x = place(time, scale) * WIDTH;
          const anchor = x < 10 ? "start" : x > WIDTH - 10 ? "end" : "middle";
          return (
            <g key={time}>
              <line class="grid" x1={x} x2={x} y1={0} y2={base} />
              <text class="tick-label" x={x} y={HEIGHT - 2} text-anchor={anchor}>
                {duration(time).replace(/\.0+(?=\D)/, "")}
              </text>
            </g>
          );
        })}
        <line class="axis-line" x1={0} x2={WIDTH} y1={base} y2={base} />
        <path class="bars" d={path} />
      </svg>
    </figure>
  );
}
