/** Figures of the response of an axis to a step. */

import type { RingStore } from "../scope/store.ts";

export interface StepFigures {
  size: number; // of the commanded step [rad or m]
  rise: number; // 10 to 90 % of the step [s]
  overshoot: number; // part of the step
  settling: number; // from the begin of the command to the last time outside of the band [s]
  error: number; // mean of position minus command in the last tenth [rad or m]
  largest: number; // largest difference of position and command [rad or m]
}

const BAND = 0.02; // of the step

/**
 * Return the figures for the rows from the first change of the command to the end of the store;
 * null if the command did not change.
 */
export function stepFigures(store: RingStore, command: string, position: string): StepFigures | null {
  const begin = firstChange(store, command);
  if (begin === null) return null;
  const initial = store.value(command, begin - 1);
  const size = store.value(command, store.end - 1) - initial;
  if (size === 0) return null;
  const part = (row: number) => (store.value(position, row) - initial) / size;
  const rows = Array.from({ length: store.end - begin }, (_, index) => begin + index);
  const errors = rows.map((row) => store.value(position, row) - store.value(command, row));
  const tail = errors.slice(-Math.max(1, Math.floor(errors.length / 10)));
  const outside = rows.findLast((row) => Math.abs(part(row) - 1) > BAND);
  return {
    size,
    rise: reached(store, rows, part, 0.9) - reached(store, rows, part, 0.1),
    overshoot: Math.max(0, ...rows.map((row) => part(row) - 1)),
    settling: outside === store.end - 1 ? NaN : store.timeOf((outside ?? begin) + 1) - store.timeOf(begin - 1),
    error: tail.reduce((sum, each) => sum + each, 0) / tail.length,
    largest: errors.reduce((most, each) => Math.max(most, Math.abs(each)), 0),
  };
}

function firstChange(store: RingStore, command: string): number | null {
  for (let row = store.begin + 1; row < store.end; row++) {
    if (Math.abs(store.value(command, row) - store.value(command, row - 1)) > 0) return row;
  }
  return null;
}

/** Return the time at which a part of the step is reached first, between two rows [s]. */
function reached(store: RingStore, rows: number[], part: (row: number) => number, level: number): number {
  const row = rows.find((each) => part(each) >= level);
  if (row === undefined) return NaN;
  const before = part(row - 1);
  const share = (level - before) / (part(row) - before);
  return store.timeOf(row - 1) + share * (store.timeOf(row) - store.timeOf(row - 1));
}
