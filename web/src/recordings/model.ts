/** A recording as the source of the charts. */

import { signal } from "@preact/signals";
import { catalog } from "../scope/catalog.ts";
import { ChartsModel } from "../scope/charts_model.ts";
import { defaultLayout, parseLayout, signalsOf, type ScopeLayout } from "../scope/layout.ts";
import { RingStore } from "../scope/store.ts";
import type { Span } from "../scope/view.ts";
import { readWindow, type RecordingInfo } from "./client.ts";
import { storeOf } from "./window_store.ts";

const POINTS = 2000; // intervals of a window
const DELAY = 80; // [ms] of rest before a window is requested

/** Owns the window of samples on the screen and the request for the next one. */
export class RecordingModel extends ChartsModel {
  readonly groups;
  readonly progress = signal<number | null>(null);
  readonly failure = signal("");
  readonly shown = signal<Span>({ start: 0, end: 0 }); // after the first cycle [s]
  readonly origin: number;
  readonly longest: number;
  store: RingStore;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private abort = new AbortController();

  constructor(readonly name: string, readonly info: RecordingInfo) {
    super();
    this.groups = signal(catalog(info.layout));
    this.origin = info.started - info.layout.utc_offset_ns * 1e-9;
    this.longest = Math.max(info.duration, 20 * info.layout.period);
    this.store = new RingStore(1, info.layout.period);
    const layout = parseLayout(localStorage.getItem(this.key())) ?? defaultLayout(this.groups.peek());
    this.active.value = layout.charts[0]?.id ?? 1;
    this.change(layout);
    this.live();
  }

  override change(layout: ScopeLayout): void {
    super.change(layout);
    this.moved();
  }

  /** Show the whole recording. */
  live(): void {
    this.showFrom(0, this.longest);
  }

  /** Show a range that begins `start` seconds after the first cycle. */
  showFrom(start: number, length: number): void {
    this.show({ start: this.origin + start, end: this.origin + start + length });
  }

  pause(): void {}

  /** End the request in progress. */
  close(): void {
    clearTimeout(this.timer);
    this.abort.abort();
  }

  protected isStill(): boolean {
    return true;
  }

  protected key(): string {
    return `catenary.recording.${this.info.layout.axes.join()}`;
  }

  protected override moved(): void {
    super.moved();
    const { start, end } = this.span;
    this.shown.value = { start: start - this.origin, end: end - this.origin };
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.load(), DELAY);
  }

  private async load(): Promise<void> {
    this.abort.abort();
    this.abort = new AbortController();
    const { signal: ended } = this.abort;
    const known = this.signals.peek();
    const signals = signalsOf(this.layout.peek()!).filter((id) => known.has(id));
    if (signals.length === 0) return;
    try {
      const request = { signals, ...this.shown.peek(), points: POINTS };
      const frame = await readWindow(this.name, request, ended, (part) => (this.progress.value = part));
      this.store = storeOf(frame, signals, this.info.layout.period);
      this.failure.value = "";
    } catch (error) {
      if (ended.aborted) return;
      this.failure.value = (error as Error).message;
    }
    this.progress.value = null;
    this.redraw();
  }
}
