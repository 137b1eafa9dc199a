/** Curves and margins of a frequency response. */

import uPlot from "uplot";
import { useEffect, useRef } from "preact/hooks";
import { fixed } from "../logic/format.ts";
import { useTheme } from "../scope/scope.tsx";
import { text } from "../strings.ts";
import { type FrequencyResponse, margins, openLoop } from "./frequency_response.ts";

const HEIGHT = 180; // [px]

/** Show a response. `isClosed`: it is that of a closed loop, and the margins are those of its open loop. */
export function BodeCurves({ response, isClosed }: { response: FrequencyResponse; isClosed: boolean }) {
  return (
    <>
      <Curve response={response} values={response.gain} label={text.tune.gain} />
      <Curve response={response} values={response.phase} label={text.tune.phase} />
      <Curve response={response} values={response.coherence} label={text.tune.coherence} range={[0, 1]} />
      <MarginList loop={isClosed ? openLoop(response) : response} />
    </>
  );
}

interface CurveProps {
  response: FrequencyResponse;
  values: number[];
  label: string;
  range?: [number, number];
}

function Curve({ response, values, label, range }: CurveProps) {
  const place = useRef<HTMLDivElement>(null);
  const theme = useTheme();
  useEffect(() => {
    const style = getComputedStyle(place.current!);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const axis = { stroke: colour("--scope-text"), grid: { stroke: colour("--scope-grid"), width: 1 } };
    const plot = new uPlot({
      width: place.current!.clientWidth,
      height: HEIGHT,
      legend: { show: false },
      scales: { x: { time: false, distr: 3, range: ends(response.frequency) }, ...(range && { y: { range } }) },
      series: [{}, { stroke: colour("--trace-0"), width: 1.5, points: { show: false } }],
      cursor: { drag: { x: false, y: false } },
      axes: [{ ...axis, values: frequencies, filter: (_plot, splits) => splits }, { ...axis, label, size: 58, labelSize: 16 }],
    }, [response.frequency, values], place.current!);
    return () => plot.destroy();
  }, [response, values, theme]);
  return <div ref={place} class="tune-curve" role="img" aria-label={label} />;
}

function ends(values: number[]): [number, number] {
  return [values[0]!, values.at(-1)!];
}

/** Label only 1, 2 and 5 times a power of ten. */
function frequencies(_plot: uPlot, splits: number[]): string[] {
  return splits.map((each) => (/^[125](e|\.0)/.test(each.toExponential(1)) ? `${Number(each.toPrecision(1))} Hz` : ""));
}

function MarginList({ loop }: { loop: FrequencyResponse }) {
  const found = margins(loop);
  const shown = (value: number, unit: string, frequency: number) =>
    Number.isNaN(value) ? text.tune.noCrossing : `${fixed(value, 1)}${unit} · ${fixed(frequency, 1)} Hz`;
  const rows: [string, string][] = [
    [text.tune.gainMargin, shown(found.gain, " dB", found.gainFrequency)],
    [text.tune.phaseMargin, shown(found.phase, "°", found.phaseFrequency)],
  ];
  return (
    <dl class="tune-figures">
      {rows.map(([name, value]) => <div key={name}><dt>{name}</dt><dd class="mono">{value}</dd></div>)}
    </dl>
  );
}
