/** Measurements of all traces, and the values at the cursors. */

import { useEffect, useRef } from "preact/hooks";
import { duration, MISSING } from "../logic/format.ts";
import { text } from "../strings.ts";
import { Swatch } from "./chart.tsx";
import type { ChartsModel } from "./charts_model.ts";

export function Measurements({ model }: { model: ChartsModel }) {
  const charts = model.layout.value!.charts;
  const [a, b] = model.cursors.value;
  const columns = Object.entries(text.scope.columns).filter(([key]) => a !== null || !["a", "b", "difference"].includes(key));
  const range = a !== null ? text.scope.between : text.scope.visible;
  return (
    <section class="scope-table" aria-label={text.scope.measurements}>
      {a !== null && b !== null && <p class="scope-cursors">{cursorLine(a - model.origin, b - model.origin)}</p>}
      <table>
        <caption>{text.scope.measurements} <small>{range}</small></caption>
        <thead><tr>{columns.map(([key, name]) => <th key={key} scope="col">{name}</th>)}</tr></thead>
        <tbody>
          {charts.flatMap((chart) => chart.traces.map((id, index) => (
            <Row key={`${chart.id} ${id}`} id={`${chart.id} ${id}`} model={model} signal={id} colour={index} cursors={a !== null} />
          )))}
        </tbody>
      </table>
    </section>
  );
}

function cursorLine(a: number, b: number): string {
  const difference = b - a;
  const frequency = difference === 0 ? MISSING : figure(1 / Math.abs(difference));
  return text.scope.cursorTimes(a.toFixed(4), b.toFixed(4), duration(difference), frequency);
}

interface Props {
  id: string;
  model: ChartsModel;
  signal: string;
  colour: number;
  cursors: boolean;
}

/** A row whose cells the frame loop writes without rendering. */
function Row({ id, model, signal, colour, cursors }: Props) {
  const row = useRef<HTMLTableRowElement>(null);
  const info = model.signals.value.get(signal);
  useEffect(() => {
    const cells = [...row.current!.querySelectorAll("td")];
    model.rows.set(id, {
      signal,
      show: (value, { minimum, maximum, mean, rms, rise }, [a, b]) => {
        const figures = [value, minimum, maximum, mean, rms].map(figure);
        const all = [...figures, duration(rise), figure(a), figure(b), figure(b - a)];
        cells.forEach((cell, index) => write(cell, all[index]!));
      },
    });
    return () => void model.rows.delete(id);
  }, [signal, cursors]);
  const count = cursors ? 9 : 6;
  return (
    <tr ref={row}>
      <th scope="row"><Swatch colour={colour} />{info?.label ?? signal} <small>{info?.unit}</small></th>
      {Array.from({ length: count }, (_, index) => <td key={index}>{MISSING}</td>)}
    </tr>
  );
}

function write(cell: HTMLElement, value: string): void {
  if (cell.textContent !== value) cell.textContent = value;
}

/** Return a number with five significant digits. */
export function figure(value: number): string {
  if (!Number.isFinite(value)) return MISSING;
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(3).replaceAll("-", "−");
  const digits = size >= 1 ? Math.max(0, 4 - Math.floor(Math.log10(size))) : 5;
  return value.toFixed(digits).replace("-", "−");
}
