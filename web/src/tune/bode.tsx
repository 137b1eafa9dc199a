/** Bode plot of two signals of the scope, with the margins of the open loop. */

import uPlot from "uplot";
import { useEffect, useRef, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { fixed } from "../logic/format.ts";
import { Panel } from "../parts/common.tsx";
import { signalsOf } from "../scope/layout.ts";
import { modelOf, type ScopeModel } from "../scope/model.ts";
import { useTheme } from "../scope/scope.tsx";
import { text } from "../strings.ts";
import { frequencyResponse, type FrequencyResponse, margins, openLoop } from "./frequency_response.ts";

const HEIGHT = 180; // [px]

export function BodePlot({ connection }: { connection: Connection }) {
  const model = modelOf(connection);
  const layout = model.layout.value;
  const signals = layout === null ? [] : signalsOf(layout);
  const [input, setInput] = useState("");
  const [output, setOutput] = useState("");
  const [isClosed, setClosed] = useState(true);
  const [response, setResponse] = useState<FrequencyResponse | null>(null);
  const [failure, setFailure] = useState("");
  const names: [string, string] = [input || signals[0] || "", output || signals[1] || ""];
  const compute = () => {
    const found = responseOf(model, names);
    setResponse(found);
    setFailure(found === null ? text.tune.tooShort : "");
  };
  const loop = response !== null && isClosed ? openLoop(response) : response;
  return (
    <Panel title={text.tune.bode}>
      <div class="body">
        <div class="row wrap">
          <Choice model={model} label={text.tune.input} signals={signals} value={names[0]} onChange={setInput} />
          <Choice model={model} label={text.tune.output} signals={signals} value={names[1]} onChange={setOutput} />
          <label class="row">
            <input type="checkbox" checked={isClosed} onChange={(event) => setClosed(event.currentTarget.checked)} />
            {text.tune.closed}
          </label>
          <button type="button" class="button" disabled={signals.length < 2} onClick={compute}>{text.tune.compute}</button>
        </div>
        <p class="muted small">{text.tune.bodeHint}</p>
        {failure !== "" && <p class="empty" role="status">{failure}</p>}
        {response !== null && loop !== null && (
          <>
            <Curve response={response} values={response.gain} label={text.tune.gain} />
            <Curve response={response} values={response.phase} label={text.tune.phase} />
            <Curve response={response} values={response.coherence} label={text.tune.coherence} />
            <MarginList loop={loop} />
          </>
        )}
      </div>
    </Panel>
  );
}

/** Return the response in the visible range of the scope; null if the record is too short. */
function responseOf(model: ScopeModel, [input, output]: [string, string]): FrequencyResponse | null {
  const { store, span } = model;
  const from = Math.max(store.begin, store.rowAt(span.start));
  const rows = Array.from({ length: Math.max(0, store.rowAt(span.end) - from) }, (_, index) => from + index);
  const kept = rows.filter((row) => !Number.isNaN(store.value(input, row) + store.value(output, row)));
  const values = (name: string) => Float64Array.from(kept, (row) => store.value(name, row));
  return frequencyResponse(values(input), values(output), store.period);
}

interface ChoiceProps {
  model: ScopeModel;
  label: string;
  signals: string[];
  value: string;
  onChange: (value: string) => void;
}

function Choice({ model, label, signals, value, onChange }: ChoiceProps) {
  return (
    <label class="row">
      {label}
      <select class="field" value={value} onChange={(event) => onChange(event.currentTarget.value)}>
        {signals.map((id) => <option key={id} value={id}>{model.signals.value.get(id)?.label ?? id}</option>)}
      </select>
    </label>
  );
}

function Curve({ response, values, label }: { response: FrequencyResponse; values: number[]; label: string }) {
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
      scales: { x: { time: false, distr: 3 } },
      series: [{}, { stroke: colour("--trace-0"), width: 1.5, points: { show: false } }],
      axes: [axis, { ...axis, label, size: 58, labelSize: 16 }],
    }, [response.frequency, values], place.current!);
    return () => plot.destroy();
  }, [response, values, theme]);
  return <div ref={place} class="tune-curve" role="img" aria-label={label} />;
}

function MarginList({ loop }: { loop: FrequencyResponse }) {
  const found = margins(loop);
  const rows: [string, string][] = [
    [text.tune.gainMargin, `${fixed(found.gain, 1)} dB · ${fixed(found.gainFrequency, 1)} Hz`],
    [text.tune.phaseMargin, `${fixed(found.phase, 1)}° · ${fixed(found.phaseFrequency, 1)} Hz`],
  ];
  return (
    <dl class="tune-figures">
      {rows.map(([name, value]) => <div key={name}><dt>{name}</dt><dd class="mono">{value}</dd></div>)}
    </dl>
  );
}
