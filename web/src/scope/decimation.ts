/** Minimum and maximum of each group of rows, so that drawing loses no peak. */

import { BLOCK, type Column, type RingStore } from "./store.ts";

/** Reusable result: group `i` covers rows `first + i * step` to `first + (i + 1) * step - 1`. */
export class Envelope {
  low: Float64Array;
  high: Float64Array;
  first = 0;
  step = 1;
  count = 0;

  constructor(groups = 4096) {
    this.low = new Float64Array(groups);
    this.high = new Float64Array(groups);
  }

  resize(groups: number): void {
    if (this.low.length >= groups) return;
    this.low = new Float64Array(groups * 2);
    this.high = new Float64Array(groups * 2);
  }
}

/** Return the rows of a group: 1, or a power of two that leaves at most `groups` groups. */
export function groupSize(rows: number, groups: number): number {
  let step = 1;
  while (rows / step > groups) step *= 2;
  return step;
}

/**
 * Compute the envelope of a column. Groups are aligned to multiples of their size, so that a
 * moving window does not flicker. A group without a number has `low > high`.
 */
export function envelope(
  store: RingStore, column: Column, from: number, to: number, groups: number, out: Envelope,
): void {
  const step = groupSize(to - from, groups);
  out.step = step;
  out.first = Math.floor(from / step) * step;
  out.count = Math.max(0, Math.ceil((to - out.first) / step));
  out.resize(out.count);
  for (let index = 0; index < out.count; index++) {
    const start = Math.max(store.begin, out.first + index * step);
    const end = Math.min(store.end, out.first + (index + 1) * step);
    group(store, column, start, end, out, index);
  }
}

function group(
  store: RingStore, column: Column, start: number, end: number, out: Envelope, index: number,
): void {
  const capacity = store.capacity;
  const { values, low, high } = column;
  let least = Infinity;
  let greatest = -Infinity;
  let row = start;
  while (row < end) {
    const at = row % capacity;
    if (at % BLOCK === 0 && row + BLOCK <= end) {
      const block = at / BLOCK;
      if (low[block]! < least) least = low[block]!;
      if (high[block]! > greatest) greatest = high[block]!;
      row += BLOCK;
      continue;
    }
    const value = values[at]!;
    if (value < least) least = value;
    if (value > greatest) greatest = value;
    row++;
  }
  out.low[index] = least;
  out.high[index] = greatest;
}

/** Return [minimum, maximum] of the groups; [NaN, NaN] if no group has a number. */
export function range(out: Envelope): [number, number] {
  let least = Infinity;
  let greatest = -Infinity;
  for (let index = 0; index < out.count; index++) {
    if (out.low[index]! < least) least = out.low[index]!;
    if (out.high[index]! > greatest) greatest = out.high[index]!;
  }
  return least > greatest ? [NaN, NaN] : [least, greatest];
}
