/** Subscription of the scope: every sample of the chosen signals goes into the store. */

import { effect, signal } from "@preact/signals";
import type { Connection } from "../connection.ts";
import type { Frame } from "../frame.ts";
import { KIND_FULL } from "../protocol.ts";
import { RingStore, type Rows } from "./store.ts";

export const HISTORY = 60; // [s]
const RATE = 60; // frames per second
const WAIT = 30; // frames that a new subscription waits for the old one

type Subscribing = Pick<Connection, "subscribe" | "hello">;

/** Owns the store and the subscription that fills it. */
export class Acquisition {
  store = new RingStore(HISTORY, 0.001);
  readonly paused = signal(false);
  readonly generation = signal(0); // changes with each new store or run
  private run: string | null = null;
  private rejoined = false; // the connection was lost during this run
  private offered = new Set<string>();
  private wanted: readonly string[] = [];
  private subscribed: readonly string[] = [];
  private end: (() => void) | null = null;

  constructor(private readonly connection: Subscribing) {
    effect(() => {
      const hello = connection.hello.value;
      if (hello === null) return;
      this.rejoined = hello.run === this.run;
      if (!this.rejoined) this.restart(hello.layout.period);
      this.run = hello.run;
      this.offered = new Set(hello.layout.fields.flatMap((field) => elements(field)));
      this.resubscribe();
    });
  }

  /** Record these signals; forget all others. */
  record(signals: readonly string[]): void {
    this.wanted = signals;
    for (const name of this.store.columns.keys()) {
      if (!signals.includes(name)) this.store.remove(name);
    }
    for (const name of signals) this.store.add(name);
    this.resubscribe();
  }

  private restart(period: number): void {
    this.store = new RingStore(HISTORY, period);
    for (const name of this.wanted) this.store.add(name);
    this.subscribed = [];
    this.generation.value = this.generation.peek() + 1;
  }

  private resubscribe(): void {
    const signals = this.wanted.filter((name) => this.offered.has(name));
    if (signals.join() === this.subscribed.join()) return;
    this.subscribed = signals;
    const old = this.end;
    if (signals.length === 0) {
      old?.();
      this.end = null;
      return;
    }
    this.end = this.replace(signals, old);
  }

  /** Subscribe, and end the old subscription when the new one continues it without a gap. */
  private replace(signals: string[], old: (() => void) | null): () => void {
    let ended = old === null;
    let waiting: Rows[] = [];
    const end = this.connection.subscribe(signals, { full: true, rate: RATE }, (frame) => {
      const rows = toRows(frame, signals);
      if (rows === null) return;
      if (ended) return this.append(rows);
      waiting.push(rows);
      if (!this.continues(waiting[0]!) && waiting.length < WAIT) return;
      old?.();
      ended = true;
      for (const each of waiting) this.append(each);
      waiting = [];
    });
    return () => {
      if (!ended) old?.();
      ended = true;
      end();
    };
  }

  private continues(rows: Rows): boolean {
    const { store } = this;
    return store.end === 0 || this.paused.peek() ||
      (rows.time[0] ?? Infinity) <= store.lastTime + 1.5 * store.period;
  }

  private append(rows: Rows): void {
    const { store } = this;
    if (!this.paused.peek()) {
      const missing = Math.round(((rows.time[0] ?? NaN) - store.lastTime) / store.period) - 1;
      store.append(this.rejoined && missing > 0 ? { ...rows, lost: missing } : rows);
    }
    this.rejoined = false;
  }
}

function elements(field: { name: string; shape: number[] }): string[] {
  const [count] = field.shape;
  if (count === undefined) return [field.name];
  return Array.from({ length: count }, (_, index) => `${field.name}[${index}]`);
}

function toRows(frame: Frame, names: readonly string[]): Rows | null {
  if (frame.kind !== KIND_FULL) return null;
  return { time: frame.time, names, values: frame.columns, lost: frame.lost };
}
