/** Samples of a window of a recording in the form that the charts draw. */

import type { Frame } from "../frame.ts";
import { KIND_FULL } from "../protocol.ts";
import { RingStore } from "../scope/store.ts";

const GAP = 1.5; // periods

/** Return a store with the samples, or with the minimum and the maximum of each interval. */
export function storeOf(frame: Frame, names: readonly string[], period: number): RingStore {
  return frame.kind === KIND_FULL
    ? samples(frame.time, frame.columns, names, period)
    : extremes(frame.time, frame.minimum, frame.maximum, names);
}

/** Each jump of the time is a gap. */
function samples(
  time: Float64Array, columns: Float64Array[], names: readonly string[], period: number,
): RingStore {
  const store = emptyStore(2 * time.length, period, names);
  let from = 0;
  for (let row = 1; row <= time.length; row++) {
    if (row < time.length && time[row]! - time[row - 1]! < GAP * period) continue;
    const values = columns.map((column) => column.subarray(from, row));
    store.append({ time: time.subarray(from, row), names, values, lost: 0 });
    from = row;
  }
  return store;
}

/** Two rows for each interval: its minimum at the begin, its maximum in the middle. */
function extremes(
  time: Float64Array, minimum: Float32Array[], maximum: Float32Array[], names: readonly string[],
): RingStore {
  const last = time.length - 1;
  const step = last > 0 ? (time[last]! - time[0]!) / last : 1;
  const store = emptyStore(2 * time.length, step / 2, names);
  const times = new Float64Array(2 * time.length);
  time.forEach((begin, index) => {
    times[2 * index] = begin;
    times[2 * index + 1] = (begin + (time[index + 1] ?? begin + step)) / 2;
  });
  const values = minimum.map((low, signal) => alternating(low, maximum[signal]!));
  store.append({ time: times, names, values, lost: 0 });
  return store;
}

function alternating(low: Float32Array, high: Float32Array): Float64Array {
  return Float64Array.from({ length: 2 * low.length }, (_, index) =>
    (index % 2 === 0 ? low : high)[index >> 1]!);
}

function emptyStore(rows: number, period: number, names: readonly string[]): RingStore {
  const store = new RingStore(Math.max(rows, 1) * period, period);
  for (const name of names) store.add(name);
  return store;
}
