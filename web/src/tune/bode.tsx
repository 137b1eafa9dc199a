/** Frequency response of two signals in the visible range of the scope. */

import { useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { signalsOf } from "../scope/layout.ts";
import { modelOf, type ScopeModel } from "../scope/model.ts";
import { text } from "../strings.ts";
import { BodeCurves } from "./bode_curves.tsx";
import { type FrequencyResponse, frequencyResponse, recorded } from "./frequency_response.ts";

export function ScopeResponse({ connection }: { connection: Connection }) {
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
  return (
    <details class="tune-scope">
      <summary>{text.tune.fromScope}</summary>
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
      {response !== null && <BodeCurves response={response} isClosed={isClosed} />}
    </details>
  );
}

/** Return the response in the visible range of the scope; null if the record is too short. */
function responseOf({ store, span }: ScopeModel, [input, output]: [string, string]): FrequencyResponse | null {
  const [from, to] = [Math.max(store.begin, store.rowAt(span.start)), store.rowAt(span.end)];
  const [u, y] = recorded(store, [input, output], from, to);
  return frequencyResponse(u!, y!, store.period);
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
