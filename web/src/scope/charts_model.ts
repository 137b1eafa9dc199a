/** Charts with a range of time, cursors and measurements: the part that scope and recordings share. */

import { computed, signal, type ReadonlySignal } from "@preact/signals";
import type { Group, SignalInfo } from "./catalog.ts";
import type { ScopeLayout } from "./layout.ts";
import { measure, type Measurement } from "./measurements.ts";
import type { Plot, Scene } from "./plot.ts";
import type { RingStore } from "./store.ts";
import { TimeView, type Span } from "./view.ts";

const BUDGET = 3; // [ms] of drawing in one frame; further charts follow in the next frame

export interface MeasuredRow {
  signal: string;
  show: (value: number, measurement: Measurement, at: readonly [number, number]) => void;
}

/** Owns arrangement, time range, cursors and the plots on the screen. */
export abstract class ChartsModel {
  readonly layout = signal<ScopeLayout | null>(null);
  readonly active = signal(1); // chart that receives signals of the picker
  readonly cursors = signal<readonly [number | null, number | null]>([null, null]);
  readonly signals = computed(() => {
    const all = this.groups.value.flatMap((group) => group.signals);
    return new Map<string, SignalInfo>(all.map((each) => [each.id, each]));
  });
  readonly plots = new Map<number, Plot>();
  readonly rows = new Map<string, MeasuredRow>();
  protected readonly view = new TimeView(5);
  protected drawn = -1;
  private nextPlot = 0;
  private pending = 0; // charts to draw until the screen shows the newest state
  private nextRow = 0;
  private frames = 0;

  abstract readonly groups: ReadonlySignal<Group[]>;
  abstract get store(): RingStore;
  /** Time that the axis shows as 0 [s]. */
  abstract get origin(): number;
  /** Longest range that can be shown [s]. */
  abstract get longest(): number;
  /** Show the range that the double click requests: the newest samples, or all. */
  abstract live(): void;
  /** Keep the samples on the screen. */
  abstract pause(): void;
  protected abstract isStill(): boolean;
  protected abstract key(): string;

  get span(): Span {
    return this.view.span(this.store.lastTime);
  }

  change(layout: ScopeLayout): void {
    this.layout.value = layout;
    localStorage.setItem(this.key(), JSON.stringify(layout));
    this.redraw();
  }

  zoom(factor: number, centre: number): void {
    this.hold();
    this.view.zoom(this.span, factor, centre, this.store.period, this.longest);
    this.moved();
  }

  show(span: Span): void {
    const length = Math.max(span.end - span.start, 10 * this.store.period);
    this.hold();
    this.view.fixed = { start: span.start, end: span.start + length };
    this.moved();
  }

  pan(seconds: number): void {
    this.hold();
    this.view.pan(this.span, seconds);
    this.moved();
  }

  setCursor(index: 0 | 1, time: number | null): void {
    const [a, b] = this.cursors.peek();
    this.cursors.value = index === 0 ? [time, b] : [a, time];
    this.redraw();
  }

  toggleCursors(): void {
    const { start, end } = this.span;
    const on = this.cursors.peek()[0] === null;
    this.cursors.value = on ? [start + (end - start) / 3, end - (end - start) / 3] : [null, null];
    if (on) this.hold();
    this.redraw();
  }

  redraw(): void {
    this.drawn = -1;
  }

  /** Draw one frame of the screen within the budget. */
  frame(): void {
    const begin = performance.now();
    const { store } = this;
    if (store.end !== this.drawn) {
      this.drawn = store.end;
      this.pending = this.plots.size;
    }
    this.drawPlots(begin);
    this.frames++;
    if (performance.now() - begin < BUDGET || this.frames % 4 === 0) this.measureRow();
  }

  /** Called after the range of time has changed. */
  protected moved(): void {
    this.redraw();
  }

  protected scene(): Scene {
    return {
      store: this.store,
      span: this.span,
      origin: this.origin,
      cursors: this.cursors.peek(),
      trigger: null,
      fine: this.isStill(),
    };
  }

  private hold(): void {
    if (!this.isStill()) this.pause();
  }

  private drawPlots(begin: number): void {
    const plots = [...this.plots.values()];
    const scene = this.scene();
    while (this.pending > 0 && plots.length > 0) {
      plots[this.nextPlot++ % plots.length]!.draw(scene);
      this.pending--;
      const next = plots[this.nextPlot % plots.length]!.cost;
      if (performance.now() - begin + next > BUDGET) break;
    }
  }

  private measureRow(): void {
    const rows = [...this.rows.values()];
    if (rows.length === 0 || this.store.end === 0) return;
    const row = rows[this.nextRow++ % rows.length]!;
    const { store, span } = this;
    const [a, b] = this.cursors.peek();
    const between = a !== null && b !== null;
    const from = store.rowAt(between ? Math.min(a, b) : span.start);
    const to = store.rowAt(between ? Math.max(a, b) : span.end);
    const result = measure(store, row.signal, from, to);
    row.show(store.value(row.signal, store.end - 1), result, [this.valueAt(row.signal, a), this.valueAt(row.signal, b)]);
  }

  private valueAt(name: string, time: number | null): number {
    if (time === null) return NaN;
    return this.store.value(name, Math.min(this.store.rowAt(time), this.store.end - 1));
  }
}
