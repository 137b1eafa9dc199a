/** Measurements of one signal over a range of rows. */

import type { RingStore } from "./store.ts";

export interface Measurement {
  readonly count: number;
  readonly minimum: number;
  readonly maximum: number;
  readonly mean: number;
  readonly rms: number;
  /** 10 to 90 % of the first rising edge [s]; NaN without such an edge. */
  readonly rise: number;
}

/** Measure the rows `from` to `to - 1`. Missing values are ignored. */
export function measure(store: RingStore, name: string, from: number, to: number): Measurement {
  const values = store.columns.get(name)?.values;
  let count = 0;
  let sum = 0;
  let squares = 0;
  let minimum = Infinity;
  let maximum = -Infinity;
  for (let row = Math.max(from, store.begin); values && row < Math.min(to, store.end); row++) {
    const value = values[row % store.capacity]!;
    if (value !== value) continue;
    count++;
    sum += value;
    squares += value * value;
    if (value < minimum) minimum = value;
    if (value > maximum) maximum = value;
  }
  if (count === 0) return { count, minimum: NaN, maximum: NaN, mean: NaN, rms: NaN, rise: NaN };
  const rise = riseTime(store, name, from, to, minimum, maximum);
  return { count, minimum, maximum, mean: sum / count, rms: Math.sqrt(squares / count), rise };
}

/** Return the time from 10 to 90 % of the first rising edge between `low` and `high` [s]. */
export function riseTime(
  store: RingStore, name: string, from: number, to: number, low: number, high: number,
): number {
  const values = store.columns.get(name)?.values;
  const ten = low + 0.1 * (high - low);
  const ninety = low + 0.9 * (high - low);
  if (!values || !(high > low)) return NaN;
  let start = NaN;
  let before = NaN;
  for (let row = Math.max(from, store.begin); row < Math.min(to, store.end); row++) {
    const value = values[row % store.capacity]!;
    if (value < ten) start = NaN;
    else if (before < ten) start = crossing(store, row, before, value, ten);
    if (value >= ninety && start === start) {
      return crossing(store, row, before, value, ninety) - start;
    }
    before = value;
  }
  return NaN;
}

/** Return the time at which the line from the row before reaches `level` [s]. */
function crossing(
  store: RingStore, row: number, before: number, value: number, level: number,
): number {
  const share = (level - before) / (value - before);
  const start = store.timeOf(row - 1);
  return start + share * (store.timeOf(row) - start);
}
