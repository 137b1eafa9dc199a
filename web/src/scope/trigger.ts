/** Edge trigger with a pre-trigger part, as in an oscilloscope. */

import type { RingStore } from "./store.ts";

export type Edge = "rising" | "falling" | "either";
export type TriggerMode = "auto" | "normal" | "single";
export type TriggerState = "free" | "armed" | "triggered" | "complete";

export interface TriggerSettings {
  readonly signal: string;
  readonly level: number;
  readonly edge: Edge;
  readonly mode: TriggerMode;
  /** Part of the window before the trigger, 0 to 1. */
  readonly pre: number;
  /** Length of the window [s]. */
  readonly window: number;
}

export interface Capture {
  readonly trigger: number;
  readonly start: number;
  readonly end: number;
}

/** Finds captures in the rows that arrive. It owns the position of the search. */
export class Trigger {
  state: TriggerState = "armed";
  capture: Capture | null = null;
  private next: number;
  private armedAt: number;
  private pending = NaN;

  constructor(readonly settings: TriggerSettings, store: RingStore) {
    this.next = Math.max(store.begin, store.end - 1);
    this.armedAt = store.lastTime;
  }

  /** Search the new rows. Return true if a capture became complete. */
  step(store: RingStore): boolean {
    if (this.state === "complete") return false;
    if (store.end < this.next) this.restart(store);
    if (!Number.isFinite(this.armedAt)) this.armedAt = store.lastTime;
    if (Number.isNaN(this.pending)) this.search(store);
    if (!Number.isNaN(this.pending)) return this.finish(store);
    this.state = this.waitedLong(store) ? "free" : "armed";
    return false;
  }

  private restart(store: RingStore): void {
    this.next = store.begin;
    this.armedAt = store.lastTime;
    this.pending = NaN;
  }

  private waitedLong(store: RingStore): boolean {
    const limit = Math.max(this.settings.window, 0.5);
    return this.settings.mode === "auto" && store.lastTime - this.armedAt > limit;
  }

  private search(store: RingStore): void {
    const { signal, level, edge } = this.settings;
    let row = Math.max(this.next, store.begin);
    let before = store.value(signal, row);
    for (row += 1; row < store.end; row++) {
      const value = store.value(signal, row);
      if (crosses(before, value, level, edge)) {
        this.pending = interpolate(store, row, before, value, level);
        this.next = row;
        return;
      }
      before = value;
    }
    this.next = Math.max(store.begin, store.end - 1);
  }

  private finish(store: RingStore): boolean {
    const { pre, window, mode } = this.settings;
    const start = this.pending - pre * window;
    const end = start + window;
    this.state = "triggered";
    if (store.lastTime < end) return false;
    this.capture = { trigger: this.pending, start, end };
    this.pending = NaN;
    this.next = Math.max(this.next, store.rowAt(end) - 1);
    this.armedAt = store.lastTime;
    if (mode === "single") this.state = "complete";
    return true;
  }
}

function crosses(before: number, value: number, level: number, edge: Edge): boolean {
  const rising = before < level && value >= level;
  const falling = before > level && value <= level;
  return edge === "rising" ? rising : edge === "falling" ? falling : rising || falling;
}

function interpolate(
  store: RingStore, row: number, before: number, value: number, level: number,
): number {
  const start = store.timeOf(row - 1);
  const share = (level - before) / (value - before);
  return start + share * (store.timeOf(row) - start);
}
