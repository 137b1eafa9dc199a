/** One chart with its traces. */

import { useEffect, useRef } from "preact/hooks";
import { text } from "../strings.ts";
import { chartKey, Gestures } from "./gestures.ts";
import { toggled, withoutChart, type ChartLayout } from "./layout.ts";
import type { ChartsModel } from "./charts_model.ts";
import { Plot } from "./plot.ts";
import { COLOURS } from "./traces.ts";

interface Props {
  model: ChartsModel;
  chart: ChartLayout;
  number: number;
  theme: number; // changes with the colours
}

export function Chart({ model, chart, number, theme }: Props) {
  const active = model.active.value === chart.id;
  return (
    <section class={active ? "scope-chart active" : "scope-chart"} aria-label={text.scope.chart(number)}>
      <header>
        <button type="button" class="button small" aria-pressed={active} title={active ? text.scope.selected : text.scope.select}
          onClick={() => (model.active.value = chart.id)}>
          {text.scope.chart(number)}
        </button>
        <Legend model={model} chart={chart} />
        <button type="button" class="button small" title={text.scope.fitHint} onClick={() => fit(model, chart.id)}>{text.scope.fit}</button>
        <button type="button" class="button small" aria-label={text.scope.removeChart} title={text.scope.removeChart}
          onClick={() => model.change(withoutChart(model.layout.value!, chart.id))}>×</button>
      </header>
      <PlotArea model={model} chart={chart} number={number} theme={theme} />
    </section>
  );
}

function fit(model: ChartsModel, id: number): void {
  model.plots.get(id)?.fit();
  model.redraw();
}

function Legend({ model, chart }: { model: ChartsModel; chart: ChartLayout }) {
  const known = model.signals.value;
  return (
    <ul class="scope-legend">
      {chart.traces.map((id, index) => {
        const label = known.get(id)?.label ?? `${id} (${text.scope.absent})`;
        return (
          <li key={id}>
            <Swatch colour={index} />
            <span>{label}</span>
            <button type="button" class="button small" aria-label={text.scope.removeTrace(label)}
              onClick={() => model.change(toggled(model.layout.value!, chart.id, id))}>×</button>
          </li>
        );
      })}
    </ul>
  );
}

export function Swatch({ colour }: { colour: number }) {
  const pattern = Math.floor(colour / COLOURS) % 4;
  return <i aria-hidden="true" class={`scope-swatch colour-${colour % COLOURS} pattern-${pattern}`} />;
}

function PlotArea({ model, chart, number, theme }: Props) {
  const place = useRef<HTMLDivElement>(null);
  const known = model.signals.value;
  const traces = chart.traces.map((id, colour) => ({ signal: id, unit: known.get(id)?.unit ?? "", colour }));
  const units = [...new Set(traces.map((trace) => trace.unit))];
  useEffect(() => mount(place.current!, model, chart.id, units), [units.join("|"), theme, chart.id]);
  useEffect(() => {
    model.plots.get(chart.id)?.setTraces(traces);
    model.redraw();
  }, [chart.traces.join("|"), units.join("|"), theme]);
  const names = traces.map((trace) => known.get(trace.signal)?.label ?? trace.signal).join(", ");
  return (
    <div ref={place} class="scope-plot" tabIndex={0} role="application"
      aria-label={`${text.scope.chart(number)}: ${names || text.scope.emptyChart} ${text.scope.help}`}
      onKeyDown={(event) => {
        if (!event.ctrlKey && !event.metaKey && chartKey(event, model)) event.preventDefault();
      }}>
      {traces.length === 0 && <p class="scope-hint">{text.scope.emptyChart}</p>}
    </div>
  );
}

function mount(element: HTMLElement, model: ChartsModel, id: number, units: string[]): () => void {
  const plot = new Plot(element, units);
  const gestures = new Gestures(plot.canvas.over, model);
  const observer = new ResizeObserver(() => {
    plot.resize(element.clientWidth, element.clientHeight);
    model.redraw();
  });
  observer.observe(element);
  model.plots.set(id, plot);
  return () => {
    observer.disconnect();
    gestures.cancel();
    if (model.plots.get(id) === plot) model.plots.delete(id);
    plot.destroy();
  };
}
