/** Toolbar and trigger of the scope. */

import { useState } from "preact/hooks";
import { text } from "../strings.ts";
import { HISTORY } from "./acquisition.ts";
import { savePng, saveCsv, saveMcap, tableOf } from "./download.ts";
import { MAX_CHARTS, signalsOf, WINDOWS, withChart } from "./layout.ts";
import type { ScopeModel } from "./model.ts";
import type { Edge, TriggerMode, TriggerSettings } from "./trigger.ts";

export function Toolbar({ model }: { model: ScopeModel }) {
  const layout = model.layout.value!;
  const paused = model.acquisition.paused.value;
  return (
    <div class="scope-toolbar" role="toolbar" aria-label={text.scope.toolbar}>
      <button type="button" class="button primary" aria-pressed={paused} onClick={() => (paused ? model.live() : model.pause())}>
        {paused ? text.scope.run : text.scope.pause}
      </button>
      <label>
        {text.scope.window}
        <select class="field" value={layout.window} onChange={(event) => model.change({ ...layout, window: Number(event.currentTarget.value) })}>
          {WINDOWS.map((seconds) => <option key={seconds} value={seconds}>{seconds} s</option>)}
        </select>
      </label>
      <button type="button" class="button small" aria-pressed={model.cursors.value[0] !== null} onClick={() => model.toggleCursors()}>
        {text.scope.cursors}
      </button>
      <button type="button" class="button small" disabled={layout.charts.length >= MAX_CHARTS} onClick={() => addChart(model)}>
        {text.scope.addChart}
      </button>
      <Export model={model} />
      <Stored model={model} />
    </div>
  );
}

function addChart(model: ScopeModel): void {
  const layout = withChart(model.layout.value!);
  model.change(layout);
  model.active.value = layout.charts.at(-1)!.id;
}

function Stored({ model }: { model: ScopeModel }) {
  const count = signalsOf(model.layout.value!).length;
  const megabytes = Math.round((count * model.store.capacity * 9) / 1e6);
  const lost = model.lost.value;
  return (
    <span class="scope-stored">
      {text.scope.stored(count, HISTORY, megabytes)}{" · "}
      <span class={lost > 0 ? "warning" : ""} role="status">{text.scope.lost(lost)}</span>
    </span>
  );
}

function Export({ model }: { model: ScopeModel }) {
  const [all, setAll] = useState(false);
  const samples = () => {
    const { store } = model;
    const known = model.signals.value;
    const ids = signalsOf(model.layout.value!).flatMap((id) => known.get(id) ?? []);
    return tableOf(store, ids, all ? { start: store.timeOf(store.begin), end: store.lastTime } : model.span);
  };
  const offset = model.utcOffset;
  return (
    <details class="scope-menu">
      <summary class="button small">{text.scope.export}</summary>
      <div>
        <label>
          {text.scope.exportRange}
          <select class="field" value={String(all)} onChange={(event) => setAll(event.currentTarget.value === "true")}>
            <option value="false">{text.scope.ranges.visible}</option>
            <option value="true">{text.scope.ranges.all}</option>
          </select>
        </label>
        <button type="button" class="button small" onClick={(event) => saveImage(model, event.currentTarget)}>{text.scope.png}</button>
        <button type="button" class="button small" onClick={() => saveCsv(samples())}>{text.scope.csv}</button>
        <button type="button" class="button small" onClick={() => saveMcap(samples(), offset)}>{text.scope.mcap}</button>
      </div>
    </details>
  );
}

function saveImage(model: ScopeModel, element: HTMLElement): void {
  const known = model.signals.value;
  const parts = model.layout.value!.charts.flatMap((chart) => {
    const plot = model.plots.get(chart.id);
    const caption = chart.traces.map((id) => known.get(id)?.label ?? id).join(", ");
    return plot === undefined ? [] : [{ canvas: plot.canvas.ctx.canvas, caption }];
  });
  savePng(parts, getComputedStyle(element));
}

export function TriggerBar({ model }: { model: ScopeModel }) {
  const layout = model.layout.value!;
  const { trigger, triggerOn } = layout;
  const change = (part: Partial<TriggerSettings>) => model.change({ ...layout, trigger: { ...trigger, ...part } });
  return (
    <fieldset class="scope-trigger">
      <legend>
        <label>
          <input type="checkbox" checked={triggerOn} onChange={(event) => enable(model, event.currentTarget.checked)} />
          {text.scope.trigger}
        </label>
      </legend>
      {triggerOn && <TriggerFields model={model} trigger={trigger} change={change} />}
    </fieldset>
  );
}

function enable(model: ScopeModel, triggerOn: boolean): void {
  const layout = model.layout.value!;
  const signal = layout.trigger.signal || signalsOf(layout)[0] || "";
  model.change({ ...layout, triggerOn, trigger: { ...layout.trigger, signal } });
}

interface FieldProps {
  model: ScopeModel;
  trigger: TriggerSettings;
  change: (part: Partial<TriggerSettings>) => void;
}

function TriggerFields({ model, trigger, change }: FieldProps) {
  const known = model.signals.value;
  const signals = signalsOf(model.layout.value!);
  const state = model.triggerState.value;
  return (
    <>
      <label>
        {text.scope.signal}
        <select class="field" value={trigger.signal} onChange={(event) => change({ signal: event.currentTarget.value })}>
          {signals.map((id) => <option key={id} value={id}>{known.get(id)?.label ?? id}</option>)}
        </select>
      </label>
      <NumberField label={text.scope.level} value={trigger.level} onChange={(level) => change({ level })} />
      <Choice label={text.scope.edge} value={trigger.edge} options={text.scope.edges} onChange={(edge: Edge) => change({ edge })} />
      <Choice label={text.scope.mode} value={trigger.mode} options={text.scope.modes} onChange={(mode: TriggerMode) => change({ mode })} />
      <label>
        {text.scope.pre}
        <input type="range" min="0" max="1" step="0.05" value={trigger.pre}
          aria-valuetext={`${Math.round(trigger.pre * 100)} %`}
          onChange={(event) => change({ pre: Number(event.currentTarget.value) })} />
        <output>{Math.round(trigger.pre * 100)} %</output>
      </label>
      <button type="button" class="button small" onClick={() => model.arm()}>{text.scope.arm}</button>
      <span role="status" class={`scope-state ${state ?? ""}`}>{state !== null && text.scope.states[state]}</span>
    </>
  );
}

interface NumberProps {
  label: string;
  value: number;
  onChange: (value: number) => void;
}

function NumberField({ label, value, onChange }: NumberProps) {
  return (
    <label>
      {label}
      <input class="field" type="number" step="any" value={value}
        onChange={(event) => {
          const entered = event.currentTarget.valueAsNumber;
          if (Number.isFinite(entered)) onChange(entered);
        }} />
    </label>
  );
}

interface ChoiceProps<T extends string> {
  label: string;
  value: T;
  options: Record<T, string>;
  onChange: (value: T) => void;
}

function Choice<T extends string>({ label, value, options, onChange }: ChoiceProps<T>) {
  return (
    <label>
      {label}
      <select class="field" value={value} onChange={(event) => onChange(event.currentTarget.value as T)}>
        {Object.entries<string>(options).map(([key, name]) => <option key={key} value={key}>{name}</option>)}
      </select>
    </label>
  );
}
