/** Live process data of a device. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Connection } from "../../connection.ts";
import { signalsOf, type DeviceSignal } from "../../logic/device_signals.ts";
import { hex, MISSING, quantity } from "../../logic/format.ts";
import type { Device } from "../../remote.ts";
import { text } from "../../strings.ts";

const RATE = 10; // frames per second
const WORD = /^(status|control)word/; // shown as hexadecimal
const MOST = 256; // signals of a subscription

type Extremes = readonly [number, number];

export function LiveValues({ connection, device }: { connection: Connection; device: Device }) {
  const layout = connection.hello.value?.layout;
  const signals = layout === undefined ? [] : signalsOf(layout, device).slice(0, MOST);
  const names = signals.map(({ signal }) => signal);
  const values = useSignal<readonly Extremes[]>([]);
  useEffect(() => {
    if (names.length === 0) return;
    return connection.subscribe(names, { full: false, rate: RATE }, (frame) => {
      if (frame.kind !== 2 || frame.rows === 0) return;
      const last = frame.rows - 1;
      values.value = frame.minimum.map((low, at) => [low[last] ?? NaN, frame.maximum[at]?.[last] ?? NaN]);
    });
  }, [connection, names.join()]);
  if (signals.length === 0) return <p class="empty">{text.devices.live.none}</p>;
  return (
    <div class="scroll-x live">
      <table>
        <thead>
          <tr>
            <th>{text.devices.live.signal}</th>
            <th class="number">{text.devices.live.value}</th>
            <th />
            <th class="number">{text.devices.live.range}</th>
          </tr>
        </thead>
        <tbody>
          {signals.map((signal, at) => (
            <Value key={signal.signal} signal={signal} extremes={values.value[at]} />
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Value({ signal, extremes }: { signal: DeviceSignal; extremes: Extremes | undefined }) {
  const [low, high] = extremes ?? [NaN, NaN];
  const isWord = WORD.test(signal.label) && !Number.isNaN(high);
  return (
    <tr>
      <td class="mono">{signal.label}</td>
      <td class="number mono">{isWord ? hex(high, 4) : shown(high, signal.unit)}</td>
      <td class="muted">{signal.unit}</td>
      <td class="number mono muted">
        {low === high || Number.isNaN(low)
          ? MISSING
          : `${shown(low, signal.unit)} … ${shown(high, signal.unit)}`}
      </td>
    </tr>
  );
}

function shown(value: number, unit: string): string {
  return unit === "" && Number.isInteger(value) ? String(value) : quantity(value, unit);
}
